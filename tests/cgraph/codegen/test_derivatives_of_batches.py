"""Derivatives at many points: each is that of its point alone, to the bit where products are not fused."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph import GraphError
from cgraph.program.functions import derivative
from tests.cgraph.codegen.test_derivatives import LANES, WRITTEN, compiled, example, x, y
from tests.cgraph.engines import RUNNERS
from tests.strategies import cases, examples
from tests.ulps import same


@pytest.fixture(params=RUNNERS)  # of NumPy, derivatives are those of Python
def backend(request):
    return request.param


def one_by_one(function, points, threads=1, wrt=None):
    """All derivatives at points, beside those at each point alone."""
    rng, n = np.random.default_rng(len(points)), len(function.graph.select_inputs(wrt))
    several, weights = rng.normal(size=(len(points), 3, n)), rng.normal(size=(len(points), function.n_out))
    more = rng.normal(size=(len(points), 9, function.n_out))
    how = {"wrt": wrt, "threads": threads}
    pairs = [(function.jacobian(points, **how), [function.jacobian(p, wrt=wrt) for p in points])]
    for along, directions in (
        (function.hessian, weights),
        (function.jvp, several),
        (function.jvp, several[:, 0]),
        (function.vjp, weights),
        (function.vjp, more),
    ):
        alone = [along(p, direction, wrt=wrt) for p, direction in zip(points, directions, strict=True)]
        pairs.append((along(points, directions, **how), alone))
    sparse = function.jacobian(points, sparse=True, **how)
    pairs.append(([each.toarray() for each in sparse], pairs[0][0]))
    return pairs


def check(function, points, **how):
    for together, alone in one_by_one(function, points, **how):
        assert len(together) == len(points)
        for k, each in enumerate(alone):
            assert together[k].shape == each.shape
            assert same(together[k], each)


@given(cases(), st.sampled_from([0, 1, 2, 9, 40]), st.sampled_from([LANES, WRITTEN]), st.integers(0, 99))
@settings(max_examples=examples(12))
def test_random_graphs_at_many_points_are_those_at_each(case, count, cost, seed):
    """With numbers of any size among the points, and NaN and infinities."""
    rng, at = np.random.default_rng(seed), np.array([case.values[name] for name in case.graph.input_names])
    points = at * rng.uniform(0.5, 1.5, (count, len(at)))
    points[3::7], points[4::7], points[5::7] = 0.0, math.nan, math.inf
    check(compiled(case.graph, ("auto", "python")[seed % 2], cost, fma=False), points)


@pytest.mark.parametrize("cost", [LANES, WRITTEN])
@pytest.mark.parametrize("wrt", [None, ["z", "x"], ["unused"]])
def test_threads_and_chosen_inputs_change_no_bit(backend, cost, wrt, monkeypatch):
    monkeypatch.setattr(derivative, "LEAST_BLOCK", 8)
    function = compiled(example(), backend, cost, fma=False)
    points = np.random.default_rng(0).uniform(0.1, 1.0, (21, 4))
    check(function, points, threads=2, wrt=wrt)
    check(function, np.asfortranarray(points), wrt=wrt)


def rows(n, sparse):
    inputs = cg.variables([f"x{k}" for k in range(n)])
    total = sum([cg.sin(each) for each in inputs], cg.constant(0.0))
    outputs = {
        f"y{k}": cg.sin(each) * inputs[k - 1] + (0.0 if sparse else total * each) for k, each in enumerate(inputs)
    }
    return cg.Graph(inputs, outputs)


@pytest.mark.parametrize("sparse", [True, False])
@pytest.mark.parametrize("n", [1, 12])
def test_sparse_and_dense_matrices_of_many_points(backend, n, sparse):
    points = np.random.default_rng(n).normal(size=(9, n))
    for cost in (LANES, WRITTEN):
        check(compiled(rows(n, sparse), backend, cost, fma=False), points)


def test_functions_without_inputs_slopes_or_points(backend):
    for graph in (cg.Graph([], {"f": 1.0, "g": 2.0}), cg.Graph([x, y], {"f": cg.floor(x), "g": 2.0}), example()):
        function = compiled(graph, backend, fma=False)
        for count in (0, 1, 3):
            check(function, points := np.ones((count, len(graph.inputs))))
            found = [np.any(each) for each, _ in one_by_one(function, points)]
            assert bool(any(found)) is (count > 0 and len(graph.inputs) == 4), "a slope where there is none"


@pytest.mark.parametrize("look", [-1, math.inf])
@pytest.mark.parametrize("cost", [LANES, WRITTEN])
def test_infinite_slopes_stay_with_their_points(backend, cost, look, monkeypatch):
    monkeypatch.setattr(derivative, "CHECK", look)
    function = compiled(cg.Graph([x, y], {"f": cg.sqrt(x) + y * y * x, "g": x * y}), backend, cost, fma=False)
    points = np.array([[1.0, 2.0], [0.0, 2.0], [math.nan, 1.0], [4.0, 0.0]] * 3)
    check(function, points)
    zero = function.jvp(points, [0.0, 1.0])
    assert zero[1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("shape", [(), (11,)])
@pytest.mark.parametrize("cost", [LANES, WRITTEN])
def test_a_bound_jacobian_writes_its_array(backend, cost, shape):
    function = compiled(example(), backend, cost, fma=False)
    points = np.random.default_rng(0).uniform(0.1, 1.0, (*shape, 4))
    dense, entries = np.full((*shape, 8, 4), np.nan), np.full((*shape, cg.sparsity(example()).nnz), np.nan)
    runs = function.bind_jacobian(points, dense), function.bind_jacobian(points, entries, threads=2)
    for scale in (1.0, 0.5):
        points *= scale
        assert [run() for run in runs] == [None, None]
        assert same(dense, function.jacobian(points))
        rows = [each.data for each in function.jacobian(points.reshape(-1, 4), sparse=True)]
        assert same(entries, np.reshape(rows, entries.shape))
    with pytest.raises(TypeError, match="a bound call holds addresses of this process"):
        pickle.dumps(runs[0])
    with pytest.raises(GraphError, match=r"values must be .* in shape \(.*8, 4\) or \(.*12,?\), got float64 \(4, 8\)"):
        function.bind_jacobian(points, np.empty((4, 8)))


def test_wrong_shapes_of_many_points_are_said(backend):
    function, points = compiled(example(), backend), np.ones((5, 4))
    for call in (function.jacobian, lambda p: function.jvp(p, points[0]), lambda p: function.hessian(p, np.ones(8))):
        for wrong in (np.ones((4, 5)), np.ones((2, 5, 4)), 1.0):
            with pytest.raises(GraphError, match=r"x must have shape \(4,\), one value for each input, or \(N, 4\)"):
                call(wrong)
    wanted = r"X_dot must have shape \(5, 4\), \(5, k, 4\) or \(4,\) for 5 points, got"
    for wrong in (np.ones((4, 4)), np.ones((5, 3)), np.ones((4, 5, 4)), np.ones((1, 5, 2, 4)), np.ones(3)):
        with pytest.raises(GraphError, match=wanted):
            function.jvp(points, wrong)
    with pytest.raises(GraphError, match=r"y_bar must have shape \(8,\) or \(5, 8\), one weight for each output, got"):
        function.hessian(points, np.ones((4, 8)))
    with pytest.raises(ValueError, match="threads"):
        function.jacobian(points, threads=0)
