"""Articulated inertia: what a body takes to be moved, while all that it carries gives way at its joints."""

from __future__ import annotations

from typing import NamedTuple

from cgraph import Node

from .composite_motion import Composite, Entries
from .spatial import ZERO, Triple, cross, dot, plus, scaled
from .spatial_vectors import Twist, Wrench


class ArticulatedInertia(NamedTuple):
    """Of a twist (w, v) the wrench (J w + H v, H^T w + M v) about the same point.  J, M: symmetric.  Rows."""

    angular: Entries
    mixed: Entries
    linear: Entries

    def wrench(self, motion: Twist) -> Wrench:
        """That moves it so."""
        columns = _transposed(self.mixed)
        torque = plus(_times(self.angular, motion.angular), _times(self.mixed, motion.linear))
        return Wrench(torque, plus(_times(columns, motion.angular), _times(self.linear, motion.linear)))

    def plus(self, other: ArticulatedInertia) -> ArticulatedInertia:
        """Of both, about the same point."""
        return ArticulatedInertia(*[_added(a, b) for a, b in zip(self, other, strict=True)])

    def less(self, taking: Wrench, lever: Wrench) -> ArticulatedInertia:
        """That gives way along a freedom that takes this wrench, and the other of it for a unit of its inertia."""
        back = lever.scaled(-1.0)
        return ArticulatedInertia(
            _added(self.angular, _symmetric(taking.torque, back.torque)),
            _added(self.mixed, _outer(taking.torque, back.force)),
            _added(self.linear, _symmetric(taking.force, back.force)),
        )

    def about(self, r: Triple) -> ArticulatedInertia:
        """The same about another point, from which this one is `r` away."""
        moved = [cross(r, row) for row in self.linear]
        mixed = _added(self.mixed, _transposed((moved[0], moved[1], moved[2])))
        outer, inner = [cross(r, row) for row in self.mixed], [cross(r, row) for row in mixed]
        entries = [[self.angular[i][k] + outer[i][k] + inner[k][i] for k in range(i + 1)] for i in range(3)]
        return ArticulatedInertia(_mirrored(entries), mixed, self.linear)


def rigid(body: Composite) -> ArticulatedInertia:
    """Of a body that has no freedom."""
    (x, y, z), m = body.moment, body.mass
    units: list[Triple] = [(m, ZERO, ZERO), (ZERO, m, ZERO), (ZERO, ZERO, m)]
    second = body.second
    trace = second[0][0] + second[1][1] + second[2][2]
    entries = [[(trace if i == k else ZERO) - second[i][k] for k in range(i + 1)] for i in range(3)]
    return ArticulatedInertia(
        _mirrored(entries), ((ZERO, -z, y), (z, ZERO, -x), (-y, x, ZERO)), (units[0], units[1], units[2])
    )


def _times(rows: Entries, vector: Triple) -> Triple:
    return dot(rows[0], vector), dot(rows[1], vector), dot(rows[2], vector)


def _added(a: Entries, b: Entries) -> Entries:
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def _outer(a: Triple, b: Triple) -> Entries:
    return scaled(a[0], b), scaled(a[1], b), scaled(a[2], b)


def _symmetric(a: Triple, b: Triple) -> Entries:
    """a b^T of parallel a and b."""
    return _mirrored([[a[i] * b[k] for k in range(i + 1)] for i in range(3)])


def _mirrored(lower: list[list[Node]]) -> Entries:
    (a,), (b, c), (d, e, f) = lower
    return (a, b, d), (b, c, e), (d, e, f)


def _transposed(rows: Entries) -> Entries:
    a, b, c = zip(*rows, strict=True)
    return a, b, c
