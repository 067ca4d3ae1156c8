"""Accelerations of chains in space, in 66 digits, by Newton-Euler and a dense solve: no graph, no derivative."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from cgraph.extend import Array

from ..multibody.mechanism import Mechanism
from .flint_numbers import Number, flint, working

Vector = list[Number]
DIGITS = 66
LOST = 1e-30  # a bound on the relative error of the results, or there were too few bits


def _solved(matrix: list[Vector], rhs: Vector) -> Array:
    column = flint().arb_mat(matrix).solve(flint().arb_mat([[each] for each in rhs]))
    x = [column[i, 0] for i in range(len(rhs))]
    largest = max(abs(float(each.mid())) for each in x)
    assert max(float(each.rad()) for each in x) <= LOST * largest
    return np.array([float(each.mid()) for each in x])


def chain_accelerations(chain: Mechanism, q: Array, qd: Array, tau: Array) -> Array:
    """qdd of a chain of revolute joints about z, (n,): all in the world's axes, about the world's origin.

    With S_i the joint's twist (angular, then linear) and I_i a body's 6 x 6 inertia,
        M_ij = S_i . (sum over k >= i of I_k) S_j for j <= i,
    and the bias is what the Newton-Euler equations give for qdd = 0. Raises ImportError without python-flint.
    """
    with working(DIGITS) as arb:
        zero = arb(0)
        place, turn = [zero] * 3, [[arb(int(i == j)) for j in range(3)] for i in range(3)]
        gravity = [arb(each) for each in np.asarray(chain.gravity, dtype=np.float64).tolist()]
        velocity, acceleration = [zero] * 6, [zero] * 3 + [-each for each in gravity]
        twists, inertias, forces = [], [], []
        for body, angle, rate in zip(chain.moving, q.tolist(), qd.tolist(), strict=True):
            assert body.joint.kind == "revolute"
            assert np.array_equal(body.joint.axis, [0.0, 0.0, 1.0])
            place = _plus(
                place, _times(turn, [arb(x) for x in np.asarray(body.joint.position, dtype=np.float64).tolist()])
            )
            s, c = arb(angle).sin(), arb(angle).cos()
            fixed = [[arb(float(x)) for x in row] for row in np.asarray(body.joint.orientation)]
            turn = _product(_product(turn, fixed), [[c, -s, zero], [s, c, zero], [zero, zero, arb(1)]])
            axis = [row[2] for row in turn]
            twist = axis + _cross(place, axis)
            rated = [arb(rate) * x for x in twist]
            acceleration = _plus(acceleration, _twist_cross(velocity, rated))
            velocity = _plus(velocity, rated)
            inertia = _inertia_about_origin(arb, body, place, turn)
            momentum = _times(inertia, velocity)
            forces.append(_plus(_times(inertia, acceleration), _wrench_cross(velocity, momentum)))
            twists.append(twist)
            inertias.append(inertia)
        n = len(twists)
        matrix = [[zero] * n for _ in range(n)]
        rhs = [zero] * n
        carried, force = [[zero] * 6 for _ in range(6)], [zero] * 6
        for i in reversed(range(n)):
            carried = [_plus(a, b) for a, b in zip(carried, inertias[i], strict=True)]
            force = _plus(force, forces[i])
            rhs[i] = (
                arb(float(tau[i])) - arb(chain.moving[i].joint.damping) * arb(float(qd[i])) - _dot(twists[i], force)
            )
            column = _times(carried, twists[i])
            for j in range(i + 1):
                matrix[i][j] = matrix[j][i] = _dot(column, twists[j])
        return _solved(matrix, rhs)


def _inertia_about_origin(
    arb: Callable[[object], Number], body: Any, place: Vector, turn: list[Vector]
) -> list[Vector]:
    """6 x 6, of (angular, linear) velocity: [[J - m [c][c], m [c]], [-m [c], m 1]], [c] the matrix of c x."""
    mass = arb(body.mass)
    c = _plus(place, _times(turn, [arb(float(x)) for x in body.center]))
    own = _product(_product(turn, [[arb(float(x)) for x in row] for row in np.asarray(body.inertia)]), _transpose(turn))
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
