"""Derivatives of compiled graphs: products in lanes, Jacobians and Hessians compressed by colors, in every back end."""

import itertools
import math
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph import GraphError
from cgraph.codegen import schedule
from cgraph.program.functions import compiled as functions, derivative
from tests import high_precision
from tests.each_row import each_row
from tests.strategies import cases, examples
from tests.tolerances import LAST_BITS, LONG_SUM, SHORT_SUM
from tests.ulps import same

LANES, WRITTEN = 0, math.inf  # of `vector_cost`: so that a Jacobian is in lanes, or written out
x, y, z = cg.variables("x y z")


def compiled(graph, backend="auto", cost=None, **options):
    function = cg.compile(graph, backend, **options)
    if cost is not None:
        function._derivatives.vector_cost = cost
    return function


def values(graph, *parts):
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, np.concatenate(parts), strict=True))).values()))


def written(graph, point):
    """The Jacobian by the graph that has a node for every entry."""
    return values(cg.jacobian(graph), point).reshape(len(graph.outputs), -1)


def example():
    """Entries of every kind: rows and columns that are zero, an input as output, an output twice, one unused input."""
    s = cg.sin(x * y)
    outputs = {"f": s / z + cg.sqrt(x), "g": cg.exp(z) * x, "one": cg.constant(1.0), "x": x, "again": cg.exp(z) * x}
    return cg.Graph([x, y, cg.variable("unused"), z], outputs | {"s": s, "and_s": s, "step": cg.floor(y)})


POINT = np.array([0.3, 0.4, 7.0, 0.5])


@pytest.mark.parametrize("cost", [LANES, WRITTEN, None])
def test_the_jacobian_is_that_of_the_graph_with_a_node_an_entry(backend, cost):
    function = compiled(example(), backend, cost)
    expected = written(example(), POINT)
    np.testing.assert_allclose(function.jacobian(POINT), expected, rtol=LAST_BITS)
    np.testing.assert_allclose(function.jacobian(POINT, sparse=True).toarray(), expected, rtol=LAST_BITS)
    np.testing.assert_allclose(function.jvp(POINT, np.eye(4)).T, expected, rtol=LAST_BITS)
    np.testing.assert_allclose(function.vjp(POINT, np.eye(8)), expected, rtol=LAST_BITS)
    assert (function.jacobian(POINT, sparse=True) != 0).nnz <= cg.sparsity(example()).nnz
    assert function.jacobian([0.25, 1.0, 2.0, 3.0]).shape == (8, 4)


@given(cases(max_operations=10), st.integers(0, 99))
@settings(max_examples=examples(16))
def test_all_back_ends_have_the_same_bits_and_those_of_the_derivative_graphs(case, seed):
    pytest.importorskip("llvmlite")
    point = np.array([case.values[name] for name in case.graph.input_names])
    rng, backends = np.random.default_rng(seed), ("python", "numpy", "llvm")
    m, n = len(case.graph.outputs), len(point)
    x_dot, y_bar = rng.uniform(-1.0, 1.0, (9, n)), rng.uniform(-1.0, 1.0, (9, m))
    forward = np.array([values(cg.jvp(case.graph), point, row) for row in x_dot])
    reverse = np.array([values(cg.vjp(case.graph), point, row) for row in y_bar])
    for backend in backends:
        function = compiled(case.graph, backend, LANES, fma=False)
        assert same(function.jvp(point, x_dot), forward)
        assert same(function.vjp(point, y_bar), reverse)
    found = [compiled(case.graph, each, cost, fma=False).jacobian(point) for each in backends for cost in (0, math.inf)]
    assert all(same(each, found[k % 2]) for k, each in enumerate(found))


def test_the_number_of_directions_is_no_matter(backend, monkeypatch):
    function, graph = compiled(example(), backend, fma=False), cg.jvp(example())
    directions = {k: np.random.default_rng(k).uniform(-1.0, 1.0, (k, 4)) for k in (0, 1, 3, 8, 9, 1000)}
    found = {k: function.jvp(POINT, along) for k, along in directions.items()}
    for k, along in directions.items():
        assert found[k].shape == (k, 8)
        some = range(0, k, 97)
        assert same(found[k][some], np.array([values(graph, POINT, along[i]) for i in some]).reshape(-1, 8)), k
    monkeypatch.setattr(functions.NativeRunner, "vectors", 1)  # blocks of one vector
    monkeypatch.setattr(functions.PythonRunner, "vectors", 1)
    function = compiled(example(), backend, fma=False)
    for k, along in directions.items():
        assert same(function.jvp(POINT, along), found[k]), k
        assert same(function.jvp(POINT, np.asfortranarray(along)), found[k]), k
    assert function.jvp(POINT, [1, 0, 0, 0]).tolist() == function.jvp(POINT, [[1.0, 0.0, 0.0, 0.0]])[0].tolist()
    assert function.vjp(POINT, np.eye(8)[3]).tolist() == [1.0, 0.0, 0.0, 0.0]


