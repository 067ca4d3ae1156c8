"""Task: the function that runs chunks of an ensemble, in any thread or process."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from cgraph.extend import Array, memo, runner

from ..estimates.error_estimate import ErrorEstimate, Estimator
from ..estimates.run_estimate import RunEstimate
from ..events.event_program import EventProgram
from ..events.watched import WatchedIntegration
from ..recorder import Recorder
from ..run_options import RunOptions
from ..steps.equal_steps import equal_steps
from ..steps.integration import integration
from ..steps.step_program import CompiledSteps, StepProgram, compile_steps
from ..steps.stepping import Integration, StoppedError
from .chunk import Chunk, Part, empty
from .lane_steps import lane_steps
from .step_grid import StepGrid
from .vectorized import VectorCode, VectorizedIntegration, beside

KEPT = 8  # programs that a process keeps ready


@dataclass(frozen=True)
class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once."""

    pickled: bytes  # a StepProgram; that it is the same as another's is seen without reading it
    options: RunOptions
    count: int  # of the rows of a trajectory
    grids: tuple[StepGrid, ...]  # of trajectories side by side; empty: one after another
    events: bytes = b""  # an EventProgram; nothing without events

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        part = self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)
        if part.interrupted:
            raise KeyboardInterrupt
        return part

    def run(self, chunk: Chunk, rows: Array, stopped: Callable[[], bool]) -> Part:
        """Run the chunk into rows (k, T, m), to its end, or until soon after Ctrl-C or `stopped`: see the part."""
        part = empty(chunk.first, rows)
        with np.errstate(all="ignore"):
            (self._side_by_side if self.grids else self._one_by_one)(chunk, part, stopped)
        return part

    def _side_by_side(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            code = _vector_code(self.pickled, self.options.backend)
        times = self.options.times
        at = int(times is None or times[0] == self.options.t0)
        part.rows[:, :at] = chunk.x[:, None]
        estimator = None
        if self.options.estimated:
            estimator = Estimator(code.program, self.options, chunk.p, partial(beside, code), sparse=True)
            estimator.begin(chunk.x, equal_steps(self.options.instants, self.options.step))
        even = len(self.grids) == 1
        run = VectorizedIntegration(code, chunk, part, at, self.options.t0, estimator, even=even)
        try:
            for grid in self.grids:
                run.begin(grid)
                for block in grid.blocks(*run.limits):
                    if stopped():
                        raise StoppedError
                    run.advance(*block)
            for k, error in enumerate(estimator.estimates() if estimator else []):
                if not part.status[k]:
                    part.tell(k, error)
        except (KeyboardInterrupt, StoppedError):
            run.interrupt()
        run.end()

    def _one_by_one(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            compiled = _compiled(self.pickled, self.options.backend)
        events = _event_program(self.events) if self.events else None
        for k, x in enumerate(chunk.x):
            run = integration(compiled, self.options, chunk.p[k].tolist(), stopped, events=events)
            if isinstance(run, WatchedIntegration):
                part.happened[k] = run.log.happened
            recorder = Recorder(x, self.options.times, self.options.t0, self.options.direction)
            interrupted, error = self._interrupted(run, x, recorder)
            states = recorder.table()[1]
            part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan
            part.steps[k], part.rejected[k], part.evaluations[k] = run.steps, run.rejected, run.evaluations
            part.dt[k], part.status[k], part.warnings[k] = run.largest, run.status or run.event, run.warnings
            part.ended[k] = bool(run.event) and not run.status
            if error is not None:
                part.tell(k, error)
            if interrupted:
                part.interrupt(k, recorder.last, len(states))
                return

    def _interrupted(self, run: Integration, x: Array, recorder: Recorder) -> tuple[bool, ErrorEstimate | None]:
        """Run one trajectory; whether it was interrupted, and its error where that is estimated."""
        estimate = RunEstimate(run, x, self.options)
        try:
            for block in run.blocks(x):
                recorder.add(block)
                estimate.add(block)
            return False, None if run.status else estimate.result()
        except (KeyboardInterrupt, StoppedError):
            return True, None


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code


@memo(KEPT)
def _vector_code(pickled: bytes, backend: str) -> VectorCode:
    program: StepProgram = pickle.loads(pickled)  # noqa: S301  # it came with the task itself
    programs = lane_steps(program)
    start = None if programs.start is None else runner(programs.start, backend)
    one_pass = runner(programs.one_pass, backend)
    for code in (start, one_pass):
        if code is not None:
            code.run_many(np.zeros((code.size, 0)), 0)  # the code for vectors is compiled at its first use
    return VectorCode(program, start, one_pass, programs.stops)


@memo(KEPT)
def _compiled(pickled: bytes, backend: str) -> CompiledSteps:
    return compile_steps(pickle.loads(pickled), backend)  # noqa: S301  # it came with the task itself


@memo(KEPT)
def _event_program(pickled: bytes) -> EventProgram:
    program: EventProgram = pickle.loads(pickled)  # noqa: S301  # it came with the task itself
    return program
