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
from ..estimates.unresolved import Watch, unresolved
from ..events.event import EventProgram
from ..outcome import INTERRUPTED, outcome
from ..run_options import RunOptions
from ..stepper import ChosenStepper, Stepper, stepper
from ..steps.equal_steps import EqualSteps, even_steps, numbers_of
from ..steps.step_program import StepProgram, compile_steps
from .ensemble import COLUMNS, Part
from .lanes import (
    ROWS,
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
LONGEST_CHUNK = 4096  # of those in lanes, of which a chunk's rows of steps have at most `ROWS` numbers
SHORT = 2**20  # equal steps of all trajectories, which take some hundredths of a second: a chunk for each worker
UNKNOWN = 16  # workers behind a map, which does not say
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


@dataclass(frozen=True)
class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once.

    many: trajectories, of all chunks.
    """

    program: StepProgram
    options: RunOptions
    many: int
    events: EventProgram | None = None

    @cached_property
    def count(self) -> int:
        """Rows of a trajectory."""
        return len(self.options.row_times)

    @cached_property
    def grids(self) -> list[EqualSteps]:
        """Equal steps; none of chosen ones."""
        return [] if self.program.adaptive else even_steps(self.options.instants, self.options.step)

    @cached_property
    def beside(self) -> RunsBeside | None:
        """Runs beside those in lanes; None where no error is estimated."""
        return runs_beside(self.grids, self.program.order) if self.options.estimated else None

    @cached_property
    def in_lanes(self) -> bool:
        """Whether trajectories go in lanes, if the program can."""
        return self.events is None and fits_lanes(self.program, self.options, self.grids, self.many)

    @cached_property
    def largest(self) -> int:
        """Trajectories in a chunk at most; 0 unless they go in lanes."""
        if not self.in_lanes:
            return 0
        numbers = self.program.steps.width * (self.count + (0 if self.beside is None else len(self.beside.t)))
        return min(LONGEST_CHUNK, max(VECTOR, ROWS // numbers))

    def width(self, chunk: int | None, workers: object, *, stored: bool = False) -> int:
        """Trajectories in a chunk: in lanes, of whole vectors.

        chunk: as asked for.  stored: whether a chunk that has not ended is lost when the process is, so that it should
        be small.
        """
        largest = self.largest or chunk or LARGEST_CHUNK
        short = self.in_lanes and self.grids and self.many * self.grids[0].steps <= SHORT
        shares = (1 if short else SHARES) * (workers if isinstance(workers, int) else UNKNOWN)
        width = chunk or min(math.ceil(self.many / shares), LARGEST_CHUNK if stored else largest)
        return math.ceil(min(width, largest) / VECTOR) * VECTOR if self.in_lanes and self.grids else min(width, largest)

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
                part.reached(whole, **{name: values[whole] for name, values in columns.items()})
                left = np.flatnonzero(~whole).tolist()  # which are made again, alone
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
        (own, *others), beside = self._legs, self.beside
        if beside is None:
            return equal_in_lanes(lanes, x, p, own, [rows], stopped)
        watch = Watch(self.program.rate, self.program.order, p, self.options.t0, x)
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
    def _legs(self) -> list[list[Leg]]:
        """Legs of the runs, and of those beside."""
        rows = numbers_of(self.grids, self.options.row_times)
        if self.beside is None:
            return [legs_of(self.grids, [rows])]
        at_once = max(1, ROWS // (min(self.many, LONGEST_CHUNK) * self.program.steps.width))
        every = at_once if unresolved(self.program.rate).there else 0
        others = [legs_of(stretches, [numbers]) for stretches, numbers in self.beside.runs]
        return [legs_of(self.grids, [rows, self.beside.numbers], every), *others]

    @property
    def _lanes(self) -> Code | None:
        """The code of lanes, if trajectories go there."""
        if not self.in_lanes:
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
                if run.unseen(x):
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