def chain(sin, points):
    """A banded and an arrow-shaped function of numbers of any kind."""
    n = len(points)
    band = [sin(points[i]) * points[min(i + 1, n - 1)] + points[max(i - 1, 0)] ** 2 for i in range(n)]
    total = points[0] * points[0]
    for each in points[1:]:
        total = total + each * each
    return [*band, total, *[points[0] * sin(each) + each * each for each in points[1:]]]


@pytest.mark.parametrize("cost", [LANES, WRITTEN])
def test_a_band_and_an_arrow_agree_with_complex_steps(cost, backend):
    n = 40
    inputs = cg.variables([f"x{k}" for k in range(n)])
    graph = cg.Graph(inputs, {f"y{k}": node for k, node in enumerate(chain(cg.sin, inputs))})
    point = np.random.default_rng(0).uniform(-1.0, 1.0, n)
    columns = [np.imag(chain(np.sin, point + 1e-200j * unit)) / 1e-200 for unit in np.eye(n)]
    found = compiled(graph, backend, cost).jacobian(point)
    np.testing.assert_allclose(found, np.array(columns).T, rtol=SHORT_SUM, atol=LAST_BITS)


@given(cases(max_operations=12), st.integers(0, 99))
@settings(max_examples=examples(24))
def test_a_hessian_in_lanes_is_that_of_the_weighted_sum(case, seed):
    point = np.array([case.values[name] for name in case.graph.input_names])
    weights = np.random.default_rng(seed).uniform(-1.0, 1.0, len(case.graph.outputs))
    total = sum(
        (float(w) * node for w, node in zip(weights, case.graph.outputs.values(), strict=True)), cg.constant(0.0)
    )
    one = cg.Graph(case.graph.inputs, {"f": total})
    expected = values(cg.hessian(one), point).reshape(len(point), -1)
    for function, given_weights in ((compiled(case.graph, "python"), weights), (compiled(one, "python"), None)):
        found = function.hessian(point, given_weights)
        assert np.array_equal(found, found.T)
        sizes = high_precision.path_size(cg.gradient(one), case.values, dict.fromkeys(case.values, 1.0))
        assert np.allclose(found, expected, rtol=LONG_SUM, atol=LONG_SUM * sum(sizes.values()))


def rosenbrock(points):
    pairs = itertools.pairwise(points)
    return sum((100.0 * (b - a * a) ** 2 + (1.0 - a) ** 2 + points[0] * b for a, b in pairs), 0.0 * points[0])


def test_a_sparse_hessian_is_compressed(backend):
    n = 12
    inputs = cg.variables([f"x{k}" for k in range(n)])
    graph = cg.Graph(inputs, {"f": rosenbrock(inputs)})
    point = np.random.default_rng(0).uniform(-1.0, 1.0, n)
    function = compiled(graph, backend)
    expected = values(cg.hessian(graph), point).reshape(n, n)
    np.testing.assert_allclose(function.hessian(point), expected, rtol=SHORT_SUM, atol=SHORT_SUM)
    found = function.hessian(point, [2.0], sparse=True)
    np.testing.assert_allclose(found.toarray(), 2.0 * expected, rtol=SHORT_SUM, atol=SHORT_SUM)
    assert found.nnz == np.count_nonzero(expected)


@pytest.mark.parametrize("check", [-1, math.inf])
def test_zeros_in_a_direction_win_over_infinite_slopes(backend, check, monkeypatch):
    """Whether every entry of a direction is looked at, or only where a slope is infinite."""
    monkeypatch.setattr(derivative, "CHECK", check)
    function = compiled(cg.Graph([x, y], {"f": cg.sqrt(x) + y * y * x, "g": x * y}), backend, LANES)
    inf = math.inf
    for _ in range(2):
        assert function.jacobian([1.0, 2.0]).tolist() == [[4.5, 4.0], [2.0, 1.0]]
        assert function.jacobian([0.0, 2.0]).tolist() == [[inf, 0.0], [2.0, 0.0]]
        assert function.jvp([0.0, 2.0], [[0.0, 1.0], [1.0, 0.0]]).tolist() == [[0.0, 0.0], [inf, 2.0]]
        assert function.vjp([0.0, 2.0], [[0.0, 1.0], [1.0, 0.0]]).tolist() == [[2.0, 0.0], [inf, 0.0]]
        assert function.hessian([0.0, 2.0], [1.0, 0.0]).tolist() == [[-inf, 4.0], [4.0, 0.0]]


