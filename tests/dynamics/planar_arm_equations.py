"""Torques and accelerations of planar arms to any number of digits, by closed formulas: no graph, no derivative.

With theta_i the angle of link i from the vertical, b_ki link i's share of the way to the center of mass of link k (its
length, or for i = k the distance of the center) and a_ij = sum over k of m_k b_ki b_kj + I_i [i = j], the equations are
    sum_j a_ij (cos(theta_i - theta_j) theta_j'' + sin(theta_i - theta_j) theta_j'^2)
        + g sum_k m_k b_ki sin theta_i = Q_i,    Q_i = tau_i - tau_(i+1),
and damping acts in the joints.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array
from dynamics import Mechanism
from dynamics.multibody.builders.planar_arm import planar_links
from dynamics.multiprecision.chain_equations import Pair, bounded
from dynamics.multiprecision.flint_numbers import Number, flint

Vector = list[Number]
Maker = Callable[[object], Number]


class Link(NamedTuple):
    """Numbers of a link: kg, m, m, kg m^2 about its center."""

    mass: float
    length: float
    center: float
    inertia: float


def torques(arm: Mechanism, q: Array, qd: Array, qdd: Array) -> Pair:
    """tau [N m] of a planar arm for accelerations qdd, (n,)."""

    def solved(number: Maker) -> Vector:
        matrix, right = _terms(number, planar_links(arm), _gravity(arm), q, qd)
        alpha = _running(number, qdd)
        force = [_dot(row, alpha) - given for row, given in zip(matrix, right, strict=True)]
        above = list(itertools.accumulate(reversed(force)))[::-1]
        return [f + number(c) * number(v) for f, c, v in zip(above, arm.system.damping, qd.tolist(), strict=True)]

    return bounded(solved)


def accelerations(arm: Mechanism, q: Array, qd: Array, tau: Array) -> Pair:
    """qdd [rad/s^2] of a planar arm under torques tau, (n,)."""
    return accelerations_of(planar_links(arm), _gravity(arm), q, qd, tau, arm.system.damping)


def accelerations_of(
    links: Sequence[Link],
    gravity: float,
    q: Array,
    qd: Array,
    tau: Array,
    damping: Sequence[float],
    armature: float = 0.0,
) -> Pair:
    """The same of links by their numbers.  armature: of the rotor of each joint [kg m^2]."""

    def solved(number: Maker) -> Vector:
        matrix, right = _terms(number, links, gravity, q, qd)
        rows = zip(tau.tolist(), damping, qd.tolist(), strict=True)
        torque = [number(f) - number(c) * number(v) for f, c, v in rows]
        right = [[a - b + r] for a, b, r in zip(torque, [*torque[1:], number(0)], right, strict=True)]
        for i in range(len(links)):  # armature (theta_i - theta_(i-1))'' on link i, and its reaction on the one before
            matrix[i][i] += number(armature) * (2 if i + 1 < len(links) else 1)
            if i:
                matrix[i][i - 1] -= number(armature)
                matrix[i - 1][i] -= number(armature)
        column = flint().arb_mat(matrix).solve(flint().arb_mat(right)).entries()
        return [a - b for a, b in zip(column, [number(0), *column], strict=False)]

    return bounded(solved)


def _gravity(arm: Mechanism) -> float:
    return -float(np.asarray(arm.gravity)[2])


def _terms(number: Maker, links: Sequence[Link], gravity: float, q: Array, qd: Array) -> tuple[list[Vector], Vector]:
    """The equations matrix theta'' = Q + right."""
    n = len(links)
    theta, omega = _running(number, q), _running(number, qd)
    mass, length, center, inertia = (
        [number(value) for value in row]
        for row in zip(*[(link.mass, link.length, link.center, link.inertia) for link in links], strict=True)
    )
    beyond = [*list(itertools.accumulate(reversed(mass)))[::-1][1:], number(0)]  # mass carried at the far end
    first = [m * c + b * s for m, c, b, s in zip(mass, center, beyond, length, strict=True)]
    sin, cos = [angle.sin() for angle in theta], [angle.cos() for angle in theta]
    matrix = [[number(0)] * n for _ in range(n)]
    right = [-number(gravity) * f * s for f, s in zip(first, sin, strict=True)]
    for i in range(n):
        matrix[i][i] = mass[i] * center[i] ** 2 + beyond[i] * length[i] ** 2 + inertia[i]
        for j in range(i):
            a = length[j] * first[i]
            matrix[i][j] = matrix[j][i] = a * (cos[i] * cos[j] + sin[i] * sin[j])
            turn = a * (sin[i] * cos[j] - cos[i] * sin[j])
            right[i] = right[i] - turn * omega[j] ** 2
            right[j] = right[j] + turn * omega[i] ** 2
    return matrix, right


def _running(number: Callable[[object], Number], values: Array) -> Vector:
    return list(itertools.accumulate([number(value) for value in values.tolist()]))


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return sum([x * y for x, y in zip(a, b, strict=True)])
