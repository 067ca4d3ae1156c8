"""Timing: the clocks, runs in turns, processes of their own, one core, and the machine that times belong to."""

from __future__ import annotations

import gc
import json
import math
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from cgraph._shared import Array

Made = TypeVar("Made")
CLOCKS = 200  # readings of the clocks, of which the quickest tells what they take
ANSWER = "the answer: "  # of another process, on its last line
CHUNK = 2e-3  # s, at least, of calls that are timed together


class Spent(NamedTuple, Generic[Made]):
    """Seconds by the clock and of the processor, and what came of them."""

    seconds: float
    processor: float
    made: Made


def spent(run: Callable[[], Made]) -> Spent[Made]:
    """A run, and what it took."""
    worked, begin = time.process_time(), time.perf_counter()
    made = run()
    seconds = time.perf_counter() - begin
    return Spent(seconds, time.process_time() - worked, made)


def nothing() -> None:
    """Do nothing."""


@dataclass
class Timed:
    """A run with what its turns took, by the clock and of the processor [s]; `rewind` goes back to its start."""

    run: Callable[[], Any]
    rewind: Callable[[], object] = nothing
    seconds: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)


def in_turns(runs: Sequence[Timed], turns: int, chunk: float = 0.0, enough: float = math.inf) -> None:
    """Time all runs in turns, so that a busy machine slows all alike, without garbage collection.

    chunk: seconds of a turn, which short runs fill by several.  enough: seconds of a run, after which three are enough.
    """
    gc.disable()
    read = min([spent(nothing).processor for _ in range(CLOCKS)])  # what the reading of the clocks takes
    try:
        for _ in range(turns):
            for each in runs:
                if len(each.seconds) >= 3 and sum(each.seconds) > enough:
                    continue
                left = chunk
                while left >= 0.0:
                    each.rewind()
                    taken = spent(each.run)
                    each.seconds.append(taken.seconds)
                    each.processor.append(max(taken.processor - read, 0.0))
                    left -= taken.seconds
    finally:
        gc.enable()


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


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """The p of the least-squares fit y = c x^p on logarithms; x and y positive."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


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


def machine() -> str:
    """The processor and the versions that the figures belong to."""
    packages = []
    for name in ("numpy", "llvmlite", "casadi", "pin", "mujoco", "heyoka", "jax", "sympy", "torch"):
        with suppress(metadata.PackageNotFoundError):
            packages.append(f"{name} {metadata.version(name)}")
    return f"{_processor()}, Python {platform.python_version()}, {', '.join(packages)}"


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    facts = dict(re.findall(r"^(model name|flags)\s*:\s*(.*)$", text, flags=re.MULTILINE))
    vectors = next((name for name in ("avx512f", "avx2") if name in facts.get("flags", "").split()), "")
    return " ".join(filter(None, [facts.get("model name", platform.machine()), vectors and f"({vectors})"]))


def load() -> float | None:
    """Processes that want to run, mean over the last minute; None where the system does not tell."""
    with suppress(OSError, AttributeError):
        return os.getloadavg()[0]
    return None
