"""Where a number that is not finite comes from: operations planted in random expressions, and in models."""

import json
import math
import random
import warnings

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph import why_nan
from tests.each_row import each_row

x, y = cg.variables("x y")
ROWS = [  # an operation that is not finite, of a number that is; the number, whether it is the partial, the result
    (cg.sqrt, -2.0, False, math.nan),
    (lambda z: 1.0 / z, 0.0, False, math.inf),
    (cg.log, 0.0, False, -math.inf),
    (cg.exp, 1000.0, False, math.inf),
    (cg.asin, 1.5, False, math.nan),
    (cg.sqrt, 0.0, True, math.inf),
    (cg.asin, 1.0, True, math.inf),
]


def wrapped(node, rng, times):
    """A random expression of a node that is finite wherever the node is, and depends on it."""
    steps = [lambda z: z + y, lambda z: 3.0 * z, lambda z: y - z, lambda z: -z, lambda z: z * cg.cos(y)]
    for _ in range(times):
        node = rng.choice(steps)(node)
    return node


@each_row("planted, number, partial, result", ROWS)
def test_the_planted_operation_is_found(planted, number, partial, result):
    for seed in range(8):
        rng = random.Random(seed)
        with cg.tag("fault"):
            inner = x * 2.0 + 1.0
            fault = planted(inner)
        node = wrapped(fault, rng, rng.randint(0, 5)) + cg.sin(x) * y
        graph = cg.Graph([x, y], {"other": cg.cos(y), "f": node})
        at = {"x": (number - 1.0) / 2.0, "y": 0.7}
        found = why_nan(graph, at)
        assert found.node is fault
        assert (found.slot is not None) == partial
        assert str(found.result) == str(result)
        assert not math.isfinite(found.value)
        assert not partial or math.isfinite(graph.evaluate(at)["f"])
        text = str(found)
        assert "[fault]" in text
        assert f"= {number:g}" in text
        assert found.what == ("d f / d x" if partial else "f")
        assert json.loads(json.dumps(found.to_dict()))["node"] == list(graph.nodes).index(fault)


def test_what_is_not_taken_is_no_origin():
    first = cg.where(cg.less(y, 0.0), 1.0 / y, cg.log(x))
    graph = cg.Graph([x, y], {"f": first})
    assert why_nan(graph, {"x": 0.0, "y": 0.0}).node.op.name == "log"  # of 1 / 0, the other branch, nothing comes
    assert (
        why_nan(cg.Graph([x, y], {"f": cg.exp(x) * y}), {"x": 1e3, "y": 0.0}).node.op.name == "exp"
    )  # infinity times 0


def test_what_is_asked_for_is_looked_at():
    graph = cg.Graph([x, y], {"a": cg.log(x), "b": cg.sqrt(y), "c": x + y})
    at = {"x": 0.0, "y": 0.0}
    assert why_nan(graph, at).what == "a"
    assert why_nan(graph, at, "b").what == "d b / d y"
    assert why_nan(graph, at, "b", "x").node is None
    assert why_nan(graph, at, "c").node is None
    assert str(why_nan(graph, at, "c")) == "All values and derivatives are finite here."
    assert why_nan(graph, at, "bee", "why", names={"b": "bee", "y": "why"}).what == "d bee / d why"
    assert why_nan(graph, {"x": math.nan, "y": 1.0}, "c").node is x
    steep = why_nan(cg.Graph([x], {"f": 1e200 * cg.sin(1e200 * x)}), {"x": 0.0})
    assert (steep.what, steep.node) == ("d f / d x", None)
    assert "overflows" in str(steep)


@each_row(
    "at, error, text",
    [
        ({"x": 1.0}, cg.GraphError, "no value for input y"),
        ({"x": 1.0, "y": True}, TypeError, "must be a number"),
        ({"x": 1.0, "y": 1.0, "z": 1.0}, cg.GraphError, "no input z"),
        ([1.0, 2.0], TypeError, "at"),
    ],
)
def test_a_point_that_is_none_is_refused(at, error, text):
    with pytest.raises(error, match=text):
        why_nan(cg.Graph([x, y], {"f": x + y}), at)


def softened(rate):
    """A mass on a spring k log(x - gap), a well of depth sqrt(depth), and a drag that has `rate` under a root."""

    def lagrangian(q, qd, t, p):
        return 0.5 * qd[0] ** 2 - p["k"] * cg.log(q[0] - p["gap"]) * cg.sqrt(p["depth"])

    return dyn.System(
        lagrangian, ["x"], {"k": 1.0, "gap": 0.0, "depth": 1.0}, forces=lambda q, qd, t: [-cg.sqrt(qd[0] + rate)]
    )


@each_row("parameters, operation", [({"depth": -1.0}, "sqrt"), ({"gap": 0.5}, "div"), ({}, None)])
def test_a_parameter_out_of_range_is_told_of_a_run(parameters, operation):
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        run = dyn.simulate(softened(1.0), [0.5], [0.0], 0.01, parameters=parameters)
    found = run.why_nan()
    assert run.success == (operation is None)
    assert (None if found.node is None else found.node.op.name) == operation
    if operation == "div":
        assert found.at["q.x"] == 0.5
        assert found.what == "qd_dot.x"


def test_a_run_that_leaves_the_range_of_its_rate_is_told_where():
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        for options in ({"method": "rk4", "dt": 0.01}, {}, {"method": "radau"}):
            run = dyn.simulate(softened(0.02), [1.5], [0.0], 3.0, **options)
            assert not run.success
            found = run.why_nan()
            assert found.node.op.name == "sqrt"
            assert "qd.x" in found.inputs
            assert found.at["qd.x"] < 0.0
    assert np.isfinite(run.qd).all()
