"""Whether a type of joint fits together: what it says of places, velocities, accelerations and momenta."""

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array, memo
from cgraph.extend import Builder, building

from ...systems.kinematics import Kinematics, changes, numbered_graph
from ...systems.quasi_velocities import QuasiVelocities
from ..algebra.spatial import cross
from ..algebra.turns import UNIT
from .joint_type import JointType

TOLERANCE = 1e-9  # of the largest of its kind
RATE_ROUNDING = 1e-13  # of what it is made of, where that cancels
HALVINGS = 60  # of the way from neutral coordinates, until all is finite


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
    rates = changes(dict(zip(q, rate, strict=True)), placed, build)
    claims: list[tuple[str, list[Node], list[Node]]] = [
        ("velocity must be the rate of its turn and translation, along the rates of its coordinates", rates, moved),
        ("velocity must be linear in u", [*both.angular, *both.linear], [*apart.angular, *apart.linear]),
        (
            "acceleration must be the rate of its velocity at constant u",
            [*given.angular, *given.linear],
            [*derived.angular, *derived.linear],
        ),
    ]
    sides = [node for _, first, second in claims for node in (*first, *second)]
    neutral = np.array(joint.neutral)
    away, values = _sample(joint, [*q, *u, *v], [*velocity.angular, *velocity.linear, *placed, *rate, *sides])
    if not np.isfinite(values).all():
        return "its turn, translation, velocity and rates must be finite about neutral coordinates"
    angular, linear, _, shifted, rated, values = np.split(values, np.cumsum([3, 3, 9, 3, len(q)]))
    hurry = max(np.abs(rated / away).max(), np.abs(angular).max())  # 1/s: how fast anything changes
    length = max(np.abs(shifted).max(), np.abs(linear).max() / hurry)  # m
    for power, (text, first, _) in zip((1, 1, 2), claims, strict=True):
        (a, b), values = np.split(values[: 2 * len(first)], 2), values[2 * len(first) :]
        for one, other, size in ((a[:-3], b[:-3], 1.0), (a[-3:], b[-3:], length)):  # angles and lengths: two units
            largest = max(np.abs(one).max(), np.abs(other).max())
            if not np.abs(one - other).max() <= TOLERANCE * largest + RATE_ROUNDING * size * hurry**power:
                return f"its {text}"
    off = np.abs(_values(placed, q, neutral) - np.array([*np.eye(3).ravel(), 0.0, 0.0, 0.0]))
    if not (off[:9].max() <= TOLERANCE and off[9:].max() <= TOLERANCE * np.abs(shifted).max()):
        return "its turn and translation must be none at neutral coordinates"
    if joint.turns_with_body and not JointType.turns_with_body.fget(joint):  # type: ignore[attr-defined]
        return "its velocities must be along axes that turn with the body, as it says, at all coordinates"
    return "" if rate == u else _wrong_structure(joint)


def _sample(joint: JointType, inputs: list[Node], nodes: list[Node]) -> tuple[Array, Array]:
    """Distance of coordinates from neutral ones at a state where all nodes are finite, and their values."""
    neutral, sizes, count = np.array(joint.neutral), np.sin(np.arange(1.0, 1.0 + len(inputs)) ** 2), len(joint.neutral)
    for k in range(HALVINGS):
        at = _values(list(joint.normalized(inputs[:count])), inputs[:count], neutral + 0.5 ** (k + 1) * sizes[:count])
        values = _values(nodes, inputs, np.concatenate([at, sizes[count:]]))  # velocities are any numbers
        if np.isfinite(values).all():
            break
    return at - neutral, values


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
    graph = numbered_graph(inputs, nodes)
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, at.tolist(), strict=True))).values()), dtype=float)
