"""The mass matrix of a tree of bodies, column by column, by composite inertias in the bodies' axes.

With the composite I of all that a freedom j carries, M_ij = S_i . I S_j for i between it and the world: the wrench
I S_j is carried to the axes of one body after another. A hinge's own turn leaves S and its share of a wrench as they
are. (M. W. Walker, D. E. Orin, "Efficient dynamic computer simulation of robotic mechanisms", J. Dyn. Sys. Meas.
Control 104(3), 1982.) Along many joints it takes less to have the columns S and I S_j in the axes of the first body, so
that each entry is one product of six numbers.

And the rates of momenta by composite momentum: a body and all that it carries have the momentum (n, f) about the body's
origin, the first moment h and the mass m. What turns and moves with the body has no other part in the rate of its
momentum than that the axes turn, that the origin moves, and gravity:

    n_dot = -(w x n + v x f) + h x g,   f_dot = -w x f + m g          (and what the joint that carries it does)

The momentum p of a velocity is the share of (n, f) along it, and its rate that of (n_dot, f_dot): for a hinge about z
n_x w_y - n_y w_x + f_x v_y - f_y v_x + (h_x g_y - h_y g_x). No acceleration is needed. And where a share of (n, f) is
one of the momenta, it need not be summed up from the bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import as_node, topological

from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple, combined, cross, plus, scaled
from ..algebra.spatial_vectors import Inertia, Twist, Wrench, symmetric
from ..algebra.turns import NEXT, UNIT, Axes, AxisTurn, Turn, constant_turns
from .links import Link, LinkState
from .outward import KINETIC, POTENTIAL, Motion

FEW_FREEDOMS = 6  # freedoms in a row; up to so many, columns in the axes of the first body are not tried
Carriable = TypeVar("Carriable", Inertia, Wrench)


class Shift(NamedTuple):
    """A move to a point from which the old one is `offset` away."""

    offset: Triple

    def wrench(self, old: Wrench) -> Wrench:
        """Wrench about the new point; term by term, so that no constant changes its sign."""
        (a, b, c), (x, y, z), (f, g, h) = old.torque, self.offset, old.force
        return Wrench((a + y * h - z * g, b + z * f - x * h, c + x * g - y * f), old.force)


FrameStep = Turn | Shift


def carried(value: Carriable, steps: Sequence[FrameStep]) -> Carriable:
    """An inertia or a wrench after these steps outwards."""
    for step in steps:
        if not isinstance(step, Shift):
            value = value.turned(step)
        else:
            value = step.wrench(value) if isinstance(value, Wrench) else value.about(step.offset)
    return value


class PlacedLink(NamedTuple):
    """A link with the planes that it and its parent move in, see `Motion`."""

    at: LinkState
    plane: AxisTurn | None
    before: AxisTurn | None

    @property
    def inertia(self) -> Inertia:
        """Inertia of the link alone, in the axes of its motion."""
        alone = rigid(self.at.link)
        return alone.turned(self.plane) if self.plane else alone

    @property
    def turn(self) -> list[FrameStep]:
        """Steps from its axes to those of its joint; none where S is the same in both."""
        return [] if self.plane or self.at.turn.still else [self.at.turn]

    @property
    def outwards(self) -> list[FrameStep]:
        """Steps from the axes of its joint, about its origin, to those of its parent's motion, about the parent's."""
        plane, link = self.before, self.at.link
        steps: list[FrameStep] = [Shift(self.at.shift), *constant_turns(link.turn)]
        if plane and self.plane:
            return [*steps, Shift(plane.out(link.place))]
        return [*steps, Shift(link.place), plane] if plane else [*steps, Shift(link.place)]


def rigid(link: Link) -> Inertia:
    """Inertia of a link alone, about its origin."""
    full = [[as_node(each) for each in row] for row in link.full_inertia]
    second = [[-full[i][j] for j in range(3)] for i in range(3)]
    diagonal = np.array([spatial.plain(full[i][i]) for i in range(3)])
    for i, (j, k) in enumerate(NEXT):
        both = spatial.added(diagonal[j : j + 1], diagonal[k : k + 1])
        second[i][i] = as_node(0.5 * spatial.added(both, -diagonal[i : i + 1])[0])
    return Inertia(as_node(link.mass), link.moment, symmetric(second), full[2][2])


def mass_matrix_columns(bodies: Sequence[PlacedLink], n: int) -> list[list[Node]]:
    """The lower triangle of M, (n, n), rows.  bodies: parents first, with armatures."""
    lower = [[ZERO] * (i + 1) for i in range(n)]
    ways, filled = [bodies], []
    if any([body.plane for body in bodies]):  # a short chain in a plane takes less with its bodies' axes
        ways.append([body._replace(plane=None, before=None) for body in bodies])
    for way in ways:
        columns = _columns(way, lower)
        filled.append(_by_bodies(way, columns, [list(row) for row in lower]))
        if _longest(bodies) > FEW_FREEDOMS:
            filled.append(_by_first_bodies(way, columns, [list(row) for row in lower]))
    return min(filled, key=size_of)


def size_of(rows: Sequence[Sequence[Node]]) -> int:
    """Number of nodes of a matrix."""
    return len(topological([entry for row in rows for entry in row]))


def _columns(bodies: Sequence[PlacedLink], lower: list[list[Node]]) -> list[list[Wrench]]:
    """I S of all freedoms, in the axes of their joints; their own entries go into the matrix."""
    composites: list[Inertia | None] = [None] * len(bodies)
    columns: list[list[Wrench]] = [[] for _ in bodies]
    for i in reversed(range(len(bodies))):
        body, at = bodies[i], bodies[i].at
        with cg.tag(at.name, KINETIC):
            others, twists = composites[i], at.columns
            whole = body.inertia if others is None else body.inertia.plus(others)
            turned = carried(whole, body.turn)
            if at.joint.has_axis:
                wrenches = columns[i] = [turned.wrench(twist) for twist in twists]
            else:
                wrenches = [whole.wrench(twist) for twist in twists]
                columns[i] = [carried(wrench, body.turn) for wrench in wrenches]
            for k, wrench in enumerate(wrenches):
                row = lower[at.first + k]
                for j, twist in enumerate(twists[: k + 1], at.first):
                    row[j] = twist.power(wrench)  # S_j . I S_k
                row[at.first + k] = row[at.first + k] + at.link.armature
            if at.parent >= 0:
                moved, others = carried(turned, body.outwards), composites[at.parent]
                composites[at.parent] = moved if others is None else others.plus(moved)
    return columns


def _by_bodies(
    bodies: Sequence[PlacedLink], columns: Sequence[Sequence[Wrench]], lower: list[list[Node]]
) -> list[list[Node]]:
    """The other entries, each in the axes of the body between."""
    for i, wrenches in enumerate(columns):
        body, turn = bodies[i], list[FrameStep]()
        while body.at.parent >= 0:
            with cg.tag(body.at.name, KINETIC):
                wrenches = [carried(wrench, [*turn, *body.outwards]) for wrench in wrenches]
            body = bodies[body.at.parent]
            turn = body.turn
            with cg.tag(body.at.name, KINETIC):
                for k, wrench in enumerate(wrenches, bodies[i].at.first):
                    for j, twist in enumerate(body.at.columns, body.at.first):
                        lower[k][j] = twist.power(wrench)  # M_kj = S_j . I S_k, both in the axes of body j
    return lower


def _by_first_bodies(
    bodies: Sequence[PlacedLink], columns: Sequence[Sequence[Wrench]], lower: list[list[Node]]
) -> list[list[Node]]:
    """The other entries, in the axes of the body on the world, about its origin."""
    frames: list[BaseFrame] = []
    twists: list[list[Twist]] = []
    for body, wrenches in zip(bodies, columns, strict=True):
        at = body.at
        with cg.tag(at.name, KINETIC):
            joint = frames[at.parent].of(body.outwards) if at.parent >= 0 else None
            frames.append(joint.of(body.turn) if joint else FIRST)
            twists.append([frames[-1].twist(twist) for twist in at.columns])
            for k, wrench in enumerate(wrenches if joint else (), at.first):
                seen, outer = joint.wrench(wrench), at.parent  # type: ignore[union-attr]
                while outer >= 0:
                    for j, twist in enumerate(twists[outer], bodies[outer].at.first):
                        lower[k][j] = twist.power(seen)  # both in the axes of the first body
                    outer = bodies[outer].at.parent
    return lower


class BaseFrame(NamedTuple):
    """Axes as columns, and an origin, in those of the body on the world."""

    axes: Axes
    origin: Triple

    def of(self, steps: Sequence[FrameStep]) -> BaseFrame:
        """The frame from which these steps lead to this one."""
        axes, origin = self
        for step in reversed(steps):
            if isinstance(step, Shift):
                origin = plus(origin, combined(axes, step.offset))
            else:
                axes = step.columns(axes)
        return BaseFrame(axes, origin)

    def twist(self, own: Twist) -> Twist:
        """Twist in these axes, about the origin of the body on the world."""
        angular = combined(self.axes, own.angular)
        return Twist(angular, plus(combined(self.axes, own.linear), cross(self.origin, angular)))

    def wrench(self, own: Wrench) -> Wrench:
        """Wrench in these axes, about the origin of the body on the world."""
        return Wrench(combined(self.axes, own.torque), combined(self.axes, own.force)).about(self.origin)


FIRST = BaseFrame(UNIT, STILL)


def _longest(bodies: Sequence[PlacedLink]) -> int:
    """The most freedoms from the world to a tip."""
    counts: list[int] = []
    for at in [body.at for body in bodies]:
        counts.append(len(at.u) + (counts[at.parent] if at.parent >= 0 else 0))
    return max(counts)


COMPOSITE = "momentum"  # tag of what composite momenta are made of, and of the rates made of them


class SubtreeMomentum(NamedTuple):
    """Momentum of a body and what it carries, about its origin, in its motion's axes; mass and moment of its weight."""

    mass: Node
    moment: Triple
    momentum: Wrench

    def plus(self, other: SubtreeMomentum) -> SubtreeMomentum:
        """Sum of two about the same point."""
        with cg.tag(POTENTIAL):
            mass, moment = self.mass + other.mass, plus(self.moment, other.moment)
        with cg.tag(KINETIC):
            return SubtreeMomentum(mass, moment, self.momentum.plus(other.momentum))


