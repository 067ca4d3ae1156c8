"""With fma=False every back end has the bits of `evaluate` at a point, singly, in batches of any size and in loops."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from tests.cgraph.engines import SPECIAL, evaluated
from tests.strategies import cases
from tests.ulps import same

pytestmark = pytest.mark.optimized


def wrong(graph, backend, points):
    """Which ways to the outputs at the columns of points do not have the bits of `evaluate`."""
    function = cg.compile(graph, backend, fma=False)
    expected = evaluated(graph, points.T).T
    sizes = {size: function.batch(points[:, :size]) for size in (0, 1, 2, 3, 4, 7, 8, 9, points.shape[1])}
    bad = [f"batch of {size}" for size, found in sizes.items() if not same(found, expected[:, :size])]
    for name, alone in (("single", function), ("values", function.values)):
        bad += [] if same(np.array([alone(point) for point in points.T.tolist()]).T, expected) else [name]
    return bad


@given(case=cases(), seed=st.integers(0, 99))
@settings(max_examples=12, deadline=None)
def test_random_graphs_have_the_same_bits_in_every_engine(case, seed):
    pytest.importorskip("llvmlite")
    middle = np.array([[case.values[name]] for name in case.graph.input_names])
    points = middle + np.random.default_rng(seed).uniform(-0.5, 0.5, (len(middle), 19))
    points[:, :1] = middle
    assert [(engine, wrong(case.graph, engine, points)) for engine in ("python", "numpy", "llvm")] == [
        ("python", []), ("numpy", []), ("llvm", [])
    ]  # fmt: skip


def test_every_operation_has_the_same_bits_where_numbers_are_special(backend):
    inputs = cg.variables("a b c")
    graph = cg.Graph(inputs, {name: apply(op, *inputs[: op.arity]) for name, op in OPS.items()})
    points = np.array(list(itertools.product(SPECIAL, SPECIAL, (0.0, 1.5)))).T
    assert wrong(graph, backend, points) == []


def test_every_operation_on_constants_alone_has_the_same_bits(backend):
    outputs = {
        f"{name}{args}": apply(op, *map(cg.constant, args))
        for name, op in OPS.items()
        for args in itertools.product((0.0, -1.5, 1.0, 1e300, math.inf, -math.inf), repeat=op.arity)
    }
    outputs["a sum of them"] = sum(itertools.islice(outputs.values(), 5), cg.variable("x"))
    assert wrong(cg.Graph([cg.variable("x")], outputs), backend, np.array([[0.5] * 9])) == []


def test_angles_and_exponents_of_many_sizes_have_the_same_bits(backend):
    """Where polynomials, NumPy and the C library differ in some hundredths of all values."""
    x = cg.variable("x")
    graph = cg.Graph([x], {f.__name__: f(x) for f in (cg.sin, cg.cos, cg.exp, cg.log, cg.tanh, cg.cbrt, cg.logistic)})
    points = np.random.default_rng(0).uniform(0.01, 30.0, (1, 500))
    assert wrong(graph, backend, points) == []
    assert not same(cg.compile(graph, backend).batch(points), evaluated(graph, points.T).T) or backend == "python"
