"""Bounds over boxes as graphs: they hold what is sampled in the box, shrink with it, and are never NaN."""

import itertools
import math

import numpy as np

import cgraph as cg
from cgraph.core.node import apply
from cgraph.extend import OPS, Op, enclosure
from tests.cgraph.engines import graph_of
from tests.each_row import each_row

ROUNDING = 1e-14  # of a bound, relative to the largest value on the way
BOXES, WITHIN = 500, 30
WIDE = (-math.inf, -1e300, -700.0, -1.0, 0.0, 0.5, 40.0, math.inf)


def bounds_of(graph: cg.Graph, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the outputs, (outputs, boxes), for boxes in columns."""
    with np.errstate(all="ignore"):
        least, most = np.vsplit(cg.compile(enclosure(graph), "numpy").batch(np.vstack([low, high])), 2)
    assert not np.isnan([least, most]).any()
    return least, most


def outside(graph: cg.Graph, low: np.ndarray, high: np.ndarray, source: np.random.Generator) -> str:
    """A value sampled in a box that lies outside of its bounds, in words; ends are sampled too."""
    least, most = bounds_of(graph, low, high)
    run = cg.compile(cg.Graph(graph.inputs, {str(i): each for i, each in enumerate(graph.nodes)}), "numpy").batch
    places = [graph.nodes.index(each) for each in graph.outputs.values()]
    for _ in range(WITHIN):
        share = np.clip(source.uniform(-0.3, 1.3, low.shape), 0.0, 1.0)
        x = np.clip(low * (1.0 - share) + high * share, low, high)
        with np.errstate(all="ignore"):
            values = run(x)
            y, slack = values[places], ROUNDING * np.max(np.abs(values), axis=0)
            wrong = np.isfinite(values).all(axis=0) & ((y < least - slack) | (y > most + slack))
        for row, k in np.argwhere(wrong):
            return f"{low[:, k]} to {high[:, k]}: {y[row, k]!r} at {x[:, k]} not in {least[row, k]!r}, {most[row, k]!r}"
    return ""


def boxes(op: Op, source: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Boxes narrow and wide in the domain and around it, with ends that are whole, and points."""
    ends = np.array(op.domain)[:, :, None]
    width, shape = ends[:, 1] - ends[:, 0], (op.arity, BOXES)
    middle = ends[:, 0] + width * source.uniform(-0.5, 1.5, shape)
    half = width * 10.0 ** source.uniform(-4.0, 0.3, shape)
    low, high = middle - half, middle + half
    kind = source.random(shape)
    low, high = np.where(kind < 0.3, np.round(low), low), np.where(kind < 0.3, np.round(high), high)
    return low, np.where(kind > 0.8, low, high)


@each_row("op", OPS.values())
def test_bounds_hold_every_value_in_a_box(op):
    source, graph = np.random.default_rng(len(op.name)), graph_of(op)
    assert not outside(graph, *boxes(op, source), source)
    for i, number in itertools.product(range(op.arity if op.arity > 1 else 0), (-2.0, -1.0, -0.5, 0.0, 0.5, 3.0)):
        rest = [each for each in graph.inputs if each is not graph.inputs[i]]
        fixed = cg.Graph(rest, graph(**{str(graph.inputs[i].name): number}, **{str(x.name): x for x in rest}))
        assert not outside(fixed, *np.delete(boxes(op, source), i, axis=1), source), f"{number} at {i}"
    if op.arity == 2:
        one, x = next(zip(*boxes(op, source), strict=True)), cg.variable("a")
        low, high = np.array(one)[:, None]
        assert not outside(cg.Graph([x], {"y": apply(op, x, x)}), low, high, source), "of one node twice"
