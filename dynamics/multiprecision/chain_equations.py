"""Torques and accelerations of chains of bodies to any number of digits, by Newton-Euler: no graph, no derivative."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cgraph._shared import Array

from ..multibody.bodies.body import Body
from ..multibody.trees.mechanism import Mechanism
from .flint_numbers import Number, flint, working

if TYPE_CHECKING:
    from flint import arb_mat

Maker = Callable[[object], Number]
DIGITS = 60  # of the first attempt; twice as many until `LOST` is met
MOST_DIGITS = 2000
LOST = 1e-50  # the largest bound on the error, relative to the largest component


class Pair(NamedTuple):
    """Numbers as sums of two float64, `high` the nearest one: 32 digits. Each (n,)."""

    high: Array
    low: Array

    @classmethod
    def of(cls, numbers: Sequence[Number]) -> Pair:
        """The midpoints of numbers at the working precision."""
        high = [float(value.mid()) for value in numbers]
        return cls(np.array(high), np.array([float((x - h).mid()) for x, h in zip(numbers, high, strict=True)]))

    def deviation(self, x: Array) -> Array:
        """x - this, exact to the last bits of x."""
        return (x - self.high) - self.low


def torques(chain: Mechanism, q: Array, qd: Array, qdd: Array) -> Pair:
    """tau [N m] of a chain for accelerations qdd, (n,). Raises ImportError without python-flint."""

    def solved(number: Maker) -> list[Number]:
        matrix, right = _equations(number, chain, q, qd)
        found: list[Number] = (matrix * _column(number, qdd) - right).entries()
        return found

    return bounded(solved)


def accelerations(chain: Mechanism, q: Array, qd: Array, tau: Array) -> Pair:
    """qdd [rad/s^2] of a chain under torques tau, (n,). Raises ImportError without python-flint."""

    def solved(number: Maker) -> list[Number]:
        matrix, right = _equations(number, chain, q, qd)
        found: list[Number] = matrix.solve(_column(number, tau) + right).entries()
        return found

    return bounded(solved)


def bounded(solved: Callable[[Maker], Sequence[Number]]) -> Pair:
    """The numbers, computed with so many digits that the bound on their error is at most LOST."""
    digits = DIGITS
    while digits <= MOST_DIGITS:
        with working(digits) as number:
            try:
                x = solved(number)
            except ZeroDivisionError:  # flint: the matrix cannot be told from a singular one
                x = []
            largest = max([abs(float(value.mid())) for value in x], default=math.nan)
            if x and max(float(value.rad()) for value in x) <= LOST * largest:
                return Pair.of(x)
        digits *= 2
    raise ArithmeticError(f"{MOST_DIGITS} digits are not enough for these equations")


def _equations(number: Maker, chain: Mechanism, q: Array, qd: Array) -> tuple[arb_mat, arb_mat]:
    """The matrix and the right side of matrix qdd = tau + right, of revolute joints about axes of their frames.

    All in the world's axes, about the world's origin. With S_i the joint's twist (angular, then linear) and I_i a
    body's 6 x 6 inertia,
        M_ij = S_i . (sum over k >= i of I_k) S_j for j <= i,
    and the bias is what the Newton-Euler equations give for qdd = 0.
    """
    place, turn = _column(number, np.zeros(3)), _matrix(number, np.eye(3))
    velocity = _column(number, np.zeros(6))
    acceleration = _column(number, [0.0, 0.0, 0.0, *-np.asarray(chain.gravity, dtype=np.float64)])
    twists, inertias, forces = [], [], []
    for body, angle, rate in zip(chain.moving, q.tolist(), qd.tolist(), strict=True):
        assert body.joint.kind == "revolute"
        place = place + turn * _column(number, body.joint.position)
        turn = turn * _matrix(number, body.joint.orientation)
        axis = turn * _column(number, body.joint.axis)
        turn = turn * _rotation(number, np.asarray(body.joint.axis, dtype=np.float64), number(angle))
        twist = _blocks([[axis], [_skew(place) * axis]])
        rated = twist * number(rate)
        acceleration = acceleration + _carried(velocity) * rated
        velocity = velocity + rated
        inertia = _inertia_about_origin(number, body, place, turn)
        # the rate of a wrench that a twist V carries along is -(V x)^T of it
        forces.append(inertia * acceleration - _carried(velocity).transpose() * (inertia * velocity))
        twists.append(twist)
        inertias.append(inertia)
    n, rows = len(twists), [twist.entries() for twist in twists]
    matrix, right = [[number(0)] * n for _ in range(n)], [number(0)] * n
    inertia, force = _matrix(number, np.zeros((6, 6))), _column(number, np.zeros(6))
    for i in reversed(range(n)):
        inertia, force = inertia + inertias[i], force + forces[i]
        damping = number(chain.moving[i].joint.damping) * number(float(qd[i]))
        right[i] = -damping - (twists[i].transpose() * force)[0, 0]
        for j, entry in enumerate((flint().arb_mat(rows[: i + 1]) * (inertia * twists[i])).entries()):
            matrix[i][j] = matrix[j][i] = entry
    return flint().arb_mat(matrix), flint().arb_mat([[each] for each in right])


def _matrix(number: Maker, rows: object) -> arb_mat:
    return flint().arb_mat([[number(x) for x in row] for row in np.asarray(rows, dtype=np.float64).tolist()])


def _column(number: Maker, values: object) -> arb_mat:
    return _matrix(number, np.reshape(np.asarray(values, dtype=np.float64), (-1, 1)))


def _blocks(rows: Sequence[Sequence[arb_mat]]) -> arb_mat:
    """The matrix of blocks."""
    lines: list[list[Number]] = []
    for row in rows:
        lines += [[x for part in parts for x in part] for parts in zip(*[each.tolist() for each in row], strict=True)]
    return flint().arb_mat(lines)


def _skew(a: arb_mat) -> arb_mat:
    """[a], the matrix of a x."""
    x, y, z = a.entries()
    return flint().arb_mat([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])


def _carried(twist: arb_mat) -> arb_mat:
    """[[w], 0; [v], [w]]: the rate of a twist that the twist (w, v) carries along."""
    angular, linear = (_skew(flint().arb_mat([[each] for each in twist.entries()[k : k + 3]])) for k in (0, 3))
    return _blocks([[angular, 0 * angular], [linear, angular]])


def _rotation(number: Maker, axis: Array, angle: Number) -> arb_mat:
    """Rotation by an angle about an axis of the frame, 3 x 3: c 1 + (1 - c) a a^T + s [a]."""
    assert sorted(np.abs(axis)) == [0.0, 0.0, 1.0]
    a, c = _column(number, axis), angle.cos()
    return _matrix(number, np.eye(3)) * c + a * a.transpose() * (1 - c) + _skew(a) * angle.sin()


def _inertia_about_origin(number: Maker, body: Body, place: arb_mat, turn: arb_mat) -> arb_mat:
    """6 x 6, of (angular, linear) velocity: [[J - m [c][c], m [c]], [-m [c], m 1]]."""
    mass, rows = number(body.mass), np.asarray(body.inertia, dtype=np.float64)
    skew = _skew(place + turn * _column(number, body.center))
    own = turn * _matrix(number, np.diag(rows) if rows.ndim == 1 else rows) * turn.transpose()
    return _blocks([[own - skew * skew * mass, skew * mass], [-skew * mass, _matrix(number, np.eye(3)) * mass]])
