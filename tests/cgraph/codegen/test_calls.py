"""Calls of a compiled function: arrays of every kind at one point, and arrays bound once."""

import gc
import pickle
import sys
import threading
import weakref
from array import array
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import cgraph as cg
from cgraph.codegen import bound_call


@pytest.fixture(params=["llvm", "numpy", "python"])
def backend(request):
    if request.param == "llvm":
        pytest.importorskip("llvmlite")
    return request.param


def graph():
    x, y, z = cg.variables("x y z")
    return cg.Graph([x, y, z], {"u": cg.sin(x) * y + z, "v": x / y, "z": z})


POINT = np.array([0.25, -3.0, 1024.0])  # of a kind that float32 and integers hold, but for the first
VIEWS = {
    "list": POINT.tolist(),
    "tuple": tuple(POINT.tolist()),
    "every second": np.repeat(POINT, 2)[::2],
    "from the right": POINT[::-1].copy()[::-1],
    "read-only": np.frombuffer(POINT.tobytes()),
    "float32": POINT.astype(np.float32),
    "float16": POINT.astype(np.float16),
    "another byte order": POINT.astype(">f8"),
    "objects": POINT.astype(object),
    "masked": np.ma.array(POINT),
    "matrix row": np.asfortranarray(np.tile(POINT, (4, 1)))[2],
    "misaligned": np.ndarray(3, np.float64, b"1" + POINT.tobytes(), 1),
    "array of the standard library": array("d", POINT),
    "memory": memoryview(POINT),
}


@pytest.mark.parametrize("view", VIEWS)
def test_the_kind_of_array_is_no_matter(backend, view):
    function = cg.compile(graph(), backend)
    expected = list(graph().evaluate(dict(zip("xyz", POINT.tolist(), strict=True))).values())
    np.testing.assert_array_almost_equal_nulp(function(VIEWS[view]), np.array(expected), 1)


