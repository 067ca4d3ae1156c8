"""The motion and the energy of bodies as nodes, each from the motion of the body that carries it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import Array, Builder, as_node, building

from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple
from ..joints import AxialJoint, MovingJoint, SpatialJoint
from .inertial_numbers import Link


class PlaneAngle(NamedTuple):
    """How far a body is turned about z from axes that do not turn with it."""

    angle: Node
    cos: Node
    sin: Node


class Motion(NamedTuple):
    """How a body's frame moves, in axes whose z is the joint's axis: the body's own.

    vertical, depth, strength: a mass m at r from the origin has the potential energy m strength (depth + vertical . r).
    plane: of a body that turns about z alone, whose axes are those of the plane it moves in: the body is turned from
    them. What does not turn with the body is then constant, and velocities are rates of positions.
    """

    omega: Triple  # angular velocity
    velocity: Triple  # of the origin
    vertical: Triple  # upward, as long as gravity is strong; or downward, of length 1
    depth: Node  # of the origin along it
    strength: float | Node = 1.0  # 1 in the first case, -g [m/s^2] in the second
    plane: PlaneAngle | None = None


def ground(gravity: Array, *, in_plane: bool = False) -> Motion:
    """The world at rest.

    in_plane: all bodies turn about parallel axes. Then g is kept apart from the vertical, so that heights are lengths:
    fewer nodes. In space the vertical has three components, which had better be scaled once.
    """
    along = np.flatnonzero(gravity != 0.0)
    if not len(along):
        return Motion(STILL, STILL, STILL, ZERO)
    if in_plane and gravity.dtype != object:
        downward = spatial.unit(gravity)
        return Motion(STILL, STILL, spatial.constant(downward + 0.0), ZERO, -float(downward @ gravity))
    with building(Builder()):
        if in_plane and len(along) == 1:
            return Motion(STILL, STILL, spatial.constant(-np.eye(3)[along[0]] + 0.0), ZERO, as_node(gravity[along[0]]))
        return Motion(STILL, STILL, spatial.constant(0.0 - gravity), ZERO)


def propagate_motion(parent: Motion, link: Link, joint: MovingJoint, q: Sequence[Node], u: Sequence[Node]) -> Motion:
    """The motion of a link from that of its parent; q and u are the coordinates and velocities of its joint."""
    parent = carrier_motion(parent, link, joint)
    offset = joint_translation(link, joint, q)
    if isinstance(joint, AxialJoint):
        return _about_axis(parent, link, joint, offset, q[0], u[0])
    return _in_space(parent, link, joint, offset, q, u)


def _in_space(
    parent: Motion, link: Link, joint: SpatialJoint, offset: Triple, q: Sequence[Node], u: Sequence[Node]
) -> Motion:
    """omega = R^T omega_parent + omega_joint, v = R^T (v_parent + omega_parent x offset) + v_joint."""
    turn = joint.rotation(q)

    def turned(vector: Triple) -> Triple:
        return spatial.rotate_transpose(turn, spatial.rotate_transpose(link.turn, vector))

    with cg.tag("kinetic"):
        omega = spatial.plus(turned(parent.omega), joint.angular_velocity(q, u))
        velocity = spatial.plus(turned(_velocity_at(parent, offset)), joint.linear_velocity(q, u))
    with cg.tag("potential"):
        depth = parent.depth + spatial.dot(parent.vertical, offset)
        vertical = turned(parent.vertical)
    return Motion(omega, velocity, vertical, depth, parent.strength)


def _about_axis(parent: Motion, link: Link, joint: AxialJoint, offset: Triple, q: Node, qd: Node) -> Motion:
    along = link.turn[2][2]  # the joint's axis on the parent's
    with cg.tag("kinetic"):
        omega = spatial.rotate_transpose(link.turn, parent.omega)
        velocity = spatial.rotate_transpose(link.turn, _velocity_at(parent, offset))
    with cg.tag("potential"):
        vertical = spatial.rotate_transpose(link.turn, parent.vertical)
        depth = parent.depth + spatial.dot(parent.vertical, in_plane_axes(parent, offset))
    angle = joint.angle(q)
    with cg.tag("kinetic"):
        velocity = velocity[0], velocity[1], velocity[2] + joint.shift(qd)
    if angle.value == 0.0:
        plane = parent.plane and PlaneAngle(along * parent.plane.angle, parent.plane.cos, along * parent.plane.sin)
        return Motion(omega, velocity, vertical, depth, parent.strength, plane)
    if parent.plane or all(each.value == 0.0 for each in omega):
        angle = along * parent.plane.angle + angle if parent.plane else angle
        if not parent.plane and all(each.value == 0.0 for each in (*velocity, vertical[0], vertical[1])):
            angle = ZERO  # all is alike about the axis, so the plane may as well turn with the first body
        with cg.tag("kinetic"):
            spin = omega[2] + joint.angle(qd)
        plane = PlaneAngle(angle, cg.cos(angle), cg.sin(angle))
        return Motion((ZERO, ZERO, spin), velocity, vertical, depth, parent.strength, plane)
    c, s = cg.cos(angle), cg.sin(angle)
    with cg.tag("kinetic"):
        x, y, z = spatial.rotate_about_z(c, s, omega)
        velocity = spatial.rotate_about_z(c, s, velocity)
    with cg.tag("potential"):
        vertical = spatial.rotate_about_z(c, s, vertical)
    return Motion((x, y, z + joint.angle(qd)), velocity, vertical, depth, parent.strength)


def _velocity_at(motion: Motion, offset: Triple) -> Triple:
    """v + omega x offset; of (a, 0, d) axis by axis, so that elimination moves inertia along one after the other."""
    if motion.plane or all([each.value != 0.0 for each in offset]):
        return spatial.plus(motion.velocity, in_plane_axes(motion, spatial.cross(motion.omega, offset)))
    velocity = motion.velocity
    for k, along in enumerate(offset):
        x, y, z = (along if k == i else ZERO for i in range(3))
        velocity = spatial.plus(velocity, spatial.cross(motion.omega, (x, y, z)))
    return velocity


def carrier_motion(parent: Motion, link: Link, joint: MovingJoint) -> Motion:
    """The parent's motion in the axes that the link is carried in: those of a plane where it stays in the plane."""
    if parent.plane and isinstance(joint, AxialJoint) and link.parallel:
        return parent
    return in_body_axes(parent)


