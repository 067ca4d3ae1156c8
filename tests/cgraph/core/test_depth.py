"""No recursion anywhere: chains far deeper than Python's stack."""

import gc
import math
import pickle
import sys

import pytest

import cgraph as cg
from tests.tolerances import SOLVED

DEEP = 20_000


def chain(length: int) -> cg.Graph:
    """sin(sin(... sin(x))), a fixed point iteration towards 0."""
    x = node = cg.variable("x")
    for _ in range(length):
        node = cg.sin(node)
    return cg.Graph([x], {"f": node})


def by_hand(length: int, x: float) -> tuple[float, float]:
    slope = 1.0
    for _ in range(length):
        slope *= math.cos(x)
        x = math.sin(x)
    return x, slope


@pytest.fixture(scope="module")
def deep() -> cg.Graph:
    assert sys.getrecursionlimit() < DEEP / 10
    return chain(DEEP)


def test_a_deep_graph_evaluates_and_has_derivatives_in_both_modes(deep):
    value, slope = by_hand(DEEP, 1.0)
    assert deep.evaluate({"x": 1.0}) == {"f": value}
    expected = pytest.approx(slope, rel=SOLVED)  # 1e5 roundings
    assert cg.jvp(deep).evaluate({"x": 1.0, "x_dot": 1.0})["f_dot"] == expected
    assert cg.gradient(deep).evaluate({"x": 1.0})["df/dx"] == expected


def test_a_deep_graph_is_counted_checked_listed_and_pickled(deep):
    counts = deep.counts()
    assert (counts.nodes, counts.edges, counts.depth, counts.width) == (DEEP + 1, DEEP, DEEP, 1)
    deep.check()
    assert deep.listing().count("\n") == DEEP + 2
    assert len(deep.edges) == DEEP
    assert pickle.loads(pickle.dumps(deep)).listing() == deep.listing()
    assert len(cg.structure_hash(deep)) == 32


def test_a_deep_graph_is_compared_and_written(deep):
    found = cg.compare(deep, cg.Graph(deep.inputs, deep(cg.variable("x"))))
    assert len(found.common) == len(found.overlay().graph.nodes) == DEEP + 1
    assert str(found).splitlines()[-1] == "Computed alike: f."
    source = cg.to_c(deep, "deep").source
    assert source.count("static void deep_part_") == 10
    assert "double w[1];" in source


def test_a_deep_graph_is_simplified_specialized_and_inlined(deep):
    assert cg.simplify(deep).counts().nodes == DEEP + 1
    constant = cg.specialize(deep, {"x": 1.0})
    assert constant.listing() == f"inputs \noutput f = {by_hand(DEEP, 1.0)[0]!r}\n"
    x = cg.variable("x")
    assert cg.Graph([x], deep(2 * x)).counts().depth == DEEP + 1


def test_a_deep_graph_is_let_go():
    graph = chain(DEEP)
    derivative = cg.gradient(graph)
    del graph, derivative
    gc.collect()
    assert chain(10).counts().nodes == 11  # and the interpreter is still there


def test_a_deep_graph_with_sharing_is_walked_once():
    """x -> x * x repeated: 2**200 paths, 200 nodes."""
    x = node = cg.variable("x")
    for _ in range(200):
        node = node * node
    graph = cg.Graph([x], {"f": node})
    assert graph.counts().nodes == 201
    assert graph.evaluate({"x": 1.0}) == {"f": 1.0}
    assert cg.gradient(graph).evaluate({"x": 1.0}) == {"df/dx": 2.0**200}
    assert cg.simplify(graph).counts().nodes == 201
