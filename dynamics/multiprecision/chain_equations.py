"""Torques and accelerations of chains of bodies to any number of digits, by Newton-Euler: no graph, no derivative."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cgraph.extend import Array

from ..multibody.mechanism import Mechanism
from .flint_numbers import Number, flint, working

Vector = list[Number]
Maker = Callable[[object], Number]
DIGITS = 60  # of the first attempt; twice as many until `LOST` is met
MOST = 2000
LOST = 1e-50  # the largest bound on the error, relative to the largest component


class Pair(NamedTuple):
    """Numbers as sums of two float64, `high` the nearest one: 32 digits. Each (n,)."""

    high: Array
    low: Array

    def deviation(self, x: Array) -> Array:
        """x - this, exact to the last bits of x."""
        return (x - self.high) - self.low


def torques(chain: Mechanism, q: Array, qd: Array, qdd: Array) -> Pair:
    """tau [N m] of a chain for accelerations qdd, (n,). Raises ImportError without python-flint."""

    def solved(terms: _Equations, number: Maker) -> Vector:
        alpha = _numbers(number, qdd)
        return [_dot(row, alpha) - right for row, right in zip(terms.matrix, terms.right, strict=True)]

    return _bounded(chain, q, qd, solved)


def accelerations(chain: Mechanism, q: Array, qd: Array, tau: Array) -> Pair:
    """qdd [rad/s^2] of a chain under torques tau, (n,). Raises ImportError without python-flint."""

    def solved(terms: _Equations, number: Maker) -> Vector:
        right = [[a + b] for a, b in zip(_numbers(number, tau), terms.right, strict=True)]
        column = flint().arb_mat(terms.matrix).solve(flint().arb_mat(right))
        return [column[i, 0] for i in range(len(right))]

    return _bounded(chain, q, qd, solved)


class _Equations(NamedTuple):
    """The equations matrix qdd = tau + right."""

    matrix: list[Vector]
    right: Vector


def _bounded(chain: Mechanism, q: Array, qd: Array, solved: Callable[[_Equations, Maker], Vector]) -> Pair:
    """The numbers, computed with so many digits that the bound on their error is at most LOST."""
    digits = DIGITS
    while digits <= MOST:
        with working(digits) as number:
            try:
                x = solved(_equations(number, chain, q, qd), number)
            except ZeroDivisionError:  # flint: the matrix cannot be told from a singular one
                x = []
            largest = max([abs(float(value.mid())) for value in x], default=math.nan)
            if x and max(float(value.rad()) for value in x) <= LOST * largest:
                high = [float(value.mid()) for value in x]
                low = [float((value - h).mid()) for value, h in zip(x, high, strict=True)]
                return Pair(np.array(high), np.array(low))
        digits *= 2
    raise ArithmeticError(f"{MOST} digits are not enough for a chain of {len(chain.moving)} links")


def _equations(number: Maker, chain: Mechanism, q: Array, qd: Array) -> _Equations:
    """Of revolute joints about axes of their frames: all in the world's axes, about the world's origin.

    With S_i the joint's twist (angular, then linear) and I_i a body's 6 x 6 inertia,
        M_ij = S_i . (sum over k >= i of I_k) S_j for j <= i,
    and the bias is what the Newton-Euler equations give for qdd = 0.
    """
    zero = number(0)
    place, turn = [zero] * 3, [[number(int(i == j)) for j in range(3)] for i in range(3)]
    velocity, acceleration = [zero] * 6, [zero] * 3 + [-each for each in _numbers(number, chain.gravity)]
    twists, inertias, forces = [], [], []
    for body, angle, rate in zip(chain.moving, _numbers(number, q), _numbers(number, qd), strict=True):
        assert body.joint.kind == "revolute"
        place = _plus(place, _times(turn, _numbers(number, body.joint.position)))
        turn = _product(turn, [_numbers(number, row) for row in np.asarray(body.joint.orientation)])
        axis = _times(turn, _numbers(number, body.joint.axis))
        turn = _product(turn, _rotation(number, np.asarray(body.joint.axis, dtype=np.float64), angle))
        twist = axis + _cross(place, axis)
        rated = [rate * x for x in twist]
        acceleration = _plus(acceleration, _twist_cross(velocity, rated))
        velocity = _plus(velocity, rated)
        inertia = _inertia_about_origin(number, body, place, turn)
        forces.append(_plus(_times(inertia, acceleration), _wrench_cross(velocity, _times(inertia, velocity))))
        twists.append(twist)
        inertias.append(inertia)
    n = len(twists)
    matrix, right = [[zero] * n for _ in range(n)], [zero] * n
    carried, force = [[zero] * 6 for _ in range(6)], [zero] * 6
    for i in reversed(range(n)):
        carried = [_plus(a, b) for a, b in zip(carried, inertias[i], strict=True)]
        force = _plus(force, forces[i])
        right[i] = -number(chain.moving[i].joint.damping) * number(float(qd[i])) - _dot(twists[i], force)
        column = _times(carried, twists[i])
        for j in range(i + 1):
            matrix[i][j] = matrix[j][i] = _dot(column, twists[j])
    return _Equations(matrix, right)


def _numbers(number: Maker, values: object) -> Vector:
    return [number(x) for x in np.asarray(values, dtype=np.float64).tolist()]


def _rotation(number: Maker, axis: Array, angle: Number) -> list[Vector]:
    """By an angle about an axis of the frame, 3 x 3: c 1 + (1 - c) a a^T + s [a]."""
    assert sorted(np.abs(axis)) == [0.0, 0.0, 1.0]
    s, c, a = angle.sin(), angle.cos(), _numbers(number, axis)
    zero = number(0)
    skew = [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]]
    return [[c * int(i == j) + (1 - c) * a[i] * a[j] + s * skew[i][j] for j in range(3)] for i in range(3)]


def _inertia_about_origin(arb: Maker, body: Any, place: Vector, turn: list[Vector]) -> list[Vector]:
    """6 x 6, of (angular, linear) velocity: [[J - m [c][c], m [c]], [-m [c], m 1]], [c] the matrix of c x."""
    mass = arb(body.mass)
    c = _plus(place, _times(turn, _numbers(arb, body.center)))
    inertia = np.asarray(body.inertia, dtype=np.float64)
    rows = np.diag(inertia) if inertia.ndim == 1 else inertia
    own = _product(_product(turn, [_numbers(arb, row) for row in rows]), _transpose(turn))
    zero = arb(0)
    skew = [[zero, -c[2], c[1]], [c[2], zero, -c[0]], [-c[1], c[0], zero]]
    square = _product(skew, skew)
    top = [
        [own[i][j] - mass * square[i][j] for j in range(3)] + [mass * skew[i][j] for j in range(3)] for i in range(3)
    ]
    return top + [[-mass * x for x in skew[i]] + [mass * int(i == j) for j in range(3)] for i in range(3)]


def _sum(values: Iterable[Number]) -> Number:
    return sum(values, 0)


def _dot(a: Vector, b: Vector) -> Number:
    return _sum([x * y for x, y in zip(a, b, strict=True)])


def _plus(a: Vector, b: Vector) -> Vector:
    return [x + y for x, y in zip(a, b, strict=True)]


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _twist_cross(a: Vector, b: Vector) -> Vector:
    """The rate of a twist b that is carried along by a."""
    return _cross(a[:3], b[:3]) + _plus(_cross(a[:3], b[3:]), _cross(a[3:], b[:3]))


def _wrench_cross(a: Vector, f: Vector) -> Vector:
    """The rate of a wrench f (moment, force) that is carried along by a."""
    return _plus(_cross(a[:3], f[:3]), _cross(a[3:], f[3:])) + _cross(a[:3], f[3:])


def _times(matrix: Sequence[Vector], vector: Vector) -> Vector:
    return [_dot(row, vector) for row in matrix]


def _transpose(matrix: list[Vector]) -> list[Vector]:
    return [list(column) for column in zip(*matrix, strict=True)]


def _product(a: list[Vector], b: list[Vector]) -> list[Vector]:
    columns = _transpose(b)
    return [[_dot(row, column) for column in columns] for row in a]
