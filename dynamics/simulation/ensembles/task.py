"""Task: the function that runs chunks of an ensemble, in any thread or process."""

from __future__ import annotations

import copy
import pickle
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np

from cgraph.extend import Record, Runner, runner

from ..recorder import Rows
from ..run_options import Limits
from ..stepping import AdaptiveRun, FixedRun
from ..trajectory import Array
from .chunk import Chunk, Part, empty
from .serialized import Portable
from .step_grid import Stretch
from .vectorized import SideBySide, Together

KEPT = 8  # programs that a process keeps ready


class StoppedError(Exception):
    """Nobody waits for the part any more."""


class _Watched:
    """A runner that looks up before each piece, of which a run makes many between two rows."""

    def __init__(self, runner: Runner, stopped: Callable[[], bool]) -> None:
        self._runner, self._stopped = runner, stopped

    def run(self, memory: Array, passes: int, every: int = 1) -> Record:
        """As the runner does. Raises StoppedError."""
        if self._stopped():
            raise StoppedError
        return self._runner.run(memory, passes, every)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._runner, name)


@dataclass(frozen=True)
class Task:
    """The function that runs chunks. It goes to other processes as it is, and is made ready there once."""

    pickled: bytes  # a Portable; that it is the same as another's is seen without reading it
    backend: str
    asked: Array | None  # times of the rows; None: every step
    count: int  # of the rows
    plan: Mapping[str, Any]  # what FixedRun or AdaptiveRun takes
    stretches: tuple[Stretch, ...]  # of trajectories side by side; empty: one after another

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        return self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)

    def run(self, chunk: Chunk, rows: Array, stopped: Callable[[], bool]) -> Part:
        """Run the chunk into rows (k, T, m). Raises StoppedError soon after it was stopped."""
        part = empty(chunk, rows)
        with np.errstate(all="ignore"):
            (self._side_by_side if self.stretches else self._one_by_one)(chunk, part, stopped)
        return part

    def _side_by_side(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            code = _together(self.pickled, self.backend)
        at = int(self.asked is None or self.asked[0] == 0.0)
        part.rows[:, :at] = chunk.x[:, None]
        run = SideBySide(code, chunk, part, at)
        for stretch in self.stretches:
            run.begin(stretch)
            for piece in stretch.pieces(*run.limits):
                if stopped():
                    raise StoppedError
                run.advance(*piece)
        run.end()

    def _one_by_one(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            template = _alone(self.pickled, self.backend)
        for k, x in enumerate(chunk.x):
            run = copy.copy(template)  # with the same machine code
            watched = _Watched(template.runner, stopped)
            vars(run).update(self.plan, parameters=chunk.p[k].tolist(), runner=watched)
            rows = Rows(x, self.asked)
            for piece in run.pieces(x):
                rows.add(piece)
            found = rows.table()[1]
            part.rows[k, : len(found)], part.rows[k, len(found) :] = found, np.nan
            part.steps[k], part.rejected[k], part.evaluations[k] = run.steps, run.rejected, run.evaluations
            part.dt[k], part.status[k] = run.largest, run.status


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code


@lru_cache(KEPT)
def _together(pickled: bytes, backend: str) -> Together:
    problem: Portable = pickle.loads(pickled)  # noqa: S301  # it came with the task itself
    programs = problem.straight()
    assert programs is not None
    start = None if programs.start is None else runner(programs.start, backend)
    many = runner(programs.one_pass, backend)
    for each in (start, many):
        if each is not None:
            each.run_many(np.zeros((each.size, 0)), 0)  # the code for vectors is made at its first use
    return Together(problem, start, many)


@lru_cache(KEPT)
def _alone(pickled: bytes, backend: str) -> FixedRun | AdaptiveRun:
    """A run to be copied; its numbers come from `plan`."""
    problem = cast(Any, pickle.loads(pickled))  # noqa: S301  # it came with the task itself
    if problem.adaptive:
        return AdaptiveRun(problem, problem, (), backend, Limits(), dense=True)
    return FixedRun(problem, problem, (), backend, instants=(), dt=1.0, each=False, most=0.0)
