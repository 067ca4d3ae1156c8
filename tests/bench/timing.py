"""Timing of short calls, on one core, and in processes of their own."""

from __future__ import annotations

import gc
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cgraph._shared import Array
from dynamics.experiments.timing import spent

ANSWER = "the answer: "  # of another process, on its last line
CHUNK = 2e-3  # s, at least, of calls that are timed together


def repetitions(run: Callable[[], object]) -> int:
    """Number of calls that make a measurable time."""
    once = spent(run).seconds
    return max(1, math.ceil(CHUNK / once)) if once < CHUNK else 1


def timed(run: Callable[[], object], repetitions: int) -> float:
    """Seconds of a call, after one that brings the caches back."""
    gc.disable()
    try:
        run()
        start = time.perf_counter()
        for _ in range(repetitions):
            run()
        return (time.perf_counter() - start) / repetitions
    finally:
        gc.enable()


def relative_difference(found: Array, expected: Array) -> float:
    """The largest difference, over the largest entry of what was expected."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


_ONE_CORE = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "TF_CPP_MIN_LOG_LEVEL": "3",
}


@contextmanager
def single_core() -> Iterator[None]:
    """This process and those started within run on one core, the same for all, and start no threads to share it."""
    before = {name: os.environ.get(name) for name in _ONE_CORE}
    os.environ.update(_ONE_CORE)
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    try:
        if cores:
            os.sched_setaffinity(0, {max(cores)})
        yield
    finally:
        if cores:
            os.sched_setaffinity(0, cores)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def run_fresh(module: str, function: str, *arguments: Any, timeout: float | None = None) -> Any:
    """What a function of that module returns in a process of its own, which imports what this one would; as JSON.

    Raises RuntimeError with the last line of its errors, or where it takes longer than `timeout` s.
    """
    program = (
        f"import json, sys; from {module} import {function} as run; "
        f"sys.stdout.write('\\n{ANSWER}' + json.dumps(run(*json.loads(sys.stdin.read()))))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([each or str(Path.cwd()) for each in sys.path])}
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", program], input=json.dumps(arguments), capture_output=True, text=True,
            timeout=timeout, check=False, env=environment,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"not ready within {timeout:g} s") from None
    if (last := done.stdout.rpartition("\n")[2]).startswith(ANSWER):
        return json.loads(last.removeprefix(ANSWER))
    lines = done.stderr.strip().splitlines()
    raise RuntimeError((lines[-1] if lines else f"its process ended with status {done.returncode}")[:200])
