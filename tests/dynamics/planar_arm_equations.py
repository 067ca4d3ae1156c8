"""Torques and accelerations of planar arms to any number of digits, by closed formulas: no graph, no derivative.

With theta_i the angle of link i from the vertical, b_ki link i's share of the way to the center of mass of link k (its
length, or for i = k the distance of the center) and a_ij = sum over k of m_k b_ki b_kj + I_i [i = j], the equations are
    sum_j a_ij (cos(theta_i - theta_j) theta_j'' + sin(theta_i - theta_j) theta_j'^2)
        + g sum_k m_k b_ki sin theta_i = Q_i,    Q_i = tau_i - tau_(i+1),
and damping acts in the joints.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array
from dynamics import Mechanism
from dynamics.multibody.builders.planar_arm import planar_links
from dynamics.multiprecision.chain_equations import Pair
from dynamics.multiprecision.flint_numbers import Number, flint, working

Vector = list[Number]
DIGITS = 60  # of the first attempt; twice as many until `LOST` is met
MOST = 2000
LOST = 1e-50  # the largest bound on the error, relative to the largest component


def torques(arm: Mechanism, q: Array, qd: Array, qdd: Array) -> Pair:
    """tau [N m] of a planar arm for accelerations qdd, (n,). Raises ImportError without python-flint."""

    def solved(terms: _Equations, number: Callable[[object], Number]) -> Vector:
        alpha = _running(number, qdd)
        force = [_dot(row, alpha) - right for row, right in zip(terms.matrix, terms.right, strict=True)]
        above = list(itertools.accumulate(reversed(force)))[::-1]
        return [f + c for f, c in zip(above, terms.damping, strict=True)]

    return _bounded(arm, q, qd, solved)


def accelerations(arm: Mechanism, q: Array, qd: Array, tau: Array) -> Pair:
    """qdd [rad/s^2] of a planar arm under torques tau, (n,). Raises ImportError without python-flint."""

    def solved(terms: _Equations, number: Callable[[object], Number]) -> Vector:
        torque = [number(value) - c for value, c in zip(tau.tolist(), terms.damping, strict=True)]
        beyond = [*torque[1:], number(0)]
        right = [[a - b + r] for a, b, r in zip(torque, beyond, terms.right, strict=True)]
        matrix = flint().arb_mat(terms.matrix)
        alpha = matrix.solve(flint().arb_mat(right))
        column = [alpha[i, 0] for i in range(len(right))]
        return [a - b for a, b in zip(column, [number(0), *column], strict=False)]

    return _bounded(arm, q, qd, solved)


class _Equations(NamedTuple):
    """The equations matrix theta'' = Q + right, and the torques that damping takes in the joints."""

    matrix: list[Vector]
    right: Vector
    damping: Vector


def _bounded(
    arm: Mechanism, q: Array, qd: Array, solved: Callable[[_Equations, Callable[[object], Number]], Vector]
) -> Pair:
    """The numbers, computed with so many digits that the bound on their error is at most LOST."""
    digits = DIGITS
    while digits <= MOST:
        with working(digits) as number:
            try:
                x = solved(_terms(number, arm, q, qd), number)
            except ZeroDivisionError:  # flint: the matrix cannot be told from a singular one
                x = []
            largest = max([abs(float(value.mid())) for value in x], default=math.nan)
            if x and max(float(value.rad()) for value in x) <= LOST * largest:
                high = [float(value.mid()) for value in x]
                low = [float((value - h).mid()) for value, h in zip(x, high, strict=True)]
                return Pair(np.array(high), np.array(low))
        digits *= 2
    raise ArithmeticError(f"{MOST} digits are not enough for an arm of {len(arm.moving)} links")


def _terms(number: Callable[[object], Number], arm: Mechanism, q: Array, qd: Array) -> _Equations:
    n = len(arm.moving)
    gravity = number(np.asarray(arm.gravity)[2])
    theta, omega = _running(number, q), _running(number, qd)
    mass, length, center, inertia = (
        [number(value) for value in row]
        for row in zip(
            *[(link.mass, link.length, link.center, link.inertia) for link in planar_links(arm)], strict=True
        )
    )
    beyond = [*list(itertools.accumulate(reversed(mass)))[::-1][1:], number(0)]  # mass carried at the far end
    first = [m * c + b * s for m, c, b, s in zip(mass, center, beyond, length, strict=True)]
    sin, cos = [angle.sin() for angle in theta], [angle.cos() for angle in theta]
    matrix = [[number(0)] * n for _ in range(n)]
    right = [gravity * f * s for f, s in zip(first, sin, strict=True)]
    for i in range(n):
        matrix[i][i] = mass[i] * center[i] ** 2 + beyond[i] * length[i] ** 2 + inertia[i]
        for j in range(i):
            a = length[j] * first[i]
            matrix[i][j] = matrix[j][i] = a * (cos[i] * cos[j] + sin[i] * sin[j])
            turn = a * (sin[i] * cos[j] - cos[i] * sin[j])
            right[i] = right[i] - turn * omega[j] ** 2
            right[j] = right[j] + turn * omega[i] ** 2
    damping = [number(c) * number(v) for c, v in zip(arm.system.damping, qd.tolist(), strict=True)]
    return _Equations(matrix, right, damping)


def _running(number: Callable[[object], Number], values: Array) -> Vector:
    return list(itertools.accumulate([number(value) for value in values.tolist()]))


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return sum([x * y for x, y in zip(a, b, strict=True)])