def test_integers_and_truth_values_are_numbers(backend):
    function = cg.compile(graph(), backend)
    assert np.array_equal(function(np.array([0, 2, 7])), [7.0, 0.0, 7.0])
    assert np.array_equal(function(np.array([False, True, True])), [1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    "x",
    [POINT[:2], POINT[:1], POINT[:, None], POINT[None], np.zeros(4), np.float64(1.0), np.zeros(0)],
)
def test_an_array_of_another_shape_is_an_error(backend, x):
    function = cg.compile(graph(), backend)
    with pytest.raises(ValueError, match=r"x must have shape \(3,\)"):
        function(x)
    assert np.array_equal(function([0.0, 2.0, 7.0]), [7.0, 0.0, 7.0])


NUMBERLESS = {
    "text": np.zeros(3, "S1"),
    "complex numbers": POINT + 0j,
    "an array with masked values": np.ma.array(POINT, mask=[False, True, False]),
    "NoneType: None": [1.0, None, 2.0],
}


@pytest.mark.parametrize("given", NUMBERLESS)
def test_what_is_no_real_number_is_an_error(backend, given):
    function = cg.compile(graph(), backend)
    with pytest.raises(TypeError, match=f"x must be real numbers, got {given}"):
        function(NUMBERLESS[given])
    with pytest.raises(TypeError, match=f"X must be real numbers, got {given}"):
        function.batch(NUMBERLESS[given])
    assert np.array_equal(function([0.0, 2.0, 7.0]), [7.0, 0.0, 7.0])


def test_a_result_is_the_callers_own(backend):
    function = cg.compile(graph(), backend)
    first = function(POINT)
    kept = first.copy()
    function(2.0 * POINT)
    assert np.array_equal(first, kept)


def test_a_bound_function_reads_and_writes_its_arrays(backend):
    function = cg.compile(graph(), backend)
    x, y = np.empty(3), np.empty(3)
    run = function.bind(x, y)
    for scale in (1.0, -2.0, 0.5):
        x[:] = scale * POINT
        assert run() is None
        assert np.array_equal(y, function(x))


def test_a_bound_function_works_within_larger_arrays(backend):
    function = cg.compile(graph(), backend)
    trajectory = np.tile(np.arange(5.0)[:, None] + 1.0, (1, 6))
    steps = [function.bind(row[:3], row[3:]) for row in trajectory]  # of one array, but apart
    for run in steps:
        run()
    assert np.array_equal(trajectory[:, 3:], function.batch(trajectory[:, :3].T).T)


def test_a_bound_function_keeps_what_it_needs(backend):
    y = np.empty(3)
    run = cg.compile(graph(), backend).bind(POINT.copy(), y)
    gc.collect()
    fill = [np.full(3, np.nan) for _ in range(100)]  # takes the place of memory set free
    run()
    assert len(fill) == 100
    assert np.array_equal(y, cg.compile(graph(), backend)(POINT))


def test_bound_functions_of_many_threads_do_not_meet(backend):
    function = cg.compile(graph(), backend)
    found = {}

    def work(key):
        x, y = np.full(3, float(key)), np.empty(3)
        run = function.bind(x, y)
        for _ in range(300):
            run()
        found[key] = y

    workers = [threading.Thread(target=work, args=(key,)) for key in range(1, 5)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(np.array_equal(found[key], function(np.full(3, float(key)))) for key in range(1, 5))


def read_only(values):
    values.flags.writeable = False
    return values


one = np.zeros(5)
WRONG = {
    "x of another length": (
        np.zeros(2),
        np.zeros(3),
        r"x must be an array of float64 in shape \(3,\), got float64 \(2,\)",
    ),
    "x of two dimensions": (np.zeros((3, 1)), np.zeros(3), r"x must be an array of float64 in shape \(3,\)"),
    "x a list": ([0.0] * 3, np.zeros(3), "x must be an array of float64 .* got list"),
    "y of integers": (np.zeros(3), np.zeros(3, int), "y must be an array of float64 .* got int"),
    "x in another byte order": (np.zeros(3, ">f8"), np.zeros(3), "x must be an array of float64 .* got >f8"),
    "y with gaps": (np.zeros(3), np.zeros(6)[::2], r"y must be contiguous and aligned, got strides \(16,\)"),
    "x misaligned": (np.ndarray(3, np.float64, b"1" * 25, 1), np.zeros(3), "x must be contiguous and aligned"),
    "y read-only": (np.zeros(3), read_only(np.zeros(3)), "y must be an array that can be written"),
    "x and y in one place": (one[:3], one[2:], "x and y must not share memory"),
}


@pytest.mark.parametrize("what", WRONG)
def test_binding_anything_else_is_an_error(backend, what):
    x, y, sentence = WRONG[what]
    with pytest.raises(cg.GraphError, match=sentence):
        cg.compile(graph(), backend).bind(x, y)


def test_a_graph_without_inputs_is_called_with_nothing(backend):
    function = cg.compile(cg.Graph([], {"c": cg.constant(1.5)}), backend)
    y = np.zeros(1)
    function.bind(np.empty(0), y)()
    assert y[0] == function([])[0] == function(np.empty(0))[0] == function.values([])[0] == 1.5


def test_a_bound_function_is_what_it_is_through_ctypes(monkeypatch):
    """Which is how other Pythons than CPython call it."""
    pytest.importorskip("llvmlite")
    direct, converted = np.empty(3), np.empty(3)
    function = cg.compile(graph(), "llvm")
    function.bind(POINT, direct)()
    monkeypatch.setattr(bound_call, "_enter", lambda: None)
    function.bind(POINT, converted)()
    assert np.array_equal(direct, converted)


def test_a_bound_function_takes_nothing_gives_none_and_stays_in_its_process():
    pytest.importorskip("llvmlite")
    run = cg.compile(graph(), "llvm").bind(POINT.copy(), np.empty(3))
    before = sys.getrefcount(None)
    results = [run() for _ in range(5000)]
    assert results == [None] * 5000
    del results
    assert abs(sys.getrefcount(None) - before) < 500  # a None too few or too many for each call is seen
    with pytest.raises(TypeError):
        run(POINT)
    with pytest.raises(TypeError, match="pickle the compiled graph and bind it again"):
        pickle.dumps(run)


def test_a_bound_function_lets_its_arrays_go():
    x, y = POINT.copy(), np.empty(3)
    run = cg.compile(graph()).bind(x, y)
    alive = weakref.ref(y)
    del x, y
    gc.collect()
    assert alive() is not None
    del run
    gc.collect()
    assert alive() is None


def test_bound_functions_of_many_threads(backend):
    function = cg.compile(graph(), backend)
    points = np.random.default_rng(0).uniform(1.0, 2.0, (8, 3))
    expected = [function(point) for point in points]

    def calls(k):
        x, y = points[k].copy(), np.empty(3)
        run = function.bind(x, y)
        for _ in range(500):
            y[:] = np.nan
            run()
            if not np.array_equal(y, expected[k]):
                return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(calls, range(8)))
