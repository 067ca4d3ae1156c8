"""Twists and wrenches at a point, six nodes each, their products, and the inertia of bodies about the point.

An inertia is mass, first moment and second moments of mass; of bodies on joints that give way, what they answer to an
acceleration of the first of them: articulated inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cgraph import Node

from .spatial import STILL, Matrix, Triple, cross, dot, plus, rotate, rotate_transpose, scaled
from .turns import NEXT, AxisTurn, Turn


class Twist(NamedTuple):
    """Twist of a body, its velocity or its acceleration in space: the part of a point of it last."""

    angular: Triple
    linear: Triple

    def plus(self, other: Twist) -> Twist:
        """Sum."""
        return Twist(plus(self.angular, other.angular), plus(self.linear, other.linear))

    def scaled(self, factor: float | Node) -> Twist:
        """Multiple."""
        return Twist(scaled(factor, self.angular), scaled(factor, self.linear))

    def cross(self, other: Twist) -> Twist:
        """The rate of the other, where it is carried along with this velocity: (w x w', w x v' + v x w')."""
        linear = plus(cross(self.angular, other.linear), cross(self.linear, other.angular))
        return Twist(cross(self.angular, other.angular), linear)

    def at(self, offset: Triple) -> Twist:
        """Twist by the motion of a point `offset` away."""
        return Twist(self.angular, plus(self.linear, cross(self.angular, offset)))

    def power(self, wrench: Wrench) -> Node:
        """Power of a wrench along the twist."""
        return dot(self.angular, wrench.torque) + dot(self.linear, wrench.force)


class Wrench(NamedTuple):
    """A torque about a point and a force."""

    torque: Triple
    force: Triple

    def plus(self, other: Wrench) -> Wrench:
        """Sum."""
        return Wrench(plus(self.torque, other.torque), plus(self.force, other.force))

    def carried(self, velocity: Twist) -> Wrench:
        """Rate of a wrench that is carried along with a velocity: (w x n + v x f, w x f)."""
        torque = plus(cross(velocity.angular, self.torque), cross(velocity.linear, self.force))
        return Wrench(torque, cross(velocity.angular, self.force))

    def turned(self, turn: Turn) -> Wrench:
        """Wrench in the axes before a turn."""
        return Wrench(turn.out(self.torque), turn.out(self.force))

    def about(self, offset: Triple) -> Wrench:
        """Wrench about a point from which this one is `offset` away."""
        return Wrench(plus(self.torque, cross(offset, self.force)), self.force)


REST, IDLE = Twist(STILL, STILL), Wrench(STILL, STILL)


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


class ArticulatedInertia(NamedTuple):
    """A symmetric map of twists at a point to wrenches: torque = N w + H v, force = H^T w + M v."""

    angular: Rows  # N, symmetric
    coupling: Rows  # H
    linear: Rows  # M, symmetric

    def wrench(self, rate: Twist) -> Wrench:
        """Wrench of an acceleration."""
        torque = plus(_times(self.angular, rate.angular), _times(self.coupling, rate.linear))
        return Wrench(torque, plus(rotate_transpose(self.coupling, rate.angular), _times(self.linear, rate.linear)))

    def without(self, wrench: Wrench, gain: Wrench) -> ArticulatedInertia:
        """The inertia less wrench gain^T, parallel to each other: of a freedom that gives way."""
        (n, f), (a, b) = wrench, gain
        coupling = rows([[self.coupling[i][j] - n[i] * b[j] for j in range(3)] for i in range(3)])
        return ArticulatedInertia(_less(self.angular, n, a), coupling, _less(self.linear, f, b))

    def seen(self, turn: Matrix, offset: Triple) -> ArticulatedInertia:
        """The inertia in the axes that `turn` turns from, about a point from which this one is `offset` away.

        With R N R^T and the like for N, and p for the offset: H + [p] M, and N - H [p] + [p] (H + [p] M)^T.
        """
        n, h, m = (_turned(turn, each) for each in self)
        moved = _columns([cross(offset, column) for column in _columns(m)])  # [p] M
        h_new = rows([plus(a, b) for a, b in zip(h, moved, strict=True)])
        right = [cross(offset, row) for row in h]  # the rows of -H [p]
        both = _columns([cross(offset, row) for row in h_new])  # [p] (H + [p] M)^T
        lower = [[n[i][j] + right[i][j] + both[i][j] for j in range(i + 1)] for i in range(3)]
        return ArticulatedInertia(symmetric(lower), h_new, m)


def _times(matrix: Rows, vector: Triple) -> Triple:
    x, y, z = (dot(row, vector) for row in matrix)
    return x, y, z


def _less(matrix: Rows, a: Triple, b: Triple) -> Rows:
    return symmetric([[matrix[i][j] - a[i] * b[j] for j in range(i + 1)] for i in range(3)])


def _columns(of: Sequence[Triple]) -> Rows:
    return rows(list(zip(*of, strict=True)))


def _turned(turn: Matrix, matrix: Rows) -> Rows:
    """R A R^T."""
    half = [rotate(turn, row) for row in matrix]  # the rows of A R^T
    return _columns([rotate(turn, column) for column in _columns(half)])


def weighted(gain: Wrench, factor: Node) -> Wrench:
    """Multiple."""
    return Wrench(scaled(factor, gain.torque), scaled(factor, gain.force))
