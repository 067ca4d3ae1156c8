"""The torques of a tree of bodies with their derivatives, in closed form: column by column, from the tips down.

All bodies are in one set of axes. A joint moves its body in one stage, or in two where some of its velocities are in
axes that do not turn with the body. Of a stage with the columns S, on what moves with velocity v and acceleration a:

    psi' = v x S,  psi'' = a x S + v x psi',   v + S u,   a + psi' u + S udot

A small displacement along S turns and moves all that is carried, and changes in the axes that are carried along the
velocity by psi' and the acceleration by psi''; a change of u by S and by psi' + S', S' = psi' + (S u) x S. (S. Singh,
R. P. Russell, P. M. Wensing, "Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra",
IEEE Robotics and Automation Letters 7(2), 2022.)

With the composite I, B, f of all that a freedom j carries, all about the same point, and i between it and the world:

    dtau_i/dq_j = S_i . (I psi''_j + 2 B psi'_j + S_j x f),   dtau_j/dq_i = psi''_i . I S_j + psi'_i . 2 B^T S_j
    dtau_i/du_j = S_i . (I (psi'_j + S'_j) + 2 B S_j),        dtau_j/du_i = (psi'_i + S'_i) . I S_j + S_i . 2 B^T S_j
    M_ij = M_ji = S_i . I S_j

(Of one stage of a joint, the right column holds of both.) Bodies on different branches have nothing to do with one
another. All is taken about the origin of body i, whose own numbers then keep their digits however far it is from the
base: wrenches are carried down from j to i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, as_node, building, cotangents

from ...systems.body_terms import TorqueDerivatives
from ...systems.kinematics import ONE, gathered
from ..algebra.spatial import STILL, ZERO, Triple, combined, cross, dot, plus, scaled
from ..algebra.spatial_vectors import IDLE, REST, Inertia, Rows, Twist, Wrench, rows, symmetric, traced
from ..algebra.turns import NEXT, UNIT, Axes, MatrixTurn, Turn, in_a_row
from .links import Link, LinkState
from .outward import KINETIC, POTENTIAL

Tags = Sequence[str]


class Column(NamedTuple):
    """One freedom of a joint.  velocity: its place among all.  stage: of its joint."""

    velocity: int
    stage: int
    motion: Twist  # S
    carried: Twist  # psi'
    carried_rate: Twist  # psi''
    rate: Twist  # psi' + S'


class Frame(NamedTuple):
    """Placement and motion of a body, by its origin.

    offset: from the parent's origin.  before, turn: the axes are `before` turned so, in a tree in a
    plane by the sum of all angles.
    """

    offset: Triple
    axes: Axes  # columns
    velocity: Twist
    acceleration: Twist  # in space, against free fall
    columns: Sequence[Column]
    before: Axes
    turn: Turn


def frames_of(states: Sequence[LinkState], up: Triple, tags: Tags) -> list[Frame]:
    """Placements and motions of all links, parents first.

    up: the acceleration of the world against free fall.  tags: the energies that accelerations come of.
    """
    flat, frames = trees_in_a_plane(states), list[Frame]()
    for at, in_plane in zip(states, flat, strict=True):
        with cg.tag(at.name):
            if at.parent < 0:
                frames.append(_root_frame(up, at, tags, in_plane=in_plane))
            else:
                frames.append(_next_frame(frames[at.parent], at, tags, in_plane=in_plane))
    return frames


def trees_in_a_plane(states: Sequence[LinkState]) -> list[bool]:
    """Flags of the links, true where all axes of the tree are parallel."""
    roots: list[int] = []
    flat: dict[int, bool] = {}
    for i, at in enumerate(states):
        roots.append(roots[at.parent] if at.parent >= 0 else i)
        along = at.joint.has_axis and (at.parent < 0 or at.link.parallel)
        flat[roots[i]] = flat.get(roots[i], True) and along
    return [flat[root] for root in roots]


def _root_frame(up: Triple, at: LinkState, tags: Tags, *, in_plane: bool) -> Frame:
    """Frame of a body on the world.  in_plane: so move it and all that it carries.

    All that a tree needs is alike in any axes, so they are those that this body has just now, or, of a tree in a plane
    and of velocities along them, those of its joint.
    """
    turn, axes = at.turn, UNIT
    with cg.tag(*tags):
        up = at.into(up)
    if in_plane or at.joint.sliding:
        axes = turn.columns(UNIT)
    else:
        with cg.tag(*tags):
            up = turn.into(up)
    return moved_frame(at, tags, UNIT, Frame(STILL, axes, REST, Twist(STILL, up), (), UNIT, turn))


def _next_frame(parent: Frame, at: LinkState, tags: Tags, *, in_plane: bool) -> Frame:
    """Frame of a body that another carries."""
    before, turn = MatrixTurn(at.link.turn).columns(parent.axes), at.turn
    offset = plus(combined(parent.axes, at.link.place), combined(before, at.shift))
    if in_plane:
        before = MatrixTurn(at.link.turn).columns(parent.before)
        turn = in_a_row(parent.turn, turn, at.link.turn[2][2])
    with cg.tag(KINETIC):
        velocity = parent.velocity.at(offset)
    with cg.tag(*tags):
        acceleration = parent.acceleration.at(offset)
    return moved_frame(at, tags, before, Frame(offset, turn.columns(before), velocity, acceleration, (), before, turn))


def moved_frame(at: LinkState, tags: Tags, before: Axes, frame: Frame) -> Frame:
    """The frame with the motion of the joint, as long as it has that of the body that carries it.

    before: the axes of the joint.
    """
    sliding = at.joint.sliding
    if sliding:
        frame = _stage(frame, 0, [Twist(STILL, axis) for axis in before[:sliding]], at, tags)
    turned = [Twist(combined(frame.axes, w), combined(frame.axes, v)) for w, v in at.columns[sliding:]]
    return _stage(frame, sliding, turned, at, tags)


def _stage(frame: Frame, first: int, motions: Sequence[Twist], at: LinkState, tags: Tags) -> Frame:
    """The frame with the motion of the joint's freedoms from `first` on."""
    velocity, acceleration = frame.velocity, frame.acceleration
    along, columns = REST, []
    with cg.tag(KINETIC):
        carried = [velocity.cross(motion) for motion in motions]  # psi'
        for k, motion in enumerate(motions, first):
            along = along.plus(motion.scaled(at.u[k]))  # S u
        rates = [slow.scaled(2.0) for slow in carried]
        if len(motions) > 1:
            rates = [rate.plus(along.cross(motion)) for rate, motion in zip(rates, motions, strict=True)]  # psi' + S'
    with cg.tag(*tags):
        for k, (motion, slow, rate) in enumerate(zip(motions, carried, rates, strict=True), first):
            twice = frame.acceleration.cross(motion).plus(velocity.cross(slow))  # psi''
            columns.append(Column(at.first + k, first, motion, slow, twice, rate))
            acceleration = acceleration.plus(slow.scaled(at.u[k]).plus(motion.scaled(at.u_dot[k])))
    velocity = velocity.plus(along)
    return frame._replace(velocity=velocity, acceleration=acceleration, columns=[*frame.columns, *columns])


