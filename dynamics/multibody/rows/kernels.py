"""Kernels: the sweeps of one body on one kind of joint, as graphs over blocks of numbers.

They are traced from the formulas of `sweeps/outward.py`, which every other graph of bodies is made of. A pass of poses
comes first: behind it a body hangs on its parent by a turn and a place, and its joint is what it adds to velocities.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, as_node, building

from ..algebra.spatial import STILL, ZERO, Triple, cross, plus, rotate, scaled
from ..algebra.spatial_vectors import ArticulatedInertia, Twist, Wrench, symmetric, weighted
from ..algebra.turns import NO_TURN, UNIT, MatrixTurn, Turn
from ..joints import JointType
from ..sweeps.links import Link, LinkState, Numbers
from ..sweeps.outward import (
    Motion,
    acceleration_in_space,
    energies as sweep_energies,
    propagate_acceleration,
    propagate_motion,
    wrench,
)
from .blocks import BLOCKS


class Kernel(NamedTuple):
    """A graph of one kind of joint, by blocks: what it reads, writes and adds to."""

    reads: Mapping[str, Sequence[Node]]
    writes: Mapping[str, Sequence[Node]]
    adds: Mapping[str, Sequence[Node]]


def triples(numbers: Sequence[Node]) -> list[Triple]:
    """Numbers three by three."""
    return [(a, b, c) for a, b, c in zip(numbers[::3], numbers[1::3], numbers[2::3], strict=False)]


def flat(*groups: Iterable[Any]) -> list[Node]:
    """The nodes of groups, and of groups of these, end to end."""
    return [node for group in groups for each in group for node in (each if isinstance(each, tuple) else (each,))]


class PosedLink(LinkState):
    """A link on a joint, of which a pose has the turn and the shift: what moves is left."""

    @property
    def turn(self) -> Turn:
        """None."""
        return NO_TURN

    @property
    def shift(self) -> Triple:
        """None."""
        return STILL


class Row:
    """Variables of a row, by blocks, and the link that they are."""

    def __init__(self, joint: JointType) -> None:
        self.blocks: dict[str, list[Node]] = {}
        self.joint = joint.with_pitch(self["numbers"][12]) if joint.pitched else joint  # type: ignore[arg-type]
        self.q = self.block("q", len(joint.coordinates))
        self.u, self.a, self.tau = (self.block(name, len(joint.velocities)) for name in ("u", "a", "tau"))

    def block(self, name: str, count: int) -> list[Node]:
        """Variables of a block."""
        return self.blocks.setdefault(name, cg.variables([f"{name.replace(' ', '_')}{k}" for k in range(count)]))

    def __getitem__(self, name: str) -> list[Node]:
        return self.block(name, BLOCKS[name].length)

    def triples(self, name: str) -> list[Triple]:
        """The numbers of a block, three by three."""
        return triples(self[name])

    def on_link(self, accelerations: Sequence[Node]) -> LinkState:
        """The link on its joint."""
        return LinkState(*self.state(accelerations, self["numbers"]))

    def state(self, accelerations: Sequence[Node] | None = None, pose: Sequence[Node] = ()) -> LinkState:
        """The link on its joint, where the pose has it."""
        pose = pose or self["pose"]
        turn, place = triples(pose[:9]), np.array(pose[9:12], dtype=object)
        first = np.array(self["numbers"][14:17], dtype=object)
        mass, _, _, _, a, b, c, d, e, f = self["numbers"][13:23]
        damping, stiffness, reference, armature = self["numbers"][23:27]
        known = stiffness if self.joint.sprung and self.u else 0.0
        link = Link(turn, place, mass, first, [[a], [b, c], [d, e, f]], damping, known, reference, armature)
        state = self.q or [ZERO], self.u or [ZERO], accelerations or [ZERO] * max(1, len(self.u))  # a weld is at 0
        return PosedLink("", 0, link, self.joint, *state)

    def kernel(self, writes: Mapping[str, Sequence[Node]], adds: Mapping[str, Sequence[Node]] = {}) -> Kernel:
        """The kernel of these results."""
        return Kernel(self.blocks, writes, adds)


def _posed(row: Row) -> list[Node]:
    """Pose of a body against its parent: R of link and joint (rows), and the place of its origin."""
    at = row.on_link(())
    columns = at.turn.columns(MatrixTurn(at.link.turn).columns(UNIT))
    return [*[column[i] for i in range(3) for column in columns], *at.place]


def outward(joint: JointType, *, rest: bool = False) -> Kernel:
    """Motion of a body from its parent's, and the wrench that it takes.  rest: at velocities that do not change."""
    row = Row(joint)
    with building(Builder()):
        pose = _posed(row)
        at = row.state(None if rest else row.a, pose)
        omega, angular, linear = row.triples("carrier")
        before = Motion(omega, STILL, STILL, ZERO)
        motion = propagate_motion(before, at)
        carrier = acceleration_in_space(omega, Twist(angular, linear), ())
        acceleration = propagate_acceleration(carrier, before, motion, at)
        forces = [force for _, force in wrench(acceleration, motion, at)[:6]]
    writes = {"pose": pose, "motion": [*motion.omega, *acceleration.angular, *acceleration.linear], "wrench": forces}
    if rest:
        mass, x, y, z, *inertia = row["numbers"][13:23]
        writes["stiff"] = [*inertia, mass, ZERO, mass, ZERO, ZERO, mass]
        writes["coupling"] = [ZERO, -z, y, z, ZERO, -x, -y, x, ZERO]
    return row.kernel(writes)


