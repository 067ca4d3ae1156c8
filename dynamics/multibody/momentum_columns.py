"""How velocities and rates of momenta of a tree of bodies change with coordinates and momenta: column by column.

With the columns S, psi' = v x S of `motion_columns`, the momentum h of all that a body carries, and its articulated
inertia I, U = I S, d = S . U, I^a = I - U U^T / d (R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, 7.3):

a small displacement along the freedom j, at fixed momenta, gives what it carries the velocity psi'_j more and takes

    Z = G_j,   G_j = S_j x h_j + I^a_j psi'_j,   and on the way to the world   y = -S . Z,   Z + U y / d

and a change of the momentum j has y = 1 there. On the way back from the world all velocities change by

    du = (y - U . V) / d,   V + S du,   V = 0 at the world, and psi'_j more from the freedom j on

and the rate of the momentum i, between the world and j, by G_i . V + psi'_i . Z: dL/dq of the kinetic energy is
psi' . h. A freedom that j does not move and that does not move j has Z = 0. All is about the origin of a body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building

from ..systems.momentum_derivatives import MomentumDerivatives
from .articulated_inertia import ArticulatedInertia, rigid
from .body import Body
from .composite_motion import body_motion
from .inertial_numbers import Link
from .inverse_dynamics_columns import add_spring_slopes, tree_frames
from .joint_coordinates import places
from .joints import moving_type
from .motion_columns import ONE, Column, Frame
from .spatial import STILL, ZERO, Triple, cross, dot, plus, scaled
from .spatial_vectors import REST, Twist, Wrench


class Freedom(NamedTuple):
    """A freedom with what it takes.  lever: U / d.  share: 1 / d.  turned: G.  weighed: the couple of its weight."""

    column: Column
    lever: Wrench
    share: Node
    turned: Wrench
    weighed: Triple

    @property
    def velocity(self) -> int:
        """Its place among all velocities."""
        return self.column.velocity


Stage = Sequence[Freedom]


class Carried(NamedTuple):
    """Of a body and all that it carries.  momentum: about its origin."""

    inertia: ArticulatedInertia
    mass: Node
    moment: Triple
    momentum: Wrench

    def plus(self, other: Carried) -> Carried:
        """Of both."""
        return Carried(
            self.inertia.plus(other.inertia),
            self.mass + other.mass,
            plus(self.moment, other.moment),
            self.momentum.plus(other.momentum),
        )

    def about(self, offset: Triple) -> Carried:
        """About another point, from which this one is `offset` away."""
        moment = plus(self.moment, scaled(self.mass, offset))
        return Carried(self.inertia.about(offset), self.mass, moment, self.momentum.about(offset))


class Seen(NamedTuple):
    """A motion by a point that another is `offset` away from, where wrenches are. At a tip it need not be moved."""

    motion: Twist
    offset: Triple

    @property
    def here(self) -> Twist:
        """By the other point."""
        return self.motion.at(self.offset)

    def power(self, wrench: Wrench) -> Node:
        """What a wrench about the other point does along it."""
        return self.motion.power(wrench.about(self.offset))


class Tree(NamedTuple):
    """Bodies, parents first, with the freedoms of their joints by stages."""

    names: Sequence[str]
    parents: Sequence[int]
    frames: Sequence[Frame]
    stages: Sequence[Sequence[Stage]]

    def to_world(self, i: int, s: int, wrench: Wrench, pulls: dict[int, Node]) -> dict[tuple[int, int], Wrench]:
        """Z on the way from what stage s of body i carries, after each (body, stage); y / d goes into the pulls."""
        after: dict[tuple[int, int], Wrench] = {}
        while True:
            for k in reversed(range(s)):
                with cg.tag(self.names[i]):
                    after[i, k] = wrench = _given_way(self.stages[i][k], wrench, pulls)
            if self.parents[i] < 0:
                return after
            wrench, i = wrench.about(self.frames[i].offset), self.parents[i]
            s = len(self.stages[i])

    def from_world(
        self, pulls: Mapping[int, Node], place: tuple[int, int] | None = None, more: Twist = REST
    ) -> Iterator[tuple[tuple[int, int], Stage, Seen, list[Node]]]:
        """Stages with their places, V in front of them, and du of their freedoms; more: at this place."""
        motions: list[Twist] = []
        for i, frame in enumerate(self.frames):
            before = Seen(motions[self.parents[i]], frame.offset) if self.parents[i] >= 0 else Seen(REST, STILL)
            for k, stage in enumerate(self.stages[i]):
                with cg.tag(self.names[i]):
                    before = Seen(before.here.plus(more), STILL) if (i, k) == place else before
                    motion, changes = before, []
                    for freedom in stage:
                        change = pulls.get(freedom.velocity, ZERO) - motion.power(freedom.lever)
                        motion = Seen(motion.here.plus(freedom.column.motion.scaled(change)), STILL)
                        changes.append(change)
                yield (i, k), stage, before, changes
                before = motion
            motions.append(before.here)


def momentum_derivatives(
    bodies: Sequence[Body],
    links: Sequence[Link],
    parents: Sequence[int],
    up: Triple,
    state: tuple[Sequence[Node], Sequence[Node]],
    p: Sequence[Node],
    build: Builder,
) -> MomentumDerivatives:
    """Of bodies, parents first, with springs, without dampers and forces, at (q, u), and the velocities of momenta p.

    up: the acceleration of the world against free fall.
    """
    n, still = len(state[1]), [ZERO] * len(state[1])
    result = MomentumDerivatives(_zeros(n), _zeros(n), _zeros(n), [])
    with building(build):
        links, frames = tree_frames(bodies, links, parents, (up, ()), (*state, still))
        at_rest = tree_frames(bodies, links, parents, (up, ()), (state[0], still, still))[1]
        tree = Tree(
            [body.name for body in bodies],
            parents,
            frames,
            _stages(bodies, links, parents, frames, [each.acceleration.linear for each in at_rest]),
        )
        for i, stages in enumerate(tree.stages):
            for s, stage in enumerate(stages):
                for freedom in stage:
                    _displace(result, tree, (i, s), freedom)
                    _push(result, tree, (i, s), freedom)
        result.velocities[:] = _velocities(tree, p)
        springs = _zeros(n)
        for body, link, place in zip(bodies, links, places(bodies), strict=True):
            add_spring_slopes(springs, link, moving_type(body.joint.type), place, state, build)
        for row, stiff in zip(result.second, springs, strict=True):
            row[:] = [entry - slope for entry, slope in zip(row, stiff, strict=True)]
    return result


def _zeros(n: int) -> list[list[Node]]:
    return [[ZERO] * n for _ in range(n)]


def _stages(
    bodies: Sequence[Body], links: Sequence[Link], parents: Sequence[int], frames: Sequence[Frame], up: Sequence[Triple]
) -> list[list[Stage]]:
    """The freedoms of all bodies, from the tips to the base.  up: in the axes of each frame."""
    carried: list[Carried | None] = [None] * len(frames)
    result: list[list[Stage]] = [[] for _ in frames]
    for i in reversed(range(len(frames))):
        with cg.tag(bodies[i].name):
            alone = body_motion(links[i], frames[i].axes, frames[i].velocity, REST)
            whole = Carried(rigid(alone), alone.mass, alone.moment, alone.inertial(frames[i].velocity))
            if (others := carried[i]) is not None:
                whole = whole.plus(others)
            for first in sorted({column.stage for column in frames[i].columns}, reverse=True):
                columns = [column for column in frames[i].columns if column.stage == first]
                stage, left = _stage(columns, whole, links[i].armature, up[i])
                result[i].insert(0, stage)
                whole = whole._replace(inertia=left)
        if (parent := parents[i]) >= 0:
            moved, others = whole.about(frames[i].offset), carried[parent]
            carried[parent] = moved if others is None else moved.plus(others)
    return result


def _stage(
    columns: Sequence[Column], whole: Carried, armature: float | Node, up: Triple
) -> tuple[Stage, ArticulatedInertia]:
    """The freedoms of a stage, and what is left of the inertia of all that they carry."""
    inertia, taken = whole.inertia, dict[int, tuple[Wrench, Node]]()
    for column in reversed(columns):
        taking = inertia.wrench(column.motion)
        share = ONE / (column.motion.power(taking) + armature)
        lever = taking.scaled(share)
        inertia = inertia.less(taking, lever)
        taken[column.velocity] = lever, share
    stage = []
    for column in columns:
        turned = whole.momentum.carried(column.motion).plus(inertia.wrench(column.carried))
        force = plus(scaled(whole.mass, column.motion.linear), cross(column.motion.angular, whole.moment))
        stage.append(Freedom(column, *taken[column.velocity], turned, cross(up, force)))
    return stage, inertia


def _given_way(stage: Stage, wrench: Wrench, pulls: dict[int, Node], p: Sequence[Node] = ()) -> Wrench:
    """Z after the freedoms of a stage, whose momenta change by p."""
    for freedom in reversed(stage):
        pull = -freedom.column.motion.power(wrench)
        pull = p[freedom.velocity] + pull if p else pull
        pulls[freedom.velocity] = pull * freedom.share
        wrench = wrench.plus(freedom.lever.scaled(pull))
    return wrench


def _displace(result: MomentumDerivatives, tree: Tree, place: tuple[int, int], freedom: Freedom) -> None:
    """Enter the column of a displacement along a freedom."""
    j, motion, pulls = freedom.velocity, freedom.column.motion, dict[int, Node]()
    after = tree.to_world(*place, freedom.turned, pulls)
    for at, stage, before, changes in tree.from_world(pulls, place, freedom.column.carried):
        for other, change in zip(stage, changes, strict=True):
            i = other.velocity
            result.by_q[i][j] = change
            if at == place:
                result.second[i][j] = before.power(other.turned) + dot(motion.angular, other.weighed)
            elif i < j:
                entry = before.power(other.turned)
                if at in after:
                    entry = entry + other.column.carried.power(after[at])
                    entry = entry + dot(other.column.motion.angular, freedom.weighed)
                result.second[i][j] = result.second[j][i] = entry


def _push(result: MomentumDerivatives, tree: Tree, place: tuple[int, int], freedom: Freedom) -> None:
    """Enter the column of a change of a freedom's momentum."""
    j, (i, s) = freedom.velocity, place
    pulls = {j: freedom.share}
    outer = tree.stages[i][s][: freedom.velocity - tree.stages[i][s][0].velocity]
    tree.to_world(i, s, _given_way(outer, freedom.lever, pulls), pulls)
    for _, others, _, changes in tree.from_world(pulls):
        for other, change in zip(others, changes, strict=True):
            if other.velocity <= j:
                result.inverse[other.velocity][j] = result.inverse[j][other.velocity] = change


def _velocities(tree: Tree, p: Sequence[Node]) -> list[Node]:
    """u of momenta p: all pushed at once."""
    wrenches, pulls = [Wrench(STILL, STILL)] * len(tree.frames), dict[int, Node]()
    for i in reversed(range(len(tree.frames))):
        wrench = wrenches[i]
        for stage in reversed(tree.stages[i]):
            wrench = _given_way(stage, wrench, pulls, p)
        if (parent := tree.parents[i]) >= 0:
            wrenches[parent] = wrenches[parent].plus(wrench.about(tree.frames[i].offset))
    return [change for *_, changes in tree.from_world(pulls) for change in changes]
