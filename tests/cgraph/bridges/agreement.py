"""What a function of another library has in common with the graph that it was made of."""

import math
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume

import cgraph as cg
import dynamics as dyn
from cgraph.core.node import apply
from cgraph.extend import OPS, Op, certain_digits, register
from tests.strategies import Case

ROUNDINGS = 4e-15  # relative: of one operation, by two libraries that promise an ulp or a few
SLOPES = 1e-13  # relative: of formulas of the slope that differ
ARM = dyn.forward_dynamics(dyn.planar_arm([1.0] * 7, [1.0] * 7))  # the state and torques of seven joints
POINT = np.random.default_rng(0).normal(size=21)
x, y, z = cg.variables("x y z")
SMALL = cg.Graph([x, y, z], {"f": cg.sin(x * y) + z**2, "g": cg.exp(x) * z, "h": cg.hypot(x, y)})
SAMPLES = np.random.default_rng(0).normal(size=(4, 5, 3))


class Bridge(NamedTuple):
    """A library: makes a function of arrays of a graph, and of its Jacobian."""

    function: Callable[[cg.Graph], Callable[[Any], Any]]
    jacobian: Callable[[cg.Graph], Callable[[Any], Any]]


def disagreements(bridge: Bridge, *without: str) -> dict[str, Any]:
    """{operation: (point, theirs, ours)} where value or slopes differ, at its samples and inside its domain."""
    ops = [op for name, op in OPS.items() if name not in without]
    inputs = [cg.variables([f"{op.name}{k}" for k in range(op.arity)]) for op in ops]
    whole = cg.Graph(
        [each for args in inputs for each in args],
        {op.name: apply(op, *args) for op, args in zip(ops, inputs, strict=True)},
    )
    fn, value, slope = cg.compile(whole, "python"), bridge.function(whole), bridge.jacobian(whole)
    rng = np.random.default_rng(1)
    points = [[each for op in ops for each in op.samples[k % len(op.samples)]] for k in range(2)]
    points += [[rng.uniform(*interval) for op in ops for interval in op.domain] for _ in range(4)]
    found = {}
    for point in points:
        for theirs, ours, near in ((value, fn, ROUNDINGS), (slope, fn.jacobian, SLOPES)):
            got, wanted = np.array(theirs(np.array(point))), ours(point)
            close = (
                np.isclose(got.reshape(wanted.shape), wanted, rtol=near, atol=near).reshape(len(ops), -1).all(axis=1)
            )
            found |= {op.name: (point, got, wanted) for op, fits in zip(ops, close, strict=True) if not fits}
    return found


def agrees(bridge: Bridge, case: Case) -> None:
    """Assert that a random graph has its values, as far as rounding leaves digits of them."""
    point = list(case.values.values())
    wanted = np.array(list(case.graph.evaluate(case.values).values()))
    digits = np.array([certain_digits(case.graph, case.values)[name] for name in case.graph.outputs])
    assume((digits > 4).all())
    got = np.array(bridge.function(case.graph)(np.array(point))).ravel()
    assert (np.abs(got - wanted) <= np.abs(wanted) * 10.0 ** (2 - digits)).all(), (got, wanted, digits)


@contextmanager
def own_row(**columns: Any):
    """A row of a program's own, in the table for as long as the block takes; gives a graph that has it."""
    square = {"scalar": lambda x: x * x + 1.0, "array": lambda x: x * x + 1.0, "partials": lambda y, x: (2.0 * x,)}
    register(Op("own", 1, samples=((0.3,),), **(square | columns)))
    try:
        yield cg.Graph([x], {"y": apply(OPS["own"], x)})
    finally:
        del OPS["own"], cg.core.row.ROWS["own"]


def lets_zero_win(bridge: Bridge) -> None:
    """Assert that an exact zero wins over infinity and NaN, and that the product then has the slopes of a product."""
    graph = cg.Graph([x, y], {"f": apply(OPS["zero_safe_mul"], x, y)})
    value, slopes = bridge.function(graph), bridge.jacobian(graph)
    for point, wanted in (((0.0, np.inf), 0.0), ((np.nan, 0.0), 0.0), ((2.0, np.inf), np.inf), ((2.0, 3.0), 6.0)):
        assert np.array(value(np.array(point))).ravel().tolist() == [wanted]
    for point in ((0.0, 2.0), (2.0, 0.0), (0.0, 0.0), (2.0, 3.0)):
        assert np.array(slopes(np.array(point))).ravel().tolist() == [*reversed(point)]


def refuses(make: Callable[[cg.Graph], Any], library: str) -> None:
    """Assert that an operation that says nothing of the library is refused, and one that does is taken."""
    with own_row() as graph, pytest.raises(cg.GraphError, match=f"{library} has no operation 'own'"):
        make(graph)
    with own_row(operator=lambda x: x * x + 1.0) as graph:
        assert np.array(make(graph)(np.array([0.5]))).ravel() == pytest.approx([1.25], rel=1e-6)
    asinh = {"scalar": math.asinh, "array": np.arcsinh, "partials": lambda y, x: (1.0 / cg.hypot(1.0, x),)}
    with own_row(**asinh) as graph:
        assert np.array(make(graph)(np.array([0.5]))).ravel() == pytest.approx([np.arcsinh(0.5)], rel=1e-6)
