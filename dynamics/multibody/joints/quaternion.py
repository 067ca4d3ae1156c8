"""Joints of unit quaternions (w, x, y, z), with angular velocities in the body's axes: ball, free.

A free body has its linear velocity in the axes of the joint, as in MuJoCo, or in its own, as in Pinocchio.
"""

from collections.abc import Sequence

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array

from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple, cross, plus
from ..algebra.spatial_vectors import REST, Twist
from .joint_type import NodeMatrix, SpatialJoint

NAMES = ("qw", "qx", "qy", "qz")
UNITS = ("1", "1", "1", "1")
NEUTRAL = (1.0, 0.0, 0.0, 0.0)
_HALVINGS, _TERMS = 3, 9  # tan(pi / 32)^2 to the power 9, over 19: below 1e-19


def rotation(e: Sequence[Node]) -> NodeMatrix:
    """The body's axes as columns; of e / |e|, so that a length other than 1, as rounding leaves it, turns alike."""
    w, x, y, z = e
    twice = 2.0 / (w * w + x * x + (y * y + z * z))
    xs, ys, zs = twice * x, twice * y, twice * z
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz, yy, yz, zz = x * xs, x * ys, x * zs, y * ys, y * zs, z * zs
    return (
        (1.0 - (yy + zz), xy - wz, xz + wy),
        (xy + wz, 1.0 - (xx + zz), yz - wx),
        (xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


def rate(e: Sequence[Node], omega: Sequence[Node]) -> list[Node]:
    """de/dt = e (0, omega) / 2."""
    w, x, y, z = e
    a, b, c = [0.5 * each for each in omega]
    return [-(x * a + y * b + z * c), w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]


def rotation_vector(e: Sequence[Node]) -> list[Node]:
    """The rotation as an axis times an angle of at most pi [rad]; smooth but at half turns, where it changes sign.

    With t = tan(angle / 4) = |v| / (|e| + |w|) the angle is 4 atan t. tan(a / 2) = t / (1 + sqrt(1 + t^2)) three times
    leaves at most pi / 32, and atan(t) / t a short series in t^2, so that nothing is divided by |v|.
    """
    w, *v = e
    squares = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    sign = cg.where(cg.less(w, 0.0), -1.0, 1.0)
    over = w + sign * cg.sqrt(w * w + squares)
    tangent = squares / (over * over)
    for _ in range(_HALVINGS):
        half = 1.0 + cg.sqrt(1.0 + tangent)
        over, tangent = over * half, tangent / (half * half)
    series = cg.constant(0.0)
    for k in reversed(range(_TERMS)):
        series = (-1.0) ** k / (2 * k + 1) + tangent * series
    factor = 4.0 * 2.0**_HALVINGS * series / over
    return [factor * each for each in v]


class QuaternionJoint(SpatialJoint):
    """A joint that turns the body by its last four coordinates, with its last three velocities as angular ones.

    The coordinates before are places along the joint's axes, whose rates are the velocities before.
    """

    def rotation(self, q: Sequence[Node]) -> NodeMatrix:
        """Rotation of the quaternion."""
        return rotation(q[-4:])

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """The linear velocities, and the rate of the quaternion."""
        return [*u[:-3], *rate(q[-4:], u[-3:])]

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """Zero, and omega x the angular momentum."""
        return [*[ZERO for _ in u[:-3]], *cross((u[-3], u[-2], u[-1]), (p[-3], p[-2], p[-1]))]

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """Coordinates with a quaternion of length 1."""
        w, x, y, z = q[-4:]
        length = cg.sqrt(w * w + x * x + (y * y + z * z))
        return [*q[:-4], *[each / length for each in (w, x, y, z)]]

    def resists(self, mass: float, inertia: Array) -> bool:
        """Inertia about every axis, more than rounding leaves of the largest; and mass, where it slides."""
        moments = np.linalg.eigvalsh(inertia)
        turned = bool(moments[0] > spatial.SUM_ROUNDING * moments[2])
        return turned and (mass > 0.0 or len(self.velocities) == 3)


class Ball(QuaternionJoint):
    """A ball joint: a unit quaternion, and the angular velocity in the body's axes [rad/s]."""

    kind = mjcf = "ball"
    urdf = "spherical"
    coordinates = NAMES
    velocities = ("wx", "wy", "wz")
    units = UNITS
    velocity_units = ("rad/s", "rad/s", "rad/s")
    neutral = NEUTRAL
    groups = (0, 0, 0, 0)
    sprung = True

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """The velocities are the angular velocity."""
        x, y, z = u
        return Twist((x, y, z), STILL)

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """The rotation vector, from where the body stands at the joint."""
        return rotation_vector(q)

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The mass, taken at the joint."""
        return mass, np.zeros(3), np.zeros((3, 3))


class Free(QuaternionJoint):
    """Six freedoms: the place of the body's origin in the joint's axes, which are the world's of a body on the world,
    and a unit quaternion; the rates of that place [m/s], and the angular velocity in the body's axes [rad/s].
    """

    kind = mjcf = "free"
    urdf = "floating"
    coordinates = ("x", "y", "z", *NAMES)
    velocities = ("vx", "vy", "vz", "wx", "wy", "wz")
    units = ("m", "m", "m", *UNITS)
    velocity_units = ("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")
    neutral = (0.0, 0.0, 0.0, *NEUTRAL)
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
        return [*self.turn(q).out((u[0], u[1], u[2])), *rate(q[3:], u[3:])]

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """(omega x p_v, omega x p_w + v x p_v)."""
        v, omega, p_v, p_w = ((each[k], each[k + 1], each[k + 2]) for each in (u, p) for k in (0, 3))
        return [*cross(omega, p_v), *plus(cross(omega, p_w), cross(v, p_v))]


BALL, FREE, FREE_BODY_AXES = Ball(), Free(), FreeBodyAxes()
