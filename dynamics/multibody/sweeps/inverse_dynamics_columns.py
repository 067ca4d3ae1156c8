"""The torques of a tree of bodies with their derivatives, in closed form: column by column, from the tips down.

With the composite I, B, f of all that a freedom j carries, all about the same point, and i between it and the world:

    dtau_i/dq_j = S_i . (I psi''_j + 2 B psi'_j + S_j x f),   dtau_j/dq_i = psi''_i . I S_j + psi'_i . 2 B^T S_j
    dtau_i/du_j = S_i . (I (psi'_j + S'_j) + 2 B S_j),        dtau_j/du_i = (psi'_i + S'_i) . I S_j + S_i . 2 B^T S_j
    M_ij = M_ji = S_i . I S_j

(See `motion_columns`; of one stage of a joint, the right column holds of both.) Bodies on different branches have
nothing to do with one another. All is taken about the origin of body i, whose own numbers then keep their digits
however far it is from the base: wrenches are carried down from j to i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, cotangents

from ...systems.body_terms import MotionState, TorqueDerivatives
from ..algebra.spatial import ZERO, Triple, dot
from ..algebra.spatial_vectors import Wrench
from ..body import Body
from ..joint_coordinates import Places, places
from ..joints import AxialJoint, MovingJoint, moving_type
from .body_motion import spring_forces
from .composite_motion import Composite, body_motion
from .inertial_numbers import Link
from .motion_columns import Column, Frame, Freedoms, Tags, next_frame, root_frame
from .newton_euler import KINETIC, POTENTIAL


class Reaction(NamedTuple):
    """What a freedom of all that it carries takes: wrenches about a point, and 2 B^T S, a torque alone.

    tags: the energies that the first comes of.
    """

    displaced: Wrench  # I psi'' + 2 B psi' + S x f
    moved: Wrench  # I (psi' + S') + 2 B S
    accelerated: Wrench  # I S
    couple: Triple
    tags: Tags

    def about(self, offset: Triple) -> Reaction:
        """About another point, from which this one is `offset` away."""
        with cg.tag(KINETIC):
            moved, accelerated = self.moved.about(offset), self.accelerated.about(offset)
        with cg.tag(*self.tags):
            return Reaction(self.displaced.about(offset), moved, accelerated, self.couple, self.tags)


def torque_derivatives(
    bodies: Sequence[Body],
    links: Sequence[Link],
    parents: Sequence[int],
    up: Triple,
    state: MotionState,
    build: Builder,
) -> TorqueDerivatives:
    """Of bodies, parents first, with springs, without dampers and forces.

    up: the acceleration of the world against free fall.
    """
    n = len(state[1])
    result = TorqueDerivatives([ZERO] * n, *[[[ZERO] * n for _ in range(n)] for _ in range(3)])
    tags = (KINETIC, POTENTIAL) if any([x.value != 0.0 for x in up]) else (KINETIC,)  # of accelerations
    with building(build):
        links, frames = tree_frames(bodies, links, parents, (up, tags), state)
        composites: list[Composite | None] = [None] * len(bodies)
        for i in reversed(range(len(bodies))):
            with cg.tag(bodies[i].name):
                alone = body_motion(links[i], frames[i].axes, frames[i].velocity, frames[i].acceleration, tags)
            carried = composites[i]
            composite = alone if carried is None else alone.plus(carried)
            with cg.tag(bodies[i].name):
                reactions = [(column, _reaction(column, composite, tags)) for column in frames[i].columns]
                for column, _ in reactions:
                    with cg.tag(*tags):
                        result.torques[column.velocity] = column.motion.power(composite.wrench)
                _fill(result, frames, parents, i, reactions)
            if (parent := parents[i]) >= 0:
                moved = composite.about(frames[i].offset)
                carried = composites[parent]
                composites[parent] = moved if carried is None else moved.plus(carried)
        for body, link, place in zip(bodies, links, places(bodies), strict=True):
            with cg.tag(body.name, KINETIC):
                for k in range(place.u.start, place.u.stop):
                    result.torques[k] = result.torques[k] + link.armature * state[2][k]
                    result.mass[k][k] = result.mass[k][k] + link.armature
            with cg.tag(body.name, POTENTIAL):
                _add_spring(result, link, moving_type(body.joint.type), place, state, build)
    return result


def _add_spring(
    result: TorqueDerivatives, link: Link, joint: MovingJoint, place: Places, state: MotionState, build: Builder
) -> None:
    q, u = state[0][place.q], state[1][place.u]
    for i, (_, force) in zip(range(place.u.start, place.u.stop), spring_forces(link, joint, q, u), strict=False):
        result.torques[i] = result.torques[i] + force
    add_spring_slopes(result.by_q, link, joint, place, state[:2], build)


def add_spring_slopes(
    to: list[list[Node]],
    link: Link,
    joint: MovingJoint,
    place: Places,
    state: tuple[Sequence[Node], Sequence[Node]],
    build: Builder,
) -> None:
    """The slopes of a spring's forces by displacements: of its energy G^T d/dq."""
    q, u = state[0][place.q], state[1][place.u]
    rate = joint.rate(q, u)
    for i, (_, force) in zip(range(place.u.start, place.u.stop), spring_forces(link, joint, q, u), strict=False):
        slopes = cotangents({force: cg.constant(1.0)}, q, build)
        seeds: dict[Node, Node] = {}
        for node, slope in zip(rate, slopes, strict=True):
            seeds[node] = seeds.get(node, ZERO) + slope
        for j, slope in zip(range(place.u.start, place.u.stop), cotangents(seeds, u, build), strict=True):
            to[i][j] = to[i][j] + slope