def joint_translation(link: Link, joint: MovingJoint, q: Sequence[Node]) -> Triple:
    """Where the link's origin is from its parent's, in the parent's axes."""
    if isinstance(joint, AxialJoint):
        x, y, z = (row[2] * joint.shift(q[0]) for row in link.turn)
        return spatial.plus(link.place, (x, y, z))
    return spatial.plus(link.place, spatial.rotate(link.turn, joint.translation(q)))


def in_body_axes(motion: Motion) -> Motion:
    """The same motion in axes that turn with the body."""
    if not motion.plane:
        return motion
    _, c, s = motion.plane
    with cg.tag("kinetic"):
        velocity = spatial.rotate_about_z(c, s, motion.velocity)
    with cg.tag("potential"):
        vertical = spatial.rotate_about_z(c, s, motion.vertical)
    return Motion(motion.omega, velocity, vertical, motion.depth, motion.strength)


def in_plane_axes(motion: Motion, vector: Triple) -> Triple:
    """A vector in the body's axes, in those of its motion."""
    return spatial.rotate_about_z(motion.plane.cos, -motion.plane.sin, vector) if motion.plane else vector


def energy(motion: Motion, link: Link, joint: MovingJoint, q: Sequence[Node], u: Sequence[Node]) -> Node:
    """L_i = K_i - P_i with the first moment m c and the inertia J about the joint, without the center's velocity.

    K = m v.v / 2 + m c . (v x w) + w . J w / 2,  P = m g h + g u . m c + spring.
    """
    own, inertia = in_body_axes(motion), link.inertia
    omega, v = own.omega, motion.velocity
    with cg.tag("kinetic"):
        translation = 0.5 * link.mass * spatial.dot(v, v)
        coupling = spatial.dot(spatial.cross(own.velocity, omega), link.moment)
        rotation = 0.5 * spatial.total([inertia[i][i] * (omega[i] * omega[i]) for i in range(3)])
        # Forward dynamics eliminates from the last term on: in these orders with the fewest and shallowest nodes.
        if motion.plane:
            terms = [rotation, translation, coupling]
        else:
            terms = [coupling, rotation] if translation.value == 0.0 else [translation, rotation, coupling]
        terms += [inertia[i][j] * (omega[i] * omega[j]) for i in range(3) for j in range(i)]
        terms.append(0.5 * link.armature * spatial.total([velocity * velocity for velocity in u]))
        kinetic = spatial.total(terms)
    with cg.tag("potential"):
        weight = spatial.scaled(motion.strength, link.moment)
        potential = link.mass * motion.strength * motion.depth + spatial.dot(own.vertical, weight)
        for stretch in _stretches(link, joint, q):
            potential = potential + 0.5 * link.stiffness * (stretch * stretch)
    return kinetic - potential


def spring_forces(link: Link, joint: MovingJoint, q: Sequence[Node], u: Sequence[Node]) -> list[tuple[Node, Node]]:
    """The velocities that the joint's spring works on, and its forces."""
    return [(velocity, link.stiffness * x) for velocity, x in zip(u, _stretches(link, joint, q), strict=False)]


def _stretches(link: Link, joint: MovingJoint, q: Sequence[Node]) -> Sequence[Node]:
    """One for each velocity, or none where there is no spring."""
    absent = not isinstance(link.stiffness, Node) and not link.stiffness
    return [] if absent else joint.stretches(q, link.spring_reference)
