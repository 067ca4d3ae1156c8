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

from ..algebra.spatial import STILL, Triple, combined, plus
from ..algebra.spatial_vectors import REST, Twist
from ..algebra.turns import UNIT, Axes, MatrixTurn, Turn, in_a_row
from .links import LinkState
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
    return _moved(at, tags, UNIT, Frame(STILL, axes, REST, Twist(STILL, up), (), UNIT, turn))


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
    return _moved(at, tags, before, Frame(offset, turn.columns(before), velocity, acceleration, (), before, turn))


def _moved(at: LinkState, tags: Tags, before: Axes, frame: Frame) -> Frame:
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