def inward(joint: JointType) -> Kernel:
    """Forces of a joint and the wrench that the parent carries, of all that the body carries."""
    row = Row(joint)
    at, (force, torque) = row.state(row.a), row.triples("wrench")
    with building(Builder()):
        tau = [
            twist.power(Wrench(torque, force)) + at.link.armature * a
            for twist, a in zip(at.columns, row.a, strict=True)
        ]
        tau = [each + at.link.damping * u for each, u in zip(tau, row.u, strict=True)]
        for k, (_, spring) in enumerate(at.springs()):
            tau[k] = tau[k] + spring
    return row.kernel({"tau": tau}, {"carried": _carried(at, Wrench(torque, force))})


def _carried(at: LinkState, own: Wrench) -> list[Node]:
    """The wrench about the parent's origin, in its axes."""
    torque, force = [rotate(at.link.turn, each) for each in own]
    return flat(force, plus(torque, cross(at.link.place, force)))


def eliminate(joint: JointType) -> Kernel:
    """Joint accelerations in terms of that of the parent, and what the parent then carries: wrench and inertia."""
    row = Row(joint)
    at, (stiff, coupling) = row.state(), (row["stiff"], row.triples("coupling"))
    with building(Builder()):
        lower = [[[each[0]], each[1:3], each[3:6]] for each in (stiff[:6], stiff[6:])]
        inertia = ArticulatedInertia(symmetric(lower[0]), (coupling[0], coupling[1], coupling[2]), symmetric(lower[1]))
        force, torque = row.triples("wrench")
        carried, gains, rests = Wrench(torque, force), list[Wrench](), list[Node]()
        applied = [tau - at.link.damping * u for tau, u in zip(row.tau, row.u, strict=True)]
        springs = [force for _, force in at.springs()]
        for k, twist in reversed([*enumerate(at.columns)]):
            taken = inertia.wrench(twist)
            pivot = twist.power(taken) + at.link.armature
            rest = applied[k] - (springs[k] if springs else ZERO) - twist.power(carried)
            gain, rest = weighted(taken, 1.0 / pivot), rest / pivot
            inertia, carried = inertia.without(taken, gain), carried.plus(weighted(taken, rest))
            gains.append(gain)
            rests.append(rest)
        seen, moved = inertia.seen(at.link.turn, at.link.place), _carried(at, carried)
    lower_of = [[matrix[i][j] for i in range(3) for j in range(i + 1)] for matrix in (seen.angular, seen.linear)]
    adds = {
        "carried": moved,
        "stiff in": [*lower_of[0], *lower_of[1]],
        "coupling in": [each for of_row in seen.coupling for each in of_row],
    }
    gain_numbers = [number for gain in reversed(gains) for number in (*gain.torque, *gain.force)]
    return row.kernel({"gain": [*gain_numbers, *reversed(rests)]}, adds)


def accelerate(joint: JointType) -> Kernel:
    """Accelerations of a joint, and of its body, from that of the parent."""
    row, n = Row(joint), len(joint.velocities)
    at, gain = row.state(), row.block("gain", 7 * n)
    with building(Builder()):
        turn, place = at.link.turn, at.link.place
        angular, linear = row.triples("base")
        moved = Twist(angular, linear).at(place)
        relative = Twist(*[MatrixTurn(turn).into(each) for each in moved])
        rates = []
        for k, twist in enumerate(at.columns):
            a, b, c, d, e, f = gain[6 * k : 6 * k + 6]
            rates.append(gain[6 * n + k] - relative.power(Wrench((a, b, c), (d, e, f))))
            relative = relative.plus(twist.scaled(rates[-1]))
    return row.kernel({"a": rates, "relative": [*relative.angular, *relative.linear]})


def lifted(joint: JointType) -> Kernel:
    """The vertical in the axes of a body, and what its weightless part adds to the wrench that it takes."""
    row = Row(joint)
    turn, lift = [row["pose"][k : k + 3] for k in (0, 3, 6)], row["numbers"][27:]
    with building(Builder()):
        up = MatrixTurn(turn).into(row.triples("up")[0])
        force, torque = scaled(-lift[0], up), cross((-lift[1], -lift[2], -lift[3]), up)
    return row.kernel({"vertical": up}, {"wrench": [*force, *torque]})


def energies(joint: JointType) -> Kernel:
    """Kinetic and potential energy of a body, from its parent's motion."""
    row = Row(joint)
    omega, velocity, vertical = triples(row["height in"])
    with building(Builder()):
        at = row.state(None, _posed(row))
        motion = propagate_motion(Motion(omega, velocity, vertical, row["height in"][9]), at)
        lift = Numbers(row["numbers"][27], np.array(row["numbers"][28:]), np.zeros((3, 3)))
        link = replace(at.link, lift=lift)
        found = sweep_energies(motion, at._replace(link=link))
    return row.kernel({"height": flat(*motion[:3], [motion.depth])}, {"energy": found})


def coordinate_rates(joint: JointType) -> Kernel:
    """Rates of the coordinates."""
    row = Row(joint)
    with building(Builder()):
        return row.kernel({"rate": [as_node(each) for each in joint.rate(row.q, row.u)]})
