"""Kernels of derivatives: the closed form of `sweeps/torque_derivatives.py`, body by body and pair by pair of freedoms.

All is in the axes of the world, and about the origin of the body that it is of; a pair moves the reaction of one of its
freedoms to the origin of the other's body.
"""

from __future__ import annotations

from collections.abc import Sequence

from cgraph import Node
from cgraph.extend import Builder, building

from ...systems.body_terms import TorqueDerivatives
from ..algebra.spatial import ZERO, Triple, combined, plus
from ..algebra.spatial_vectors import REST, Inertia, Twist, Wrench, symmetric
from ..algebra.turns import MatrixTurn
from ..joints import JointType
from ..sweeps.links import LinkState
from ..sweeps.torque_derivatives import (
    Column,
    Frame,
    MovingInertia,
    Reaction,
    add_spring,
    enter,
    enter_both,
    moved_frame,
    moving_body,
    reaction_of,
)
from .blocks import FREEDOM
from .kernels import Kernel, Row, flat, triples


def located(joint: JointType) -> Kernel:
    """Place of a body, from its parent's."""
    row = Row(joint)
    with building(Builder()):
        return row.kernel({"place": _place(row, row.on_link(row.a))[0]})


def placed(joint: JointType) -> Kernel:
    """Place and motion of a body, the columns of its joint, and the sums over its mass, from its parent's."""
    row = Row(joint)
    at = row.on_link(row.a)
    w, v, alpha, a = triples(row["moving in"])
    with building(Builder()):
        place, frame = _place(row, at)
        frame = frame._replace(velocity=Twist(w, v).at(frame.offset), acceleration=Twist(alpha, a).at(frame.offset))
        frame = moved_frame(at, (), frame.before, frame)
        mass = moving_body(at.link, frame.axes, frame.velocity, frame.acceleration, ())
        columns = [number for column in frame.columns for number in flat(*column[2:])]
    moving = flat(frame.velocity, frame.acceleration)
    return row.kernel({"place": place, "moving": moving, "column": columns, "mass": _numbers(mass)})


def _place(row: Row, at: LinkState) -> tuple[list[Node], Frame]:
    """Place of a body, and its frame at rest."""
    x, y, z, origin, _ = triples(row["place in"])
    before = MatrixTurn(at.link.turn).columns((x, y, z))
    offset = plus(combined((x, y, z), at.link.place), combined(before, at.shift))
    axes = at.turn.columns(before)
    return flat(axes, plus(origin, offset), offset), Frame(offset, axes, REST, REST, (), before, at.turn)


def reactions(joint: JointType) -> Kernel:
    """Torques of a joint, reactions of its freedoms and their own entries; what the parent carries of all this."""
    row, n = Row(joint), len(joint.velocities)
    at, build = row.on_link(row.a), Builder()
    columns = [_column(joint, k, row.block("column", FREEDOM * n)[FREEDOM * k :]) for k in range(n)]
    *_, origin, offset = triples(row["place"])
    own = TorqueDerivatives([ZERO] * n, *[[[ZERO] * n for _ in range(n)] for _ in range(3)])
    with building(build):
        mass = _moving_inertia(row["mass"])
        found = [reaction_of(column, mass, ()) for column in columns]
        for k, (column, reaction) in enumerate(zip(columns, found, strict=True)):
            own.torques[k] = column.motion.power(mass.wrench) + at.link.armature * row.a[k] + at.link.damping * row.u[k]
            for outer in columns:
                enter(own, outer, column, reaction)
        add_spring(own, at, build)
        for k in range(n):
            own.mass[k][k] = own.mass[k][k] + at.link.armature
            own.by_qd[k][k] = own.by_qd[k][k] + at.link.damping
        carried = _numbers(mass.about(offset))
    entries = {f"entries {i}": flat(*zip(own.by_q[i], own.by_qd[i], own.mass[i], strict=True)) for i in range(n)}
    numbers = [number for each in found for number in flat(*each[:3], each.couple, origin)]
    return row.kernel({"tau": own.torques, "reaction": numbers, **entries}, {"mass in": carried})


def pairs(joint: JointType) -> Kernel:
    """The entries of a freedom with one between it and the world."""
    row = Row(joint)
    outer = _column(row.joint, 0, row.block("outer column", FREEDOM))
    numbers, origin = row.block("inner reaction", FREEDOM), triples(row["outer place"])[3]
    groups = triples(numbers)
    both = TorqueDerivatives([], *[[[ZERO] * 2 for _ in range(2)] for _ in range(3)])
    with building(Builder()):
        wrenches = [Wrench(*groups[k : k + 2]) for k in (0, 2, 4)]
        offset = plus(groups[7], (-origin[0], -origin[1], -origin[2]))
        reaction = Reaction(wrenches[0], wrenches[1], wrenches[2], groups[6], ()).about(offset)
        enter_both(both, outer, outer._replace(velocity=1), reaction)
    entry = [[of[i][j] for of in (both.by_q, both.by_qd, both.mass)] for i, j in ((0, 1), (1, 0))]
    return row.kernel({"outer inner": entry[0], "inner outer": entry[1]})


def _column(joint: JointType, k: int, numbers: Sequence[Node]) -> Column:
    """The column of a freedom, at its place in the joint."""
    groups = triples(numbers[:FREEDOM])
    stage = 0 if k < joint.sliding else joint.sliding
    return Column(k, stage, *[Twist(groups[i], groups[i + 1]) for i in (0, 2, 4, 6)])


def _numbers(mass: MovingInertia) -> list[Node]:
    """The numbers of what moves, 28."""
    second = [mass.inertia.second[i][j] for i in range(3) for j in range(i + 1)]
    rest = flat(mass.momentum, *mass.velocity_moment, *mass.wrench)
    return [mass.inertia.mass, *mass.inertia.moment, *second, *rest]


def _moving_inertia(numbers: Sequence[Node]) -> MovingInertia:
    """What moves of these numbers."""
    mass, *others = numbers
    moment, momentum, *rest = triples([*others[:3], *others[9:]])
    a, b, c, d, e, f = others[3:9]
    inertia = Inertia(mass, moment, symmetric([[a], [b, c], [d, e, f]]))
    velocity_moment: tuple[Triple, Triple, Triple] = (rest[0], rest[1], rest[2])
    return MovingInertia(inertia, momentum, velocity_moment, Wrench(rest[3], rest[4]))
