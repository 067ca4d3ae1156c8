"""Sums side by side in vectors: the bits of sums one after another, and never a sum that waits for itself."""

import random
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph.codegen import llvm_ir, vector_sums as module
from cgraph.codegen.schedule import products_of
from cgraph.codegen.vector_sums import vector_sums
from cgraph.core.node import Node
from cgraph.extend import jets, straight

pytestmark = pytest.mark.optimized

pytest.importorskip("llvmlite")


def rounds(width: int, count: int, draw: random.Random) -> cg.Graph:
    """Values that are sums of products of values before, `width` at a time, in parts; some with differences."""
    x = cg.variables([f"x{k}" for k in range(width)])
    rows: list[list[Node]] = [[cg.sin(each) for each in x]]
    kept = draw.sample(range(width), width)
    for _ in range(count):
        row = []
        for lane in range(width):
            products = [a[lane] * b[kept[lane]] for a, b in zip(rows, rows[::-1], strict=True)]
            early, last = products[1:], products[0]
            part = early[0] if early else last
            for product in early[1:]:
                part = part - product if draw.random() < 0.01 else part + product
            total = (last + rows[-1][lane]) + part
            row.append(total * (0.5 + 0.1 * draw.random()))
        rows.append(row)
    return cg.Graph(x, {f"{k}": node for k, node in enumerate([each for row in rows[1:] for each in row])})


def values(graph: cg.Graph, x: Sequence[float]) -> np.ndarray:
    return cg.compile(graph, backend="llvm")(np.array(x))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=2, deadline=None)
def test_bits_are_those_of_sums_one_by_one(seed: int) -> None:
    draw = random.Random(seed)
    graph = rounds(draw.randint(4, 13), 9, draw)
    x = [draw.uniform(-1.0, 1.0) for _ in graph.inputs]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "MANY", 0)
        patch.setattr(module, "AGAIN", 0.0)
        beside, side_by_side = values(graph, x), vector_sums(graph, products_of(graph))
        patch.setattr(llvm_ir, "vector_sums", lambda graph, products: {})
        cg.clear_caches()
        alone = values(graph, x)
    assert side_by_side
    assert beside.tobytes() == alone.tobytes()


def test_coefficients_of_a_series_are_added_up_side_by_side() -> None:
    """Of a graph as long as that of three bodies; a short one stays as it is."""
    q = cg.variables([f"q{k}" for k in range(12)])
    rates = [sum([cg.sin(q[k]) * cg.cos(q[j]) for j in range(k % 3 + 3)], q[k]) for k in range(12)]
    long = straight(jets(cg.Graph(q, {f"{k}": rate for k, rate in enumerate(rates)})), 15)
    found = vector_sums(long, products_of(long))
    assert len(found) > 100
    assert {len(sums.roots) for sums in found.values()} <= {8, 4}
    short = straight(jets(cg.Graph(q[:1], {"rate": cg.sin(q[0])})), 15)
    assert not vector_sums(short, products_of(short))


def test_sums_that_need_each_other_stay_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is a factor in the next one, on both sides of any choice of lanes."""
    monkeypatch.setattr(module, "MANY", 0)
    monkeypatch.setattr(module, "AGAIN", 0.0)
    x = cg.variables([f"x{k}" for k in range(8)])
    sines = [cg.sin(each) for each in x]
    totals: list[Node] = []
    value = cg.cos(x[0])
    for _ in range(8):
        part = value * sines[0]
        for sine in sines[1:5]:
            part = part + (value + sine) * sine
        value = (sines[5] + sines[6]) + part
        totals.append(value)
    graph = cg.Graph(x, {f"{k}": total for k, total in enumerate(totals)})
    assert not vector_sums(graph, products_of(graph))
    point = np.linspace(0.1, 0.8, 8)
    exact = list(graph.evaluate(dict(zip(graph.input_names, point.tolist(), strict=True))).values())
    assert values(graph, point) == pytest.approx(exact, rel=1e-13)
