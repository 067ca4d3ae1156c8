"""Spurious nodes by definition, whatever the author of a Lagrangian tagged: counts, classes, and what is left."""

import random
from functools import partial
from typing import Any

from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from cgraph.core.traversal import rebuild
from tests.dynamics.models import random_arm
from tests.each_row import each_row
from tests.formulations import WRONG
from viz.models.node_classes import formulation_classes

ROUNDING = 1e-12  # a few dozen operations on numbers of order one
SEEDS = range(3)


def random_system(seed: int, order: tuple[int, int], tagged: float) -> dyn.System:
    """A random L of two coupled coordinates at places `order`, every term of it under a tag with chance `tagged`."""
    rng = random.Random(seed)
    numbers, chance = [rng.uniform(0.3, 2.0) for _ in range(9)], random.Random(seed + 1)
    functions = [rng.choice([cg.sin, cg.cos, cg.tanh, cg.atan, cg.exp]) for _ in range(4)]

    def lagrangian(q: Any, qd: Any, t: Any) -> Any:
        (x, y), (u, v) = [q[i] for i in order], [qd[i] for i in order]
        a, b, c, d, e, f, g, h, i = numbers
        terms = [
            lambda: (a + functions[0](b * x + y) ** 2) * u * u,
            lambda: c * functions[1](x - d * y) * u * v,
            lambda: (e + x * x) * v**2,
            lambda: -f * functions[2](x * y),
            lambda: g * functions[3](h * y) * x * x,
            lambda: i * cg.sin(t) * y * u,
        ]
        total = 0.0
        for k, term in enumerate(terms):
            with cg.tag(*[f"part {k}"] * (chance.random() < tagged)):
                total = total + term()
        return total

    return dyn.System(lagrangian, [["x", "y"][i] for i in order])


@mark.parametrize("formulation", WRONG)
@mark.parametrize("seed", SEEDS)
def test_tags_of_the_author_change_no_count_and_no_class(seed: int, formulation: str) -> None:
    for order in ((0, 1), (1, 0)):
        seen = []
        for tagged in (0.0, 0.5, 1.0):
            system = random_system(seed, order, tagged)
            verdict, rate = dyn.formulation_verdict(system, formulation), dyn.momentum_rate(system, formulation)
            name, graph = formulation_classes([verdict])(verdict.graph), verdict.graph
            assert verdict.nodes == dyn.spurious_nodes(graph)
            wrong = dyn.spurious_nodes(graph) | dyn.spurious_nodes(rate)
            marked = [node in wrong for node in (*graph.nodes, *rate.nodes)]
            seen.append((marked, [name(node) for node in graph.nodes]))
        assert seen[0] == seen[1] == seen[2]
        assert any(seen[0][0])


def test_lint_counts_them_too() -> None:
    graphs = [dyn.inverse_dynamics(random_system(0, (0, 1), tagged), "by_definition") for tagged in (0.0, 1.0)]
    lint = [str(cg.lint(graph, independent=("q0 q1", "qd0 qd1"), function="L")) for graph in graphs]
    assert lint[0] == lint[1]
    assert f"{len(dyn.spurious_nodes(graphs[0]))} nodes of {len(graphs[0].nodes)} serve nothing else." in lint[0]


@mark.parametrize("formulation", WRONG)
@each_row(
    ("model", "simplify"),
    [
        (make, simplify)
        for make in (*[partial(random_system, seed, (0, 1), 0.5) for seed in SEEDS], partial(random_arm, 2))
        for simplify in (False, True)
    ],
)
def test_without_its_spurious_nodes_the_graph_is_the_rate_of_the_momentum_at_an_independent_state(
    model: Any, formulation: str, simplify: bool
) -> None:
    """By definition dp/dt, p = dL/dqd of independent q and qd; along dt, where q moves at qd + qdd dt."""
    system, dt = dyn.as_system(model()), 0.05
    old = {"q0_old": 0.4, "q1_old": -0.7, "qd0_old": 0.3, "qd1_old": 0.9, "qdd0": -0.5, "qdd1": 0.8, "dt": dt, "t": 0.6}
    graph = dyn.momentum_rate(system, formulation, simplify=simplify)
    gone = dict.fromkeys(dyn.spurious_nodes(graph), cg.constant(0.0))
    assert gone
    kept = rebuild(graph.outputs.values(), gone, lambda node, args: cg.Node(node.op, args))
    cut = cg.Graph(graph.inputs, {name: kept[node] for name, node in graph.outputs.items()})

    at = {"t": old["t"], "t_dot": 1.0}
    for i in range(2):
        at[f"qd{i}"] = old[f"qdd{i}"] * dt + old[f"qd{i}_old"]
        at[f"q{i}"] = at[f"qd{i}"] * dt + old[f"q{i}_old"]
        at |= {f"qd{i}_dot": old[f"qdd{i}"], f"q{i}_dot": at[f"qd{i}"] + old[f"qdd{i}"] * dt}
    rate = cg.jvp(dyn.momentum(system))
    expected = rate.evaluate({name: at[name] for name in rate.input_names})
    found = cut.evaluate({name: old[name] for name in cut.input_names})
    assert list(found.values()) == approx(list(expected.values()), rel=ROUNDING)


def test_only_the_relations_are_euler_edges() -> None:
    """qd = qdd dt + qd_old and q = qd dt + q_old, four nodes; the rate of q serves only what is spurious."""
    pendulum = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 9.81 * cg.cos(q[0]), ["x"])
    verdict = dyn.formulation_verdict(pendulum, "by_definition")
    graph, name = verdict.graph, formulation_classes([verdict])(verdict.graph)
    edges = [node for node in graph.nodes if name(node) == "Euler relation"]
    assert [node.name or node.op.name for node in edges] == ["mul", "qd0", "mul", "q0"]