SELECTED = cg.asin(abs(x))


@each_row(
    "f",
    [
        cg.where(SELECTED, SELECTED, abs(y)),
        cg.where(SELECTED, SELECTED, abs(y)) / 2.0 + y / x,
        math.inf * cg.maximum(x, 0.0) + y,
        cg.cbrt(y) / 3.0 + x * y,
        cg.sqrt(y) / cg.sqrt(x) + x,
        cg.hypot(x, y) * 5e-324 / y,
    ],
)
def test_a_look_at_slopes_sees_every_infinite_one(f, monkeypatch):
    graph, points = cg.Graph([x, y], {"f": f, "g": x * y}), [[1.0, 0.0], [0.0, 1.0], [1.0, 5e-324], [0.5, 0.5]]
    found = []
    for check in (-100, math.inf):
        monkeypatch.setattr(derivative, "CHECK", check)
        function = compiled(graph, "python", LANES)
        found.append([[function.jacobian(p), function.jvp(p, np.eye(2)), function.vjp(p, np.eye(2))] for p in points])
        found[-1] += [[function.hessian(p, weights) for weights in np.eye(2)] for p in points]
    for plain, guarded in zip(*found, strict=True):
        np.testing.assert_allclose(plain, guarded, rtol=LAST_BITS, atol=LAST_BITS)  # slopes of order 1 cancel


@pytest.mark.parametrize("cost", [LANES, WRITTEN])
@each_row("wrt", [["z", "x"], "y", ["unused"], ["x", "y", "unused", "z"]])
def test_derivatives_by_chosen_inputs_are_columns_of_those_by_all(backend, cost, wrt):
    function, rng = compiled(example(), backend, cost), np.random.default_rng(0)
    names = [wrt] if isinstance(wrt, str) else wrt
    places = [example().input_names.index(name) for name in names]
    whole, weights = function.jacobian(POINT), rng.normal(size=8)
    np.testing.assert_allclose(function.jacobian(POINT, wrt=wrt), whole[:, places], rtol=LAST_BITS)
    np.testing.assert_allclose(function.jacobian(POINT, wrt=wrt, sparse=True).toarray(), whole[:, places], LAST_BITS)
    values = np.empty((8, len(names)))
    function.bind_jacobian(POINT.copy(), values, wrt=[cg.variable(name) for name in names])()
    np.testing.assert_allclose(values, whole[:, places], rtol=LAST_BITS)
    X_dot = rng.normal(size=(3, len(names)))
    np.testing.assert_allclose(function.jvp(POINT, X_dot, wrt=wrt), X_dot @ whole[:, places].T, rtol=SHORT_SUM)
    np.testing.assert_allclose(function.vjp(POINT, weights, wrt=wrt), function.vjp(POINT, weights)[places], LAST_BITS)
    second = function.hessian(POINT, weights)[np.ix_(places, places)]
    np.testing.assert_allclose(function.hessian(POINT, weights, wrt=wrt), second, rtol=SHORT_SUM)


def test_inputs_to_differentiate_by_are_checked(backend):
    function = compiled(example(), backend)
    for wrt, message in ((["w"], "no input 'w'"), (["x", "x"], "twice"), ([], "at least one")):
        with pytest.raises(GraphError, match=message):
            function.jacobian(POINT, wrt=wrt)
    with pytest.raises(GraphError, match=r"X_dot must have shape \(k, 2\) or \(2,\), got \(4,\)"):
        function.jvp(POINT, np.ones(4), wrt=["x", "y"])
    with pytest.raises(GraphError, match=r"in shape \(8, 2\)"):
        function.bind_jacobian(POINT, np.empty((8, 4)), wrt=["x", "y"])


def test_names_are_no_matter():
    long = cg.variable("u" * 1000)
    taken = cg.Graph([long, cg.variable("f_bar")], {"f": long * cg.variable("f_bar"), "a line": long, "d0/d0": 1.0})
    function = compiled(taken, "python", LANES)
    assert function.jacobian([2.0, 3.0]).tolist() == [[3.0, 2.0], [1.0, 0.0], [0.0, 0.0]]
    assert function.vjp([2.0, 3.0], [1.0, 1.0, 1.0]).tolist() == [4.0, 2.0]
    assert function.hessian([2.0, 3.0], [1.0, 1.0, 1.0]).tolist() == [[0.0, 1.0], [1.0, 0.0]]


