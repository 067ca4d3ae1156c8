"""Composite momentum: the rates of the momenta of a tree of bodies from what each body and all that it carries have.

A body and all that it carries have the momentum (n, f) about the body's origin, the first moment h and the mass m. What
turns and moves with the body has no other part in the rate of its momentum than that the axes turn, that the origin
moves, and gravity:

    n_dot = -(w x n + v x f) + h x g,   f_dot = -w x f + m g          (and what the joint that carries it does)

The momentum p of a velocity is the share of (n, f) along it, and its rate that of (n_dot, f_dot): for a hinge about z
n_x w_y - n_y w_x + f_x v_y - f_y v_x + (h_x g_y - h_y g_x). No acceleration is needed. And where a share of (n, f) is
one of the momenta, it need not be summed up from the bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import as_node

from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple, cross, plus, scaled
from ..algebra.spatial_vectors import Twist, Wrench
from .links import Link, LinkState
from .outward import KINETIC, POTENTIAL, Motion

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
