"""Inertial numbers: a body's mass, first moment and inertia in the axes of its joint, of which its energy is made."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, building

from ..algebra import spatial
from ..algebra.spatial import Matrix, Triple
from ..algebra.spatial_vectors import Twist
from ..algebra.turns import Turn
from ..bodies.body import Body, Joint
from ..bodies.joint_coordinates import places
from ..joints import JointType
from ..parameters import symbol


class Numbers(NamedTuple):
    """Inertial numbers: floats, or nodes where there are parameters."""

    mass: Any
    moment: Array  # (3,)
    inertia: Array  # (3, 3)

    def negated(self) -> Numbers:
        """Numbers with other signs."""
        return Numbers(-self.mass, -self.moment, -self.inertia)

    def turned(self, turn: Array) -> Numbers:
        """Numbers in other axes, in which those of now are the columns of a turn."""
        moment, inertia = spatial.product(turn, self.moment), spatial.product(turn, self.inertia, turn.T)
        return Numbers(self.mass, moment, inertia)

    def about(self, offset: Array) -> Numbers:
        """Numbers about a point from which this one is r away: J + 2 (r . h) 1 - r h^T - h r^T + m (r^2 1 - r r^T)."""
        crossed = np.outer(offset, self.moment)
        inertia = spatial.added(self.inertia, 2.0 * np.trace(crossed) * np.eye(3) - crossed - crossed.T)
        moved = spatial.parallel_axis(inertia, self.mass, offset)
        return Numbers(self.mass, spatial.added(self.moment, self.mass * offset), moved)


@dataclass(frozen=True, eq=False)
class Link:
    """A body in the axes of its motion: numbers, or nodes that stand for them.

    turn, offset: its axes as columns, and its origin at q = 0, in the parent's axes.  first: m c.  inertia: about the
    origin.  angle: of a hinge, how far the axes are turned about its own beside its coordinate [rad].  lift: mass and
    moment of what is weightless.
    """

    turn: Matrix  # (3, 3)
    offset: Array  # (3,) [m]
    mass: float | Node
    first: Array  # (3,) [kg m]
    inertia: Matrix  # (3, 3), the lower triangle counts
    damping: float | Node
    stiffness: float | Node
    spring_reference: float | Node
    armature: float | Node
    angle: float = 0.0
    lift: Numbers | None = None

    @cached_property
    def place(self) -> Triple:
        """The offset, as nodes."""
        return spatial.constant(self.offset)

    @cached_property
    def moment(self) -> Triple:
        """The first moment, as nodes."""
        return spatial.constant(self.first)

    @property
    def weight(self) -> tuple[float | Node, Triple]:
        """Mass and first moment that gravity pulls at."""
        if self.lift is None:
            return self.mass, self.moment
        return self.mass - self.lift.mass, spatial.plus(self.moment, spatial.constant(-self.lift.moment))

    @cached_property
    def parallel(self) -> bool:
        """Whether the joint's axis is along that of the parent's joint, or against it."""
        across = (self.turn[0][2], self.turn[1][2], self.turn[2][0], self.turn[2][1])
        return all([float(each) == 0.0 for each in across])

    @cached_property
    def numbers(self) -> list[float | Node]:
        """Turn, place, mass, moment, inertia (lower triangle), damping, stiffness, spring reference, armature."""
        turn = [each for row in self.turn for each in row]
        lower = [each for k, row in enumerate(self.inertia, 1) for each in row[:k]]
        others = (self.damping, self.stiffness, self.spring_reference, self.armature)
        return [
            each if type(each) is float else spatial.plain(each)
            for each in (*turn, *self.offset.tolist(), self.mass, *self.first.tolist(), *lower, *others)
        ]

    @property
    def full_inertia(self) -> list[list[float | Node]]:
        """The inertia with its upper triangle."""
        return [[spatial.plain(self.inertia[max(i, j)][min(i, j)]) for j in range(3)] for i in range(3)]

    @cached_property
    def is_numeric(self) -> bool:
        """Whether there are no parameters among the numbers of place and inertia."""
        moved = len(self.numbers) - 4  # the last four are those of the joint
        lift = [] if self.lift is None else [self.lift.mass, *self.lift.moment]
        return not any([isinstance(each, Node) for each in (*self.numbers[:moved], *lift)])

    @property
    def inertial(self) -> Numbers:
        """Mass, first moment and inertia as arrays."""
        moment = np.array([spatial.plain(each) for each in self.first])
        return Numbers(self.mass, moment, np.array(self.full_inertia))

    def with_more(self, added: Numbers) -> Link:
        """The link with these numbers added to its own."""
        mass, moment, inertia = self.inertial
        moment, inertia = spatial.added(moment, added.moment), spatial.added(inertia, added.inertia)
        return self.with_inertial(Numbers(mass + added.mass, moment, inertia))

    def with_inertial(self, numbers: Numbers) -> Link:
        """The link with these numbers in place of its own."""
        mass, moment, inertia = numbers
        return replace(self, mass=mass, first=moment, inertia=inertia.tolist())


class LinkState(NamedTuple):
    """A link on its joint, at the state of that.

    name: of its body, for tags.  parent: index of the link that carries it, -1 for the world.  first: place of the
    joint's first velocity among all.
    """

    name: str
    parent: int
    link: Link
    joint: JointType
    q: Sequence[Node]
    u: Sequence[Node]
    u_dot: Sequence[Node] = ()
    first: int = 0

    @property
    def moved(self) -> Sequence[Node]:
        """The coordinates by which the axes move."""
        return [self.q[0] + self.link.angle] if self.link.angle else self.q

    @property
    def turn(self) -> Turn:
        """Turn from the joint's axes to the link's."""
        return self.joint.turn(self.moved)

    @property
    def shift(self) -> Triple:
        """Position of the link's origin in the joint's axes [m]."""
        return self.joint.translation(self.moved)

    @property
    def place(self) -> Triple:
        """Position of the link's origin from its parent's, in the parent's axes [m]."""
        return spatial.plus(self.link.place, spatial.rotate(self.link.turn, self.shift))

    @property
    def columns(self) -> list[Twist]:
        """Twists of the link by each velocity of the joint, in the link's axes."""
        return self.joint.columns(self.moved)

    def into(self, vector: Triple) -> Triple:
        """A vector in the parent's axes, in those of the joint."""
        return spatial.rotate_transpose(self.link.turn, vector)

    def springs(self) -> list[tuple[Node, Node]]:
        """The velocities that the joint's spring works on, and its forces."""
        return [(velocity, self.link.stiffness * x) for velocity, x in zip(self.u, self.stretches(), strict=False)]

    def stretches(self) -> Sequence[Node]:
        """Stretch of the spring along each velocity; nothing where there is no spring."""
        absent = not isinstance(self.link.stiffness, Node) and not self.link.stiffness
        return [] if absent else self.joint.stretches(self.q, self.link.spring_reference)


