"""Lanes: trajectories in the lanes of a vector, each to its own end, when another takes its lane."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, LaneCode, kept_by_first
from cgraph.extend import Call, FixedPoint, If, Program, While, runner

from ...integrators.step_control import DONE
from ..run_options import RunOptions
from ..stepper import BLOCK_TIME, HELD, StoppedError, first_registers, span_registers
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps, Numbers
from ..steps.state_sizes import Flags
from ..steps.step_program import StepProgram

FEW_TRAJECTORIES = 32  # trajectories: fewer by chosen steps are done one by one before the code of lanes is made
VECTOR = 8  # lanes, or a multiple of them, of every processor
PASSES = 64  # of the first block, before it is known how long one takes
RESULTS = ["status", "t", "trials", "rejected", "evaluations", "at_limit", "longest_made"]

Stopped = Callable[[], bool]


class VectorCode:
    """`LaneCode` of equal steps without machine code: all memories go together, in NumPy's vectors.

    stops: whether the memory of a step that failed makes no more, for its state may be finite, and the next not fail.
    """

    def __init__(self, steps: Program, *, stops: bool) -> None:
        failed, registers, body = cg.variable("nonfinite"), {**steps.registers, "live": 1}, steps.body
        if stops:
            live = Call(Graph([failed], {"live": cg.where(failed, 0.0, 1.0)}), ("nonfinite",), ("live",))
            body = [live, If("live", tuple(steps.body))]
        self._runner = runner(replace(steps, registers=registers, body=body, stop=None), "python")
        self.size, self.width = self._runner.size, steps.width
        places = {name: self._runner.read(np.arange(float(self.size)), name) for name in registers}
        self.numbers = {name: slice(int(at[0]), int(at[-1]) + 1) for name, at in places.items() if len(at)}

    def __call__(self, memories: Array, which: Numbers, passes: Numbers, most: int, rows: Array, marks: Array) -> None:
        """As `LaneCode`."""
        memory, (done, mark) = np.ascontiguousarray(memories[which].T), passes[which[0]].tolist()
        end = done + most
        while done < end:
            ahead = min(end, int(marks[mark]))
            record = self._runner.run_many(memory, ahead - done, ahead - done).rows[0]
            if ahead == marks[mark]:
                rows[which, mark], mark = record.T, mark + 1
            done = ahead
        memories[which], passes[which] = memory.T, (done, mark)


Code: TypeAlias = LaneCode | VectorCode


@kept_by_first
def lanes_of(program: StepProgram, backend: str, fma: bool) -> Code | None:
    """The code of lanes; None of chosen steps in Python, and where a statement has no vectors.

    Sines of equal steps are those of vectors.
    """
    steps, clock, results = program.steps, "count", ["t", "evaluations", "nonfinite"]
    if program.adaptive:
        toward, t = inputs = cg.variables("toward t")
        body = Call(Graph(inputs, {"clock": toward * t}), ("lanes.toward", "t"), ("lanes.clock",))
        lengths = {**steps.registers, "lanes.toward": 1, "lanes.clock": 1}
        steps, clock, results = replace(steps, registers=lengths, body=[*steps.body, body]), "lanes.clock", RESULTS
    code = runner(steps, backend, fma=fma).lane_code(clock, results, alike=program.adaptive)
    if code is None and not program.adaptive and not replace(steps, stop=None).alone:
        return VectorCode(steps, stops=iterates(program))
    return code


@kept_by_first
def iterates(program: StepProgram) -> bool:
    """Whether steps turn as often as numbers say, so that lanes wait for one another."""
    kinds = FixedPoint if program.adaptive else FixedPoint | While  # what looks for a first step hardly ever turns
    return any(isinstance(each, kinds) for each in program.steps.statements())


def fits_lanes(program: StepProgram, options: RunOptions, grids: Sequence[EqualSteps], count: int) -> bool:
    """Whether so many trajectories of a run without events go in lanes.

    Others go one by one: few, which are sooner done; chosen steps that turn as often as numbers say, so that lanes
    would wait for one another; with constraints, near whose flat positions a run is watched step by step; tolerances
    below the rounding of a step, of which a warning tells; and more equal steps than there may be.
    """
    if not program.adaptive:
        return (count >= VECTOR or not iterates(program)) and sum([each.steps for each in grids]) <= options.max_steps
    few = count < FEW_TRAJECTORIES
    return not few and not iterates(program) and program.rows is None and options.relative >= program.finest


class _Memories:
    """Memories of k runs in lanes, with these values of registers.

    passes: how many each has made, and how many marks of its clock passed, (k, 2).
    """

    def __init__(self, code: Code, count: int, values: Mapping[str, ArrayLike]) -> None:
        self._code, self._memories, self._most = code, np.zeros((count, code.size)), PASSES
        self.passes = np.zeros((count, 2), np.int64)
        self.set(values)

    def set(self, values: Mapping[str, ArrayLike]) -> None:
        """Set registers, those that there are."""
        for name in values.keys() & self._code.numbers.keys():
            self._memories[:, self._code.numbers[name]] = values[name]

    def read(self, name: str) -> Array:
        """A number of each."""
        return self._memories[:, self._code.numbers[name]][:, 0]

    def rows(self, marks: Array, going: Callable[[], tuple[Numbers, float]], stopped: Stopped) -> Array:
        """Go on until none is going: the rows (k, len(marks), width), NaN in time of those not there.

        going: those that are, and how many passes they may make.  Raises StoppedError after `stopped`.
        """
        rows = np.empty((len(self._memories), len(marks), self._code.width))
        rows[:, :, 0] = np.nan
        self.passes[:, 1] = 0
        which, left = going()
        while len(which):
            if stopped():
                raise StoppedError
            begin, most = time.perf_counter(), int(min(self._most, left))
            self._code(self._memories, which, self.passes, most, rows, marks)
            if most == self._most:
                self._most = max(1, int(most * min(4.0, BLOCK_TIME / max(time.perf_counter() - begin, 1e-9))))
            which, left = going()
        return rows


# Of runs: flags of those that reached their end without a remark on their course, (k,), and columns of statistics.
LaneRuns: TypeAlias = tuple[Flags, dict[str, Array]]


class Leg(NamedTuple):
    """Steps of a grid, up to the last of these marks, which are numbers of its steps.

    places: for each table of rows, which of them are at marks, and at which.
    """

    grid: EqualSteps
    marks: Array
    places: list[tuple[slice, slice | Numbers]]


def legs_of(grids: Sequence[EqualSteps], tables: Sequence[Numbers], every: int = 0) -> Iterator[Leg]:
    """The legs of runs that keep tables of rows, after so many steps each, (T,).

    every: all steps are marks, so many of a leg; 0: those that the tables ask for, and the last of a grid.
    """
    done, asked = 0, tables[0] if len(tables) == 1 else np.unique(np.concatenate(tables))
    for grid in grids:
        end = done + grid.steps
        marks = asked[slice(*asked.searchsorted((done + 1, end + 1)))]
        marks = marks if len(marks) and marks[-1] == end else np.append(marks, end)
        all_steps = (np.arange(k, min(k + every, end + 1)) for k in range(done + 1, end + 1, every or end))
        for part in all_steps if every else [marks]:
            here = [slice(*numbers.searchsorted((part[0], part[-1] + 1)).tolist()) for numbers in tables]
            there = [_together(part.searchsorted(numbers[rows])) for numbers, rows in zip(tables, here, strict=True)]
            yield Leg(grid, np.array(part - done, dtype=np.float64), list(zip(here, there, strict=True)))
        done = end


def _together(at: Numbers) -> slice | Numbers:
    """Indices as a slice, which copies nothing, if they follow one another."""
    return slice(int(at[0]), int(at[-1]) + 1) if len(at) and at[-1] - at[0] == len(at) - 1 else at


def equal_in_lanes(
    code: Code,
    x: Array,
    p: Array,
    legs: Iterable[Leg],
    tables: Sequence[Array],
    stopped: Stopped,
    watch: Callable[[Array, Array], None] | None = None,
) -> LaneRuns:
    """Runs by equal steps from states x (k, m) with parameters p (k, ..).

    tables: receive states, (k, T, m), NaN from where a run has not come to.  watch: is told those of all marks.
    """
    run, m, steps, longest = _Memories(code, len(x), {"x": x, "p": p, "fresh": 1.0}), x.shape[1], 0, 0.0
    at = 0.0  # steps of the grid
    for grid, marks, places in legs:
        if at == 0.0:
            run.set({"start": grid.begin, "t": grid.begin, "h": grid.h, "count": 0.0})
            run.passes[:, 0] = 0
            longest = max(longest, abs(grid.h))
        for (here, _), rows in zip(places, tables, strict=True) if not steps and at == 0.0 else ():
            rows[:, : here.start] = x[:, None]  # the start
        at = float(marks[-1])
        block = run.rows(marks, partial(_going, run, at), stopped)[:, :, 1 : 1 + m]
        if (run.passes[:, 1] < len(marks)).any():
            block[np.arange(len(marks)) >= run.passes[:, 1:]] = np.nan
        for (here, there), rows in zip(places, tables, strict=True):
            rows[:, here] = block[:, there]
        if watch is not None:
            watch(grid.begin + marks * grid.h, block)
        if at == grid.steps:
            at, steps = 0.0, steps + grid.steps
    columns = {"steps": np.full(len(x), steps), "nfev": run.read("evaluations"), "dt": np.full(len(x), longest)}
    return run.read("nonfinite") == 0.0, columns


def _going(run: _Memories, steps: float) -> tuple[Numbers, float]:
    """Runs that are on their way to so many steps of a grid, and how many are left to them."""
    which = np.flatnonzero((run.read("nonfinite") == 0.0) & (run.passes[:, 0] < steps))
    return which, steps - run.passes[which[0], 0] if len(which) else 0.0


def chosen_in_lanes(
    code: Code, program: StepProgram, options: RunOptions, x: Array, p: Array, rows: Array, stopped: Stopped
) -> LaneRuns:
    """Runs by chosen steps from states x (k, m) with parameters p (k, ..).

    rows: (k, T, m), receives the states at the times of the options, NaN from where a run has not come to.
    """
    first = int(options.row_times[0] == options.t0)  # the first row that a step makes
    start = first_registers(program, options) | span_registers(options)
    values: dict[str, ArrayLike] = {"x": x, "p": p, "lanes.toward": options.direction}
    run = _Memories(code, len(x), start | values)

    def going() -> tuple[Numbers, float]:
        trials = run.read("trials")
        which = np.flatnonzero((run.read("status") == 0.0) & (trials < options.max_steps))
        return which, options.max_steps - trials[which].max(initial=0.0)

    made = run.rows(options.direction * options.row_times[first:], going, stopped)
    rows[:, :first] = x[:, None]
    rows[:, first:] = _states(program, made, options.row_times[first:])
    rows[:, first:][np.arange(made.shape[1]) >= run.passes[:, 1:]] = np.nan
    # A run at a stability limit has a remark, which depends on its course.
    whole = (run.read("status") == DONE) & (run.read("at_limit") < HELD)
    rejected, longest = run.read("rejected"), np.minimum(run.read("longest_made"), options.longest_step)
    columns = {"steps": run.read("trials") - rejected, "rejected": rejected}
    return whole, {**columns, "nfev": run.read("evaluations"), "dt": longest}


def _states(program: StepProgram, rows: Array, times: Array) -> Array:
    """States (k, T, m) at times (T,), from the rows (k, T, width) of the steps in which they lie."""
    many, count, width = rows.shape
    m = program.size
    there = np.where(np.isnan(rows[:, :, 0]), 0, np.arange(count))
    number = np.maximum.accumulate(there, axis=1)  # the row of the step in which a time lies
    rows = rows if count == 1 else np.take_along_axis(rows, number[:, :, None], axis=1)
    rows, times = rows.reshape(-1, width), np.tile(times, many)
    t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m].copy()
    inside = np.flatnonzero(t != times)
    if len(inside) and program.dense:
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        block = StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), program.normalization)
        x[inside] = block.states_at(inside, (times[inside] - t_old[inside]) / h[inside])
    return x.reshape(many, count, m)
