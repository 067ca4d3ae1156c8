"""Free: no joint at all, a body that moves as it likes; its linear velocity in the axes of the joint, as in MuJoCo."""

from collections.abc import Sequence

from cgraph import Node

from ..algebra.spatial import Triple
from ..algebra.spatial_vectors import REST, Twist
from . import quaternion


class Free(quaternion.QuaternionJoint):
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

    def translation(self, q: Sequence[Node]) -> Triple:
        """The first three coordinates."""
        return q[0], q[1], q[2]

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The last three are angular; the first three are turned into the body's axes."""
        return Twist((u[3], u[4], u[5]), self.turn(q).into((u[0], u[1], u[2])))

    def acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """Zero: the velocities are the angular velocity, and rates of a place."""
        return REST


JOINT = Free()
