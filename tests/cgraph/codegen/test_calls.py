"""Calls of a compiled function in every engine: values of every kind, the same sentences, and arrays bound once."""

import gc
import pickle
import subprocess
import sys
import weakref
from array import array
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest

import cgraph as cg
from cgraph.codegen import bound_call
from tests.cgraph.engines import LLVM, ODD_POINTS, evaluated, odd_graphs
from tests.ulps import same

x, y, z = cg.variables("x y z")
GRAPH = cg.Graph([x, y, z], {"u": cg.sin(x) * y + z, "v": x / y, "z": z})
PAIR = cg.Graph([x, y], {"a": x * y, "b": x + y})


@pytest.fixture
def function(backend):
    return cg.compile(GRAPH, backend)


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


def test_the_kind_of_array_is_no_matter(function):
    expected = np.array(list(GRAPH.evaluate(dict(zip("xyz", POINT.tolist(), strict=True))).values()))
    ulp = np.spacing(np.abs(expected))
    assert [name for name, view in VIEWS.items() if (np.abs(function(view) - expected) > ulp).any()] == []
    assert np.array_equal(function(np.array([0, 2, 7])), [7.0, 0.0, 7.0])
    assert np.array_equal(function(np.array([False, True, True])), [1.0, 0.0, 1.0])


def test_every_real_number_is_taken(backend):
    function = cg.compile(PAIR, backend)
    for number in (True, Fraction(1, 3), np.float32(1.5), np.longdouble(1.5), np.int8(3), np.uint64(2), np.array(2.0)):
        expected = [2.0 * float(number), float(number) + 2.0]
        found = list(PAIR.evaluate({"x": number, "y": 2}).values())
        assert [*map(repr, found)] == [*map(repr, expected)]
        assert function([number, 2]).tolist() == function.batch([[number], [2]])[:, 0].tolist() == expected


def test_an_array_of_another_shape_is_an_error(function):
    for wrong in (POINT[:2], POINT[:1], POINT[:, None], POINT[None], np.zeros(4), np.float64(1.0), np.zeros(0), []):
        with pytest.raises(cg.GraphError, match=r"x must have shape \(3,\), one value for each input \(x, y, z\), got"):
            function(wrong)
    for wrong in ([1.0] * 3, np.ones((2, 3)), np.ones((3, 1, 1))):
        with pytest.raises(cg.GraphError, match=r"X must have shape \(3, N\)"):
            function.batch(wrong)
    assert np.array_equal(function([0.0, 2.0, 7.0]), [7.0, 0.0, 7.0])


NUMBERLESS = {  # what numbers must be, got: at one point
    "text": ["a", 1.0, 2.0],
    "text of bytes": np.zeros(3, "S1"),
    "NoneType: None": [1.0, None, 2.0],
    "complex numbers": [1j, 1.0, 2.0],
    "complex numbers of NumPy": POINT + 0j,
    "one that is too large for float64": [10**400, 1.0, 2.0],
    "an array with masked values": np.ma.array(POINT, mask=[False, True, False]),
}


def test_what_is_no_real_number_is_told_in_the_same_words(function):
    for given, point in NUMBERLESS.items():
        sentence = f"must be real numbers, got {given.partition(' of ')[0] if given != 'one' else given}"
        for call in (
            lambda point=point: GRAPH.evaluate(dict(zip("xyz", point, strict=True))),
            lambda point=point: function(point),
            lambda point=point: function.batch(point),
        ):
            with pytest.raises((TypeError, ValueError), match=sentence):
                call()
    assert np.array_equal(function([0.0, 2.0, 7.0]), [7.0, 0.0, 7.0])


def test_outputs_share_memory_with_nothing():
    product = x * y
    graph = cg.Graph([x, y], {"p": product, "q": product, "x": x, "again": x, "c": cg.constant(2.0), "d": 2.0})
    for point in (
        {"x": np.ones(3), "y": np.ones(3)},
        {"x": np.ones(3), "y": 2.0},
        {"x": np.ones((2, 1)), "y": np.ones(3)},
    ):
        kept = {name: np.array(value) for name, value in point.items()}
        arrays = [*graph.evaluate(point).values()]
        given = [value for value in point.values() if isinstance(value, np.ndarray)]
        for k, each in enumerate(arrays):
            assert not any(np.shares_memory(each, other) for other in [*arrays[:k], *given])
            each[:] = -1.0
        assert all(np.array_equal(point[name], kept[name]) for name in point)


def test_a_result_is_the_callers_own_and_what_is_given_stays(function):
    given = POINT.copy()
    first = function(given)
    kept = first.copy()
    function(2.0 * POINT)
    function.batch(np.ones((3, 5)))
    assert np.array_equal(first, kept)
    assert np.array_equal(given, POINT)


