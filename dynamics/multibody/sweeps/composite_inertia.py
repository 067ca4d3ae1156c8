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
from cgraph.extend import as_node

from ..algebra import spatial
from ..algebra.spatial import Triple, cross, plus, scaled
from ..algebra.spatial_vectors import Twist, Wrench
from ..algebra.turns import NEXT, Turn
from ..joints import JointType
from .links import Link

ONE = as_node(1.0)
Second = tuple[tuple[Node, ...], ...]  # rows, symmetric


class Shift(NamedTuple):
    """To a point from which the old one is `by` along an axis."""

    axis: int
    by: Node

    def wrench(self, old: Wrench) -> Wrench:
        """About the new point."""
        (i, j), new = NEXT[self.axis], list(old.torque)
        new[i], new[j] = new[i] - self.by * old.force[j], new[j] + self.by * old.force[i]
        return Wrench((new[0], new[1], new[2]), old.force)


Step = Turn | Shift


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
            self = self.about(step) if isinstance(step, Shift) else self.turned(step)  # noqa: PLW0642
        return self

    def turned(self, turn: Turn) -> CompositeInertia:
        """In the axes before a turn."""
        second = _rows(turn.second_moments(self.second))
        about_z = self.about_z if turn.about_z else second[0][0] + second[1][1]
        return self._replace(moment=turn.out(self.moment), second=second, about_z=about_z)

    def about(self, shift: Shift) -> CompositeInertia:
        """About the point that a shift leads to."""
        k, r, moment, new = shift.axis, shift.by, list(self.moment), [list(row) for row in self.second]
        more = self.mass * r
        change = (2.0 * r) * moment[k] + more * r if r.value is not None else 2.0 * (r * moment[k]) + more * r
        for i in NEXT[k]:
            new[k][i] = new[i][k] = new[k][i] + r * moment[i]
        new[k][k] = new[k][k] + change
        moment[k] = moment[k] + more
        about_z = self.about_z if k == 2 else self.about_z + change
        return CompositeInertia(self.mass, (moment[0], moment[1], moment[2]), _rows(new), about_z)

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


def without_axial_moments(links: Sequence[Link], joints: Sequence[JointType], parents: Sequence[int]) -> list[Link]:
    """The links, those that turn about z without the second moment along it, and those that slide without any.

    Their parents have it in their place. Base parameters leave none of the moment of inertia about y instead, which
    serves wrenches. Links stay as they are where there are parameters among their numbers.
    """
    inertias = [np.array(link.full_inertia) for link in links]
    if any([isinstance(each, Node) for link in links for each in link.numbers[:19]]):
        return list(links)
    for i in reversed(range(len(links))):
        joint, own = joints[i], inertias[i]
        if not joint.has_axis:
            continue
        along = 0.5 * (own[0, 0] + own[1, 1] - own[2, 2]) * np.diag([1.0, 1.0, 0.0])
        given = along if joint.turns else own
        inertias[i] = spatial.added(own, -given)
        if parents[i] >= 0:
            turn = np.array(links[i].turn)
            inertias[parents[i]] = spatial.added(inertias[parents[i]], spatial.product(turn, given, turn.T))
    return [replace(link, inertia=inertia.tolist()) for link, inertia in zip(links, inertias, strict=True)]


def _rows(rows: Sequence[Sequence[Node]]) -> Second:
    return tuple([tuple(row) for row in rows])