def test_a_bound_jacobian_needs_memory_that_it_can_use(backend):
    function = compiled(example(), backend)
    for point, matrix in (
        (POINT.tolist(), np.empty((8, 4))),
        (POINT, np.empty((4, 8))),
        (POINT, np.empty((8, 4), order="F")),
        (POINT, np.empty((8, 4), dtype=np.float32)),
        (POINT, np.frombuffer(bytes(8 * 32)).reshape(8, 4)),
    ):
        with pytest.raises(GraphError):
            function.bind_jacobian(point, matrix)
    both = np.empty(36)
    with pytest.raises(GraphError, match="share"):
        function.bind_jacobian(both[:4], both[1:33].reshape(8, 4))


def test_a_result_is_the_callers_own_whatever_the_kind_of_array_and_after_a_pickle(backend):
    function = compiled(example(), backend)
    first = function.jacobian(POINT)
    kept = first.copy()
    function.jacobian(2.0 * POINT)
    assert np.array_equal(first, kept)
    x_dot = np.ones((2, 8))[:, ::2]
    for point in (POINT.tolist(), POINT.astype(np.float32), np.repeat(POINT, 2)[::2]):
        assert np.allclose(function.jacobian(point), kept, rtol=1e-6)
        assert np.allclose(function.jvp(point, x_dot), function.jvp(POINT, np.ones((2, 4))), rtol=1e-6)
    assert np.array_equal(pickle.loads(pickle.dumps(function)).jacobian(POINT), kept)
    sparse = function.jacobian(POINT, sparse=True)
    sparse.indices[:] = 0
    assert np.array_equal(function.jacobian(POINT, sparse=True).toarray(), kept)


def test_threads_make_one_derivative_and_run_it_at_once():
    function = compiled(example())
    points = np.random.default_rng(0).uniform(0.1, 1.0, (40, 4))
    alone = compiled(example())
    expected = [alone.jacobian(point) for point in points]
    start = threading.Barrier(4)

    def work(_):
        start.wait()
        return [(function.jacobian(p), function.jvp(p, np.eye(4)).T, function.hessian(p, np.ones(8))) for p in points]

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(work, range(4)))
    for rows in found:
        for (jacobian, products, _), right in zip(rows, expected, strict=True):
            assert np.array_equal(jacobian, right)
            assert np.allclose(products, right, rtol=LAST_BITS)


def test_machine_code_of_derivatives_is_kept_on_disk(tmp_path):
    pytest.importorskip("llvmlite")
    graph = cg.Graph([x, y], {"f": x * y * y, "g": x / y})
    found = []
    for _ in range(2):
        function = compiled(graph, "llvm", LANES, cache=tmp_path)
        products = function.jvp([1.0, 2.0], np.eye(2)).tolist(), function.hessian([1.0, 2.0], [1.0, 0.0]).tolist()
        found.append((products, sorted(tmp_path.iterdir())))
    assert found[0] == found[1]
    assert len(found[0][1]) == 3  # with the function itself


def test_another_shape_is_an_error(backend):
    function = compiled(example(), backend)
    for call in (function.jacobian, lambda p: function.jvp(p, POINT), lambda p: function.hessian(p, np.ones(8))):
        with pytest.raises(GraphError, match=r"x must have shape \(4,\)"):
            call(POINT[:3])
    with pytest.raises(GraphError, match=r"X_dot must have shape \(k, 4\) or \(4,\), got \(4, 3\)"):
        function.jvp(POINT, np.ones((4, 3)))
    with pytest.raises(GraphError, match=r"Y_bar must have shape \(k, 8\) or \(8,\), got \(\)"):
        function.vjp(POINT, 1.0)
    with pytest.raises(GraphError, match="hessian needs y_bar, the weights of the 8 outputs"):
        function.hessian(POINT)
    with pytest.raises(GraphError, match=r"y_bar must have shape \(8,\)"):
        function.hessian(POINT, [1.0])


def test_long_graphs_pass_values_between_functions(monkeypatch):
    """Machine code divided every few steps has the numbers of Python."""
    monkeypatch.setattr(schedule, "STEPS", 7)
    directions = np.random.default_rng(0).uniform(-1.0, 1.0, (17, 8))
    native, plain = compiled(example(), fma=False), compiled(example(), "python", fma=False)
    assert same(native.jvp(POINT, directions[:, :4]), plain.jvp(POINT, directions[:, :4]))
    assert same(native.vjp(POINT, directions), plain.vjp(POINT, directions))
