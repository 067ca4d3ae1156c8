"""Task: the function that runs chunks of an ensemble, in any thread or process."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from cgraph.extend import Array, memo

from ..estimates.error_estimate import Estimator
from ..events.event_program import EventProgram
from ..events.watched import WatchedIntegration
from ..outcome import INTERRUPTED, outcome
from ..recorder import Recorder
from ..run_options import RunOptions
from ..steps.equal_steps import EqualSteps, equal_steps
from ..steps.integration import integration
from ..steps.step_program import CompiledSteps, compile_steps
from ..steps.stepping import StoppedError
from .chunk import Chunk, Part, not_begun
from .vectorized import VectorCode, VectorizedIntegration, beside, vector_code

KEPT = 8  # programs that a process keeps ready


@dataclass(frozen=True)
class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once."""

    pickled: bytes  # a StepProgram; that it is the same as another's is seen without reading it
    options: RunOptions
    count: int  # of the rows of a trajectory
    grids: tuple[EqualSteps, ...]  # of trajectories side by side; empty: one after another
    events: bytes = b""  # an EventProgram; nothing without events

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        part = self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)
        if part.interrupted:
            raise KeyboardInterrupt
        return part

    def run(self, chunk: Chunk, rows: Array, stopped: Callable[[], bool]) -> Part:
        """Run the chunk into rows (k, T, m), to its end, or until soon after Ctrl-C or `stopped`: see the part."""
        part = not_begun(self.options.method, chunk.first, rows)
        with np.errstate(all="ignore"):
            (self._side_by_side if self.grids else self._one_by_one)(chunk, part, stopped)
        return part

    def _side_by_side(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            code = _vector_code(self.pickled, self.options.backend)
        estimator = None
        if self.options.estimated:
            estimator = Estimator(code.program, self.options, chunk.p, partial(beside, code), sparse=True)
            estimator.begin(chunk.x, equal_steps(self.options.instants, self.options.step))
        run = VectorizedIntegration(code, self.options, chunk, part, estimator, even=len(self.grids) == 1)
        try:
            for grid in self.grids:
                run.begin(grid)
                for block in grid.blocks(*run.limits):
                    if stopped():
                        raise StoppedError
                    run.advance(*block)
            run.end(errors=estimator.estimates() if estimator else [])
        except (KeyboardInterrupt, StoppedError):
            run.interrupt()

    def _one_by_one(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            compiled = _compiled(self.pickled, self.options.backend)
        events = _event_program(self.events) if self.events else None
        for k, x in enumerate(chunk.x):
            run = integration(compiled, self.options, chunk.p[k].tolist(), stopped, events=events)
            recorder = Recorder(x, self.options.times, self.options.t0, self.options.direction)
            part.stats[k] = outcome(run, x, recorder, self.options)
            if isinstance(run, WatchedIntegration):
                part.happened[k] = run.log.happened
            states = recorder.table()[1]
            part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan
            if part.stats[k].message.startswith(INTERRUPTED):
                part.rows[k + 1 :] = np.nan
                return


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code


@memo(KEPT)
def _vector_code(pickled: bytes, backend: str) -> VectorCode:
    return vector_code(pickle.loads(pickled), backend)  # noqa: S301  # it came with the task itself


@memo(KEPT)
def _compiled(pickled: bytes, backend: str) -> CompiledSteps:
    return compile_steps(pickle.loads(pickled), backend)  # noqa: S301  # it came with the task itself


@memo(KEPT)
def _event_program(pickled: bytes) -> EventProgram:
    program: EventProgram = pickle.loads(pickled)  # noqa: S301  # it came with the task itself
    return program
