"""Taylor coefficients of solutions as graphs: which equations have them, and which are refused."""

import math
import random
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import cgraph as cg
from cgraph.autodiff import jets as module
from cgraph.core.node import Node, apply
from cgraph.extend import OPS, NoSeriesError, Op, jets, straight


def an_operation(monkeypatch: pytest.MonkeyPatch, partial) -> Op:
    """f(x), whose slope is partial(f as a function of a node, x)."""

    def partials(y, a):
        return (partial(lambda node: apply(row, node), a),)

    row = Op("shifted", 1, math.sin, np.sin, partials, samples=((0.3,),))
    monkeypatch.setitem(OPS, "shifted", row)
    return row


@pytest.mark.parametrize("exact", [False, True])
def test_partials_without_end_are_refused(exact: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    x = cg.variable("x")
    endless = an_operation(monkeypatch, lambda f, a: f(a + 1.0))
    with pytest.raises(NoSeriesError, match="shifted has no Taylor series: its partials need partials of new nodes"):
        jets(cg.Graph([x], {"rate": Node(endless, (x,))}), exact=exact)
    periodic = an_operation(monkeypatch, lambda f, a: f(a) * a)
    assert jets(cg.Graph([x], {"rate": Node(periodic, (x,))}), exact=exact).sums > 0


@pytest.mark.parametrize("exact", [False, True])
def test_long_chains_of_operations_are_far_from_the_bound(exact: bool) -> None:
    x = cg.variable("x")
    y = x
    for _ in range(100):
        y = cg.tanh(cg.atan(cg.sin(y)))
    made = module._Jets(cg.Graph([x], {"rate": y}), "t", exact)
    assert max(made.rounds.values()) <= 4


ORDERS = 16
KNOWN: dict[str, tuple[Callable[[Node], Node], float, Callable[[int], Fraction]]] = {  # xdot, x(0), c_k
    "exponential": (lambda x: x, 1.0, lambda k: Fraction(1, math.factorial(k))),
    "pole": (lambda x: x * x, 1.0, lambda k: Fraction(1)),  # 1 / (1 - t)
    "root": (lambda x: -1.0 / x, 1.0, lambda k: _binomial(Fraction(1, 2), k) * (-2) ** k),  # (1 - 2 t)^1/2
    "logarithm": (lambda x: cg.exp(-x), 0.0, lambda k: Fraction((-1) ** (k - 1), k)),  # log(1 + t)
    "tangent": (lambda x: 1.0 + x * x, 0.0, lambda k: _tangent(k)),
    "power": (lambda x: x**3.0, 1.0, lambda k: _binomial(Fraction(-1, 2), k) * (-2) ** k),  # (1 - 2 t)^-1/2
}


def _binomial(power: Fraction, k: int) -> Fraction:
    result = Fraction(1)
    for j in range(k):
        result *= (power - j) / (j + 1)
    return result


def _tangent(k: int) -> Fraction:
    """Coefficients of tan t, which is its own rate - 1."""
    c = [Fraction(0), Fraction(1)]
    for n in range(1, k):
        c.append(sum((c[j] * c[n - j] for j in range(n + 1)), Fraction(0)) / (n + 1))
    return c[k]


def coefficients(rate: cg.Graph, x: Sequence[float], unit: float = 1.0) -> np.ndarray[Any, Any]:
    """Coefficients 1 .. ORDERS of the states, (ORDERS, m), by the straight graph."""
    made = jets(rate)
    first = list(made.start.evaluate(dict(zip(rate.input_names, x, strict=True))).values())
    series = straight(made, ORDERS)
    values = [*first[: len(x)], unit, *first[len(x) :]]
    found = series.evaluate(dict(zip(series.input_names, values, strict=True)))
    return np.reshape(list(found.values()), (ORDERS, len(x)))


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("unit", [1.0, 2.0**-30])
def test_coefficients_are_those_of_known_series(name: str, unit: float) -> None:
    """Order by order, relative; of the time in any unit."""
    rate, start, exact = KNOWN[name]
    x = cg.variable("x")
    found = coefficients(cg.Graph([x], {"rate": rate(x)}), [start], unit)[:, 0]
    for k, value in enumerate(found, 1):
        expected = float(exact(k) * Fraction(unit) ** k)
        assert abs(value - expected) <= 4e-16 * k * abs(expected), k


def by_orders(rate: cg.Graph, x: Sequence[float]) -> np.ndarray[Any, Any]:
    """Coefficients 1 .. ORDERS of the states by the graph of one order, over and over, with sums by NumPy."""
    made, m = jets(rate), len(x)
    first = list(made.start.evaluate(dict(zip(rate.input_names, x, strict=True))).values())
    rates, zeros = first[:m], first[m:]
    rows, left, right = [], np.zeros((0, made.sums)), np.zeros((0, made.sums))
    for k in range(1, ORDERS + 1):
        values = [*rates, 1.0, float(k), *zeros, *(left * right[::-1]).sum(axis=0)]
        now = list(made.order.evaluate(dict(zip(made.order.input_names, values, strict=True))).values())
        rows.append(now[:m])
        rates = now[m : 2 * m]
        left = np.vstack([left, now[2 * m : 2 * m + made.sums]])
        right = np.vstack([right, now[2 * m + made.sums :]])
    return np.array(rows)


@given(st.integers(0, 2**32 - 1))
def test_straight_is_the_loop_over_orders(seed: int) -> None:
    """Of random equations, to rounding beside the largest coefficient of the order."""
    draw = random.Random(seed)
    x = cg.variables("x0 x1 x2")
    nodes: list[Node] = [*x, cg.constant(0.7)]
    for _ in range(12):
        a, b = draw.choice(nodes), draw.choice(nodes)
        results = [a + b, a - b, a * b, a * a, -a, 0.3 * a, a / (2.0 + b * b), cg.sin(a), cg.cos(a)]
        nodes.append(draw.choice([*results, cg.sqrt(1.0 + a * a)]))
    rate = cg.Graph(x, {f"rate{i}": cg.sin(node) + 0.1 * x[i] for i, node in enumerate(nodes[-3:])})
    at = [draw.uniform(-0.5, 0.5) for _ in x]
    one, other = coefficients(rate, at), by_orders(rate, at)
    assert np.all(abs(one - other) <= 1e-12 * abs(other).max(axis=1, keepdims=True))
