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

import cgraph as cg
from cgraph import Node

from ..algebra import spatial
from ..algebra.spatial import STILL, Triple, combined, plus
from ..algebra.spatial_vectors import REST, Twist
from ..algebra.turns import UNIT, Axes, MatrixTurn, Turn, in_a_row
from ..joints import JointType
from .links import Link
from .outward import KINETIC

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
    """How a body is placed and moves, by its origin.

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


class Freedoms(NamedTuple):
    """The joint of a body with its state: the index of its first velocity, coordinates, velocities, accelerations.

    tags: the energies that accelerations come of.
    """

    start: int
    q: Sequence[Node]
    u: Sequence[Node]
    u_dot: Sequence[Node]
    tags: Tags


def root_frame(up: Triple, link: Link, joint: JointType, state: Freedoms, *, in_plane: bool) -> Frame:
    """Of a body on the world.  up: the acceleration against free fall.  in_plane: so move all that it carries.

    All that a tree needs is alike in any axes, so they are those that this body has just now, or, of a tree in a plane
    and of velocities along them, those of its joint.
    """
    turn = joint.turn(state.q)
    with cg.tag(*state.tags):
        up = spatial.rotate_transpose(link.turn, up)
    axes = UNIT
    if in_plane or joint.sliding:
        axes = turn.columns(UNIT)
    else:
        with cg.tag(*state.tags):
            up = turn.into(up)
    return _moved(joint, state, UNIT, Frame(STILL, axes, REST, Twist(STILL, up), (), UNIT, turn))


def next_frame(parent: Frame, link: Link, joint: JointType, state: Freedoms, *, in_plane: bool) -> Frame:
    """Of a body that another carries."""
    before, turn = MatrixTurn(link.turn).columns(parent.axes), joint.turn(state.q)
    offset = plus(combined(parent.axes, link.place), combined(before, joint.translation(state.q)))
    if in_plane:
        before, turn = MatrixTurn(link.turn).columns(parent.before), in_a_row(parent.turn, turn, link.turn[2][2])
    with cg.tag(KINETIC):
        velocity = parent.velocity.at(offset)
    with cg.tag(*state.tags):
        acceleration = parent.acceleration.at(offset)
    return _moved(joint, state, before, Frame(offset, turn.columns(before), velocity, acceleration, (), before, turn))


def _moved(joint: JointType, state: Freedoms, before: Axes, frame: Frame) -> Frame:
    """The frame with the motion of the joint, as long as it has that of the body that carries it.

    before: the axes of the joint.
    """
    if joint.sliding:
        frame = _stage(frame, 0, [Twist(STILL, axis) for axis in before[: joint.sliding]], state)
    own = joint.columns(state.q)[joint.sliding :]
    turned = [Twist(combined(frame.axes, w), combined(frame.axes, v)) for w, v in own]
    return _stage(frame, joint.sliding, turned, state)


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