def test_results_go_where_they_are_to_go(function):
    points = np.random.default_rng(0).normal(size=(3, 9))
    expected = function.batch(points)
    for order in "CF":
        out = np.empty((3, 9), order=order)
        assert function.batch(points, out=out) is out
        assert np.array_equal(out, expected)
    frozen = np.empty((3, 9))
    frozen.flags.writeable = False
    for wrong, says in ((np.empty((3, 8)), "shape"), (np.empty((3, 9), np.float32), "float64"), (frozen, "read-only")):
        with pytest.raises(cg.GraphError, match=says):
            function.batch(points, out=wrong)
    both = np.zeros((3, 9))
    with pytest.raises(cg.GraphError, match="must not share memory"):
        function.batch(both, out=both)


def test_odd_graphs_have_the_same_values_in_every_engine(backend):
    for name, graph in odd_graphs().items():
        function = cg.compile(graph, backend)
        for point, expected in zip(ODD_POINTS[name], evaluated(graph, ODD_POINTS[name]), strict=True):
            x, bound = np.array(point), np.zeros(len(expected))
            function.bind(x, bound)()
            for found in (bound, function(point), function(x), function.values(point)):
                assert same(found, expected)
            assert same(function.batch(np.repeat(x[:, None], 60, axis=1))[:, 59], expected)
            assert same(function.batch(x[:, None])[:, 0], expected)
    assert function.batch(np.ones((0, 0))).shape == (3, 0)


def test_a_cache_in_the_home_is_not_a_folder_called_tilde(backend, monkeypatch, tmp_path):
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path))
    assert cg.compile(PAIR, backend, cache="~/code").options["cache"] == str(tmp_path / "code")
    assert cg.clear_cache("~/code") == (backend == "llvm")


def test_a_bound_function_reads_and_writes_its_arrays(function):
    x, y = np.empty(3), np.empty(3)
    run = function.bind(x, y)
    for scale in (1.0, -2.0, 0.5):
        x[:] = scale * POINT
        assert run() is None
        assert np.array_equal(y, function(x))
    trajectory = np.tile(np.arange(5.0)[:, None] + 1.0, (1, 6))
    for run in [function.bind(row[:3], row[3:]) for row in trajectory]:  # of one array, but apart
        run()
    assert np.array_equal(trajectory[:, 3:], function.batch(trajectory[:, :3].T).T)


def test_bound_functions_of_many_threads_do_not_meet(function):
    points = np.random.default_rng(0).uniform(1.0, 2.0, (8, 3))
    expected = [function(point) for point in points]

    def calls(k):
        x, y = points[k].copy(), np.empty(3)
        run = function.bind(x, y)
        for _ in range(300):
            y[:] = np.nan
            run()
            if not np.array_equal(y, expected[k]):
                return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(calls, range(8)))


one, three = np.zeros(5), np.zeros(3)
WRONG = {  # what is wrong: x, y, and what is said
    "x of another length": (np.zeros(2), three, r"x must be an array of float64 in shape \(3,\), got float64 \(2,\)"),
    "x of two dimensions": (np.zeros((3, 1)), three, r"x must be an array of float64 in shape \(3,\)"),
    "x a list": ([0.0] * 3, three, "x must be an array of float64 .* got list"),
    "y of integers": (three, np.zeros(3, int), "y must be an array of float64 .* got int"),
    "x in another byte order": (np.zeros(3, ">f8"), three, "x must be an array of float64 .* got >f8"),
    "y with gaps": (three, np.zeros(6)[::2], r"y must be contiguous and aligned, got strides \(16,\)"),
    "x misaligned": (np.ndarray(3, np.float64, b"1" * 25, 1), three, "x must be contiguous and aligned"),
    "y read-only": (three, np.frombuffer(bytes(24)), "y must be an array that can be written"),
    "x and y in one place": (one[:3], one[2:], "x and y must not share memory"),
}


def test_binding_anything_else_is_an_error(function):
    for x, y, sentence in WRONG.values():
        with pytest.raises(cg.GraphError, match=sentence):
            function.bind(x, y)


@pytest.mark.parametrize("engine", [LLVM])
def test_a_bound_function_takes_nothing_gives_none_and_stays_in_its_process(engine, monkeypatch):
    """And is the same through ctypes, which is how other Pythons than CPython call it."""
    direct, converted = np.empty(3), np.empty(3)
    function = cg.compile(GRAPH, engine)
    run = function.bind(POINT.copy(), direct)
    before = sys.getrefcount(None)
    results = [run() for _ in range(5000)]
    assert results == [None] * 5000
    del results
    assert abs(sys.getrefcount(None) - before) < 500  # a None too few or too many for each call is seen
    with pytest.raises(TypeError):
        run(POINT)
    with pytest.raises(TypeError, match="pickle the compiled graph and bind it again"):
        pickle.dumps(run)
    monkeypatch.setattr(bound_call, "_enter", lambda: None)
    function.bind(POINT, converted)()
    assert np.array_equal(direct, converted)


def test_a_bound_function_lets_its_arrays_go():
    x, y = POINT.copy(), np.empty(3)
    run = cg.compile(GRAPH).bind(x, y)
    alive = weakref.ref(y)
    del x, y
    gc.collect()
    assert alive() is not None
    del run
    gc.collect()
    assert alive() is None


def test_python_m_cgraph_is_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "cgraph", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"cgraph {cg.__version__}\n"
