"""The motion of a tree of bodies in one set of axes, and its columns: what a joint's freedoms do to it.

A joint moves its body in one stage, or in two where some of its velocities are in axes that do not turn with the body.
Of a stage with the columns S, on what moves with the velocity v and the acceleration a:

    psi' = v x S,  psi'' = a x S + v x psi',   v + S u,   a + psi' u + S udot

A small displacement along S turns and moves all that is carried, and changes in the axes that are carried along the
velocity by psi' and the acceleration by psi''; a change of u by S and by psi' + S', S' = psi' + (S u) x S. (S. Singh,
R. P. Russell, P. M. Wensing, "Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra",
IEEE Robotics and Automation Letters 7(2), 2022.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import as_node

from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Matrix, Triple
from ..algebra.spatial_vectors import REST, Twist
from ..joints import AxialJoint, MovingJoint, SpatialJoint
from .composite_motion import Entries, combined
from .inertial_numbers import Link
from .newton_euler import KINETIC

Tags = Sequence[str]
ONE = cg.constant(1.0)
UNIT: Entries = tuple([spatial.constant(row) for row in np.eye(3)])  # type: ignore[assignment]


class Column(NamedTuple):
    """One freedom of a joint.  velocity: its place among all.  stage: of its joint."""

    velocity: int
    stage: int
    motion: Twist  # S
    carried: Twist  # psi'
    carried_rate: Twist  # psi''
    rate: Twist  # psi' + S'


class Frame(NamedTuple):
    """How a body is placed and moves, by its origin.

    offset: from the parent's origin.  before, angle: the axes are `before` turned about their z by that angle, of a
    tree in a plane the sum of all angles.
    """

    offset: Triple
    axes: Entries  # columns
    velocity: Twist
    acceleration: Twist  # in space, against free fall
    columns: Sequence[Column]
    before: Entries
    angle: Node


class Freedoms(NamedTuple):
    """The joint of a body with its state: the index of its first velocity, coordinates, velocities, accelerations.

    tags: the energies that accelerations come of.
    """

    start: int
    q: Sequence[Node]
    u: Sequence[Node]
    u_dot: Sequence[Node]
    tags: Tags


def root_frame(up: Triple, link: Link, joint: MovingJoint, state: Freedoms, *, in_plane: bool) -> Frame:
    """Of a body on the world.  up: the acceleration against free fall.  in_plane: so move all that it carries.

    All that a tree needs is alike in any axes, so they are those that this body has just now, or, of a tree in a plane
    and of velocities along them, those of its joint.
    """
    angle = joint.angle(state.q[0]) if isinstance(joint, AxialJoint) else ZERO
    with cg.tag(*state.tags):
        up = spatial.rotate_transpose(link.turn, up)
    if isinstance(joint, SpatialJoint):
        turn = joint.rotation(state.q)
        turned = _transposed(turn)
        if not joint.sliding:
            turned = UNIT
            with cg.tag(*state.tags):
                up = spatial.rotate_transpose(turn, up)
    elif in_plane:
        turned = _turned(UNIT, angle)
    else:
        turned = UNIT
        with cg.tag(*state.tags):
            up = spatial.rotate_about_z(cg.cos(angle), cg.sin(angle), up)  # of a slide by 0
    return _moved(joint, state, UNIT, turned, Frame(STILL, turned, REST, Twist(STILL, up), (), UNIT, angle))


def next_frame(parent: Frame, link: Link, joint: MovingJoint, state: Freedoms, *, in_plane: bool) -> Frame:
    """Of a body that another carries."""
    before = _product(parent.axes, link.turn)
    offset, angle = combined(parent.axes, link.place), ZERO
    if isinstance(joint, SpatialJoint):
        offset = spatial.plus(offset, combined(before, joint.translation(state.q)))
        axes = _product(before, joint.rotation(state.q))
    else:
        offset = spatial.plus(offset, spatial.scaled(joint.shift(state.q[0]), before[2]))
        angle = joint.angle(state.q[0])
        if in_plane:
            before, angle = _product(parent.before, link.turn), link.turn[2][2] * parent.angle + angle
        axes = _turned(before, angle)
    with cg.tag(KINETIC):
        velocity = parent.velocity.at(offset)
    with cg.tag(*state.tags):
        acceleration = parent.acceleration.at(offset)
    return _moved(joint, state, before, axes, Frame(offset, axes, velocity, acceleration, (), before, angle))


def _moved(joint: MovingJoint, state: Freedoms, before: Entries, axes: Entries, frame: Frame) -> Frame:
    """The frame with the motion of the joint, as long as it has that of the body that carries it.

    before: the axes of the joint.
    """
    if isinstance(joint, AxialJoint):
        turn, shift = joint.angle(ONE), joint.shift(ONE)
        return _stage(frame, 0, [Twist(spatial.scaled(turn, axes[2]), spatial.scaled(shift, axes[2]))], state)
    sliding = joint.sliding
    if sliding:
        frame = _stage(frame, 0, [Twist(STILL, axis) for axis in before[:sliding]], state)
    units = [[ONE if i == k else ZERO for i in range(len(state.u))] for k in range(sliding, len(state.u))]
    parts = [(joint.angular_velocity(state.q, u), joint.linear_velocity(state.q, u)) for u in units]
    return _stage(frame, sliding, [Twist(combined(axes, w), combined(axes, v)) for w, v in parts], state)


def _stage(frame: Frame, first: int, motions: Sequence[Twist], state: Freedoms) -> Frame:
    """The frame with the motion of the joint's freedoms from `first` on."""
    velocity, acceleration = frame.velocity, frame.acceleration
    along, columns = REST, []
    with cg.tag(KINETIC):
        carried = [velocity.cross(motion) for motion in motions]
        for k, motion in enumerate(motions, first):
            along = along.plus(motion.scaled(state.u[k]))
        rates = [slow.scaled(2.0) for slow in carried]
        if len(motions) > 1:
            rates = [rate.plus(along.cross(motion)) for rate, motion in zip(rates, motions, strict=True)]
    with cg.tag(*state.tags):
        for k, (motion, slow, rate) in enumerate(zip(motions, carried, rates, strict=True), first):
            twice = frame.acceleration.cross(motion).plus(velocity.cross(slow))
            columns.append(Column(state.start + k, first, motion, slow, twice, rate))
            change = slow.scaled(state.u[k]).plus(motion.scaled(state.u_dot[k]))
            acceleration = acceleration.plus(change)
    velocity = velocity.plus(along)
    return frame._replace(velocity=velocity, acceleration=acceleration, columns=[*frame.columns, *columns])


def _turned(columns: Entries, angle: Node) -> Entries:
    """The columns of A R_z."""
    if angle.value == 0.0:
        return columns
    c, s = cg.cos(angle), cg.sin(angle)
    x, y, z = columns
    along = [c * a + s * b for a, b in zip(x, y, strict=True)]
    across = [c * b - s * a for a, b in zip(x, y, strict=True)]
    return (along[0], along[1], along[2]), (across[0], across[1], across[2]), z


def _product(columns: Entries, matrix: Matrix) -> Entries:
    """The columns of A B, of those of A and the rows of B."""
    x, y, z = (combined(columns, (as_node(a), as_node(b), as_node(c))) for a, b, c in zip(*matrix, strict=True))
    return x, y, z


def _transposed(matrix: Matrix) -> Entries:
    return _product(UNIT, matrix)
