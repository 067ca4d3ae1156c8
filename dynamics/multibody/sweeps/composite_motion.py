"""Composite bodies in motion: what a body and all that it carries have together, about a point.

For points b of mass dm, whose velocities are b' = v + w x b, the sums over dm of 1, b, b b^T, b' and b' b^T say what
any change of velocity or acceleration takes. Of the last, C = v h^T + [w] Sigma, come all Coriolis forces of a body:
b x 2 (x x b') adds up to 2 (tr(C) x - C x) for an angular velocity x.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import as_node

from ..algebra.spatial import ZERO, Triple, combined, cross, plus, scaled
from ..algebra.spatial_vectors import Twist, Wrench
from .links import Link

Entries = tuple[Triple, Triple, Triple]  # rows
TURNS = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


class Composite(NamedTuple):
    """Sums over the mass of bodies, about a point, in axes that stand still.

    second: of b b^T, symmetric; half the trace of the inertia less the inertia.  spread: of b' b^T, the C above.
    wrench: of the accelerations b'', their rate of momentum, with gravity.
    """

    mass: Node
    moment: Triple
    second: Entries
    momentum: Triple
    spread: Entries
    wrench: Wrench

    def plus(self, other: Composite) -> Composite:
        """Of both, about the same point."""
        return Composite(
            self.mass + other.mass,
            plus(self.moment, other.moment),
            _symmetric([[self.second[i][j] + other.second[i][j] for j in range(i + 1)] for i in range(3)]),
            plus(self.momentum, other.momentum),
            _rows([plus(a, b) for a, b in zip(self.spread, other.spread, strict=True)]),
            self.wrench.plus(other.wrench),
        )

    def about(self, offset: Triple) -> Composite:
        """The same about another point, from which this one is `offset` away: b + offset in place of b."""
        old, r = self.moment, offset
        new = plus(old, scaled(self.mass, r))
        second = [
            [self.second[i][j] + (r[i] * new[j] + old[i] * r[j]) for j in range(i)]
            + [self.second[i][i] + r[i] * (old[i] + new[i])]
            for i in range(3)
        ]
        spread = [plus(row, scaled(p, r)) for row, p in zip(self.spread, self.momentum, strict=True)]
        return Composite(self.mass, new, _symmetric(second), self.momentum, _rows(spread), self.wrench.about(r))

    def inertial(self, rate: Twist) -> Wrench:
        """I rate: what a change of the acceleration takes."""
        torque = plus(cross(self.moment, rate.linear), _less(self.second, rate.angular))
        return Wrench(torque, plus(scaled(self.mass, rate.linear), cross(rate.angular, self.moment)))

    def coriolis(self, velocity: Twist) -> Wrench:
        """B velocity, half of what a change of the velocity takes. Linear velocities take none."""
        return Wrench(_less(self.spread, velocity.angular), cross(velocity.angular, self.momentum))

    def coriolis_transpose(self, velocity: Twist) -> Triple:
        """B^T velocity, a torque."""
        columns = _rows([(self.spread[0][i], self.spread[1][i], self.spread[2][i]) for i in range(3)])
        return plus(_less(columns, velocity.angular), cross(self.momentum, velocity.linear))


def body_motion(link: Link, axes: Entries, velocity: Twist, acceleration: Twist, tags: Sequence[str] = ()) -> Composite:
    """A body alone, about its origin.

    axes: the body's as columns.  acceleration: in space, against free fall.  tags: the energies that it comes of.
    """
    mass = as_node(link.mass)
    moment = combined(axes, link.moment)
    second = _rotated_second(link, axes)
    momentum = plus(scaled(mass, velocity.linear), cross(velocity.angular, moment))
    w = velocity.angular
    columns = [cross(w, column) for column in second]  # of [w] Sigma, as Sigma is symmetric
    rows = [(columns[0][i], columns[1][i], columns[2][i]) for i in range(3)]
    spread = [plus(scaled(v, moment), row) for v, row in zip(velocity.linear, rows, strict=True)]
    still = Composite(mass, moment, second, momentum, _rows(spread), Wrench((ZERO,) * 3, (ZERO,) * 3))
    with cg.tag(*tags):
        return still._replace(wrench=still.inertial(acceleration).plus(still.coriolis(velocity)))


def _rotated_second(link: Link, axes: Entries) -> Entries:
    """R Sigma R^T, with a multiple of 1 taken out, which does not turn."""
    inertia = [[as_node(link.inertia[max(i, j)][min(i, j)]) for j in range(3)] for i in range(3)]
    diagonal = [0.5 * (inertia[j][j] + inertia[k][k] - inertia[i][i]) for i, j, k in TURNS]
    k = 0 if diagonal[0] is diagonal[1] or diagonal[0].value == diagonal[1].value is not None else 1
    alike = diagonal[k]
    rest = [[diagonal[i] - alike if i == j else -inertia[i][j] for j in range(3)] for i in range(3)]
    # With halves on the diagonal, sum over i >= j of rest_ij (r_i r_j^T + r_j r_i^T).
    lower = [[rest[i][j] if j < i else 0.5 * rest[i][i] if j == i else ZERO for j in range(3)] for i in range(3)]
    scaled_axes = [combined(axes, (row[0], row[1], row[2])) for row in lower]
    entries = []
    for i in range(3):
        row = []
        for j in range(i + 1):
            total = alike if i == j else ZERO
            for axis, other in zip(axes, scaled_axes, strict=True):
                total = total + (2.0 * (axis[i] * other[i]) if i == j else axis[i] * other[j] + axis[j] * other[i])
            row.append(total)
        entries.append(row)
    return _symmetric(entries)


def _less(matrix: Entries, x: Triple) -> Triple:
    """(tr(A) 1 - A) x: of the second moments of a body that is its inertia times x."""
    result = []
    for i, j, k in TURNS:
        trace = matrix[j][j] + matrix[k][k]
        result.append(trace * x[i] - matrix[i][j] * x[j] - matrix[i][k] * x[k])
    return result[0], result[1], result[2]


def _symmetric(lower: list[list[Node]]) -> Entries:
    return _rows([(lower[i][0], lower[max(i, 1)][min(i, 1)], lower[2][i]) for i in range(3)])


def _rows(rows: list[Triple]) -> Entries:
    return rows[0], rows[1], rows[2]
