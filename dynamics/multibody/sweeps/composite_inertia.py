"""Composite inertia: what a body and all that it carries have as one rigid body, on its way to the axes of its parent.

Of the second moments of mass, the sums of b b^T over its points b, a shift along an axis changes three entries, and a
turn about one takes half the products that two matrix products would, as c^2 + s^2 = 1: as in `hessian_solve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cgraph import Node
from cgraph.extend import Array, as_node

from ..algebra import spatial
from ..algebra.spatial import Matrix, Triple, cross, plus, scaled
from ..algebra.spatial_vectors import Twist, Wrench
from ..joints import AxialJoint, MovingJoint
from .composite_motion import Entries, combined
from .inertial_numbers import Link

NEXT = ((1, 2), (2, 0), (0, 1))
Axes = Entries
ONE = as_node(1.0)
Second = tuple[tuple[Node, ...], ...]  # rows, symmetric


class AxisTurn(NamedTuple):
    """A turn about an axis of the old axes and of the new ones: (a, b) after it becomes (c a - s b, s a + c b)."""

    axis: int
    cos: Node
    sin: Node

    def vector(self, old: Triple) -> Triple:
        """What a vector is in the new axes."""
        (i, j), new = NEXT[self.axis], list(old)
        new[i], new[j] = self.cos * old[i] - self.sin * old[j], self.sin * old[i] + self.cos * old[j]
        return new[0], new[1], new[2]

    def wrench(self, old: Wrench) -> Wrench:
        """What a wrench is in the new axes."""
        return Wrench(self.vector(old.torque), self.vector(old.force))

    def inertia(self, old: CompositeInertia) -> CompositeInertia:
        """With u = s (A_ii - A_jj) + 2 c A_ij the block is [[A_ii - s u, c u - A_ij], [.., A_jj + s u]]."""
        k, (i, j), (c, s) = self.axis, NEXT[self.axis], self[1:]
        new = [list(row) for row in old.second]
        if c.value == 0.0:
            new[i][i], new[j][j], new[i][j] = new[j][j], new[i][i], -new[i][j]
        else:
            u = s * (new[i][i] - new[j][j]) + 2.0 * c * new[i][j]
            new[i][i], new[j][j], new[i][j] = new[i][i] - s * u, new[j][j] + s * u, c * u - new[i][j]
        new[j][i] = new[i][j]
        a, b = new[k][i], new[k][j]
        new[k][i] = new[i][k] = c * a - s * b
        new[k][j] = new[j][k] = s * a + c * b
        about_z = old.about_z if k == 2 else new[0][0] + new[1][1]
        return old._replace(moment=self.vector(old.moment), second=_rows(new), about_z=about_z)

    def axes(self, new: Axes) -> Axes:
        """The old axes as columns, of the new ones."""
        (i, j), old = NEXT[self.axis], list(new)
        old[i] = plus(scaled(self.cos, new[i]), scaled(self.sin, new[j]))
        x, y, z = (self.cos * b - self.sin * a for a, b in zip(new[i], new[j], strict=True))
        old[j] = x, y, z
        return old[0], old[1], old[2]


class MatrixTurn(NamedTuple):
    """A turn about any axis.  rows: of the matrix that gives components in the new axes."""

    rows: Matrix

    def vector(self, old: Triple) -> Triple:
        """What a vector is in the new axes."""
        return spatial.rotate(self.rows, old)

    def wrench(self, old: Wrench) -> Wrench:
        """What a wrench is in the new axes."""
        return Wrench(self.vector(old.torque), self.vector(old.force))

    def inertia(self, old: CompositeInertia) -> CompositeInertia:
        """R A R^T."""
        half = [self.vector((row[0], row[1], row[2])) for row in old.second]  # columns of R A
        rows = [spatial.total([self.rows[i][k] * half[k][j] for k in range(3)]) for i in range(3) for j in range(i + 1)]
        new = [[rows[_place(i, j)] for j in range(3)] for i in range(3)]
        return old._replace(moment=self.vector(old.moment), second=_rows(new), about_z=new[0][0] + new[1][1])

    def axes(self, new: Axes) -> Axes:
        """The old axes as columns, of the new ones."""
        x, y, z = (combined(new, (as_node(a), as_node(b), as_node(c))) for a, b, c in zip(*self.rows, strict=True))
        return x, y, z


class Shift(NamedTuple):
    """To a point from which the old one is `by` along an axis."""

    axis: int
    by: Node

    def wrench(self, old: Wrench) -> Wrench:
        """About the new point."""
        (i, j), new = NEXT[self.axis], list(old.torque)
        new[i], new[j] = new[i] - self.by * old.force[j], new[j] + self.by * old.force[i]
        return Wrench((new[0], new[1], new[2]), old.force)

    def inertia(self, old: CompositeInertia) -> CompositeInertia:
        """About the new point."""
        k, r, moment, new = self.axis, self.by, list(old.moment), [list(row) for row in old.second]
        more = old.mass * r
        change = (2.0 * r) * moment[k] + more * r if r.value is not None else 2.0 * (r * moment[k]) + more * r
        for i in NEXT[k]:
            new[k][i] = new[i][k] = new[k][i] + r * moment[i]
        new[k][k] = new[k][k] + change
        moment[k] = moment[k] + more
        about_z = old.about_z if k == 2 else old.about_z + change
        return CompositeInertia(old.mass, (moment[0], moment[1], moment[2]), _rows(new), about_z)


Step = AxisTurn | MatrixTurn | Shift


class CompositeInertia(NamedTuple):
    """Mass, first moment, second moments; and the sum of the first two of these, the moment of inertia about z.

    It is kept beside them, as a turn about z leaves it as it is.
    """

    mass: Node
    moment: Triple
    second: Second
    about_z: Node

    def plus(self, other: CompositeInertia) -> CompositeInertia:
        """Of both, about the same point."""
        second = [[a + b for a, b in zip(*rows, strict=True)] for rows in zip(self.second, other.second, strict=True)]
        about_z = self.about_z + other.about_z
        return CompositeInertia(self.mass + other.mass, plus(self.moment, other.moment), _rows(second), about_z)

    def through(self, steps: Sequence[Step]) -> CompositeInertia:
        """In other axes, about another point."""
        for step in steps:
            self = step.inertia(self)  # noqa: PLW0642
        return self

    def wrench(self, rate: Twist) -> Wrench:
        """What gives it this acceleration from rest."""
        w, rows, turned = rate.angular, self.second, list[Node]()
        for i, (j, k) in enumerate(NEXT):
            along = self.about_z if i == 2 else rows[j][j] + rows[k][k]
            turned.append(along * w[i] - rows[i][j] * w[j] - rows[i][k] * w[k])
        torque = plus((turned[0], turned[1], turned[2]), cross(self.moment, rate.linear))
        return Wrench(torque, plus(scaled(self.mass, rate.linear), cross(w, self.moment)))


def rigid(link: Link) -> CompositeInertia:
    """Of a link alone, about its origin."""
    full = [[as_node(each) for each in row] for row in link.full_inertia]
    second = [[-full[i][j] for j in range(3)] for i in range(3)]
    diagonal = np.array([spatial.plain(full[i][i]) for i in range(3)])
    for i, (j, k) in enumerate(NEXT):
        both = spatial.added(diagonal[j : j + 1], diagonal[k : k + 1])
        second[i][i] = as_node(0.5 * spatial.added(both, -diagonal[i : i + 1])[0])
    return CompositeInertia(as_node(link.mass), link.moment, _rows(second), full[2][2])


def without_axial_moments(links: Sequence[Link], joints: Sequence[MovingJoint], parents: Sequence[int]) -> list[Link]:
    """The links, those that turn about z without the second moment along it, and those that slide without any.

    Their parents have it in their place. Base parameters leave none of the moment of inertia about y instead, which
    serves wrenches. Links stay as they are where there are parameters among their numbers.
    """
    inertias = [np.array(link.full_inertia) for link in links]
    if any([isinstance(each, Node) for link in links for each in link.numbers[:19]]):
        return list(links)
    for i in reversed(range(len(links))):
        joint, own = joints[i], inertias[i]
        if not isinstance(joint, AxialJoint):
            continue
        along = 0.5 * (own[0, 0] + own[1, 1] - own[2, 2]) * np.diag([1.0, 1.0, 0.0])
        given = along if joint.angle(ONE).value != 0.0 else own
        inertias[i] = spatial.added(own, -given)
        if parents[i] >= 0:
            turn = np.array(links[i].turn)
            inertias[parents[i]] = spatial.added(inertias[parents[i]], spatial.product(turn, given, turn.T))
    return [replace(link, inertia=inertia.tolist()) for link, inertia in zip(links, inertias, strict=True)]


def constant_turn(matrix: Matrix) -> list[Step]:
    """Turns about axes, to components in the old axes from those in the columns: R = R_z R_x R_z."""
    rows: Array = np.array(matrix, dtype=np.float64)
    across = float(np.hypot(rows[2, 0], rows[2, 1]))
    c, s = (rows[2, 1] / across, rows[2, 0] / across) if across else (1.0, 0.0)
    rest = c * rows[:, 0] - s * rows[:, 1]  # the columns of R_z R_x: so they fit where axes are nearly parallel, too
    turns = [(2, c, s), (0, rows[2, 2], across), (2, rest[0], rest[1])]
    return [AxisTurn(axis, as_node(float(c)), as_node(float(s))) for axis, c, s in turns if (c, s) != (1.0, 0.0)]


def _rows(rows: Sequence[Sequence[Node]]) -> Second:
    return tuple([tuple(row) for row in rows])


def _place(i: int, j: int) -> int:
    """Of an entry in the lower triangle, row by row."""
    i, j = max(i, j), min(i, j)
    return i * (i + 1) // 2 + j