class MovingInertia(NamedTuple):
    """Sums over the mass of a body and all that it carries, about a point, in axes that stand still.

    For points b of mass dm, whose velocities are b' = v + w x b, the sums over dm of 1, b, b b^T, b' and b' b^T say
    what any change of velocity or acceleration takes. Of the last, C = v h^T + [w] Sigma, come all Coriolis forces of a
    body: b x 2 (x x b') adds up to 2 (tr(C) x - C x) for an angular velocity x.

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


class Reaction(NamedTuple):
    """Wrenches that a freedom takes of all that it carries, about a point, and 2 B^T S, a torque alone.

    tags: the energies that the first comes of.
    """

    displaced: Wrench  # I psi'' + 2 B psi' + S x f
    moved: Wrench  # I (psi' + S') + 2 B S
    accelerated: Wrench  # I S
    couple: Triple
    tags: Tags

    def about(self, offset: Triple) -> Reaction:
        """Reaction about a point from which this one is `offset` away."""
        with cg.tag(KINETIC):
            moved, accelerated = self.moved.about(offset), self.accelerated.about(offset)
        with cg.tag(*self.tags):
            return Reaction(self.displaced.about(offset), moved, accelerated, self.couple, self.tags)


def torque_derivatives(states: Sequence[LinkState], up: Triple, build: Builder) -> TorqueDerivatives:
    """Torques of links, parents first, and their derivatives, with springs, without dampers and forces.

    up: the acceleration of the world against free fall.
    """
    n = sum([len(at.u) for at in states])
    result = TorqueDerivatives([ZERO] * n, *[[[ZERO] * n for _ in range(n)] for _ in range(3)])
    tags = (KINETIC, POTENTIAL) if any([x.value != 0.0 for x in up]) else (KINETIC,)  # of accelerations
    with building(build):
        frames = frames_of(states, up, tags)
        composites: list[MovingInertia | None] = [None] * len(states)
        for i, flat in reversed(list(enumerate(trees_in_a_plane(states)))):
            at, frame, carried = states[i], frames[i], composites[i]
            about_z = at.link.inertia[2][2]  # the only moment that counts where all joints turn about z
            link = replace(at.link, inertia=[[0.0], [0.0, 0.0], [0.0, 0.0, about_z]]) if flat else at.link
            with cg.tag(at.name):
                alone = moving_body(link, frame.axes, frame.velocity, frame.acceleration, tags)
            composite = alone if carried is None else alone.plus(carried)
            with cg.tag(at.name):
                reactions = [(column, reaction_of(column, composite, tags)) for column in frame.columns]
                for column, _ in reactions:
                    with cg.tag(*tags):
                        result.torques[column.velocity] = column.motion.power(composite.wrench)
                _fill(result, frames, states, i, reactions)
            if at.parent >= 0:
                moved, carried = composite.about(frame.offset), composites[at.parent]
                composites[at.parent] = moved if carried is None else moved.plus(carried)
        for at in states:
            with cg.tag(at.name, KINETIC):
                for k, rate in enumerate(at.u_dot, at.first):
                    result.torques[k] = result.torques[k] + at.link.armature * rate
                    result.mass[k][k] = result.mass[k][k] + at.link.armature
            with cg.tag(at.name, POTENTIAL):
                add_spring(result, at, build)
    return result


def add_spring(result: TorqueDerivatives, at: LinkState, build: Builder) -> None:
    """The forces of a spring, and their slopes by displacements, G^T d/dq."""
    rate, end = at.joint.rate(at.q, at.u), at.first + len(at.u)
    for i, (_, force) in enumerate(at.springs(), at.first):
        result.torques[i] = result.torques[i] + force
        seeds = gathered(zip(rate, cotangents({force: ONE}, at.q, build), strict=True))
        for j, slope in zip(range(at.first, end), cotangents(seeds, at.u, build), strict=True):
            result.by_q[i][j] = result.by_q[i][j] + slope


def _fill(
    result: TorqueDerivatives,
    frames: Sequence[Frame],
    states: Sequence[LinkState],
    at: int,
    reactions: Sequence[tuple[Column, Reaction]],
) -> None:
    """All entries of the freedoms of a body with their own and those between it and the world."""
    for inner, reaction in reactions:
        for outer in frames[at].columns:
            enter(result, outer, inner, reaction)
    while states[at].parent >= 0:
        reactions = [(column, reaction.about(frames[at].offset)) for column, reaction in reactions]
        at = states[at].parent
        for inner, reaction in reactions:
            for outer in frames[at].columns:
                enter_both(result, outer, inner, reaction)


def reaction_of(column: Column, of: MovingInertia, tags: Tags) -> Reaction:
    """Reaction of a freedom at the base of the composite.  tags: the energies that accelerations come of."""
    motion = column.motion
    with cg.tag(KINETIC):
        double = motion.scaled(2.0)
        moved = of.inertia.wrench(column.rate).plus(of.coriolis(double))  # I (psi' + S') + 2 B S
        accelerated, couple = of.inertia.wrench(motion), of.coriolis_transpose(double)
    with cg.tag(*tags):
        displaced = of.inertia.wrench(column.carried_rate).plus(of.coriolis(column.carried.scaled(2.0)))
        displaced = displaced.plus(of.wrench.carried(motion))  # I psi'' + 2 B psi' + S x f
    return Reaction(displaced, moved, accelerated, couple, tags)


def enter_both(result: TorqueDerivatives, outer: Column, inner: Column, reaction: Reaction) -> None:
    """outer: between the world and inner, whose reaction is about the origin of the outer's body."""
    i, j = outer.velocity, inner.velocity
    with cg.tag(*reaction.tags):
        result.by_q[i][j] = outer.motion.power(reaction.displaced)  # dtau_i/dq_j = S_i . (I psi''_j + ..)
        result.by_q[j][i] = displaced_by(outer, reaction)
    with cg.tag(KINETIC):
        result.by_qd[i][j] = outer.motion.power(reaction.moved)  # dtau_i/du_j = S_i . (I (psi'_j + S'_j) + 2 B S_j)
        # dtau_j/du_i = (psi'_i + S'_i) . I S_j + S_i . 2 B^T S_j
        result.by_qd[j][i] = outer.rate.power(reaction.accelerated) + dot(outer.motion.angular, reaction.couple)
        result.mass[i][j] = result.mass[j][i] = outer.motion.power(reaction.accelerated)


def enter(result: TorqueDerivatives, outer: Column, inner: Column, reaction: Reaction) -> None:
    """Freedoms of one joint."""
    i, j = outer.velocity, inner.velocity
    if outer.stage < inner.stage:
        enter_both(result, outer, inner, reaction)
    elif outer.stage == inner.stage:
        with cg.tag(*reaction.tags):
            result.by_q[j][i] = displaced_by(outer, reaction)
        with cg.tag(KINETIC):
            result.by_qd[i][j] = outer.motion.power(reaction.moved)
            if i <= j:
                result.mass[i][j] = result.mass[j][i] = outer.motion.power(reaction.accelerated)


def displaced_by(outer: Column, reaction: Reaction) -> Node:
    """Change of the force at the inner freedom by a displacement of the outer one."""
    # dtau_j/dq_i = psi''_i . I S_j + psi'_i . 2 B^T S_j
    return outer.carried_rate.power(reaction.accelerated) + dot(outer.carried.angular, reaction.couple)
