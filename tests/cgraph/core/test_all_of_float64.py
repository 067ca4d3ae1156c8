"""First and second derivatives of every operation over the whole range of float64: nothing overflows on the way."""

import itertools
import math
from functools import cache

import pytest
from mpmath import mp, mpf

import cgraph as cg
from cgraph.operations.operation import OPS
from tests import high_precision
from tests.cgraph.engines import graph_of

ULPS = 16 * 2.0**-53  # a dozen roundings
SIZES = (5e-324, 1e-310, 1e-300, 1e-155, 1e-20, 1e-3, 0.3, 0.9, 1.0, 1 - 2.0**-53, 1.1, 20.0, 356.0, 709.0, 1e9, 1e80)
SIZES += (1e155, 1e300, 1.7e308)
FEWER = (3e-308, 1e-200, 1e-20, 0.3, 1e100, 1e300)
LARGEST = mpf(1.7e308)
DIGITS = 700  # what is cancelled in 1 + a * a at the largest numbers


def points(op):
    sizes = {1: SIZES, 2: FEWER}.get(op.arity, (0.3, 1e300))
    return itertools.product([sign * size for size in sizes for sign in (1.0, -1.0)], repeat=op.arity)


def condition(op, point):
    """By what an error of the last bit in an argument is magnified on the way: in b - 1, for a power."""
    return 1.0 + abs(point[1] * math.log(abs(point[0]))) if op.name == "pow" else 1.0


@cache
def derived(op):
    graph = graph_of(op)
    return graph, (cg.gradient(graph), cg.hessian(graph))


def wrong(op, point):
    """What is off at a point by more than its rounding, relative to the largest entry; nothing where that overflows.

    A second derivative also counts by how far it changes the first, over one and over the size of the argument.
    """
    graph, slopes = derived(op)
    values = dict(zip("abc", point, strict=False))
    y = graph.evaluate(values)["y"]
    if not math.isfinite(y):
        return []
    if op.name == "pow" and (y == 0.0 or abs(point[1]) < 1e-100):  # it underflows, or a ** (b - 2) alone overflows
        return []
    result, floor = [], 0.0
    for slope in slopes:
        try:
            exact = {name: mpf(value) for name, value in high_precision.evaluate(slope, values, DIGITS).items()}
        except ZeroDivisionError:  # an infinite slope
            break
        scale = max(map(abs, exact.values()))
        if mp.isnan(scale) or scale > LARGEST:
            break
        bound = ULPS * condition(op, point) * max(float(scale), floor) + 4 * math.ulp(0.0)
        found = slope.evaluate(values)
        result += [(point, k, found[k], float(exact[k])) for k in found if not abs(found[k] - exact[k]) <= bound]
        floor = float(scale) * min(1.0, 1.0 / max(map(abs, point)))
    return result


@pytest.mark.parametrize("op", [pytest.param(op, id=op.name) for op in OPS.values()])
def test_derivatives_are_right_wherever_they_are_numbers(op):
    assert [each for point in points(op) for each in wrong(op, point)] == []


x = cg.variable("x")
SOFTPLUS, ENTROPY = cg.log(1.0 + cg.exp(x)), x * cg.log(x)


@pytest.mark.parametrize(
    ("f", "at", "first", "second"),
    [
        (SOFTPLUS, 400.0, 1.0, 0.0),
        (SOFTPLUS, 700.0, 1.0, 0.0),
        (SOFTPLUS, -400.0, math.exp(-400.0), math.exp(-400.0)),
        (ENTROPY, 1e-310, math.log(1e-310) + 1.0, math.inf),
        (1.0 / (x * x), 1e-100, -2e300, math.inf),
        (1.0 / (x * x), 1e100, -2e-300, 0.0),
        (cg.tanh(x), 1e300, 0.0, 0.0),
    ],
)
def test_of_these_nothing_overflows_on_the_way(f, at, first, second):
    graph = cg.Graph([x], {"f": f})
    found = [*cg.gradient(graph).evaluate({"x": at}).values(), *cg.hessian(graph).evaluate({"x": at}).values()]
    assert found == [pytest.approx(first, rel=ULPS, abs=0.0), pytest.approx(second, rel=ULPS, abs=ULPS * abs(first))]


ENTROPIES = {
    "x log x": lambda m, x, y: x * m.log(x),
    "- x log x": lambda m, x, y: -x * m.log(x),
    "2 x log x": lambda m, x, y: 2.0 * x * m.log(x),
    "x^2 log x": lambda m, x, y: x * x * m.log(x),
    "x log 3x": lambda m, x, y: x * m.log(3.0 * x),
    "x log xy": lambda m, x, y: x * m.log(x * y),
    "x log2 x": lambda m, x, y: x * (m.log2(x) if m is cg else m.log(x, 2)),
    "x log10 x": lambda m, x, y: x * m.log10(x),
    "x log x / y": lambda m, x, y: x * m.log(x) / y,
    "x log(x / y)": lambda m, x, y: x * m.log(x / y),
    "a sum": lambda m, x, y: x * m.log(x) + y * m.log(y),
}


@pytest.mark.parametrize("f", ENTROPIES.values(), ids=ENTROPIES)
def test_the_slope_of_an_entropy_is_the_same_in_both_modes_down_to_the_least_number(f):
    graph = cg.Graph(inputs := cg.variables("x y"), {"f": f(cg, *inputs)})
    for at in (5e-324, 1e-310, 5e-309, 1e-300, 0.3):
        with mp.workdps(DIGITS if at < 0.1 else 50):
            slope = float(mp.diff(lambda x: f(mp, x, mpf(1.5)), mpf(at), h=mpf(at) * mpf(10) ** -20))
        for by in (1.0, 0.7, -3.0):
            assert_both_modes(graph, at, by, by * slope)


def assert_both_modes(graph, at, by, exact):
    point, bound = {"x": at, "y": 1.5}, ULPS * abs(exact) + 4.0 * math.ulp(0.0) / at
    for wrt, rest in ((["x"], {}), (None, {"y_dot": 0.0})):
        forward = cg.jvp(graph, wrt).evaluate(point | rest | {"x_dot": by})["f_dot"]
        assert forward == pytest.approx(exact, abs=bound, rel=0.0), (at, by, wrt)
    assert cg.vjp(graph).evaluate(point | {"f_bar": by})["x_bar"] == pytest.approx(exact, abs=bound, rel=0.0)
