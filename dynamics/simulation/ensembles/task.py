"""Task: the function that runs chunks of an ensemble, in lanes or one by one, in any thread or process."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cgraph._shared import Array

from ..estimates.error_estimate import ASIDE, Comparison, RunsBeside, error_estimates, runs_beside
from ..estimates.unresolved import Watch
from ..events.event import EventProgram
from ..outcome import INTERRUPTED, outcome
from ..run_options import RunOptions
from ..stepper import ChosenStepper, Stepper, stepper
from ..steps.equal_steps import EqualSteps, Numbers, even_steps
from ..steps.step_program import StepProgram, compile_steps
from .ensemble import COLUMNS, Part
from .lanes import (
    VECTOR,
    Code,
    LaneRuns,
    Leg,
    Stopped,
    chosen_in_lanes,
    equal_in_lanes,
    fits_lanes,
    lanes_of,
    legs_of,
)

LARGEST_CHUNK = 256  # trajectories in a chunk one by one, unless asked for
LONGEST_CHUNK = 4096  # of those in lanes, of which a chunk's rows of steps have no more than ..
ROWS = 2**22  # .. so many numbers
SHORT = 2**20  # equal steps of all trajectories, which take some hundredths of a second: a chunk for each worker
UNKNOWN = 16  # workers behind a map, which does not say
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once.

    count: rows of a trajectory.  largest: trajectories in a chunk at most, if they go in lanes, else 0.
    """

    def __init__(
        self, program: StepProgram, options: RunOptions, many: int, events: EventProgram | None = None
    ) -> None:
        """many: trajectories, of all chunks."""
        self.program, self.options, self.events, self._many = program, options, events, many
        self._grids: list[EqualSteps] = []
        if not program.adaptive:
            self._grids, self._numbers = even_steps(options.instants, options.step)
        self._beside: RunsBeside | None = None
        self.count, self.largest = len(options.row_times), 0
        if events is None and fits_lanes(program, options, self._grids, many):
            self._beside = runs_beside(self._grids, program.order) if options.estimated else None
            rows = self.count if self._beside is None else self.count + len(self._beside.t)
            self.largest = min(LONGEST_CHUNK, max(VECTOR, ROWS // (program.steps.width * rows)))

    def width(self, chunk: int | None, workers: object, *, stored: bool = False) -> int:
        """Trajectories in a chunk: in lanes, of whole vectors.

        chunk: as asked for.  stored: whether a chunk that has not ended is lost when the process is, so that it should
        be small.
        """
        largest, equal = self.largest or chunk or LARGEST_CHUNK, self.largest and self._grids
        shares = 1 if equal and self._many * self._grids[0].steps <= SHORT else SHARES
        shares *= workers if isinstance(workers, int) else UNKNOWN
        width = min(chunk or min(math.ceil(self._many / shares), LARGEST_CHUNK if stored else largest), largest)
        return math.ceil(width / VECTOR) * VECTOR if equal else width

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        return self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)

    def run(self, chunk: Chunk, rows: Array, stopped: Stopped) -> Part:
        """Run the chunk into rows (k, T, m).

        Raises KeyboardInterrupt soon after Ctrl-C, and StoppedError after `stopped`.
        """
        part, left = Part(chunk.first, rows), list(range(len(chunk.x)))
        with np.errstate(all="ignore"):
            if (found := self.run_lanes(chunk.x, chunk.p, rows, stopped)) is not None:
                whole, columns = found
                left = np.flatnonzero(~whole).tolist()  # which are made again, alone
                done = whole if left else slice(None)
                part.reached(done, **{name: values[done] for name, values in columns.items()})
            self._one_by_one(chunk, part, left, stopped)
        return part

    def run_lanes(self, x: Array, p: Array, rows: Array, stopped: Stopped) -> LaneRuns | None:
        """Run trajectories from states x (k, m) with parameters p (k, ..) in lanes; None if they do not go there.

        rows: (k, T, m), receives their rows.
        """
        lanes = self._lanes
        if lanes is None:
            return None
        if self.program.adaptive:
            return chosen_in_lanes(lanes, self.program, self.options, x, p, rows, stopped)
        (own, *others), beside = self._legs, self._beside
        if beside is None:
            return equal_in_lanes(lanes, x, p, own, [rows], stopped)
        watch = Watch(self.program.rate, self.program.order, p, self.options.t0, x)
        if watch.needed:  # which sees all steps, so many at once
            every = max(1, ROWS // (len(x) * self.program.steps.width))
            own = legs_of(self._grids, self._tables, every)
        states = np.empty((1 + len(others), len(x), len(beside.t), x.shape[1]))
        whole, columns = equal_in_lanes(
            lanes, x, p, own, [rows, states[0]], stopped, watch.add if watch.needed else None
        )
        for legs, each in zip(others, states[1:], strict=True):
            equal_in_lanes(lanes, x * ASIDE, p, legs, [each], stopped)
        steps = int(columns["steps"][0])
        errors = error_estimates(self.program, self.options, beside.law, watch, steps, Comparison(beside.t, [*states]))
        return whole, columns | errors

    @cached_property
    def _tables(self) -> list[Numbers]:
        """How many equal steps are done at the rows, and when runs are looked at to be compared."""
        times, numbers = self.options.times, self._numbers
        rows = (
            np.arange(numbers[-1] + 1) if times is None else numbers[int(times[0] != self.options.t0) :][: len(times)]
        )
        return [rows, *([] if self._beside is None else [self._beside.numbers])]

    @cached_property
    def _legs(self) -> list[Iterable[Leg]]:
        """Legs of the runs, and of those beside."""
        beside = () if self._beside is None else self._beside.runs
        others = [list(legs_of(stretches, [numbers])) for stretches, numbers in beside]
        return [list(legs_of(self._grids, self._tables)), *others]

    @property
    def _lanes(self) -> Code | None:
        """The code of lanes, if trajectories go there."""
        if not self.largest:
            return None
        with _lock:
            return lanes_of(self.program, self.options.backend, self.options.fma)

    def _one_by_one(self, chunk: Chunk, part: Part, which: Iterable[int], stopped: Stopped) -> None:
        """Run these, each alone."""
        run: Stepper | None = None
        has_end = self.options.row_times[-1] == self.options.t_end
        for k in which:
            with _lock:
                compiled = compile_steps(self.program, self.options.backend, self.options.fma)
            x, p = chunk.x[k], chunk.p[k].tolist()
            if run is None or self.events is not None:
                run = stepper(compiled, self.options, p, stopped=stopped, events=self.events)
            run.set_parameters(p)
            if has_end and isinstance(run, ChosenStepper) and run.log is None:  # steps need not be looked at
                if run.unseen(x, self.options):
                    counts = {"steps": run.steps, "rejected": run.rejected, "nfev": run.evaluations, "dt": run.largest}
                    part.reached(k, **counts)
                    part.rows[k, :-1], part.rows[k, -1] = x, run.x
                    continue
                run = stepper(compiled, self.options, p, stopped=stopped)  # whose first blocks are short: it says when
            stats, recorder = outcome(run, x, self.options)
            if stats.message.startswith(INTERRUPTED):
                raise KeyboardInterrupt
            part.put(k, **{name: getattr(stats, name) for name in COLUMNS})
            if run.log is not None:
                part.put(k, happened=run.log.happened)
            states = recorder.table()[1]
            part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code
