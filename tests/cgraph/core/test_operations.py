"""Every row of the operation table: values, derivatives of first and second order in every mode, and IEEE specials."""

import itertools
import math
import random
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from mpmath import mpf

import cgraph as cg
from cgraph.operations.operation import OPS, Op
from tests import high_precision
from tests.cgraph.engines import graph_of
from tests.ulps import ulps_apart

RELATIVE_ERROR = 1e-13  # of a derivative, relative to the larger of 1 and the size; a few dozen roundings
ULPS = 4  # NumPy's own vector functions promise no more
ROWS = [pytest.param(op, id=op.name) for op in OPS.values()]
NAMES = ("a", "b", "c")


def points(op: Op) -> list[tuple[float, ...]]:
    """The samples of the row, and three random points of the domain."""
    source = random.Random(op.name)
    drawn = [tuple(source.uniform(*interval) for interval in op.domain) for _ in range(3)]
    return [*op.samples, *drawn]


def at(graph: cg.Graph, *values: float) -> list[float]:
    return list(graph.evaluate(dict(zip(graph.input_names, values, strict=True))).values())


def unit(n: int, i: int) -> tuple[float, ...]:
    return tuple(float(i == j) for j in range(n))


def exact(op: Op, point: Sequence[float], *slots: int) -> float:
    """The partial derivative in these argument slots, by mpmath.diff; zero in an argument that is a step."""
    if any((op.name, slot) in high_precision.STEPS for slot in slots):
        return 0.0
    orders = [slots.count(slot) for slot in range(op.arity)]
    return float(high_precision.partial(high_precision.OPERATIONS[op.name], point, orders))


def close(found: float, expected: float) -> bool:
    return abs(found - expected) <= RELATIVE_ERROR * max(1.0, abs(expected))


def first_derivatives(op: Op, point: Sequence[float]) -> dict[str, list[float]]:
    """dy/d(argument i) for every i, by every way to get there."""
    graph, n = graph_of(op), op.arity
    return {
        "jvp": [at(cg.jvp(graph), *point, *unit(n, i))[0] for i in range(n)],
        "jvp, one input": [at(cg.jvp(graph, name), *point, 1.0)[0] for name in NAMES[:n]],
        "vjp": at(cg.vjp(graph), *point, 1.0),
        "gradient": at(cg.gradient(graph), *point),
        "jacobian": at(cg.jacobian(graph), *point),
        "edges": at(cg.Graph(graph.inputs, {str(e.slot): e.partial for e in graph.edges}), *point),
    }


def second_derivatives(op: Op, point: Sequence[float]) -> dict[str, list[float]]:
    """d2y / d(argument i) d(argument j), row by row, by every way to get there."""
    graph, n = graph_of(op), op.arity
    primal = NAMES[:n]
    pairs = list(itertools.product(range(n), repeat=2))
    gradient = cg.gradient(graph)
    return {
        "hessian": at(cg.hessian(graph), *point),
        "jvp of jvp": [at(cg.jvp(cg.jvp(graph), primal), *point, *unit(n, i), *unit(n, j))[0] for i, j in pairs],
        "jvp of vjp": [at(cg.jvp(cg.vjp(graph), primal), *point, 1.0, *unit(n, j))[i] for i, j in pairs],
        "vjp of jvp": [at(cg.vjp(cg.jvp(graph), primal), *point, *unit(n, i), 1.0)[j] for i, j in pairs],
        "vjp of vjp": [at(cg.vjp(cg.vjp(graph), primal), *point, 1.0, *unit(n, i))[j] for i, j in pairs],
        "jacobian of gradient": at(cg.jacobian(gradient), *point),
    }


def wrong_derivatives(op: Op, point: Sequence[float]) -> list[str]:
    """The ways to a first or second derivative that disagree with mpmath, each with what was found and expected."""
    slots = range(op.arity)
    expected = {1: [exact(op, point, i) for i in slots], 2: [exact(op, point, i, j) for i in slots for j in slots]}
    found = {1: first_derivatives(op, point), 2: second_derivatives(op, point)}
    return [
        f"{op.name}{tuple(point)}: {way} gives {values}, mpmath {expected[order]}"
        for order, ways in found.items()
        for way, values in ways.items()
        if len(values) != len(expected[order]) or not all(map(close, values, expected[order]))
    ]


def samples_have_as_many_numbers_as_the_operation_has_arguments(op: Op) -> None:
    assert op.samples
    assert {len(sample) for sample in op.samples} == {op.arity} == {len(op.domain)}


def there_is_one_partial_for_each_argument(op: Op) -> None:
    graph = graph_of(op)
    (node,) = graph.outputs.values()
    assert len(op.partials(node, *node.args)) == op.arity == len(graph.edges)


