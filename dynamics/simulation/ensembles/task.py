"""Task: the function that runs chunks of an ensemble, in lanes of vectors or one by one, and who shares them out."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, LaneCode, kept_by_first, thread_count
from cgraph.extend import Call, FixedPoint, While, runner

from ...integrators import Problem
from ...integrators.step_control import DONE
from ..error_estimate import ASIDE, RunsBeside, Watch, error_estimates, phases, runs_beside
from ..events.event import EventProgram
from ..events.modes import Modes
from ..outcome import INTERRUPTED, outcome
from ..run_options import Span, Steps
from ..stepper import BLOCK_TIME, HELD, ChosenStepper, Stepper, StoppedError, first_registers, stepper
from ..steps.equal_steps import EqualSteps, Numbers, even_steps, instants_of
from ..steps.first_step import start_registers
from ..steps.state_sizes import Flags
from ..steps.step_program import StepProgram, compile_steps, step_program
from .ensemble import COLUMNS, Part

LARGEST_CHUNK = 256  # trajectories in a chunk one by one or of a store, unless asked for
LONGEST_CHUNK = 4096  # of those in lanes, of which a chunk's rows of steps have no more than ..
ROWS = 2**22  # .. so many numbers
SHORT = 2**20  # equal steps of all trajectories, which take some hundredths of a second: a chunk for each worker
UNKNOWN = 16  # workers behind a map, which does not say
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together
LOOK = 0.1  # s: not every system interrupts a wait without an end for Ctrl-C
FEW_TRAJECTORIES = 32  # trajectories: fewer by chosen steps are done one by one before the code of lanes is made
VECTOR = 8  # lanes, or a multiple of them, of every processor
PASSES = 64  # of the first block, before it is known how long one takes
RESULTS = ["status", "t", "trials", "rejected", "evaluations", "at_limit", "longest_made"]

Stopped = Callable[[], bool]
LaneRuns: TypeAlias = tuple[Flags, dict[str, Array]]  # which reached their end without a remark; columns of statistics


@kept_by_first
def lanes_of(program: StepProgram, backend: str, fma: bool) -> LaneCode | None:
    """The code of lanes; None without machine code."""
    steps, clock, results = program.steps, "count", ["t", "evaluations", "nonfinite"]
    if program.adaptive:
        toward, t = inputs = cg.variables("toward t")
        body = Call(Graph(inputs, {"clock": toward * t}), ("lanes.toward", "t"), ("lanes.clock",))
        lengths = {**steps.registers, "lanes.toward": 1, "lanes.clock": 1}
        steps, clock, results = replace(steps, registers=lengths, body=[*steps.body, body]), "lanes.clock", RESULTS
    return runner(steps, backend, fma=fma).lane_code(clock, results, alike=program.adaptive)


def fits_lanes(program: StepProgram, options: Steps, steps: int, count: int) -> bool:
    """Whether so many trajectories of so many equal steps each, or of chosen ones, without events, go in lanes."""
    if steps > options.max_steps or (program.adaptive and count < FEW_TRAJECTORIES):
        return False
    if program.adaptive and (program.rows is not None or options.relative < program.finest):
        return False  # with constraints steps are watched, near flat positions; of tolerances below rounding is warned
    # Where steps turn as often as numbers say lanes wait for one another; what looks for a first step hardly ever does.
    kinds = FixedPoint if program.adaptive else FixedPoint | While
    many = not program.adaptive and count >= VECTOR
    return many or not any(isinstance(each, kinds) for each in program.steps.statements())


class Leg(NamedTuple):
    """Part of runs up to the last of these marks of their clock."""

    grid: EqualSteps | None  # the equal steps that it is
    marks: Array
    here: slice  # of the rows that are states at marks


def equal_legs(grids: Sequence[EqualSteps], numbers: Numbers) -> list[Leg]:
    """The legs of runs whose rows are states after so many steps each, (T,)."""
    legs, done = list[Leg](), 0
    for grid in grids:
        here = slice(*numbers.searchsorted((done + 1, done + grid.steps + 1)).tolist())
        marks = numbers[here] - done
        marks = marks if len(marks) and marks[-1] == grid.steps else np.append(marks, grid.steps)
        legs.append(Leg(grid, marks.astype(np.float64), here))
        done += grid.steps
    return legs


class LaneRun:
    """k runs in lanes, from states x (k, m) with parameters p (k, ..)."""

    def __init__(self, code: LaneCode, program: StepProgram, options: Steps, span: Span, x: Array, p: Array) -> None:
        self._code, self._program, self._options, self._span = code, program, options, span
        self._x, self._most = x, PASSES
        self._memories = np.zeros((len(x), code.size))
        self._passes = np.zeros((len(x), 2), np.int64)  # how many each has made, and how many marks of its clock passed
        self._set({"x": x, "p": p, "fresh": 1.0})
        if program.adaptive:
            ends = start_registers({"t_end": span.t_end, "goal": span.t_end})
            self._set({**first_registers(program, options), **ends, "t": span.t0, "lanes.toward": span.direction})

    def to_end(self, legs: Sequence[Leg], rows: Array, stopped: Stopped) -> LaneRuns:
        """Go all legs, with states for rows (k, T, m), NaN from where a run stops on."""
        program, k, m, steps, longest = self._program, len(rows), self._program.size, 0, 0.0
        rows[:, 0] = self._x  # unless that is not at the start
        for grid, marks, here in legs:
            if grid is not None:
                self._set({"start": grid.begin, "t": grid.begin, "h": grid.h, "count": 0.0})
                self._passes[:, 0], steps, longest = 0, steps + grid.steps, max(longest, abs(grid.h))
            made = self._rows(marks, stopped)
            times = self._span.direction * marks
            block = _states(program, made, times) if program.adaptive else made[:, :, 1 : 1 + m]
            if (self._passes[:, 1] < len(marks)).any():
                block[np.arange(len(marks)) >= self._passes[:, 1:]] = np.nan
            rows[:, here] = block[:, : here.stop - here.start]
        columns = {"nfev": self._read("evaluations"), "steps": np.full(k, steps), "dt": np.full(k, longest)}
        if not program.adaptive:
            return self._read("nonfinite") == 0.0, columns
        # A run at a stability limit has a remark, which depends on its course.
        whole = (self._read("status") == DONE) & (self._read("at_limit") < HELD)
        rejected, length = self._read("rejected"), np.minimum(self._read("longest_made"), self._options.longest_step)
        return whole, {**columns, "steps": self._read("trials") - rejected, "rejected": rejected, "dt": length}

    def _set(self, values: Mapping[str, ArrayLike]) -> None:
        for name in values.keys() & self._code.numbers.keys():
            self._memories[:, self._code.numbers[name]] = values[name]

    def _read(self, name: str) -> Array:
        return self._memories[:, self._code.numbers[name]][:, 0]

    def _going(self, marks: Array) -> tuple[Numbers, float]:
        """Runs that are on their way to the last mark, and how many passes are left to them."""
        if not self._program.adaptive:
            last = float(marks[-1])
            which = np.flatnonzero((self._read("nonfinite") == 0.0) & (self._passes[:, 0] < last))
            return which, last - self._passes[which[0], 0] if len(which) else 0.0
        trials, most = self._read("trials"), self._options.max_steps
        which = np.flatnonzero((self._read("status") == 0.0) & (trials < most))
        return which, most - trials[which].max(initial=0.0)

    def _rows(self, marks: Array, stopped: Stopped) -> Array:
        """Go on until none is going: the rows (k, len(marks), width), NaN in time of those not there."""
        rows = np.empty((len(self._memories), len(marks), self._code.width))
        rows[:, :, 0] = np.nan
        self._passes[:, 1] = 0
        which, left = self._going(marks)
        while len(which):
            if stopped():
                raise StoppedError
            begin, most = time.perf_counter(), int(min(self._most, left))
            self._code(self._memories, which, self._passes, most, rows, marks)
            if most == self._most:
                self._most = max(1, int(most * min(4.0, BLOCK_TIME / max(time.perf_counter() - begin, 1e-9))))
            which, left = self._going(marks)
        return rows


def _states(program: StepProgram, rows: Array, times: Array) -> Array:
    """States (k, T, m) at times (T,), from the rows (k, T, width) of the steps in which they lie."""
    many, count, width = rows.shape
    there = np.where(np.isnan(rows[:, :, 0]), 0, np.arange(count))
    number = np.maximum.accumulate(there, axis=1)  # the row of the step in which a time lies
    rows = rows if count == 1 else np.take_along_axis(rows, number[:, :, None], axis=1)
    block, times = program.block(rows.reshape(-1, width)), np.tile(times, many)
    x, inside = block.x.copy(), np.flatnonzero(block.t != times)
    if len(inside) and program.dense:
        x[inside] = block.states_at(inside, (times[inside] - block.t_old[inside]) / block.h[inside])
    return x.reshape(many, count, program.size)


class Chunk(NamedTuple):
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once."""

    def __init__(
        self,
        problem: Problem,
        options: Steps,
        span: Span,
        many: int,
        events: EventProgram | None = None,
        *,
        dense: bool,
    ) -> None:
        portable = replace(problem, model=None, system=None)  # type: ignore[arg-type]  # which pickles
        self._switched = None if problem.switches is None else portable
        dense = dense or problem.switches is not None
        program = self.program = step_program(problem, options.integrator, dense=dense)
        self.options, self.span, self.events, self._many = options, span, events, many
        self.times = options.row_times(span)
        self.count = len(self.times)  # rows of a trajectory
        self.largest = 0  # trajectories in a chunk at most, if they go in lanes
        self._grids, self._all_steps, self._steps = list[EqualSteps](), False, 0
        self._beside: RunsBeside | None = None
        if not program.adaptive:
            self._grids, numbers = even_steps(span.instants, options.step)
            first = 0 if span.times is None else int(span.times[0] != span.t0)
            self._at_rows = np.arange(self.count) if span.times is None else numbers[first : first + self.count]
            self._steps = int(numbers[-1])
        if events is None and self._switched is None and fits_lanes(program, options, self._steps, many):
            rows = self.count
            if options.estimated:
                self._beside = runs_beside(self._grids, program.order)
                self._all_steps = phases(program.rate) is not None  # are looked at
                rows = self._steps + 1 if self._all_steps else rows + len(self._beside.t)
            most = ROWS // (program.steps.width * rows)
            self.largest = 0 if self._all_steps and most < VECTOR else min(LONGEST_CHUNK, max(VECTOR, most))

    def width(self, chunk: int | None, workers: Team, *, stored: bool = False) -> int:
        """Trajectories in a chunk: as asked for, or the shares of workers; in lanes whole vectors."""
        if chunk is None:
            shares = 1 if 0 < self._many * self._steps <= SHORT else SHARES
            shares *= min(workers, self._many) if isinstance(workers, int) else UNKNOWN
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
        program, options, beside = self.program, self.options, self._beside
        with _lock:
            lanes = lanes_of(program, options.backend, options.fma) if self.largest else None
        if lanes is None:
            return None
        (own, *others), run = self._legs, LaneRun(lanes, program, options, self.span, x, p)
        if beside is None:
            return run.to_end(own, rows, stopped)
        numbers, watch = self._numbers, Watch(program.rate, p, self.span.t0, x)
        states = [np.empty((len(x), len(each), x.shape[1])) for each in numbers]
        whole, columns = run.to_end(own, states[0], stopped)
        for legs, each in zip(others, states[1:], strict=True):
            LaneRun(lanes, program, options, self.span, x * ASIDE, p).to_end(legs, each, stopped)
        watch.see(instants_of(self._grids, numbers[0][1:]), states[0][:, 1:])
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
        if self.program.adaptive:
            first = int(self.times[0] == self.span.t0)  # that a step makes
            return [[Leg(None, self.span.direction * self.times[first:], slice(first, self.count))]]
        beside = [] if self._beside is None else [stretches for stretches, _ in self._beside.runs]
        return [equal_legs(*each) for each in zip([self._grids, *beside], self._numbers, strict=True)]

    def _one_by_one(self, chunk: Chunk, part: Part, which: Iterable[int], stopped: Stopped) -> None:
        run: Stepper | None = None
        has_end = self.times[-1] == self.span.t_end
        for k in which:
            with _lock:
                compiled = compile_steps(self.program, self.options.backend, self.options.fma)
            x, p = chunk.x[k], chunk.p[k].tolist()
            if run is None or self.events is not None:
                modes = None if self._switched is None else Modes(self._switched)
                run = stepper(compiled, self.options, p, stopped=stopped, events=self.events, modes=modes)
            run.set_parameters(p)
            is_plain = run.log is None and run.modes is None  # steps need not be looked at
            if has_end and isinstance(run, ChosenStepper) and is_plain:
                if run.unseen(x, self.span):
                    part.reached(k, steps=run.steps, rejected=run.rejected, nfev=run.evaluations, dt=run.largest)
                    part.rows[k, :-1], part.rows[k, -1] = x, run.x
                    continue
                run = stepper(compiled, self.options, p, stopped=stopped)  # whose first blocks are short: it says when
            stats, recorder = outcome(run, x, self.span)
            if stats.message.startswith(INTERRUPTED):
                raise KeyboardInterrupt
            happened = () if run.log is None else run.log.happened
            part.put(k, happened=happened, **{name: getattr(stats, name) for name in COLUMNS})
            states = recorder.table()[1]
            part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code

Team = int | Executor | Callable[[Callable[[Chunk], Part], Sequence[Chunk]], Iterable[Part]]  # threads, or a map
Workers = Team | None


def team_of(workers: Workers) -> Team:
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


def parts_of(task: Task, chunks: Sequence[Chunk], workers: Team, table: Array) -> Generator[Part, None, None]:
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
