"""Whether a type of joint fits together: what it says of places, velocities, accelerations and momenta."""

from __future__ import annotations

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, memo, tangents

from ...systems.kinematics import Kinematics
from ...systems.quasi_velocities import QuasiVelocities
from ..algebra.spatial import ZERO, cross
from ..algebra.turns import UNIT
from .joint_type import JointType

TOLERANCE = 1e-9  # of the largest of its kind: rounding


@memo(64)
def contradiction(joint: JointType) -> str:
    """A sentence on a type of joint that contradicts itself, at any state; "" of one that does not."""
    q, u, v = (cg.variables([f"{name}{k}" for k in range(len(of))]) for name, of in (
        ("q", joint.coordinates), ("u", joint.velocities), ("v", joint.velocities)))  # fmt: skip
    build = Builder()
    with building(build):
        turn, rate, velocity = joint.turn(q), list(joint.rate(q, u)), joint.velocity(q, u)
        both = joint.velocity(q, [a + b for a, b in zip(u, v, strict=True)])
        apart = velocity.plus(joint.velocity(q, v))
        axes = turn.columns(UNIT)
        placed = [*[node for axis in axes for node in axis], *joint.translation(q)]
        turned = [node for axis in UNIT for node in turn.out(cross(velocity.angular, axis))]  # R (w x e)
        moved = [*turned, *turn.out(velocity.linear)]
        given, derived = joint.acceleration(q, u), JointType.acceleration(joint, q, u)
    dots = tangents(dict(zip(q, rate, strict=True)), placed, build)
    carried = cross(velocity.angular, velocity.linear)  # beside which accelerations may be rounding
    rates = [dots.get(node, ZERO) for node in placed]
    claims: list[tuple[str, list[Node], list[Node]]] = [
        ("velocity must be the rate of its turn and translation, along the rates of its coordinates", rates, moved),
        ("velocity must be linear in u", [*both.angular, *both.linear], [*apart.angular, *apart.linear]),
        (
            "acceleration must be the rate of its velocity at constant u",
            [*given.angular, *given.linear, *carried],
            [*derived.angular, *derived.linear, *carried],
        ),
    ]
    neutral, sizes = np.array(joint.neutral), np.sin(np.arange(1.0, 1.0 + len(q) + 2 * len(u)) ** 2)  # any numbers
    at = _values(list(joint.normalized(q)), q, neutral + 0.5 * sizes[: len(q)])
    state = np.concatenate([at, sizes[len(q) :]])
    for text, first, second in claims:
        a, b = np.split(_values([*first, *second], [*q, *u, *v], state), 2)
        if not np.abs(a - b).max() <= TOLERANCE * max(np.abs(a).max(), np.abs(b).max()):
            return f"its {text}"
    stands, away = np.array([*np.eye(3).ravel(), 0.0, 0.0, 0.0]), _values(placed, q, at)
    off = np.abs(_values(placed, q, neutral) - stands)
    if not (off[:9].max() <= TOLERANCE and off[9:].max() <= TOLERANCE * np.abs(away[9:]).max()):
        return "its turn and translation must be none at neutral coordinates"
    if joint.turns_with_body and not JointType.turns_with_body.fget(joint):  # type: ignore[attr-defined]
        return "its velocities must be along axes that turn with the body, as it says, at all coordinates"
    return "" if rate == u else _wrong_structure(joint)


def _wrong_structure(joint: JointType) -> str:
    """The sentence of `Kinematics` on rates and structure, if there is one."""
    names = [f"u{k}" for k in range(len(joint.velocities))]
    quasi = QuasiVelocities(names, joint.rate, joint.structure, joint.neutral, joint.normalized, joint.groups)
    try:
        Kinematics([f"q{k}" for k in range(len(joint.coordinates))], quasi).require_consistent()
    except ValueError as error:
        return str(error)
    return ""


def _values(nodes: list[Node], inputs: list[Node], at: Array) -> Array:
    """Values of nodes, (len(nodes),), at those of the inputs."""
    graph = Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)})
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, at.tolist(), strict=True))).values()), dtype=float)
