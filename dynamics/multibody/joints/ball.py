"""Ball: a joint that turns the body about a point."""

from collections.abc import Sequence

import numpy as np

from cgraph import Node
from cgraph._shared import Array

from ..algebra.spatial import STILL
from ..algebra.spatial_vectors import Twist
from . import quaternion


class Ball(quaternion.QuaternionJoint):
    """A ball joint: a unit quaternion, and the angular velocity in the body's axes [rad/s]."""

    kind = mjcf = "ball"
    urdf = "spherical"
    coordinates = quaternion.NAMES
    velocities = ("wx", "wy", "wz")
    units = quaternion.UNITS
    velocity_units = ("rad/s", "rad/s", "rad/s")
    neutral = quaternion.NEUTRAL
    groups = (0, 0, 0, 0)
    sprung = True

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The velocities are the angular velocity."""
        x, y, z = u
        return Twist((x, y, z), STILL)

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """The rotation vector, from where the body stands at the joint."""
        return quaternion.rotation_vector(q)

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The mass, taken at the joint."""
        return mass, np.zeros(3), np.zeros((3, 3))


JOINT = Ball()