def _body_momentum(motion: Motion, link: Link) -> SubtreeMomentum:
    """Momentum of the body alone, f = m v + w x h, n = J w + h x v; in a plane f alone, as n_z is one of p."""
    h, w, v, mass = motion.out(link.moment), motion.omega, motion.velocity, as_node(link.mass)
    with cg.tag(KINETIC):
        force = plus(scaled(mass, v), cross(w, h))
        torque = STILL
        if not motion.plane:
            torque = plus(spatial.rotate(link.full_inertia, w), cross(h, v))
    weight, moment = link.weight
    return SubtreeMomentum(as_node(weight), motion.out(moment), Wrench(torque, force))


def _with_known_momenta(composite: SubtreeMomentum, at: LinkState, p: Sequence[Node]) -> SubtreeMomentum:
    """Momentum with the momenta p of the joint's velocities in place of the shares of (n, f) that they are."""
    torque, force = list(composite.momentum.torque), list(composite.momentum.force)
    own = [momentum - at.link.armature * velocity for momentum, velocity in zip(p, at.u, strict=True)]
    if at.joint.sliding:
        force = list(at.turn.into((own[0], own[1], own[2])))
    for twist, momentum in list(zip(at.columns, own, strict=True))[at.joint.sliding :]:
        shares = [each.value for each in (*twist.angular, *twist.linear)]
        if sorted(map(str, shares)) == ["0.0"] * 5 + ["1.0"]:
            k = shares.index(1.0)
            (torque if k < 3 else force)[k % 3] = momentum
    return composite._replace(momentum=Wrench((torque[0], torque[1], torque[2]), (force[0], force[1], force[2])))


