"""Task: the function that runs chunks of an ensemble, in lanes or one by one, and who shares the chunks out."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ThreadPoolExecutor, wait
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cgraph._shared import Array, thread_count

from ..estimates.error_estimate import ASIDE, RunsBeside, Watch, error_estimates, runs_beside, unresolved
from ..events.event import EventProgram
from ..outcome import INTERRUPTED, outcome
from ..run_options import RunOptions
from ..stepper import ChosenStepper, Stepper, stepper
from ..steps.equal_steps import EqualSteps, Numbers, even_steps, instants_of
from ..steps.step_program import StepProgram, compile_steps
from .ensemble import COLUMNS, Part
from .lanes import VECTOR, LaneRun, LaneRuns, Leg, Stopped, equal_legs, fits_lanes, lanes_of

LARGEST_CHUNK = 256  # trajectories in a chunk one by one or of a store, unless asked for
LONGEST_CHUNK = 4096  # of those in lanes, of which a chunk's rows of steps have no more than ..
ROWS = 2**22  # .. so many numbers
SHORT = 2**20  # equal steps of all trajectories, which take some hundredths of a second: a chunk for each worker
UNKNOWN = 16  # workers behind a map, which does not say
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together
LOOK = 0.1  # s: not every system interrupts a wait without an end for Ctrl-C


class Chunk(NamedTuple):
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once."""

    def __init__(
        self, program: StepProgram, options: RunOptions, many: int, events: EventProgram | None = None
    ) -> None:
        self.program, self.options, self.events, self._many = program, options, events, many
        self.count = len(options.row_times)  # rows of a trajectory
        self.largest = 0  # trajectories in a chunk at most, if they go in lanes
        self._grids, self._all_steps, self._steps = list[EqualSteps](), False, 0
        self._beside: RunsBeside | None = None
        if not program.adaptive:
            self._grids, numbers = even_steps(options.instants, options.step)
            first = 0 if options.times is None else int(options.times[0] != options.t0)
            self._at_rows = np.arange(self.count) if options.times is None else numbers[first : first + self.count]
            self._steps = int(numbers[-1])
        if events is None and fits_lanes(program, options, self._grids, many):
            rows = self.count
            if options.estimated:
                self._beside = runs_beside(self._grids, program.order)
                self._all_steps = unresolved(program.rate)[0] is not None  # are looked at
                rows = self._steps + 1 if self._all_steps else rows + len(self._beside.t)
            self.largest = min(LONGEST_CHUNK, max(VECTOR, ROWS // (program.steps.width * rows)))

    def width(self, chunk: int | None, workers: Team, *, stored: bool = False) -> int:
        """Trajectories in a chunk: as asked for, or the shares of workers; in lanes whole vectors."""
        if chunk is None:
            shares = 1 if 0 < self._many * self._steps <= SHORT else SHARES
            shares *= workers if isinstance(workers, int) else UNKNOWN
            most = LARGEST_CHUNK if stored or not self.largest else self.largest
            chunk = min(math.ceil(self._many / shares), most)
        return math.ceil(min(chunk, self.largest) / VECTOR) * VECTOR if self.largest else chunk

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        return self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)

    def run(self, chunk: Chunk, rows: Array, stopped: Stopped) -> Part:
        """Run the chunk into rows (k, T, m). Raises KeyboardInterrupt, and StoppedError after `stopped`."""
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
        """Run states x (k, m) with parameters p (k, ..) in lanes, into rows (k, T, m); None if they do not go there."""
        program, options = self.program, self.options
        with _lock:
            lanes = lanes_of(program, options.backend, options.fma) if self.largest else None
        if lanes is None:
            return None
        (own, *others), run = self._legs, LaneRun(lanes, program, options, x, p)
        if self._beside is None:
            return run.to_end(own, rows, stopped)
        beside, numbers, watch = self._beside, self._numbers, Watch(program.rate, p, options.t0, x)
        states = [np.empty((len(x), len(each), x.shape[1])) for each in numbers]
        whole, columns = run.to_end(own, states[0], stopped)
        for legs, each in zip(others, states[1:], strict=True):
            LaneRun(lanes, program, options, x * ASIDE, p).to_end(legs, each, stopped)
        watch.add(instants_of(self._grids, numbers[0][1:]), states[0][:, 1:])
        rows[:] = states[0][:, numbers[0].searchsorted(self._at_rows)]
        states[0] = states[0][:, numbers[0].searchsorted(beside.numbers)]
        return whole, columns | error_estimates(program, options, beside, watch, self._steps, states)

    @cached_property
    def _numbers(self) -> list[Numbers]:
        """How many equal steps of the runs, and of those beside, are done when they are looked at."""
        if self._beside is None:
            return [self._at_rows]
        own = np.arange(self._steps + 1) if self._all_steps else np.union1d(self._at_rows, self._beside.numbers)
        return [own, *[numbers for _, numbers in self._beside.runs]]

    @cached_property
    def _legs(self) -> list[list[Leg]]:
        """Legs of the runs, and of those beside."""
        if self.program.adaptive:
            options, first = self.options, int(self.options.row_times[0] == self.options.t0)  # that a step makes
            return [[Leg(None, options.direction * options.row_times[first:], slice(first, self.count))]]
        beside = [] if self._beside is None else [stretches for stretches, _ in self._beside.runs]
        return [equal_legs(*each) for each in zip([self._grids, *beside], self._numbers, strict=True)]

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
            happened = () if run.log is None else run.log.happened
            part.put(k, happened=happened, **{name: getattr(stats, name) for name in COLUMNS})
            states = recorder.table()[1]
            part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code

Map = Callable[[Callable[[Chunk], Part], Sequence[Chunk]], Iterable[Part]]
Team = int | Map | Executor  # number of threads, or who does the work
Workers = Team | None


def checked(workers: Workers) -> Team:
    """The number of threads, the executor or the map. Raises ValueError for what is none of these."""
    known: Any = workers
    is_class = isinstance(known, type) and issubclass(known, Executor)
    if isinstance(workers, Executor) or (callable(workers) and not is_class):
        return workers
    try:
        return thread_count(known)
    except ValueError:
        kinds = "a whole number from 1, None for one on each core, an executor or a function like map"
        raise ValueError(f"workers must be {kinds}, got {workers!r:.60}") from None


def finished(task: Task, chunks: Sequence[Chunk], workers: Team, table: Array) -> Generator[Part, None, None]:
    """The parts as they come, in any order; closing it, or an exception, ends the threads, which fill the table."""
    stop = threading.Event()

    def run(chunk: Chunk) -> Part:
        return task.run(chunk, table[chunk.first : chunk.first + len(chunk.x)], stop.is_set)

    if workers == 1:
        yield from map(run, chunks)
    elif isinstance(workers, int):
        with ThreadPoolExecutor(min(workers, len(chunks))) as pool:  # which waits for its threads at any exit
            try:
                yield from _by_executor(pool, run, chunks)
            finally:
                stop.set()
    elif isinstance(executor := getattr(workers, "__self__", workers), Executor):  # also by its own map
        yield from _by_executor(executor, task, chunks)
    elif callable(workers):
        results: object = workers(task, chunks)
        for part in results if isinstance(results, Iterable) else [results]:
            if not isinstance(part, Part):
                got = f"{type(part).__name__}: {part!r:.60}"
                raise TypeError(f"workers must give the results of the function, as map does, got {got}")
            yield part


def _by_executor(pool: Executor, run: Callable[[Chunk], Part], chunks: Sequence[Chunk]) -> Generator[Part, None, None]:
    """The parts as they end, none of which is kept: an executor's own map waits for the first, and holds the others."""
    waiting = {pool.submit(run, chunk) for chunk in chunks}
    try:
        while waiting:
            ended, waiting = wait(waiting, LOOK, FIRST_COMPLETED)
            while ended:
                yield ended.pop().result()
    finally:
        for each in waiting:
            each.cancel()
