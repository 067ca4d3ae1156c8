"""Free, in the body's axes: as `free`, with the linear velocity in the body's axes, as in Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence

from cgraph import Node

from ..algebra import spatial
from ..algebra.spatial import Triple, cross
from . import quaternion
from .free import Free


class FreeBodyAxes(Free):
    """Six freedoms, linear and angular velocity both in the body's axes [m/s], [rad/s]."""

    kind = "free (body axes)"
    mjcf = urdf = ""
    sliding = 0
    geared = False  # of a velocity in axes that turn, it would be a mass

    def linear_velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """The first three."""
        return u[0], u[1], u[2]

    def linear_acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """omega x v, as the axes of constant velocities turn."""
        return cross((u[3], u[4], u[5]), (u[0], u[1], u[2]))

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """The linear velocity in the joint's axes, and the rate of the quaternion."""
        x, y, z = (spatial.dot((row[0], row[1], row[2]), (u[0], u[1], u[2])) for row in self.rotation(q))
        return [x, y, z, *quaternion.rate(q[3:], u[3:])]

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """(omega x p_v, omega x p_w + v x p_v)."""
        v, omega = u[:3], u[3:]
        turned = zip(quaternion.structure(omega, p[3:]), quaternion.structure(v, p[:3]), strict=True)
        return [*quaternion.structure(omega, p[:3]), *[a + b for a, b in turned]]


JOINT = FreeBodyAxes()
