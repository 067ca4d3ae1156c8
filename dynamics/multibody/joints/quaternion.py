"""Unit quaternions (w, x, y, z) as coordinates of a rotation, and angular velocities in the body's axes."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Node

from ..spatial import Triple, cross
from .joint_type import NodeMatrix

NAMES = ("qw", "qx", "qy", "qz")
NEUTRAL = (1.0, 0.0, 0.0, 0.0)


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


def structure(omega: Sequence[Node], momentum: Sequence[Node]) -> Triple:
    """omega x momentum."""
    (a, b, c), (p, q, r) = omega, momentum
    return cross((a, b, c), (p, q, r))


def normalized(e: Sequence[Node]) -> list[Node]:
    """e / |e|."""
    w, x, y, z = e
    length = cg.sqrt(w * w + x * x + (y * y + z * z))
    return [each / length for each in e]
