"""Free, in the body's axes: as `free`, with the linear velocity in the body's axes, as in Pinocchio."""

from collections.abc import Sequence

from cgraph import Node

from ..algebra.spatial import STILL, cross
from ..algebra.spatial_vectors import Twist
from . import quaternion
from .free import Free


class FreeBodyAxes(Free):
    """Six freedoms, linear and angular velocity both in the body's axes [m/s], [rad/s]."""

    kind = "free (body axes)"
    mjcf = urdf = ""
    sliding = 0
    geared = False  # of a velocity in axes that turn, it would be a mass

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The last three are angular, the first three linear."""
        return Twist((u[3], u[4], u[5]), (u[0], u[1], u[2]))

    def acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """omega x v, as the axes of constant velocities turn."""
        return Twist(STILL, cross((u[3], u[4], u[5]), (u[0], u[1], u[2])))

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """The linear velocity in the joint's axes, and the rate of the quaternion."""
        return [*self.turn(q).out((u[0], u[1], u[2])), *quaternion.rate(q[3:], u[3:])]

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """(omega x p_v, omega x p_w + v x p_v)."""
        v, omega = u[:3], u[3:]
        turned = zip(quaternion.structure(omega, p[3:]), quaternion.structure(v, p[:3]), strict=True)
        return [*quaternion.structure(omega, p[:3]), *[a + b for a, b in turned]]


JOINT = FreeBodyAxes()
