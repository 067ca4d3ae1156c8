"""Long sums in blocks: the same values, every partial sum of them, in a logarithm of the depth."""

from __future__ import annotations

import math

import numpy as np
import pytest

import cgraph as cg
from tests.tolerances import LONG_SUM


def partial_sums(terms, signs):
    total, result = terms[0], []
    for term, sign in zip(terms[1:], signs, strict=True):
        total = {"+": lambda a, b: a + b, "-": lambda a, b: a - b, "~": lambda a, b: b - a}[sign](total, term)
        result.append(total)
    return result


@pytest.mark.parametrize("n", [2, 15, 16, 17, 64, 100])
def test_all_partial_sums_are_those_of_the_terms(n):
    for signs in ("+", "-", "~", "+-", "+~-"):
        assert_partial_sums(n, signs)


def assert_partial_sums(n: int, signs: str) -> None:
    x = cg.variables([f"x{i}" for i in range(n)])
    order = [signs[i % len(signs)] for i in range(n - 1)]
    graph = cg.Graph(x, {f"s{i}": s for i, s in enumerate(partial_sums(x, order))})
    balanced = cg.balanced_sums(graph)
    values = np.random.default_rng(n).normal(size=n)
    found = cg.compile(balanced, backend="python")(values)
    exact, coefficients = [], [1.0]
    for sign in order:
        coefficients = [-c for c in coefficients] if sign == "~" else coefficients
        coefficients = [*coefficients, -1.0 if sign == "-" else 1.0]
        exact.append(math.fsum(c * v for c, v in zip(coefficients, values, strict=False)))
    assert found == pytest.approx(exact, rel=0.0, abs=LONG_SUM * np.abs(values).sum())
    counts = balanced.counts()
    assert counts.nodes <= n + 1 + n * max(1.0, 0.5 * math.log2(n) + 1)
    if n < 16:
        assert counts.depth <= n - 1
    else:
        assert counts.depth <= math.ceil(math.log2(n)) + 2


def test_terms_may_be_made_of_earlier_sums():
    """As along a chain, where what is added at a link depends on the angle so far."""
    x = cg.variables([f"x{i}" for i in range(40)])
    angle, height, outputs = cg.constant(0.0), cg.constant(0.0), {}
    for i, node in enumerate(x):
        angle = angle + node
        height = height - cg.cos(angle) * (1.0 + 0.1 * i)
        outputs[f"h{i}"] = height
    graph = cg.Graph(x, outputs)
    balanced = cg.balanced_sums(graph)
    values = np.random.default_rng(0).normal(size=40)
    assert cg.compile(balanced)(values) == pytest.approx(cg.compile(graph)(values), rel=0.0, abs=LONG_SUM * 120)
    assert balanced.counts().depth < 20 < graph.counts().depth


def test_tags_and_names_stay():
    x = cg.variables([f"x{i}" for i in range(20)])
    with cg.tag("weight"):
        total = sum(x[1:], x[0])
    graph = cg.balanced_sums(cg.Graph(x, {"total": cg.with_name(total, "total") * 2.0}))
    assert all("weight" in node.tags for node in graph.nodes if node.op.name == "add")
