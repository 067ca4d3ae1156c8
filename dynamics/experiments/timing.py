"""Timing: the clocks, runs in turns, and the machine that times belong to."""

import gc
import math
import os
import platform
import re
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

Made = TypeVar("Made")
CLOCKS = 200  # readings of the clocks, of which the quickest tells what they take


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


@dataclass
class Timed:
    """A run with what its turns took, by the clock and of the processor [s]; `rewind` goes back to its start."""

    run: Callable[[], Any]
    rewind: Callable[[], object] = lambda: None
    seconds: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)


def in_turns(runs: Sequence[Timed], turns: int, chunk: float = 0.0, enough: float = math.inf) -> None:
    """Time all runs in turns, so that a busy machine slows all alike, without garbage collection.

    chunk: seconds of a turn, which short runs fill by several.  enough: seconds of a run, after which three are enough.
    """
    gc.disable()
    read = min([spent(lambda: None).processor for _ in range(CLOCKS)])  # what the reading of the clocks takes
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


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """The p of the least-squares fit y = c x^p on logarithms; x and y positive."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def machine() -> str:
    """The processor and the versions that the figures belong to."""
    packages = []
    for name in ("numpy", "llvmlite", "casadi", "pin", "mujoco", "heyoka", "jax"):
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
