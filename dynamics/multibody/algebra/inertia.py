"""Inertia of bodies about a point, as nodes: mass, first moment and second moments of mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cgraph import Node

from .spatial import Triple, cross, plus, scaled
from .spatial_vectors import Twist, Wrench
from .turns import NEXT, AxisTurn, Turn

Rows = tuple[Triple, Triple, Triple]


class Inertia(NamedTuple):
    """Sums over the mass of bodies of 1, b and b b^T, for points b from a point.

    about_z: the moment of inertia about z, the sum of the first two second moments, where it is kept beside them, as a
    turn about z leaves it as it is.
    """

    mass: Node
    moment: Triple
    second: Rows
    about_z: Node | None = None

    def plus(self, other: Inertia) -> Inertia:
        """Sum of two inertias about the same point."""
        about_z = None if self.about_z is None or other.about_z is None else self.about_z + other.about_z
        lower = [[self.second[i][j] + other.second[i][j] for j in range(i + 1)] for i in range(3)]
        return Inertia(self.mass + other.mass, plus(self.moment, other.moment), symmetric(lower), about_z)

    def about(self, offset: Triple) -> Inertia:
        """Inertia about a point from which this one is `offset` away, b + offset in place of b."""
        old, r = self.moment, offset
        new = plus(old, scaled(self.mass, r))
        more = [r[i] * (old[i] + new[i]) for i in range(3)]  # 2 r h + m r^2
        if self.about_z is not None:  # in a plane wrenches have the products r h as well
            for i in range(2):
                if r[i].value is None:
                    more[i] = 2.0 * (r[i] * old[i]) + (self.mass * r[i]) * r[i]
        second = [
            [self.second[i][j] + (r[i] * new[j] + old[i] * r[j]) for j in range(i)] + [self.second[i][i] + more[i]]
            for i in range(3)
        ]
        about_z = None if self.about_z is None else self.about_z + more[0] + more[1]
        return Inertia(self.mass, new, symmetric(second), about_z)

    def turned(self, turn: Turn) -> Inertia:
        """Inertia in the axes before a turn."""
        second = rows(turn.second_moments(self.second))
        stays = self.about_z is None or (isinstance(turn, AxisTurn) and turn.axis == 2)
        about_z = self.about_z if stays else second[0][0] + second[1][1]
        return Inertia(self.mass, turn.out(self.moment), second, about_z)

    def wrench(self, rate: Twist) -> Wrench:
        """I rate: what gives the bodies this acceleration from rest."""
        torque = plus(cross(self.moment, rate.linear), traced(self.second, rate.angular, self.about_z))
        return Wrench(torque, plus(scaled(self.mass, rate.linear), cross(rate.angular, self.moment)))


def traced(matrix: Rows, x: Triple, about_z: Node | None = None) -> Triple:
    """(tr(A) 1 - A) x: of the second moments of a body that is its inertia times x.  about_z: A_xx + A_yy, if known."""
    result = []
    for i, (j, k) in enumerate(NEXT):
        trace = matrix[j][j] + matrix[k][k] if about_z is None or i < 2 else about_z
        result.append(trace * x[i] - matrix[i][j] * x[j] - matrix[i][k] * x[k])
    return result[0], result[1], result[2]


def symmetric(lower: Sequence[Sequence[Node]]) -> Rows:
    """Rows of a symmetric matrix from its lower triangle."""
    return rows([[lower[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)])


def rows(entries: Sequence[Sequence[Node]]) -> Rows:
    """Rows of a matrix, as triples."""
    (a, b, c), (d, e, f), (g, h, i) = entries
    return (a, b, c), (d, e, f), (g, h, i)
