"""Unit quaternions (w, x, y, z) as coordinates of a rotation, and angular velocities in the body's axes."""

from collections.abc import Sequence

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array

from ..algebra import spatial
from ..algebra.spatial import ZERO, Triple, cross
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


def structure(omega: Sequence[Node], momentum: Sequence[Node]) -> Triple:
    """omega x momentum."""
    (a, b, c), (p, q, r) = omega, momentum
    return cross((a, b, c), (p, q, r))


def normalized(e: Sequence[Node]) -> list[Node]:
    """e / |e|."""
    w, x, y, z = e
    length = cg.sqrt(w * w + x * x + (y * y + z * z))
    return [each / length for each in e]


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
        return [*[ZERO for _ in u[:-3]], *structure(u[-3:], p[-3:])]

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """Coordinates with a quaternion of length 1."""
        return [*q[:-4], *normalized(q[-4:])]

    def resists(self, mass: float, inertia: Array) -> bool:
        """Inertia about every axis, more than rounding leaves of the largest; and mass, where it slides."""
        moments = np.linalg.eigvalsh(inertia)
        turned = bool(moments[0] > spatial.SUM_ROUNDING * moments[2])
        return turned and (mass > 0.0 or len(self.velocities) == 3)
