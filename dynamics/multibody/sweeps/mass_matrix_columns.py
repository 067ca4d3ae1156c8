"""The mass matrix of a tree of bodies, column by column, by composite inertias in the bodies' axes.

With the composite I of all that a freedom j carries, M_ij = S_i . I S_j for i between it and the world: the wrench
I S_j is carried to the axes of one body after another. A hinge's own turn leaves S and its share of a wrench as they
are. (M. W. Walker, D. E. Orin, "Efficient dynamic computer simulation of robotic mechanisms", J. Dyn. Sys. Meas.
Control 104(3), 1982.) Along many joints it takes less to have the columns S and I S_j in the axes of the first body, so
that each entry is one product of six numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import topological

from ..algebra.spatial import STILL, ZERO, Triple, combined, cross, plus, scaled
from ..algebra.spatial_vectors import Twist, Wrench
from ..algebra.turns import UNIT, Axes, AxisTurn, constant_turns
from ..joints import JointType
from .composite_inertia import CompositeInertia, Shift, Step, rigid
from .links import Link
from .outward import KINETIC

FEW = 6  # freedoms in a row; up to so many, columns in the axes of the first body are not tried


class Carried(NamedTuple):
    """A body on its parent.  names: of the body, for tags.  first: the place of its first velocity among all."""

    name: str
    parent: int
    link: Link
    joint: JointType
    q: Sequence[Node]
    first: int
    plane: AxisTurn | None  # see `Motion`
    before: AxisTurn | None  # of its parent

    @property
    def twists(self) -> list[Twist]:
        """The columns S of its velocities, in the axes of its motion."""
        return self.joint.columns(self.q)

    def own(self) -> CompositeInertia:
        """Its inertia in the axes of its motion."""
        alone = rigid(self.link)
        return alone.turned(self.plane) if self.plane else alone

    def turn(self) -> list[Step]:
        """From its axes to those of its joint; none where S is the same in both."""
        turn = self.joint.turn(self.q)
        return [] if self.plane or turn.still else [turn]

    def outwards(self) -> list[Step]:
        """From the axes of its joint, about its origin, to those of its parent's motion, about the parent's origin."""
        plane, link = self.before, self.link
        steps = [*_shifts(self.joint.translation(self.q)), *constant_turns(link.turn)]
        if plane and self.plane:
            return [*steps, *_shifts(plane.out(link.place))]
        steps += _shifts(link.place)
        return [*steps, plane] if plane else steps


def mass_matrix_columns(bodies: Sequence[Carried], n: int) -> list[list[Node]]:
    """The lower triangle of M, (n, n), rows.  bodies: parents first, with armatures."""
    lower = [[ZERO] * (i + 1) for i in range(n)]
    ways = [bodies, [body._replace(plane=None, before=None) for body in bodies]]
    filled = []
    for way in (
        ways if any([body.plane for body in bodies]) else ways[:1]
    ):  # a short chain in a plane takes less with its bodies' axes than with the plane's
        columns = _columns(way, lower)
        filled.append(_by_bodies(way, columns, [list(row) for row in lower]))
        if _longest(bodies) > FEW:
            filled.append(_by_first_bodies(way, columns, [list(row) for row in lower]))
    return min(filled, key=size_of)


def size_of(rows: Sequence[Sequence[Node]]) -> int:
    """How many nodes a matrix takes."""
    return len(topological([entry for row in rows for entry in row]))


def _columns(bodies: Sequence[Carried], lower: list[list[Node]]) -> list[list[Wrench]]:
    """I S of all freedoms, in the axes of their joints; their own entries go into the matrix."""
    carried: list[CompositeInertia | None] = [None] * len(bodies)
    columns: list[list[Wrench]] = [[] for _ in bodies]
    for i in reversed(range(len(bodies))):
        body = bodies[i]
        with cg.tag(body.name, KINETIC):
            whole, others = body.own(), carried[i]
            whole = whole if others is None else whole.plus(others)
            turned = whole.through(body.turn())
            if body.joint.has_axis:
                wrenches = columns[i] = [turned.wrench(body.twists[0])]
            else:
                wrenches = [whole.wrench(twist) for twist in body.twists]
                columns[i] = [_through(body.turn(), wrench) for wrench in wrenches]
            for k, wrench in enumerate(wrenches):
                row = lower[body.first + k]
                for j, twist in enumerate(body.twists[: k + 1], body.first):
                    row[j] = twist.power(wrench)
                row[body.first + k] = row[body.first + k] + body.link.armature
            if body.parent >= 0:
                moved, others = turned.through(body.outwards()), carried[body.parent]
                carried[body.parent] = moved if others is None else others.plus(moved)
    return columns


def _by_bodies(
    bodies: Sequence[Carried], columns: Sequence[Sequence[Wrench]], lower: list[list[Node]]
) -> list[list[Node]]:
    """The other entries, each in the axes of the body between."""
    for i, wrenches in enumerate(columns):
        at, turn = bodies[i], list[Step]()
        while at.parent >= 0:
            with cg.tag(at.name, KINETIC):
                wrenches = [_through([*turn, *at.outwards()], wrench) for wrench in wrenches]
            at = bodies[at.parent]
            turn = at.turn()
            with cg.tag(at.name, KINETIC):
                for k, wrench in enumerate(wrenches, bodies[i].first):
                    for j, twist in enumerate(at.twists, at.first):
                        lower[k][j] = twist.power(wrench)
    return lower


def _by_first_bodies(
    bodies: Sequence[Carried], columns: Sequence[Sequence[Wrench]], lower: list[list[Node]]
) -> list[list[Node]]:
    """The other entries, in the axes of the body on the world, about its origin."""
    frames: list[Frame] = []
    twists: list[list[Twist]] = []
    for body, wrenches in zip(bodies, columns, strict=True):
        with cg.tag(body.name, KINETIC):
            joint = frames[body.parent].of(body.outwards()) if body.parent >= 0 else None
            frames.append(joint.of(body.turn()) if joint else FIRST)
            twists.append([frames[-1].twist(twist) for twist in body.twists])
            at = body.parent
            for k, wrench in enumerate(wrenches if joint else (), body.first):
                seen, at = joint.wrench(wrench), body.parent  # type: ignore[union-attr]
                while at >= 0:
                    for j, twist in enumerate(twists[at], bodies[at].first):
                        lower[k][j] = twist.power(seen)
                    at = bodies[at].parent
    return lower


class Frame(NamedTuple):
    """Axes as columns, and an origin, in those of the body on the world."""

    axes: Axes
    origin: Triple

    def of(self, steps: Sequence[Step]) -> Frame:
        """The frame from which these steps lead to this one."""
        axes, origin = self
        for step in reversed(steps):
            if isinstance(step, Shift):
                origin = plus(origin, scaled(step.by, axes[step.axis]))
            else:
                axes = step.columns(axes)
        return Frame(axes, origin)

    def twist(self, own: Twist) -> Twist:
        """One in these axes, about the origin of the body on the world."""
        angular = combined(self.axes, own.angular)
        return Twist(angular, plus(combined(self.axes, own.linear), cross(self.origin, angular)))

    def wrench(self, own: Wrench) -> Wrench:
        """Likewise."""
        return Wrench(combined(self.axes, own.torque), combined(self.axes, own.force)).about(self.origin)


FIRST = Frame(UNIT, STILL)


def _longest(bodies: Sequence[Carried]) -> int:
    """The most freedoms from the world to a tip."""
    counts: list[int] = []
    for body in bodies:
        counts.append(len(body.joint.velocities) + (counts[body.parent] if body.parent >= 0 else 0))
    return max(counts)


def _through(steps: Sequence[Step], wrench: Wrench) -> Wrench:
    for step in steps:
        wrench = step.wrench(wrench) if isinstance(step, Shift) else wrench.turned(step)
    return wrench


def _shifts(moved: Triple) -> list[Step]:
    return [Shift(k, by) for k, by in enumerate(moved) if by.value != 0.0]
