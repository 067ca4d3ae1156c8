"""Task: the function that runs chunks of an ensemble, side by side or one by one, in any thread or process."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Call, If, Runner, runner

from ..estimates.error_estimate import ErrorEstimates, Estimator
from ..estimates.runs_beside import Course, States
from ..events.event import EventProgram
from ..events.event_log import Happening, WatchedIntegration
from ..outcome import INTERRUPTED, outcome
from ..run_options import RunOptions
from ..steps.equal_steps import EqualSteps, equal_steps
from ..steps.integration import AdaptiveIntegration, integration
from ..steps.step_program import StepProgram, compile_steps
from ..steps.stepping import (
    BLOCK_TIME,
    Integration,
    NativeIntegration,
    StoppedError,
    begin_equal,
    failed_step,
)
from .ensemble import RunTable
from .lanes import ChosenInLanes, EqualInLanes, InLanes, Lanes, iterates, lanes_of
from .unseen_run import run_unseen

WORK = 2**21  # nodes computed in a block: half a millisecond for each vector
NUMBERS = 2**22  # in the rows of a block
SEEN = 4  # steps that one of the longest of runs beside stands for
MAKING = 0.5  # s; lanes take about so long to be made


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


@dataclass(frozen=True)
class Part:
    """Results of a chunk, or of all: rows (k, T, m), NaN after a trajectory has stopped, and the runs' statistics."""

    first: int
    rows: Array
    runs: RunTable
    happened: list[list[Happening]]  # the events of each, if any are looked for

    def put(self, part: Part) -> None:
        """Put the results of a part in their place."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        self.runs.put(here, part.runs)
        self.happened[here] = part.happened


def not_begun(first: int, rows: Array, *, events: bool) -> Part:
    """The part of the chunk whose rows are to be here, before its first step."""
    return Part(first, rows, RunTable(len(rows)), [[] for _ in rows] if events else [])


class VectorCode(NamedTuple):
    """Machine code for the equal steps of many trajectories, a lane of a vector for each.

    start: what they do before the first, over the same memory.  stops: whether a lane whose step failed makes no more;
    else it goes on, and its state is not finite.
    """

    program: StepProgram
    start: Runner | None
    one_pass: Runner
    stops: bool


@kept_by_first
def vector_code(program: StepProgram, backend: str, fma: bool) -> VectorCode:
    """The steps of a program, without its `stop`: lanes that go on do not stop for one that failed."""
    steps = replace(program.steps, stop=None)
    first, start = steps.body[0], None
    if isinstance(first, If) and first.register == "fresh" and not first.otherwise:
        start, steps = replace(steps, body=first.body), replace(steps, body=steps.body[1:])
    stops = iterates(program)
    if stops:  # equations that were not solved leave a state that is finite
        registers = {**steps.registers, "live": 1}
        body = (Call(_LIVE, ("nonfinite",), ("live",)), If("live", tuple(steps.body)))
        start = start and replace(start, registers=registers)
        steps = replace(steps, registers=registers, body=body)
    begin = None if start is None else runner(start, backend, fma=fma)
    code = VectorCode(program, begin, runner(steps, backend, fma=fma), stops)
    for each in (code.start, code.one_pass):
        if each is not None:
            each.run_many(np.zeros((each.size, 0)), 0)  # the code for vectors is compiled at its first use
    return code


_NONFINITE = cg.variable("nonfinite")
_LIVE = Graph([_NONFINITE], {"live": cg.where(_NONFINITE, 0.0, 1.0)})


def _start_memories(code: VectorCode, x: Array, p: Array) -> Array:
    """Memories before the first step from states x (k, m) with parameters p (k, ..), (size, k)."""
    memories = code.one_pass.memory({"x": x.T, "p": p.T}, len(x))
    if code.start is not None:
        code.start.run_many(memories, 1)
    return memories


def _block_limits(code: VectorCode, count: int) -> tuple[int, int]:
    """Steps, and rows, of `count` trajectories in a block; of `SEEN` at least, or a multiple."""
    program = code.one_pass.program
    nodes = sum(len(graph.nodes) for graph in program.graphs())
    limits = WORK // nodes, NUMBERS // (program.width * count)
    return SEEN * max(1, limits[0] // SEEN), SEEN * max(1, limits[1] // SEEN)


def _advanced(code: VectorCode, memories: Array, steps: int, every: int) -> tuple[Array, States]:
    """Record and states of each `every`th of so many steps."""
    record, read = code.one_pass.run_many(memories, steps, every).rows, code.one_pass.read
    farthest = int(np.argmax(read(memories, "count")[0]))  # where one has failed its time stands still
    times, states = np.ascontiguousarray(record[:, 0, farthest]), record[:, 1 : 1 + code.program.size]
    failed = np.flatnonzero(read(memories, "nonfinite")[0])
    if code.stops and len(failed):  # what it leaves may be finite, and is no solution
        begin, ends = read(memories, "start")[0, failed], read(memories, "t")[0, failed]
        after = np.abs(times[:, None] - begin) >= np.abs(ends - begin)
        states = states.copy()
        states[:, :, failed] = np.where(after[:, None], np.nan, states[:, :, failed])
    return record, States(times, states.transpose(2, 0, 1))


def beside(code: VectorCode, course: Course, x: Array, p: Array) -> Iterator[States]:
    """The states of runs from x (k, m) with parameters p (k, ..) on another course."""
    memories, most = _start_memories(code, x, p), min(_block_limits(code, len(x)))
    for number, stretch in enumerate(course.stretches):
        begin_equal(code.one_pass, memories, stretch.begin, stretch.h)
        for done in range(0, stretch.steps, most):
            steps = min(most, stretch.steps - done)
            yield _advanced(code, memories, steps, math.gcd(steps, 1 if number else course.every))[1]


class VectorizedIntegration:
    """One run of the trajectories of a chunk, into a part.

    estimator: is told the states after all steps, or, where the grid is even, after those that it looks at.
    A trajectory whose state is no longer finite is noticed after the block in which it stopped being so. From there its
    lane repeats a neighbor, since NaN is slow to compute with, and its rows become NaN in the end.
    """

    def __init__(
        self,
        code: VectorCode,
        options: RunOptions,
        chunk: Chunk,
        part: Part,
        estimator: Estimator | None,
        *,
        even: bool,
    ) -> None:
        self.code, self.program, self.runner, self.part = code, code.program, code.one_pass, part
        self.estimator, self._seen = estimator, SEEN if even and estimator and not estimator.every else 1
        count, total = part.rows.shape[:2]
        self._memories = _start_memories(code, chunk.x, chunk.p)
        self._live = np.ones(count, dtype=bool)
        self._good = np.full(count, total)  # rows that count
        self._done, self._longest = 0, 0.0  # steps; s, a step
        self._at = int(options.times is None or options.times[0] == options.t0)  # row
        part.rows[:, : self._at] = chunk.x[:, None]
        passes, rows = _block_limits(code, count)
        self.limits = passes if estimator is None else min(passes, rows), rows

    def begin(self, grid: EqualSteps) -> None:
        """The steps that follow are of this grid."""
        begin_equal(self.runner, self._memories, grid.begin, grid.h)
        self._longest = max(self._longest, abs(grid.h))

    def advance(self, steps: int, every: int, due: bool) -> None:
        """Make steps; those after every `every`th are rows if they are due."""
        if not self._live.any():
            return
        before, at, m = self._memories.copy(), self._at, self.program.size
        seen = every if self.estimator is None else math.gcd(every, self._seen)
        record, states = _advanced(self.code, self._memories, steps, seen)
        record = record[every // seen - 1 :: every // seen]
        if self.estimator is not None:
            self.estimator.add(states)
        if due:
            kept = record[: self.part.rows.shape[1] - self._at]  # t_end itself may be no row
            self.part.rows[:, self._at : self._at + len(kept)] = kept[:, 1 : 1 + m].transpose(2, 0, 1)
            self._at += len(kept)
        failed = self._live & (self.runner.read(self._memories, "nonfinite")[0] != 0.0)
        for k in np.flatnonzero(failed).tolist():
            done = self._fail(k, before[:, [k]], steps)
            self._good[k] = at + done // every if due else at
        self._live &= ~failed
        if failed.any() and self._live.any():
            self._memories[:, ~self._live] = self._memories[:, np.flatnonzero(self._live)[:1]]
        self._done += steps

    def end(self, errors: ErrorEstimates | None = None) -> None:
        """End the runs that have not failed, at their end.  errors: of all, if they are estimated."""
        evaluations = self.runner.read(self._memories, "evaluations")[0]
        live, runs = np.flatnonzero(self._live), self.part.runs
        columns: dict[str, Any] = {}
        if errors is not None:
            columns = {"error": errors.largest[live], "error_at_end": errors.last[live]}
            for k in live.tolist():
                runs.warnings[k] = tuple(filter(None, [errors.warnings[k]]))
        runs.reached(live, steps=self._done, nfev=evaluations[live], dt=self._longest, **columns)
        for k in np.flatnonzero(self._good < self.part.rows.shape[1]).tolist():
            self.part.rows[k, self._good[k] :] = np.nan

    def _fail(self, k: int, memory: Array, steps: int) -> int:
        """Note the step of a block of so many, begun with this memory, (size, 1), at which trajectory k failed.

        How many were done before.
        """
        read, begun = self.runner.read, memory.copy()
        rows = self.runner.run_many(memory, steps, 1).rows[:, :, 0]
        times, states = rows[:, 0], rows[:, 1 : 1 + self.program.size]
        if self.code.stops:  # the lane makes no more
            done = int(read(memory, "count")[0, 0] - read(begun, "count")[0, 0]) - 1
        else:
            done = int(np.argmax(~np.isfinite(states).all(axis=1)))
        before = states[done - 1] if done else read(begun, "x")[:, 0]
        singular = read(memory, "singular")[0, 0] if "singular" in self.runner.program.registers else 0.0
        first, last = (read(each, "evaluations")[0, 0] for each in (begun, memory))
        evaluations = first + (done + 1) * (last - first) / (done + 1 if self.code.stops else steps)
        status = failed_step(self.program.components, times[done], before, states[done], int(singular))
        self.part.runs.stopped(k, status, steps=self._done + done, nfev=int(evaluations), dt=self._longest)
        return done


@dataclass(frozen=True)
class Task:
    """The function that runs chunks. It goes to other processes as it is, and is compiled there once."""

    program: StepProgram
    options: RunOptions
    count: int  # of the rows of a trajectory
    grids: tuple[EqualSteps, ...]  # of trajectories side by side; empty: one after another
    events: EventProgram | None = None
    lanes: bool = False  # whether trajectories go in lanes, where the program can

    def __call__(self, chunk: Chunk) -> Part:
        """Run the chunk."""
        return self.run(chunk, np.empty((len(chunk.x), self.count, chunk.x.shape[1])), lambda: False)

    def run(self, chunk: Chunk, rows: Array, stopped: Callable[[], bool]) -> Part:
        """Run the chunk into rows (k, T, m).

        Raises KeyboardInterrupt soon after Ctrl-C, and StoppedError after `stopped`.
        """
        part = not_begun(chunk.first, rows, events=self.events is not None)
        with np.errstate(all="ignore"):
            done = 0 if self.grids or not self.lanes else self._before_lanes(chunk, part, stopped)
            if done == len(chunk.x) or (self.lanes and self._in_lanes(chunk, part, done, stopped)):
                return part
            if self.grids:
                self._side_by_side(chunk, part, stopped)
            else:
                self._one_by_one(chunk, part, range(len(chunk.x)), stopped)
        return part

    def _side_by_side(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> None:
        with _lock:
            code = vector_code(self.program, self.options.backend, self.options.fma)
        estimator = None
        if self.options.estimated:
            estimator = Estimator(code.program, self.options, chunk.p, partial(beside, code), sparse=True)
            estimator.begin(chunk.x, equal_steps(self.options.instants, self.options.step))
        run = VectorizedIntegration(code, self.options, chunk, part, estimator, even=len(self.grids) == 1)
        for grid in self.grids:
            run.begin(grid)
            for block in grid.blocks(*run.limits):
                if stopped():
                    raise StoppedError
                run.advance(*block)
        run.end(errors=estimator.estimates() if estimator else None)

    def _before_lanes(self, chunk: Chunk, part: Part, stopped: Callable[[], bool]) -> int:
        """Number of trajectories done one by one first: until that took as long as lanes take to be made, about.

        Of a few, or of short ones, that is all. The results are the same.
        """
        alone, begin = _alone(self.program, self.options.backend), time.perf_counter()
        done = self._one_by_one(chunk, part, range(len(chunk.x)), stopped, MAKING - alone.seconds)
        alone.seconds += time.perf_counter() - begin
        return done

    def lane_run(self, lanes: Lanes, x: Array, p: Array) -> InLanes:
        """The run in lanes from states x (k, m) with parameters p (k, ..)."""
        if self.grids:
            return EqualInLanes(lanes, self.options, x, p, self.grids[0])
        return ChosenInLanes(lanes, self.options, x, p)

    def _in_lanes(self, chunk: Chunk, part: Part, first: int, stopped: Callable[[], bool]) -> bool:
        """Whether that can be, from the first on: else nothing is done. Runs that end early are made again, alone."""
        with _lock:
            lanes = lanes_of(self.program, self.options.backend, self.options.fma)
        if lanes is None:
            return False
        run = self.lane_run(lanes, chunk.x[first:], chunk.p[first:])
        while run.advance(BLOCK_TIME):
            if stopped():
                raise StoppedError
        whole, columns = run.result(part.rows[first:])
        done, others = np.flatnonzero(whole), np.flatnonzero(~whole).tolist()
        part.runs.reached(first + done, **{name: values[done] for name, values in columns.items()})
        self._one_by_one(chunk, part, [first + k for k in others], stopped)
        return True

    def _one_by_one(
        self, chunk: Chunk, part: Part, which: Iterable[int], stopped: Callable[[], bool], seconds: float = math.inf
    ) -> int:
        """Number of these that were run: no more once they took so long [s]."""
        with _lock:
            compiled = compile_steps(self.program, self.options.backend, self.options.fma)
        run: Integration | None = None
        ends = self.options.row_times[-1] == self.options.t_end
        end, count = time.perf_counter() + seconds, 0
        for k in which:
            if time.perf_counter() >= end:
                break
            count += 1
            x, p = chunk.x[k], chunk.p[k].tolist()
            if isinstance(run, NativeIntegration):
                run.set_parameters(p)
            else:
                run = integration(compiled, self.options, p, stopped=stopped, events=self.events)
            by_end = run if ends and isinstance(run, AdaptiveIntegration) else None
            if by_end is None or not run_unseen(by_end, x, part.runs, k, part.rows[k]):
                run = (
                    run if by_end is None else integration(compiled, self.options, p, stopped=stopped)
                )  # whose first blocks are short: it says when
                stats, recorder = outcome(run, x, self.options)
                if stats.message.startswith(INTERRUPTED):
                    raise KeyboardInterrupt
                part.runs.set(k, stats)
                if isinstance(run, WatchedIntegration):
                    part.happened[k] = run.log.happened
                states = recorder.table()[1]
                part.rows[k, : len(states)], part.rows[k, len(states) :] = states, np.nan
        return count


class Alone:
    """Seconds that the trajectories of a program have taken one by one."""

    seconds = 0.0


@kept_by_first
def _alone(program: StepProgram, backend: str) -> Alone:
    return Alone()


_lock = threading.Lock()  # threads that come at the same time wait for one to make the code
