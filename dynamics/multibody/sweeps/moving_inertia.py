"""Moving composite bodies: what a body and all that it carries have together, about a point, in axes that stand still.

For points b of mass dm, whose velocities are b' = v + w x b, the sums over dm of 1, b, b b^T, b' and b' b^T say what
any change of velocity or acceleration takes. Of the last, C = v h^T + [w] Sigma, come all Coriolis forces of a body:
b x 2 (x x b') adds up to 2 (tr(C) x - C x) for an angular velocity x.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph.extend import as_node

from ..algebra.inertia import Inertia, Rows, rows, symmetric, traced
from ..algebra.spatial import ZERO, Triple, combined, cross, plus, scaled
from ..algebra.spatial_vectors import IDLE, Twist, Wrench
from ..algebra.turns import NEXT, Axes
from .links import Link


class MovingInertia(NamedTuple):
    """Sums over the mass of bodies about a point.

    velocity_moment: of b' b^T, the C above.  wrench: of the accelerations b'', their rate of momentum, with gravity.
    """

    inertia: Inertia
    momentum: Triple
    velocity_moment: Rows
    wrench: Wrench

    def plus(self, other: MovingInertia) -> MovingInertia:
        """Sum of two about the same point."""
        moment = [plus(a, b) for a, b in zip(self.velocity_moment, other.velocity_moment, strict=True)]
        momentum, wrench = plus(self.momentum, other.momentum), self.wrench.plus(other.wrench)
        return MovingInertia(self.inertia.plus(other.inertia), momentum, rows(moment), wrench)

    def about(self, offset: Triple) -> MovingInertia:
        """Sums about a point from which this one is `offset` away, b + offset in place of b."""
        moment = [plus(row, scaled(p, offset)) for row, p in zip(self.velocity_moment, self.momentum, strict=True)]
        return MovingInertia(self.inertia.about(offset), self.momentum, rows(moment), self.wrench.about(offset))

    def coriolis(self, velocity: Twist) -> Wrench:
        """B velocity, half of what a change of the velocity takes. Linear velocities take none."""
        return Wrench(traced(self.velocity_moment, velocity.angular), cross(velocity.angular, self.momentum))

    def coriolis_transpose(self, velocity: Twist) -> Triple:
        """B^T velocity, a torque."""
        columns = rows(list(zip(*self.velocity_moment, strict=True)))
        return plus(traced(columns, velocity.angular), cross(self.momentum, velocity.linear))


def moving_body(link: Link, axes: Axes, velocity: Twist, acceleration: Twist, tags: Sequence[str]) -> MovingInertia:
    """A body alone, about its origin.

    axes: the body's as columns.  acceleration: in space, against free fall.  tags: the energies that it comes of.
    """
    moment, (w, v) = combined(axes, link.moment), velocity
    inertia = Inertia(as_node(link.mass), moment, _rotated_second(link, axes))
    momentum = plus(scaled(inertia.mass, v), cross(w, moment))
    spun = zip(*[cross(w, column) for column in inertia.second], strict=True)  # [w] Sigma, as Sigma is symmetric
    spread = rows([plus(scaled(x, moment), (row[0], row[1], row[2])) for x, row in zip(v, spun, strict=True)])
    still = MovingInertia(inertia, momentum, spread, IDLE)
    with cg.tag(*tags):
        return still._replace(wrench=inertia.wrench(acceleration).plus(still.coriolis(velocity)))


def _rotated_second(link: Link, axes: Axes) -> Rows:
    """R Sigma R^T, with a multiple of 1 taken out, which does not turn."""
    inertia = [[as_node(each) for each in row] for row in link.full_inertia]
    diagonal = [0.5 * (inertia[j][j] + inertia[k][k] - inertia[i][i]) for i, (j, k) in enumerate(NEXT)]
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
    return symmetric(entries)