def momentum_rates(states: Sequence[LinkState], motions: Sequence[Motion], p: Sequence[Node]) -> list[Node]:
    """The rates of the momenta p of all links, parents first, without applied forces.

    motions: those of the links, and that of the world last.
    """
    composites: list[SubtreeMomentum] = []
    for at, motion in zip(states, motions, strict=False):
        with cg.tag(at.name, COMPOSITE):
            composites.append(_body_momentum(motion, at.link))
    rates = list[Node]()
    for i, at in reversed(list(enumerate(states))):
        own = p[at.first : at.first + len(at.u)]
        with cg.tag(at.name, COMPOSITE):
            composites[i] = _with_known_momenta(composites[i], at, own)
            rates[:0] = _own_rates(composites[i], motions[at.parent], motions[i], at, own)
            if at.parent >= 0:
                carried = _about_parent(composites[i], motions[at.parent], motions[i], at)
                composites[at.parent] = composites[at.parent].plus(carried)
    return rates


def _own_rates(
    composite: SubtreeMomentum, parent: Motion, motion: Motion, at: LinkState, p: Sequence[Node]
) -> list[Node]:
    """The rates of the momenta p of a joint's velocities, without applied forces; the spring's among them."""
    rates: list[Node] = []
    if at.joint.sliding:  # along the joint's axes, which turn with the parent: -(omega x p + m g)
        carrier = parent.in_body_axes()
        with cg.tag(KINETIC):
            x, y, z = (p[k] - at.link.armature * at.u[k] for k in range(3))
            turned = cross(at.into(carrier.omega), (x, y, z))
        with cg.tag(POTENTIAL):
            up = at.into(scaled(parent.strength, carrier.vertical))
            rates = [-(a + composite.mass * b) for a, b in zip(turned, up, strict=True)]
    with cg.tag(KINETIC):
        # (w x n + v x f, w x f), from axes and an origin that move
        carried = composite.momentum.carried(Twist(motion.omega, motion.velocity))
    with cg.tag(POTENTIAL):
        up = scaled(motion.strength, motion.vertical)  # gravity is -up
        loss = carried.plus(Wrench(cross(composite.moment, up), scaled(composite.mass, up)))  # -(n_dot, f_dot)
        rates += [-twist.power(loss) for twist in at.columns[len(rates) :]]
        springs = [force for _, force in at.springs()] or [ZERO] * len(rates)
        return [rate - spring for rate, spring in zip(rates, springs, strict=True)]


def _about_parent(composite: SubtreeMomentum, parent: Motion, motion: Motion, at: LinkState) -> SubtreeMomentum:
    """Momentum about the parent's origin, in the axes of the parent's motion."""
    stays, offset = parent.keeps(at), parent.out(at.place)
    back = motion.turn.reversed  # not `out`, for the sake of products that other equations have as well

    def turned(vector: Triple) -> Triple:
        vector = spatial.rotate(at.link.turn, back.into(vector))
        return vector if stays else parent.out(vector)

    with cg.tag(POTENTIAL):
        moment = plus(turned(composite.moment), scaled(composite.mass, offset))
    with cg.tag(KINETIC):
        momentum = Wrench(turned(composite.momentum.torque), turned(composite.momentum.force)).about(offset)
    return SubtreeMomentum(composite.mass, moment, momentum)
