"""Forward kinematics: where a point of a body is in the world, and how it moves, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array

from ..algebra import spatial
from ..algebra.spatial import STILL, Triple
from ..body import Body
from ..joint_coordinates import parts
from ..joints import JointType
from .kinematic_tree import Carrier
from .links import Link, axes_of
from .outward import joint_translation


class Step(NamedTuple):
    """One joint on the way from a body to the world: the link that it carries, and its coordinates."""

    link: Link
    joint: JointType
    q: Sequence[Node]
    u: Sequence[Node]


class PointMotion(NamedTuple):
    """How a point fixed to a body moves, in the world's axes."""

    position: Triple
    velocity: Triple
    omega: Triple  # angular velocity of the body


@dataclass(frozen=True, eq=False)
class KinematicChain:
    """The joints between a body's frame and the world's."""

    position: Array  # (3,) of the frame in that of the first step's link
    orientation: Array  # (3, 3)
    steps: tuple[Step, ...]

    def direction(self, vector: Triple) -> Triple:
        """A vector in the body's axes, in the world's."""
        vector = spatial.rotate_transpose(self.orientation.T.tolist(), vector)
        for step in self.steps:
            vector = _in_parent_axes(step, vector)
        return vector

    def motion(self, at: ArrayLike) -> PointMotion:
        """How the point `at`, (3,) in the body's frame, moves: summed from the body to the world."""
        point = spatial.constant(spatial.placed(self.position, self.orientation, at))
        velocity, omega = STILL, STILL
        for step in self.steps:
            place = joint_translation(step.link, step.joint, step.q)
            turning, sliding = step.joint.velocity(step.q, step.u)
            (u, v, w), (a, b, c), (x, y, z) = velocity, turning, point
            velocity = spatial.plus((u + b * z - c * y, v + c * x - a * z, w + a * y - b * x), sliding)
            omega = spatial.plus(omega, turning)
            point = spatial.plus(place, _in_parent_axes(step, point))
            velocity, omega = _in_parent_axes(step, velocity), _in_parent_axes(step, omega)
        return PointMotion(point, velocity, omega)

    def graph(self, at: ArrayLike, q: Sequence[Node], qd: Sequence[Node]) -> Graph:
        """The motion of a point and the body's axes: outputs x, y, z, vx, vy, vz, wx, wy, wz, R_0_0, R_0_1, .. ."""
        point = self.motion(at)
        columns = [self.direction(spatial.constant(each)) for each in np.eye(3)]
        outputs = dict(zip(("x", "y", "z"), point.position, strict=True))
        outputs |= dict(zip(("vx", "vy", "vz"), point.velocity, strict=True))
        outputs |= dict(zip(("wx", "wy", "wz"), point.omega, strict=True))
        outputs |= {f"R_{i}_{j}": columns[j][i] for i in range(3) for j in range(3)}
        return cg.simplify(Graph([*q, *qd], outputs))


def _in_parent_axes(step: Step, vector: Triple) -> Triple:
    """A vector in the axes of a step's link, in those of the next."""
    return spatial.rotate(step.link.turn, step.joint.turn(step.q).out(vector))


def kinematic_chain(
    carrier: Carrier, moving: Sequence[Body], links: Sequence[Link], q: Sequence[Node], qd: Sequence[Node]
) -> KinematicChain:
    """The chain from a body that `carrier` carries; links, q and qd are those of the moving bodies."""
    index: Mapping[str, int] = {body.name: i for i, body in enumerate(moving)}
    axes = axes_of(moving[index[carrier.name]]) if carrier.name in index else np.eye(3)
    steps: list[Step] = []
    name, states = carrier.name, parts(moving, q, qd)
    while name in index:
        i = index[name]
        steps.append(Step(links[i], moving[i].joint.type, *states[i]))
        name = moving[i].parent
    position = spatial.product(axes.T, carrier.position)
    return KinematicChain(position, spatial.snapped(axes.T @ carrier.orientation), tuple(steps))
