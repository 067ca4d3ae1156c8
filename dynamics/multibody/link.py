"""A link: one moving body as the numbers that its motion and energy are made of, and these two as nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node

from . import spatial
from .body import Body
from .spatial import STILL, ZERO, Array, Matrix, Triple


class Turned(NamedTuple):
    """How far a body is turned about z from axes that do not turn with it."""

    angle: Node
    cos: Node
    sin: Node


class Motion(NamedTuple):
    """How a body's frame moves, in axes whose z is the joint's axis: the body's own.

    turned: of a body that turns about z alone, whose axes are those of the plane it moves in: the body is turned from
    them. What does not turn with the body is then constant, and velocities are rates of positions.
    """

    omega: Triple  # angular velocity
    velocity: Triple  # of the origin
    up: Triple  # what holds against gravity [m/s^2]
    height: Node  # of the origin along it, times gravity [J/kg]
    turned: Turned | None = None


@dataclass(frozen=True, eq=False)
class Link:
    """A body in the axes of its motion: numbers, or nodes that stand for them.

    turn, place: its axes as columns, and its origin at q = 0, in the parent's axes.  moment: m c.  inertia: about the
    origin.
    """

    turn: Matrix  # (3, 3)
    place: Triple
    mass: float | Node
    moment: Triple
    inertia: Matrix  # (3, 3), the lower triangle counts
    damping: float | Node
    stiffness: float | Node
    spring_reference: float | Node
    armature: float | Node

    @cached_property
    def numbers(self) -> list[float]:
        """Turn, place, mass, moment, inertia (lower triangle), damping, stiffness, rest, armature."""
        turn = [each for row in self.turn for each in row]
        lower = [self.inertia[i][j] for i in range(3) for j in range(i + 1)]
        others = (self.damping, self.stiffness, self.spring_reference, self.armature)
        return [float(each) for each in (*turn, *self.place, self.mass, *self.moment, *lower, *others)]


def ground(gravity: ArrayLike) -> Motion:
    """The world at rest."""
    pull = np.asarray(gravity, dtype=np.float64)
    strength = float(np.linalg.norm(pull))
    up = spatial.constant(strength * spatial.snapped(-pull / strength)) if strength else STILL
    return Motion(STILL, STILL, up, ZERO)


def axes_of(body: Body) -> Array:
    """The axes of the body's motion, as columns in its own."""
    return spatial.to_z(np.asarray(body.joint.axis))


def link(body: Body, outer: Array) -> Link:
    """The link of a body whose parent moves in the axes `outer`."""
    axes, joint = axes_of(body), body.joint
    turn, place = spatial.hung(outer, joint.orientation, joint.position, axes)
    center = axes.T @ np.asarray(body.center)
    inertia = spatial.about(axes.T @ np.asarray(body.inertia) @ axes, body.mass, center)
    inertia = np.where(np.abs(inertia) <= spatial.SNAP * np.abs(inertia).max(initial=0.0), 0.0, inertia)
    moment = spatial.constant(spatial.snapped(body.mass * center))
    numbers = (joint.damping, joint.stiffness, joint.spring_reference, joint.armature)
    return Link(turn.tolist(), place, body.mass, moment, inertia.tolist(), *numbers)


def carried(parent: Motion, link: Link, kind: str, q: Node, qd: Node) -> Motion:
    """The motion of a link, "revolute" or "prismatic", from that of its parent."""
    along = link.turn[2][2]  # the joint's axis on the parent's
    parent = carrier(parent, link)
    place = placed(parent, link, kind, q)
    with cg.tag("kinetic"):
        omega = spatial.turned(link.turn, parent.omega)
        velocity = spatial.turned(link.turn, spatial.plus(parent.velocity, spatial.cross(parent.omega, place)))
    with cg.tag("potential"):
        up = spatial.turned(link.turn, parent.up)
        height = parent.height + spatial.dot(parent.up, place)
    if kind == "prismatic":
        turned = parent.turned and Turned(along * parent.turned.angle, parent.turned.cos, along * parent.turned.sin)
        return Motion(omega, (velocity[0], velocity[1], velocity[2] + qd), up, height, turned)
    if parent.turned or all(each.value == 0.0 for each in omega):
        angle = along * parent.turned.angle + q if parent.turned else q
        if not parent.turned and all(each.value == 0.0 for each in (*velocity, up[0], up[1])):
            angle = ZERO  # all is alike about the axis, so the plane may as well turn with the first body
        with cg.tag("kinetic"):
            spin = omega[2] + qd
        turned = Turned(angle, cg.cos(angle), cg.sin(angle))
        return Motion((ZERO, ZERO, spin), velocity, up, height, turned)
    c, s = cg.cos(q), cg.sin(q)
    with cg.tag("kinetic"):
        x, y, z = spatial.turned_about_z(c, s, omega)
        velocity = spatial.turned_about_z(c, s, velocity)
    with cg.tag("potential"):
        up = spatial.turned_about_z(c, s, up)
    return Motion((x, y, z + qd), velocity, up, height)


def carrier(parent: Motion, link: Link) -> Motion:
    """The parent's motion in the axes that the link is carried in: those of a plane where it stays in the plane."""
    return _in_own_axes(parent) if parent.turned and abs(link.turn[2][2]) != 1.0 else parent


def placed(carrier: Motion, link: Link, kind: str, q: Node) -> Triple:
    """Where the link's origin is from its parent's, in the axes of `carrier`."""
    place = link.place
    if kind == "prismatic":
        x, y, z = (row[2] * q for row in link.turn)
        place = spatial.plus(place, (x, y, z))
    if carrier.turned:
        place = spatial.turned_about_z(carrier.turned.cos, -carrier.turned.sin, place)
    return place


def _in_own_axes(motion: Motion) -> Motion:
    """The same motion in axes that turn with the body."""
    if not motion.turned:
        return motion
    _, c, s = motion.turned
    with cg.tag("kinetic"):
        velocity = spatial.turned_about_z(c, s, motion.velocity)
    with cg.tag("potential"):
        up = spatial.turned_about_z(c, s, motion.up)
    return Motion(motion.omega, velocity, up, motion.height)


def energy(motion: Motion, link: Link, q: Node, qd: Node) -> Node:
    """L_i = K_i - P_i with the first moment m c and the inertia J about the joint, without the centre's velocity.

    K = m v.v / 2 + m c . (v x w) + w . J w / 2,  P = m g h + g u . m c + spring.
    """
    own, inertia = _in_own_axes(motion), link.inertia
    omega, v = own.omega, motion.velocity
    with cg.tag("kinetic"):
        terms = [0.5 * link.mass * spatial.dot(v, v)]
        terms.append(spatial.dot(spatial.cross(own.velocity, omega), link.moment))  # the order with fewest nodes
        terms.append(0.5 * spatial.total([inertia[i][i] * (omega[i] * omega[i]) for i in range(3)]))
        terms += [inertia[i][j] * (omega[i] * omega[j]) for i in range(3) for j in range(i)]
        terms.append(0.5 * link.armature * (qd * qd))
        kinetic = spatial.total(terms)
    with cg.tag("potential"):
        stretch = q - link.spring_reference
        potential = link.mass * motion.height + spatial.dot(own.up, link.moment)
        potential = potential + 0.5 * link.stiffness * (stretch * stretch)
    return kinetic - potential
