"""Batches by several threads: the same values, every column once, and a clean end."""

import signal
import threading

import numpy as np
import pytest

import cgraph as cg
from cgraph.program.runners import native_runner, python_runner
from cgraph.util import threads
from cgraph.util.threads import share, thread_count
from tests.cgraph.engines import ENGINES

BATCH_ULPS = 4  # of a batch against one point at a time: polynomials in place of libm
PATIENCE = 30.0  # seconds until a test that waits for another thread gives up


def graph():
    x, y = cg.variables("x y")
    return cg.Graph([x, y], {"u": cg.sin(x) + cg.exp(y) + 4.0, "v": cg.log(cg.abs(x) + 1.0) * y, "x": x})


def points(count):
    """Among them some that a vector of lanes takes to libm, and its neighbours with it."""
    source = np.random.default_rng(7)
    X = source.uniform(-2.0, 2.0, (2, count)).astype(np.float32).astype(float)
    X[0, source.random(count) < 0.05] = 1e9
    return X


@pytest.fixture(params=[*ENGINES, "auto without llvmlite"])
def function(request, without, monkeypatch):
    """Functions whose blocks are small, so that small batches have many."""
    if "without" in request.param:
        without("llvmlite")
    monkeypatch.setattr(native_runner, "WORK", 24 * len(graph().nodes))
    for name in ("BLOCK", "STATES"):
        monkeypatch.setattr(python_runner, name, 24)
    return cg.compile(graph(), request.param.partition(" ")[0])


def test_the_values_do_not_depend_on_the_number_of_threads(function):
    for count in (0, 1, 7, 8, 9, 23, 24, 25, 47, 48, 49, 55, 1000):
        X = points(count)
        alone = function.batch(X)
        for number in (1, 2, 3, 8, None, np.int64(2)):
            assert function.batch(X, threads=number).tobytes() == alone.tobytes(), (count, number)
        for column in range(0, count, 7):
            np.testing.assert_array_almost_equal_nulp(alone[:, column], function(X[:, column]), BATCH_ULPS)


LAYOUTS = {
    "Fortran": np.asfortranarray,
    "every second column": lambda X: np.repeat(X, 2, axis=1)[:, ::2],
    "every second row": lambda X: np.repeat(X, 2, axis=0)[::2],
    "rows from below": lambda X: X[::-1].copy()[::-1],
    "columns from the right": lambda X: X[:, ::-1].copy()[:, ::-1],
    "part of a wider array": lambda X: np.pad(X, ((0, 0), (3, 5)))[:, 3:-5],
    "misaligned": lambda X: np.ndarray(X.shape, X.dtype, b"1" + X.tobytes(), 1),
    "misaligned rows": lambda X: np.ndarray(X.shape, X.dtype, b"".join(r.tobytes() + b"12" for r in X), 0, (802, 8)),
    "another byte order": lambda X: X.astype(">f8"),
    "float32": lambda X: X.astype(np.float32),
    "lists": lambda X: X.tolist(),
}


def test_the_layout_of_the_points_is_no_matter(function):
    X = points(100)
    expected = function.batch(X)
    for layout in LAYOUTS.values():
        laid_out = layout(X)
        assert np.array_equal(laid_out, X)
        found = function.batch(laid_out, threads=3)
        assert found.tobytes() == function.batch(laid_out).tobytes()
        # Of columns from right to left, NumPy computes some functions in another way.
        np.testing.assert_array_almost_equal_nulp(found, expected, 0 if function.backend == "llvm" else BATCH_ULPS)


def test_one_row_for_all_columns_and_one_column_for_all(function):
    X = points(100)
    assert np.array_equal(
        function.batch(np.broadcast_to(X[:, :1], (2, 100)), threads=3), function.batch(np.repeat(X[:, :1], 100, axis=1))
    )
    assert np.array_equal(
        function.batch(np.broadcast_to(X[0], (2, 100)), threads=3), function.batch(np.stack([X[0], X[0]]))
    )


def test_every_item_is_done_once_whoever_does_it():
    done = []
    share(done.append, range(1000), 4)
    assert sorted(done) == list(range(1000))


def test_as_many_threads_work_at_once_as_asked_for_the_callers_among_them():
    together, names = threading.Barrier(3), []

    def work(_):
        names.append(threading.current_thread())
        together.wait(PATIENCE)  # passed only by three at once

    share(work, range(3), 3)
    assert len(set(names)) == 3
    assert threading.current_thread() in names


def test_a_small_batch_starts_no_thread(monkeypatch):
    def refuse(_):
        raise AssertionError("a thread for a small batch")

    monkeypatch.setattr(threads, "ThreadPoolExecutor", refuse)
    for backend in ("auto", "numpy", "python"):
        assert cg.compile(graph(), backend).batch(points(4096), threads=8).shape == (3, 4096)


@pytest.mark.parametrize("number", [1, 2, 5])
def test_an_error_ends_the_work_and_is_raised(number):
    done = []

    def work(item):
        if item == 10:
            raise ZeroDivisionError("item 10")
        done.append(item)

    before = threading.active_count()
    with pytest.raises(ZeroDivisionError, match="item 10"):
        share(work, range(100_000), number)
    assert len(done) < 99_999
    assert threading.active_count() == before


def test_an_error_in_another_thread_is_raised_in_the_callers():
    main, met = threading.current_thread(), threading.Barrier(2)

    def work(_):
        met.wait(PATIENCE)
        if threading.current_thread() is not main:
            raise FloatingPointError("elsewhere")

    with pytest.raises(FloatingPointError, match="elsewhere"):
        share(work, range(2), 2)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", [1, 2])
def test_ctrl_c_stops_after_the_blocks_under_way(number):
    main, done = threading.current_thread(), []
    interrupted = threading.Event()

    def work(item):
        if threading.current_thread() is main:
            interrupted.set()
            signal.raise_signal(signal.SIGINT)
        interrupted.wait(PATIENCE)
        done.append(item)

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        share(work, range(100_000), number)
    assert len(done) < 99_999
    assert threading.active_count() == before


def test_none_is_the_number_of_cores_of_this_process():
    assert 1 <= thread_count(None) <= (threads.os.cpu_count() or 1)