def value_is_that_of_mpmath(op: Op) -> None:
    for point in points(op):
        (found,) = at(graph_of(op), *point)
        expected = float(high_precision.OPERATIONS[op.name](*map(mpf, point)))
        assert ulps_apart(found, expected) <= 2, point


def derivatives_are_those_of_mpmath_in_every_mode(op: Op) -> None:
    for point in points(op):
        assert wrong_derivatives(op, point) == []


def arrays_have_the_values_of_floats(op: Op) -> None:
    graph = graph_of(op)
    rows = points(op)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    (together,) = at(graph, *columns)
    assert together.shape == (len(rows),)
    assert together.dtype == np.float64
    for found, point in zip(together, rows, strict=True):
        assert ulps_apart(found, at(graph, *point)) <= ULPS, point


# IEEE specials: NumPy's functions by name, the reference that the table itself may not supply.
NUMPY: dict[str, Callable[..., float]] = {op.name: getattr(np, op.name, op.array) for op in OPS.values()} | {
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "pow": lambda a, b: np.power(np.full(2, a), np.full(2, b))[0],  # of scalars, a**0.5 is the square root
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "less": lambda a, b: np.float64(np.less(a, b)),
    "less_equal": lambda a, b: np.float64(np.less_equal(a, b)),
    "equal": lambda a, b: np.float64(np.equal(a, b)),
    "not_equal": lambda a, b: np.float64(np.not_equal(a, b)),
    "where": lambda c, a, b: np.where(c, a, b)[()],
    "round": np.rint,
    "zero_safe_mul": lambda a, b: 0.0 if 0.0 in (a, b) else a * b,
}
POSITIVE_SPECIALS = (0.0, 5e-324, 1e-310, 2.2250738585072014e-308, 1e-20, 0.5, 1.0, 2.0, 3.0, 711.0, 1e20, 1e308)
POSITIVE_SPECIALS += (math.inf,)
SPECIALS = (math.nan, *POSITIVE_SPECIALS, *(-value for value in POSITIVE_SPECIALS))
ZERO_SIGN_IS_OPEN = {"minimum", "maximum", "zero_safe_mul"}  # IEEE 754 lets min(0, -0) be either


def specials(op: Op) -> list[tuple[float, ...]]:
    values = SPECIALS if op.arity < 3 else SPECIALS[::2]
    return list(itertools.product(values, repeat=op.arity))


def same_special(op: Op, found: float, expected: float) -> bool:
    if found != expected and ulps_apart(found, expected) > ULPS:
        return False
    signed = found == expected == 0.0 and op.name not in ZERO_SIGN_IS_OPEN
    return not signed or math.copysign(1.0, found) == math.copysign(1.0, expected)


def specials_are_those_of_numpy(op: Op) -> None:
    graph = graph_of(op)
    with np.errstate(all="ignore"):
        different = [
            (point, found, expected)
            for point in specials(op)
            for found, expected in [(at(graph, *point)[0], float(NUMPY[op.name](*map(np.float64, point))))]
            if type(found) is not float or not same_special(op, found, expected)
        ]
    assert different == []


def alone_and_in_arrays(op: Op, graph: cg.Graph, rows: Sequence[Sequence[float]]) -> None:
    """The graph of the operation has the values of arrays that it has of their numbers one by one."""
    (together,) = at(graph, *(np.array(column) for column in zip(*rows, strict=True)))
    different = [
        (point, each, alone)
        for point, each in zip(rows, together, strict=True)
        for alone in at(graph, *point)
        if not same_special(op, each, alone)
    ]
    assert different == []


def specials_in_arrays_are_those_of_floats(op: Op) -> None:
    alone_and_in_arrays(op, graph_of(op), specials(op))


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 2.0, -1.0, 3.0])
def test_a_constant_exponent_gives_arrays_the_values_of_floats(exponent):
    x = cg.variable("a")
    alone_and_in_arrays(OPS["pow"], cg.Graph([x], {"y": x**exponent}), [(value,) for value in SPECIALS])


PROPERTIES = (
    samples_have_as_many_numbers_as_the_operation_has_arguments,
    there_is_one_partial_for_each_argument,
    value_is_that_of_mpmath,
    derivatives_are_those_of_mpmath_in_every_mode,
    arrays_have_the_values_of_floats,
    specials_are_those_of_numpy,
    specials_in_arrays_are_those_of_floats,
)


@pytest.mark.parametrize("op", ROWS)
def test_a_row_of_the_table_has_every_property(op):
    for holds in PROPERTIES:
        holds(op)