def tree_frames(
    bodies: Sequence[Body],
    links: Sequence[Link],
    parents: Sequence[int],
    gravity: tuple[Triple, Tags],
    state: MotionState,
) -> tuple[list[Link], list[Frame]]:
    """How all bodies are placed and move; and the links, of trees in a plane without inertia that has no part in it.

    gravity: the acceleration against free fall, and the tags of accelerations.
    """
    in_plane = _trees_in_a_plane(bodies, links, parents)
    links = [_about_z(link) if flat else link for link, flat in zip(links, in_plane, strict=True)]
    return links, _frames(bodies, links, parents, in_plane, gravity, state)


def _frames(
    bodies: Sequence[Body],
    links: Sequence[Link],
    parents: Sequence[int],
    in_plane: Sequence[bool],
    gravity: tuple[Triple, Tags],
    state: MotionState,
) -> list[Frame]:
    up, tags = gravity
    frames: list[Frame] = []
    for body, link, parent, place, flat in zip(bodies, links, parents, places(bodies), in_plane, strict=True):
        q, u, u_dot = state
        with cg.tag(body.name):
            joint = Freedoms(place.u.start, link.at(q[place.q]), u[place.u], u_dot[place.u], tags)
            if parent < 0:
                frames.append(root_frame(up, link, moving_type(body.joint.type), joint, in_plane=flat))
            else:
                frames.append(next_frame(frames[parent], link, moving_type(body.joint.type), joint, in_plane=flat))
    return frames


def _trees_in_a_plane(bodies: Sequence[Body], links: Sequence[Link], parents: Sequence[int]) -> list[bool]:
    """For each body whether all axes of its tree are parallel."""
    roots: list[int] = []
    flat: dict[int, bool] = {}
    for i, (body, link, parent) in enumerate(zip(bodies, links, parents, strict=True)):
        roots.append(roots[parent] if parent >= 0 else i)
        along = isinstance(body.joint.type, AxialJoint) and (parent < 0 or link.parallel)
        flat[roots[i]] = flat.get(roots[i], True) and along
    return [flat[root] for root in roots]


def _about_z(link: Link) -> Link:
    """The link with the only moment of inertia that counts where all joints turn about z: it does not turn itself."""
    return replace(link, inertia=[[0.0], [0.0, 0.0], [0.0, 0.0, link.inertia[2][2]]])


def _fill(
    result: TorqueDerivatives,
    frames: Sequence[Frame],
    parents: Sequence[int],
    at: int,
    reactions: Sequence[tuple[Column, Reaction]],
) -> None:
    """All entries of the freedoms of a body with their own and those between it and the world."""
    for inner, reaction in reactions:
        for outer in frames[at].columns:
            _enter(result, outer, inner, reaction)
    while parents[at] >= 0:
        reactions = [(column, reaction.about(frames[at].offset)) for column, reaction in reactions]
        at = parents[at]
        for inner, reaction in reactions:
            for outer in frames[at].columns:
                _enter_both(result, outer, inner, reaction)


def _reaction(column: Column, of: Composite, tags: Tags) -> Reaction:
    """Of a freedom at the base of the composite.  tags: the energies that accelerations come of."""
    motion = column.motion
    with cg.tag(KINETIC):
        double = motion.scaled(2.0)
        moved = of.inertial(column.rate).plus(of.coriolis(double))
        accelerated, couple = of.inertial(motion), of.coriolis_transpose(double)
    with cg.tag(*tags):
        displaced = of.inertial(column.carried_rate).plus(of.coriolis(column.carried.scaled(2.0)))
        displaced = displaced.plus(of.wrench.carried(motion))
    return Reaction(displaced, moved, accelerated, couple, tags)


def _enter_both(result: TorqueDerivatives, outer: Column, inner: Column, reaction: Reaction) -> None:
    """outer: between the world and inner, whose reaction is about the origin of the outer's body."""
    i, j = outer.velocity, inner.velocity
    with cg.tag(*reaction.tags):
        result.by_q[i][j] = outer.motion.power(reaction.displaced)
        result.by_q[j][i] = _displaced_by(outer, reaction)
    with cg.tag(KINETIC):
        result.by_qd[i][j] = outer.motion.power(reaction.moved)
        result.by_qd[j][i] = outer.rate.power(reaction.accelerated) + dot(outer.motion.angular, reaction.couple)
        result.mass[i][j] = result.mass[j][i] = outer.motion.power(reaction.accelerated)


def _enter(result: TorqueDerivatives, outer: Column, inner: Column, reaction: Reaction) -> None:
    """Freedoms of one joint."""
    i, j = outer.velocity, inner.velocity
    if outer.stage < inner.stage:
        _enter_both(result, outer, inner, reaction)
    elif outer.stage == inner.stage:
        with cg.tag(*reaction.tags):
            result.by_q[j][i] = _displaced_by(outer, reaction)
        with cg.tag(KINETIC):
            result.by_qd[i][j] = outer.motion.power(reaction.moved)
            if i <= j:
                result.mass[i][j] = result.mass[j][i] = outer.motion.power(reaction.accelerated)


def _displaced_by(outer: Column, reaction: Reaction) -> Node:
    """What a displacement of the outer freedom changes at the inner one."""
    return outer.carried_rate.power(reaction.accelerated) + dot(outer.carried.angular, reaction.couple)
