"""Free: no joint at all, a body that moves as it likes; its linear velocity in the axes of the joint, as in MuJoCo."""

from collections.abc import Sequence

import numpy as np

from cgraph import Node
from cgraph._shared import Array

from ..algebra import spatial
from ..algebra.spatial import ZERO, Triple
from ..algebra.spatial_vectors import REST, Twist
from . import quaternion
from .joint_type import NodeMatrix, SpatialJoint


class Free(SpatialJoint):
    """Six freedoms: the place of the body's origin in the joint's axes, which are the world's of a body on the world,
    and a unit quaternion; the rates of that place [m/s], and the angular velocity in the body's axes [rad/s].
    """

    kind = mjcf = "free"
    urdf = "floating"
    coordinates = ("x", "y", "z", *quaternion.NAMES)
    velocities = ("vx", "vy", "vz", "wx", "wy", "wz")
    units = ("m", "m", "m", *quaternion.UNITS)
    velocity_units = ("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")
    neutral = (0.0, 0.0, 0.0, *quaternion.NEUTRAL)
    groups = (0, 1, 2, 3, 3, 3, 3)
    sliding = 3

    def rotation(self, q: Sequence[Node]) -> NodeMatrix:
        """Rotation of the quaternion."""
        return quaternion.rotation(q[3:])

    def translation(self, q: Sequence[Node]) -> Triple:
        """The first three coordinates."""
        return q[0], q[1], q[2]

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The last three are angular; the first three are turned into the body's axes."""
        return Twist((u[3], u[4], u[5]), self.turn(q).into((u[0], u[1], u[2])))

    def acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """Zero: the velocities are the angular velocity, and rates of a place."""
        return REST

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """The linear velocities, and the rate of the quaternion."""
        return [*u[:3], *quaternion.rate(q[3:], u[3:])]

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """Zero, and omega x the angular momentum."""
        return [ZERO, ZERO, ZERO, *quaternion.structure(u[3:], p[3:])]

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """Coordinates with a quaternion of length 1."""
        return [*q[:3], *quaternion.normalized(q[3:])]

    def resists(self, mass: float, inertia: Array) -> bool:
        """Mass, and inertia about every axis through the center of mass; see `require_inertia`."""
        moments = np.linalg.eigvalsh(inertia)
        return mass > 0.0 and bool(moments[0] > spatial.SUM_ROUNDING * moments[2])


JOINT = Free()
