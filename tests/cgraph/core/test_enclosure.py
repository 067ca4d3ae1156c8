"""Bounds over boxes as graphs: they hold what is sampled in the box, shrink with it, and are never NaN."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.extend import OPS, Op, enclosure
from cgraph.operations.bounds import intervals
from tests.cgraph.engines import graph_of
from tests.each_row import each_row
from tests.strategies import Case, cases, examples

ROUNDING = 1e-14  # of a bound, relative to the largest value on the way, times the logarithm of it that exp and pow add
NUMBERS = (-2.0, -1.0, -0.5, 0.0, 0.5, 3.0)
SIGNED = (cg.sin, cg.exp, lambda x: -cg.exp(x), lambda x: x * x)


@np.errstate(all="ignore")
def check(graph: cg.Graph, low: np.ndarray, high: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The widths of the bounds for boxes in columns; none is NaN, and they hold the values at points in the boxes.

    points: (.., inputs, boxes). Points outside are left out, as are those where something on the way is not finite.
    """
    least, most = np.vsplit(cg.compile(enclosure(graph), "numpy").batch(np.vstack([low, high])), 2)
    for k in range(0, low.shape[1], 20):  # the rules on floats are the same
        found = intervals(graph.nodes, dict(zip(graph.input_names, np.stack([low, high], axis=-1)[:, k], strict=True)))
        least[:, k], most[:, k] = np.transpose([found[node] for node in graph.outputs.values()])
    assert not np.isnan([least, most]).any()
    run = cg.compile(cg.Graph(graph.inputs, {str(i): each for i, each in enumerate(graph.nodes)}), "numpy").batch
    places = [graph.nodes.index(each) for each in graph.outputs.values()]
    for x in points:
        values = run(x)
        y, slack = values[places], ROUNDING * np.max(np.abs(values) * (1.0 + np.log1p(np.abs(values))), axis=0)
        counts = np.isfinite(values).all(axis=0) & ((low <= x) & (x <= high)).all(axis=0)
        for row, k in np.argwhere(counts & ((y < least - slack) | (y > most + slack))):
            raise AssertionError(f"{low[:, k]} to {high[:, k]}, {x[:, k]}: {y[row, k]} {least[row, k]} {most[row, k]}")
    return most - least


def inside(low: np.ndarray, high: np.ndarray, source: np.random.Generator) -> np.ndarray:
    """Points in boxes, and at their ends where these are of some hundreds."""
    share = np.clip(source.uniform(-0.3, 1.3, (20, *low.shape)), 0.0, 1.0)
    low, high = np.clip((low, high), -700.0, 700.0)
    return np.clip(low * (1.0 - share) + high * share, low, high)


def boxes(op: Op, source: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Boxes narrow and wide in the domain and around it, with ends that are whole, huge or infinite, and points."""
    start, width = np.array([(a, b - a) for a, b in op.domain]).T[:, :, None]
    middle = start + width * source.uniform(-0.5, 1.5, (op.arity, 500))
    half, kind = width * 10.0 ** source.uniform(-4.0, 0.3, middle.shape), source.random(middle.shape)
    low, high = [np.where(kind < 0.3, np.round(end), end) for end in (middle - half, middle + half)]
    ends = np.where(kind > 0.8, low, high)
    huge = source.choice([1.0, math.inf, 1e300, 700.0], (2, *middle.shape), p=[0.85, 0.05, 0.05, 0.05])
    return np.where(huge[0] > 1.0, -huge[0], low), np.where(huge[1] > 1.0, huge[1], ends)


@each_row("op", OPS.values())
def test_bounds_hold_the_values_in_a_box(op):
    source, x = np.random.default_rng(len(op.name)), graph_of(op).inputs
    arguments = [x, [x[0]] * op.arity, *[list(map(signed, x)) for signed in SIGNED]]
    slots = itertools.product(range(op.arity if op.arity > 1 else 0), map(cg.constant, NUMBERS))
    arguments += [[number if k == i else each for k, each in enumerate(x)] for i, number in slots]
    for args in arguments:
        low, high = boxes(op, source)
        check(cg.Graph(x, {"y": apply(op, *args)}), low, high, inside(low, high, source))


@each_row("op", OPS.values())
def test_bounds_shrink_to_the_value_as_a_box_does(op):
    """They are as far apart as the slopes say; at a point they are one."""
    graph, half, source = graph_of(op), 1e-7, np.random.default_rng(len(op.name))
    points = np.array([*op.samples, *[source.uniform(*np.transpose(op.domain)) for _ in range(50)]]).T
    slopes = np.abs(cg.compile(cg.jacobian(graph), "numpy").batch(points)).sum(axis=0)
    values = np.abs(cg.compile(graph, "numpy").batch(points))
    width = check(graph, points - half, points + half, points[None])
    jumps = np.count_nonzero(width > 2.0 * half * slopes * 1.01 + 1e-12 * values)
    assert jumps <= (2 if op.jumps or op.name == "where" else 0)
    assert (check(graph, points, points, points[None]) <= ROUNDING * values).all()


@given(case=cases(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(200))
def test_bounds_of_a_graph_hold_its_values_in_a_box(case: Case, seed: int):
    source = np.random.default_rng(seed)
    middle = np.array(list(case.values.values()))[:, None]
    half = 10.0 ** source.uniform(-6.0, 1.0, (len(middle), 20))
    check(case.graph, middle - half, middle + half, inside(middle - half, middle + half, source))


def test_what_depends_on_exact_inputs_alone_is_computed_once():
    x, y, p = cg.variables("x y p")
    graph = cg.Graph([x, p, y], {"f": cg.sin(p) * x, "g": cg.exp(p) - p + y})
    made = enclosure(graph, exact=["p"])
    assert made.input_names == ("p", "x.low", "y.low", "x.high", "y.high")
    assert list(made.outputs) == ["f.low", "g.low", "f.high", "g.high"]
    assert (made.counts().by_operation["sin"], made.counts().by_operation["exp"]) == (1, 1)
    point = {"x": 0.3, "y": 2.0, "p": -0.7}
    assert list(enclosure(graph, exact=graph.inputs).evaluate(point).values()) == [*graph.evaluate(point).values()] * 2
    with pytest.raises(cg.GraphError, match="no input 'q'"):
        enclosure(graph, exact=["q"])


@each_row("interval, expected", [(None, (-math.inf, math.inf)), (lambda a: (0.0, 1.0), (0.0, 1.0))])
def test_an_operation_of_a_reader_has_the_bounds_that_its_row_knows(interval, expected):
    x, bump = cg.variable("x"), lambda a: 1.0 / (1.0 + a * a)
    op = Op("bump", 1, bump, bump, lambda y, a: (-2.0 * a * y * y,), ((0.3,),), interval=interval)
    made = enclosure(cg.Graph([x], {"y": apply(op, x)}))
    assert tuple(made.evaluate({"x.low": 0.0, "x.high": 1.0}).values()) == expected
