"""Forces and torques on bodies, and the generalized forces that they are."""

from __future__ import annotations

import math
import numbers
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, cotangents, topological

from . import spatial
from .body import Body, MechanismError, vector
from .kinematic_tree import Carrier
from .spatial import STILL, ZERO, Array, Triple

FORCE = "force"  # tag
FRAMES = ("world", "body")
Component = Node | float | str


@dataclass(frozen=True, eq=False)
class Force:
    """A force [N] on a body at a point, and a torque [N m] on the body, from outside the mechanism.

    value, torque: three components each, in the axes of `frame`, "world" or "body" (they then turn with the body).
        A component is a number, a parameter's name, or a node over q0.., qd0.., t and parameters.
    at: (3,) [m], the point, in the body's frame.
    """

    body: str
    value: Sequence[Component] = (0.0, 0.0, 0.0)
    at: ArrayLike = (0.0, 0.0, 0.0)
    frame: str = "world"
    torque: Sequence[Component] = (0.0, 0.0, 0.0)

    @property
    def components(self) -> tuple[Component, ...]:
        """The six components, force first."""
        return (*self.value, *self.torque)

    @property
    def names(self) -> set[str]:
        """Names of the parameters and variables that it uses."""
        variables = topological([each for each in self.components if isinstance(each, Node)])
        named = {str(node.name) for node in variables if node.name}
        return named | {each for each in self.components if isinstance(each, str)}


def check(force: Force, bodies: Container[str]) -> None:
    """Raises MechanismError unless the force is three and three components at a point of one of `bodies`."""
    if not isinstance(force, Force):
        raise MechanismError(f"forces must be of the type Force, got {type(force).__name__}: {force!r:.60}")
    if not isinstance(force.body, str) or force.body not in bodies:
        raise MechanismError(f"there is a force on the unknown body {force.body!r:.80}")
    where = f"the force on body {force.body!r}"
    vector(f"{where}: at", force.at)
    if force.frame not in FRAMES:
        raise MechanismError(f"{where}: frame must be one of {', '.join(FRAMES)}, got {force.frame!r}")
    for what, given in (("value", force.value), ("torque", force.torque)):
        if isinstance(given, str | Node) or not isinstance(given, Sequence | np.ndarray) or len(given) != 3:
            raise MechanismError(f"{where}: {what} must have three components, got {given!r:.80}")
        for each in given:
            finite = isinstance(each, numbers.Real) and math.isfinite(each)
            if not (finite or isinstance(each, str | Node)):
                raise MechanismError(
                    f"{where}: a component of {what} must be a finite number, a parameter's name or a node, "
                    f"got {each!r:.60}"
                )


class Step(NamedTuple):
    """One joint on the way from a body to the world, in axes whose z is the joint's axis."""

    kind: str
    turn: Array  # these axes in those of the next step, as columns, at q = 0
    place: Triple  # of their origin in those, at q = 0
    q: Node
    qd: Node


class PointMotion(NamedTuple):
    """How a point fixed to a body moves, in the world's axes."""

    position: Triple
    velocity: Triple
    omega: Triple  # angular velocity of the body


@dataclass(frozen=True, eq=False)
class Reach:
    """The way from a body's frame to the world's."""

    position: Array  # (3,) of the frame in that of the first step
    orientation: Array  # (3, 3)
    steps: tuple[Step, ...]

    def direction(self, given: Triple) -> Triple:
        """A vector in the body's axes, in the world's."""
        given = spatial.turned(self.orientation.T.tolist(), given)
        for step in self.steps:
            given = _passed_on(step, given)
        return given

    def motion(self, at: ArrayLike) -> PointMotion:
        """How the point `at`, (3,) in the body's frame, moves: summed from the body to the world."""
        point = spatial.constant(spatial.snapped(self.position + self.orientation @ np.asarray(at)))
        velocity, omega = STILL, STILL
        for step in self.steps:
            (x, y, z), (u, v, w), qd = point, velocity, step.qd
            if step.kind == "prismatic":
                point, velocity = (x, y, z + step.q), (u, v, w + qd)
            else:
                velocity, omega = (u - qd * y, v + qd * x, w), (omega[0], omega[1], omega[2] + qd)
            point = spatial.plus(step.place, _passed_on(step, point))
            velocity, omega = _passed_on(step, velocity), _passed_on(step, omega)
        return PointMotion(point, velocity, omega)


def _passed_on(step: Step, given: Triple) -> Triple:
    """A vector in the axes of a step, in those of the next."""
    if step.kind == "revolute":
        given = spatial.turned_about_z(cg.cos(step.q), -cg.sin(step.q), given)
    return spatial.turned(step.turn.T.tolist(), given)


def reach(carrier: Carrier, moving: Mapping[str, Body], q: Mapping[str, Node], qd: Mapping[str, Node]) -> Reach:
    """The way to the world from a body that `carrier` carries; q and qd by the name of the moving body."""
    steps: list[Step] = []
    body = moving.get(carrier.name)
    axes = first = spatial.to_z(np.asarray(body.joint.axis)) if body else np.eye(3)
    while body:
        parent = moving.get(body.parent)
        outer = spatial.to_z(np.asarray(parent.joint.axis)) if parent else np.eye(3)
        turn, place = spatial.hung(outer, body.joint.orientation, body.joint.position, axes)
        steps.append(Step(body.joint.kind, turn, place, q[body.name], qd[body.name]))
        body, axes = parent, outer
    return Reach(first.T @ carrier.position, spatial.snapped(first.T @ carrier.orientation), tuple(steps))


def generalized(
    forces: Sequence[tuple[Force, Reach]], qd: Sequence[Node], parameters: Mapping[str, Node]
) -> list[Node]:
    """Q = J^T f + J_w^T torque of all forces together, one node for each of qd.

    Virtual power is f . v + torque . w, v and w linear in qd, so one reverse sweep from v and w, seeded with the force
    and the torque, gives its slope along qd. What the force itself depends on is not differentiated.
    """
    build = Builder()
    total = [ZERO] * len(qd)
    for force, way in forces:
        with building(build), cg.tag(force.body, FORCE):
            value, torque = (_nodes(each, parameters) for each in (force.value, force.torque))
            if force.frame == "body":
                value, torque = way.direction(value), way.direction(torque)
            motion = way.motion(force.at)
            seeds: dict[Node, Node] = {}
            for rate, bar in zip((*motion.velocity, *motion.omega), (*value, *torque), strict=True):
                seeds[rate] = seeds[rate] + bar if rate in seeds else bar  # two rates may be one node
            shares = cotangents(seeds, qd, build)
            total = [sum_ + share for sum_, share in zip(total, shares, strict=True)]
    return total


def _nodes(components: Sequence[Component], parameters: Mapping[str, Node]) -> Triple:
    x, y, z = (
        parameters[each] if isinstance(each, str) else each if isinstance(each, Node) else cg.constant(float(each))
        for each in components
    )
    return x, y, z
