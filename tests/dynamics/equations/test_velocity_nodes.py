"""Velocity nodes of a Lagrangian: which are recognized, that they are time derivatives, and the bias made of them."""

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.core.builder import folded
from cgraph.core.traversal import topological
from cgraph.extend import Builder
from dynamics import bias
from dynamics.equations.bias_terms import velocity_nodes
from tests import high_precision

N = 3
ZERO = 1e-45  # of numbers of the order of one, in 50 digits
SEEN = 1e-3  # of the same: a derivative that is not zero
FOLDED = 1e-14  # constants of a graph are folded in floats, some ten of them one after the other
q, qd, qdd = ([cg.variable(f"{name}{i}") for i in range(N)] for name in ("q", "qd", "qdd"))
t, k = cg.variables("t k")
angle, omega = q[0] + q[1], qd[0] + qd[1]
swing = k * cg.cos(q[0]) * qd[0] + 0.7 * cg.cos(angle) * omega

VELOCITIES = {
    "velocity": qd[1],
    "sum": omega,
    "difference": qd[0] - 2.0 * qd[2],
    "negative": -omega,
    "times a constant": 2.0 * omega,
    "times a parameter": k * qd[0],
    "divided by a parameter": omega / (1.0 + k * k),
    "a function of its own position": cg.exp(q[0]) * cg.sin(q[0]) * qd[0],
    "divided by a function of its own position": qd[0] / (2.0 + cg.sin(q[0])),
    "a function of a sum": cg.cos(angle) * omega,
    "a function of a multiple": cg.cos(angle) * (k * omega),
    "a function of a function": cg.sin(cg.exp(angle)) * (cg.cos(angle) * omega),
    "the tip of two links": swing,
    "and of a third": swing + (angle + q[2]) * (angle + q[2]) * (omega + qd[2]),
}
OTHERS = {
    "a function of another position": cg.cos(q[1]) * qd[0],
    "a function of one of two": cg.cos(q[0]) * omega,
    "a function of two": cg.cos(q[0]) * cg.cos(angle) * omega,
    "a function of time": cg.cos(t) * qd[0],
    "a function of its position and of time": cg.cos(q[0] + t) * qd[0],
    "a square": omega * omega,
    "a function of a velocity": cg.sin(qd[0]),
    "a product with a sum of velocities": cg.cos(q[0]) * swing,
    "one over a velocity": 1.0 / omega,
}


def recognized(node: cg.Node) -> tuple[cg.Node, list[cg.Node]]:
    """The node, folded, and the velocity nodes that it is made from."""
    build = Builder()
    (copy,) = folded([node], build)
    return copy, velocity_nodes(copy, q, qd, t, build)


def euler_lagrange(node: cg.Node) -> list[float]:
    """d/dt dz/dqd - dz/dq in 50 digits, at a state with accelerations, by the literal chain rule."""
    system = dyn.System(lambda *_: node, list("abc"), {"k": 1.3})
    graph = dyn.inverse_dynamics(system, "chain_rule_literal", simplify=False)
    rng = np.random.default_rng(5)
    values = {
        name: float(x) for name, x in zip(graph.input_names, rng.uniform(0.3, 1.0, len(graph.inputs)), strict=True)
    }
    return [abs(float(x)) for x in high_precision.evaluate(graph, values).values()]


@pytest.mark.parametrize("name", VELOCITIES)
def test_a_velocity_node_is_recognized_and_lagrange_s_equation_makes_nothing_of_it(name):
    node, velocities = recognized(VELOCITIES[name])
    assert velocities == [node]
    assert max(euler_lagrange(VELOCITIES[name])) < ZERO


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_time_derivative_is_not_taken_for_one(name):
    node, velocities = recognized(OTHERS[name])
    assert node not in velocities
    assert max(euler_lagrange(OTHERS[name])) > SEEN


def test_every_node_that_is_taken_for_a_velocity_node_is_one():
    node, velocities = recognized(
        sum([a * b for a in VELOCITIES.values() for b in (*VELOCITIES.values(), *OTHERS.values())], cg.constant(0.0))
    )
    assert len(velocities) >= len(VELOCITIES)
    for each in velocities:
        assert max(euler_lagrange(each)) < ZERO
    assert set(velocities) < set(topological([node]))


LAGRANGIANS = {
    "products of velocities": lambda: swing * swing + omega * qd[2] * cg.cos(q[2]) + qd[2] * qd[2],
    "a sum of velocities alone": lambda: swing,
    "a velocity alone": lambda: qd[0],
    "no velocity": lambda: cg.cos(q[0]) * q[1],
    "velocity nodes and others": lambda: (
        swing * swing * cg.cos(q[1]) + OTHERS["a function of one of two"] * swing + qd[2] * qd[2]
    ),
    "a velocity node within another and without": lambda: (
        omega * omega + swing * omega + (swing + omega) * (swing + omega)
    ),
    "explicit time": lambda: (
        (swing + cg.sin(t)) * (swing * cg.cos(t)) + OTHERS["a function of its position and of time"]
    ),
    "not quadratic": lambda: cg.exp(swing) + cg.sqrt(1.0 + omega * omega) * cg.cos(angle),
    "all": lambda: sum([a * a for a in (*VELOCITIES.values(), *OTHERS.values())], cg.constant(0.0)),
}


@pytest.mark.parametrize("name", LAGRANGIANS)
def test_the_bias_is_what_the_chain_rule_gives_without_accelerations(name):
    system = dyn.System(lambda *_: LAGRANGIANS[name](), list("abc"), {"k": 1.3})
    expected = dyn.inverse_dynamics(system, "chain_rule", simplify=False)
    graph = bias(system)
    rng = np.random.default_rng(1)
    for _ in range(3):
        values = {str(node.name): float(rng.uniform(0.3, 1.0)) for node in expected.inputs}
        values |= dict.fromkeys([str(node.name) for node in qdd], 0.0)
        truth = high_precision.evaluate(expected, values)
        result = high_precision.evaluate(graph, {each: values[each] for each in graph.input_names})
        scale = 1.0 + max(abs(x) for x in truth.values())
        for a, b in zip(truth.values(), result.values(), strict=True):
            assert abs(a - b) < FOLDED * scale
