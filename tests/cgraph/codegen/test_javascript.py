"""JavaScript: operations and graphs to the bits of evaluation, and steps to those of `simulate`."""

import itertools
import math
import random
import re

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.codegen import statements
from cgraph.core.node import apply
from cgraph.operations.operation import LIBRARY, OPS, Op
from dynamics.integrators import TABLEAUS
from tests.cgraph.engines import ODD_POINTS, SPECIAL, evaluated, odd_graphs
from tests.each_row import each_row
from tests.javascript import evaluated_by_js, run_js, stepped_by_js
from tests.ulps import same, ulps_apart

X, Y, Z = cg.variables("x y z")
STATE = cg.Graph([X, Y], {"x_dot": Y, "y_dot": -X})
BROWSER = 16.0  # ulps between functions of a browser, and rows' formulas of them, and the C library's; erfc has 9


def points():
    """Samples, points of domains and combinations of IEEE specials, for three arguments."""
    source = random.Random(3)
    found = [[*sample, 0.5, 0.5][:3] for op in OPS.values() for sample in op.samples]
    for op in OPS.values():
        drawn = [[source.uniform(*ends) for ends in op.domain] for _ in range(8)]
        found += [[*each, 0.5, 0.5][:3] for each in drawn]
    return [*found, *itertools.product(SPECIAL, SPECIAL, [0.5]), *itertools.product(*[SPECIAL[::3]] * 3)]


def test_every_operation_is_that_of_evaluate():
    """Where no function of the C library is meant to the last bit; else to the last ones, NaN and infinities alike."""
    graph = cg.Graph([X, Y, Z], {name: apply(op, *[X, Y, Z][: op.arity]) for name, op in OPS.items()})
    at = points()
    found, expected = np.array(evaluated_by_js(cg.to_js(graph), at)), evaluated(graph, at)
    for k, (name, op) in enumerate(OPS.items()):
        assert ulps_apart(found[:, k], expected[:, k]) <= BROWSER, name
        assert op.rounding >= LIBRARY or same(found[:, k], expected[:, k]), name


def rational(graph):
    """The graph with inputs in place of its sines and cosines."""
    functions = [node for node in graph.nodes if node.op.name in ("sin", "cos")]
    angles = {node: cg.variable(f"f{k}") for k, node in enumerate(functions)}
    copies = dict(angles)
    for node in graph.nodes:
        if node not in copies:
            copies[node] = apply(node.op, *[copies[arg] for arg in node.args]) if node.args else node
    outputs = {name: copies[node] for name, node in graph.outputs.items()}
    return cg.Graph([*graph.inputs, *angles.values()], outputs)


@each_row("part", [2000, 50])
def test_rates_of_an_arm_are_those_of_evaluate_to_the_last_bit_but_for_sines(part, monkeypatch):
    """In one function, and in several that hand on what they need."""
    monkeypatch.setattr(statements, "PART", part)
    graph = rational(dyn.state_equation(dyn.scenes.load("triple_pendulum")))
    text = cg.to_js(graph)
    at = np.random.default_rng(1).uniform(-2.0, 2.0, (50, len(graph.inputs)))
    assert ("function part1(" in text) == (part == 50)
    assert same(evaluated_by_js(text, at), evaluated(graph, at))


def test_inputs_unused_passed_on_and_shared_by_outputs():
    for name, graph in odd_graphs().items():
        assert same(evaluated_by_js(cg.to_js(graph), ODD_POINTS[name]), evaluated(graph, ODD_POINTS[name])), name


def test_a_deep_graph_needs_no_recursion_and_any_name_is_a_text():
    node = X
    for _ in range(5_000):
        node = node * 0.5 + 1.0
    name = '</script>"\\{0}'
    graph = cg.Graph([X], {name: node})
    text = cg.to_js(graph)
    assert "</script" not in text
    found = run_js(text, "[[module.inputs, module.outputs], module.evaluate([0.3])]")
    assert found == [[["x"], [name]], list(graph.evaluate({"x": 0.3}).values())]


def linear(x, y, t):
    """A state equation of products and sums alone."""
    return [y, -x * 1.7 - 0.3 * y * x * x + 0.25 * t]


@each_row(("method", "timed"), [("euler", False), ("rk4", True)])
def test_a_thousand_steps_are_those_of_simulate_to_the_last_bit(method, timed):
    model = dyn.OdeSystem(lambda x, t: linear(x[0], x[1], t if timed else 1.0), ["x", "y"])
    motion = dyn.simulate(model, [0.7, -0.2], None, 10.0, method, dt=0.01, backend="python", rtol=0.1)
    assert motion.stats.success
    text = cg.to_js(dyn.state_equation(model), TABLEAUS)
    found = stepped_by_js(text, method, [0.7, -0.2, *[0.0] * timed], 0.01, 1000)
    assert same(found[:2], motion.q[-1])
    assert found[2:] == [motion.t[-1]] * timed


def test_the_order_of_a_method_is_its_own():
    program = "Object.values(module.steps).map((by) => [8, 16].map((n) => by(Float64Array.of(1, 0), 1 / n, n)[0]))"
    for method, ends in zip(TABLEAUS.values(), run_js(cg.to_js(STATE, TABLEAUS), program), strict=True):
        coarse, fine = (abs(end - math.cos(1.0)) for end in ends)
        assert math.log2(coarse / fine) == pytest.approx(method.order, abs=0.35)


def own(javascript, name="versin"):
    op = Op(name, 1, lambda x: 2.0 * math.sin(x / 2.0) ** 2, lambda x: 2.0 * np.sin(x / 2.0) ** 2,
            lambda y, x: (cg.sin(x),), samples=((0.6,),), javascript=javascript)  # fmt: skip
    return cg.Graph([X], {"y": apply(op, X * X)})


@each_row(
    ("javascript", "name"),
    [
        ("(x) => 2 * Math.sin(x / 2) ** 2", "versin"),
        ("(é) => 2 * Math.sin(é / 2) ** 2", "versin"),
        ("(x) => { const half = x / 2; return 2 * Math.sin(half) ** 2; }", "new"),
        ("function (x) { return [x].map((x) => 1 - Math.cos(x))[0]; }", "versin"),
    ],
)
def test_an_operation_of_ones_own_is_computed(javascript, name):
    ((found,),) = evaluated_by_js(cg.to_js(own(javascript, name)), [[0.6]])
    assert found == pytest.approx(2.0 * math.sin(0.18) ** 2, rel=1e-14)


@each_row(
    ("make", "kind", "said"),
    [
        (lambda: cg.to_js(X), TypeError, "to_js needs a cg.Graph, got Node"),
        (lambda: cg.to_js(STATE, [TABLEAUS["rk4"]]), TypeError, "methods"),
        (lambda: cg.to_js(STATE, {"rk4": 4}), TypeError, "method 'rk4' must be a tableau"),
        (lambda: cg.to_js(cg.Graph([X], {"a": X, "b": X}), TABLEAUS), cg.GraphError, "2 outputs of 1 input"),
        (lambda: cg.to_js(STATE, time=3), TypeError, "time must be the name of an input, got 3"),
        (lambda: cg.to_js(own("")), ValueError, "'versin' has no text in JavaScript, .* its row needs the column"),
    ],
)
def test_a_mistake_is_told_in_one_sentence(make, kind, said):
    with pytest.raises(kind, match=said) as caught:
        make()
    assert not re.search("\n", str(caught.value))