def link_states(
    bodies: Sequence[Body],
    links: Sequence[Link],
    parents: Sequence[int],
    q: Sequence[Node],
    u: Sequence[Node],
    u_dot: Sequence[Node] | None = None,
) -> list[LinkState]:
    """The links of moving bodies, parents first, at a state of all.  parents: their indices.  u_dot: by default 0."""
    rates = [spatial.ZERO] * len(u) if u_dot is None else u_dot
    rows = zip(bodies, parents, links, places(bodies), strict=True)
    return [
        LinkState(body.name, parent, each, body.joint.type, q[at.q], u[at.u], rates[at.u], at.u.start)
        for body, parent, each, at in rows
    ]


@kept_by_first
def motion_axes(joint: Joint) -> Array:
    """The axes of a body's motion on its joint, as columns in the body's; if the joint has an axis, the third is it."""
    return joint.type.axes(np.asarray(joint.axis))


@dataclass(frozen=True, eq=False)
class MergedBody(Body):
    """A body with others welded to it that are not merged into its inertia, since there are parameters among theirs.

    welded: bodies in the same frame, of which mass, center and inertia count.
    """

    welded: tuple[Body, ...] = ()


@kept_by_first
def inertia_in(body: Body, joint: Joint) -> tuple[Any, Array, Array]:
    """Mass, center of mass (3,), and inertia about the joint (3, 3) of a body alone, in the axes of motion on it."""
    axes = motion_axes(joint)
    mass, center = symbol(body.mass), spatial.product(axes.T, np.asarray(body.center))
    about_center = spatial.product(axes.T, np.asarray(body.inertia), axes)
    return mass, center, spatial.parallel_axis(about_center, mass, center)


@kept_by_first
def joint_place(joint: Joint, outer: Joint | None) -> tuple[Matrix, Array]:
    """Turn and offset of a `Link` on this joint."""
    before = motion_axes(outer) if outer else np.eye(3)
    turn = spatial.snapped(before.T @ np.asarray(joint.orientation) @ motion_axes(joint))
    return turn.tolist(), spatial.product(before.T, np.asarray(joint.position))


@kept_by_first
def link(body: Body, outer: Joint | None) -> Link:
    """The link of a checked body on a body with the joint `outer`, None for the world."""
    joint, welded = body.joint, body.welded if isinstance(body, MergedBody) else ()
    nodes = welded or object in [np.asarray(x).dtype for x in (body.mass, body.center, body.inertia, joint.position)]
    with building(Builder()) if nodes else nullcontext(), cg.tag(body.name) if nodes else nullcontext():
        turn, offset = joint_place(joint, outer)
        mass, center, inertia = inertia_in(body, joint)
        moment = mass * center
        for other in welded:
            more, center, about_joint = inertia_in(other, joint)
            mass, moment, inertia = mass + more, moment + more * center, spatial.added(inertia, about_joint)
    damping, stiffness, reference, armature = map(
        symbol, (joint.damping, joint.stiffness, joint.spring_reference, joint.armature)
    )
    return Link(turn, offset, mass, moment, inertia.tolist(), damping, stiffness, reference, armature)
