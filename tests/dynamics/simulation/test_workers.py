"""Workers: whoever runs an ensemble, threads, processes or another map, its numbers are the same."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import mark, raises

from cgraph.codegen import llvm_engine
from dynamics import simulate_many
from dynamics.simulation.ensembles import task
from dynamics.simulation.steps import step_program
from tests.dynamics.models import arms, random_arm, same
from tests.dynamics.step_options import step
from tests.early_end import stops
from tests.slow import slow


def case(method: str) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Twenty-nine arms, one of which leaves the numbers."""
    model, q, qd = arms(29)
    qd[3] = 1e200
    return (model, q, qd, 0.2, method), {"t_eval": [0.1, 0.2], "tau": np.tanh(q)}


@stops
@mark.parametrize(
    ("backend", "method"),
    [("llvm", "rk4"), ("llvm", "midpoint"), ("python", "rk4")]
    + slow(("llvm", "dop853"), ("python", "midpoint"), ("python", "dop853")),
)
def test_threads_and_chunks_change_nothing(backend: str, method: str) -> None:
    if backend == "llvm":
        pytest.importorskip("llvmlite")
    arguments, options = case(method)
    options |= {"backend": backend, **step(method, 0.02)}
    alone = simulate_many(*arguments, **options)
    assert same(alone, simulate_many(*arguments, **options, workers=3))
    assert same(alone, simulate_many(*arguments, **options, workers=None, chunk=7))
    assert same(alone, simulate_many(*arguments, **options, workers=map, chunk=1))


@stops
def test_parts_may_come_in_any_order() -> None:
    arguments, options = case("rk4")
    alone = simulate_many(*arguments, **options)
    assert same(alone, simulate_many(*arguments, **options, workers=lambda f, each: [f(x) for x in reversed(each)]))


def optimize(level: int) -> None:
    llvm_engine.LEVEL = level


@stops
@mark.parametrize("method", ["dopri5", *slow("rk4")])
def test_processes_change_nothing_and_make_the_code_once(method: str) -> None:
    arguments, options = case(method)
    alone = simulate_many(*arguments, **options)
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, spawn, optimize, [llvm_engine.LEVEL]) as pool:
        assert same(alone, simulate_many(*arguments, **options, workers=pool.map, chunk=8))
        assert pool.submit(programs_made).result() == 1


@mark.slow  # two processes that load the library
@mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal on this system")
def test_a_killed_process_is_a_sentence() -> None:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(abs, range(8)))

        def kill() -> None:
            pid = next(iter({each.pid for each in multiprocessing.active_children()}))
            assert pid is not None
            os.kill(pid, signal.SIGKILL)

        timer = threading.Timer(4.0, kill)
        timer.start()
        with raises(RuntimeError, match="process pool was terminated abruptly"):
            simulate_many(
                *arms(29),
                1e5,
                "rk4",
                dt=1e-3,
                t_eval=[1e5],
                workers=pool.map,
                chunk=8,
            )
        timer.join()


def programs_made() -> int:
    return step_program._arrived.cache_info().misses


def test_threads_make_the_code_once() -> None:
    model, q, qd = arms(40, 4)
    with patch.object(task, "runner", wraps=task.runner) as making:
        simulate_many(model, q, qd, 0.1, "rk4", workers=4, chunk=8)
        simulate_many(model, q, qd, 0.2, "rk4", workers=4, chunk=8)
    assert making.call_count == 1


def drawn(seed: int) -> np.ndarray:
    """Where an arm from a start drawn here ends."""
    q, qd = np.random.default_rng(seed).normal(size=(2, 1, 2))
    return simulate_many(random_arm(2), q, qd, 0.1, t_eval=[0.1]).q


@mark.slow  # a scheduler and two processes
@stops
def test_dask_changes_nothing() -> None:
    distributed = pytest.importorskip("distributed")
    arguments, options = case("rk4")
    alone = simulate_many(*arguments, **options)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, protocol="tcp://", dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):

        def gathered(function: Callable[..., Any], items: Iterable[Any]) -> list[Any]:
            return client.gather(client.map(function, items, pure=False))  # type: ignore[no-any-return]

        assert same(alone, simulate_many(*arguments, **options, workers=gathered, chunk=8))
        executor = client.get_executor(pure=False)
        for workers in (executor, executor.map):
            assert same(alone, simulate_many(*arguments, **options, workers=workers, chunk=8))
        # Draws that a task makes from its own seed are its own.
        assert [each.tolist() for each in gathered(drawn, range(4))] == [drawn(seed).tolist() for seed in range(4)]


@mark.parametrize(("workers", "method"), [(1, "midpoint"), (3, "rk4"), *slow((1, "rk4"), (3, "midpoint"))])
def test_ctrl_c_comes_back_and_leaves_no_thread(workers: int, method: str, ctrl_c: Any) -> None:
    before = set(threading.enumerate())
    model, q, qd = arms(64)
    simulate_many(model, q, qd, 0.01, method, workers=workers)  # the code is made
    begin, timer = time.perf_counter(), ctrl_c(0.3)
    with raises(KeyboardInterrupt):
        simulate_many(model, q, qd, 1e9, method, t_eval=[0.0, 1e9], workers=workers, chunk=8)
    timer.join()
    assert time.perf_counter() - begin < 60.0  # of days
    assert set(threading.enumerate()) == before


def test_ctrl_c_is_not_lost_at_the_end_of_a_chunk() -> None:
    """Machine code hands a signal on when it returns, and its chunk may be done then."""
    made, to_end = list[Any](), task.LaneRun.to_end

    def interrupted(*arguments: Any) -> Any:
        made.append(to_end(*arguments))
        raise KeyboardInterrupt

    with patch.object(task.LaneRun, "to_end", interrupted), raises(KeyboardInterrupt):
        simulate_many(*arms(96), 0.01, "rk4", t_eval=[0.01], chunk=32, estimate_error=False)
    assert len(made) == 1


@patch.object(task.LaneRun, "to_end", side_effect=RuntimeError("broken"))
def test_an_error_in_a_thread_is_raised_and_leaves_no_thread(broken: object) -> None:
    before = set(threading.enumerate())
    with raises(RuntimeError, match="broken"):
        simulate_many(*arms(29), 0.1, "rk4", workers=3, chunk=8)
    assert set(threading.enumerate()) == before


def test_workers_that_give_no_results_are_refused() -> None:
    with raises(TypeError, match=r"workers must give the results of the function, as map does, got int: 1"):
        simulate_many(*arms(9), 0.1, "rk4", workers=lambda f, each: [1])  # type: ignore[list-item]


def test_an_interrupt_while_chunks_are_handed_out_ends_the_threads() -> None:
    """Whatever the instant: the pool waits for its threads, and these have to be told."""
    submit = task.ThreadPoolExecutor.submit

    class Interrupted(task.ThreadPoolExecutor):
        def submit(self, *arguments: Any) -> Any:
            future = submit(self, *arguments)
            if len(self._threads) > 1:
                raise KeyboardInterrupt
            return future

    before = set(threading.enumerate())
    model, q, qd = arms(64)
    with suppress(KeyboardInterrupt), patch.object(task, "ThreadPoolExecutor", Interrupted):
        simulate_many(model, q, qd, 1e9, "rk4", t_eval=[0.0, 1e9], workers=3, chunk=8)
    assert set(threading.enumerate()) <= before
