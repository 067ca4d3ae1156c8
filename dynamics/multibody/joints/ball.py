"""Ball: a joint that turns the body about a point."""

from collections.abc import Sequence

import numpy as np

from cgraph import Node
from cgraph._shared import Array

from ..algebra import spatial
from ..algebra.spatial import STILL
from ..algebra.spatial_vectors import Twist
from . import quaternion
from .joint_type import NodeMatrix, SpatialJoint


class Ball(SpatialJoint):
    """A ball joint: a unit quaternion, and the angular velocity in the body's axes [rad/s]."""

    kind = mjcf = "ball"
    coordinates = quaternion.NAMES
    velocities = ("wx", "wy", "wz")
    units = quaternion.UNITS
    velocity_units = ("rad/s", "rad/s", "rad/s")
    neutral = quaternion.NEUTRAL
    groups = (0, 0, 0, 0)
    sprung = True

    def rotation(self, q: Sequence[Node]) -> NodeMatrix:
        """Rotation of the quaternion."""
        return quaternion.rotation(q)

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The velocities are the angular velocity."""
        x, y, z = u
        return Twist((x, y, z), STILL)

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """Rate of the quaternion."""
        return quaternion.rate(q, u)

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """omega x p."""
        return quaternion.structure(u, p)

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """The rotation vector, from where the body stands at the joint."""
        return quaternion.rotation_vector(q)

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """Quaternion of length 1."""
        return quaternion.normalized(q)

    def resists(self, mass: float, inertia: Array) -> bool:
        """Inertia about every axis, more than rounding leaves of the largest."""
        moments = np.linalg.eigvalsh(inertia)
        return bool(moments[0] > spatial.SUM_ROUNDING * moments[2])

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The mass, taken at the joint."""
        return mass, np.zeros(3), np.zeros((3, 3))


JOINT = Ball()
