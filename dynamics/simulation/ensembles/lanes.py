"""Lanes: trajectories in the lanes of a vector, each to its own end, when another takes its lane."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, LaneCode, kept_by_first
from cgraph.extend import Call, FixedPoint, While, runner

from ...integrators.step_control import DONE
from ..run_options import RunOptions
from ..stepper import BLOCK_TIME, HELD, StoppedError, beginning, over, tolerance
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps, Numbers
from ..steps.first_step import TOLERANCE
from ..steps.state_sizes import Flags
from ..steps.step_program import StepProgram

FEW_TRAJECTORIES = 32  # trajectories: fewer by chosen steps are done one by one before the code of lanes is made
VECTOR = 8  # lanes, or a multiple of them, of every processor
PASSES = 64  # of the first block, before it is known how long one takes
RESULTS = ["status", "t", "trials", "rejected", "evaluations", "at_limit", "longest_made"]

Stopped = Callable[[], bool]
# Of runs: flags of those that reached their end without a remark on their course, (k,), and columns of statistics.
LaneRuns: TypeAlias = tuple[Flags, dict[str, Array]]


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


@kept_by_first
def iterates(program: StepProgram) -> bool:
    """Whether steps turn as often as numbers say, so that lanes wait for one another."""
    kinds = FixedPoint if program.adaptive else FixedPoint | While  # what looks for a first step hardly ever turns
    return any(isinstance(each, kinds) for each in program.steps.statements())


def fits_lanes(program: StepProgram, options: RunOptions, grids: Sequence[EqualSteps], count: int) -> bool:
    """Whether so many trajectories of a run without events go in lanes."""
    if not program.adaptive:
        return (count >= VECTOR or not iterates(program)) and sum([each.steps for each in grids]) <= options.max_steps
    # With constraints a run is watched step by step, near flat positions; of tolerances below rounding it warns.
    watched = program.rows is not None or options.relative < program.finest
    return count >= FEW_TRAJECTORIES and not iterates(program) and not watched


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

    def __init__(self, code: LaneCode, program: StepProgram, options: RunOptions, x: Array, p: Array) -> None:
        self._code, self._program, self._options, self._x, self._most = code, program, options, x, PASSES
        self._memories = np.zeros((len(x), code.size))
        self._passes = np.zeros((len(x), 2), np.int64)  # how many each has made, and how many marks of its clock passed
        self._set({"x": x, "p": p, "fresh": 1.0})
        if program.adaptive:
            self._set(beginning(options, max(options.relative, program.finest)) | over(options.t0, options.t_end))
            self._set({TOLERANCE: tolerance(options), "lanes.toward": options.direction})

    def to_end(self, legs: Sequence[Leg], rows: Array, stopped: Stopped) -> LaneRuns:
        """Go all legs, with states for rows (k, T, m), NaN from where a run stops on."""
        program, m, steps, longest = self._program, self._program.size, 0, 0.0
        rows[:, 0] = self._x  # unless that is not at the start
        for grid, marks, here in legs:
            if grid is not None:
                self._set({"start": grid.begin, "t": grid.begin, "h": grid.h, "count": 0.0})
                self._passes[:, 0], steps, longest = 0, steps + grid.steps, max(longest, abs(grid.h))
            made = self._rows(marks, stopped)
            times = self._options.direction * marks
            block = _states(program, made, times) if program.adaptive else made[:, :, 1 : 1 + m]
            if (self._passes[:, 1] < len(marks)).any():
                block[np.arange(len(marks)) >= self._passes[:, 1:]] = np.nan
            rows[:, here] = block[:, : here.stop - here.start]
        if not program.adaptive:
            columns = {"steps": np.full(len(self._x), steps), "dt": np.full(len(self._x), longest)}
            return self._read("nonfinite") == 0.0, {**columns, "nfev": self._read("evaluations")}
        # A run at a stability limit has a remark, which depends on its course.
        whole = (self._read("status") == DONE) & (self._read("at_limit") < HELD)
        rejected, length = self._read("rejected"), np.minimum(self._read("longest_made"), self._options.longest_step)
        columns = {"steps": self._read("trials") - rejected, "rejected": rejected, "dt": length}
        return whole, {**columns, "nfev": self._read("evaluations")}

    def _set(self, values: Mapping[str, ArrayLike]) -> None:
        """Set registers, those that there are."""
        for name in values.keys() & self._code.numbers.keys():
            self._memories[:, self._code.numbers[name]] = values[name]

    def _read(self, name: str) -> Array:
        """A number of each."""
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
