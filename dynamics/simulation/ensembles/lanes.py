"""Lanes: trajectories in the lanes of a vector, each to its own end, when another takes its lane."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, LaneCode, kept_by_first
from cgraph.extend import Call, FixedPoint, While, runner

from ...integrators.step_control import DONE
from ..estimates.state_sizes import Flags
from ..run_options import RunOptions
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps
from ..steps.first_step import TOLERANCE
from ..steps.integration import HELD, beginning, over, tolerance
from ..steps.step_program import StepProgram

FEW_TRAJECTORIES = 32  # trajectories: fewer are done one by one before the machine code of lanes is made
PASSES = 64  # of the first block, before it is known how long one takes
RESULTS = ("status", "t", "trials", "rejected", "evaluations", "at_limit", "longest_made")


class Lanes(NamedTuple):
    """A program of steps, and its machine code for lanes."""

    program: StepProgram
    code: LaneCode


@kept_by_first
def lanes_of(program: StepProgram, backend: str, fma: bool) -> Lanes | None:
    """The lanes of a program; None in Python, and where a statement has no vectors."""
    if not program.adaptive:  # sines are those of vectors, as beside an estimate of the error
        kept = "t", "evaluations", "nonfinite"
        code = runner(program.steps, backend, fma=fma).lane_code("count", kept, alike=False)
        return None if code is None else Lanes(program, code)
    toward, t = inputs = cg.variables("toward t")
    clock = Call(Graph(inputs, {"clock": toward * t}), ("lanes.toward", "t"), ("lanes.clock",))
    lengths = {**program.steps.registers, "lanes.toward": 1, "lanes.clock": 1}
    steps = replace(program.steps, registers=lengths, body=[*program.steps.body, clock])
    code = runner(steps, backend, fma=fma).lane_code("lanes.clock", RESULTS)
    return None if code is None else Lanes(program, code)


@kept_by_first
def iterates(program: StepProgram) -> bool:
    """Whether steps turn as often as numbers say, so that lanes wait for one another."""
    kinds = FixedPoint if program.adaptive else FixedPoint | While  # what looks for a first step hardly ever turns
    return any(isinstance(each, kinds) for each in program.steps.statements())


def fits_lanes(program: StepProgram, options: RunOptions, count: int) -> bool:
    """Whether so many trajectories of a run without events go in lanes.

    Others go one by one: few, which are sooner done; steps that turn as often as numbers say, so that lanes would wait
    for one another; with constraints, near whose flat positions a run is watched step by step; and tolerances below the
    rounding of a step, of which a warning tells. Equal steps whose error is estimated go side by side, all at once.
    """
    if count < FEW_TRAJECTORIES or iterates(program):
        return False
    if not program.adaptive:
        return not options.estimated
    return program.rows is None and options.relative >= program.finest


def _both(first: Flags, second: Flags) -> Flags:
    """Conjunction of the two flags."""
    where: Flags = first & second
    return where


class InLanes(ABC):
    """Runs of a chunk from states x (k, m), with these values of registers.

    marks: of the clock, at which a row is made.
    """

    def __init__(
        self, lanes: Lanes, options: RunOptions, x: Array, marks: Array, values: Mapping[str, ArrayLike]
    ) -> None:
        self.program, self.code, self.options, self.x, self._marks = lanes.program, lanes.code, options, x, marks
        self._memories = np.zeros((len(x), self.code.size))
        for name in values.keys() & self.code.numbers.keys():
            self._memories[:, self.code.numbers[name]] = values[name]
        self._passes = np.zeros((len(x), 2), np.int64)
        self._rows = np.empty((len(x), len(marks), self.code.width))
        self._rows[:, :, 0] = np.nan  # the time of a row that is not there
        self._which, self._most = np.arange(len(x)), PASSES

    def advance(self, seconds: float) -> bool:
        """Make steps for about so long [s]; whether some runs are not over yet."""
        begin, most = time.perf_counter(), int(min(self._most, self._left()))
        self.code(self._memories, self._which, self._passes, most, self._rows, self._marks)
        self._which = np.flatnonzero(self._going())
        if most == self._most:
            self._most = max(1, int(most * min(4.0, seconds / max(time.perf_counter() - begin, 1e-9))))
        return len(self._which) > 0

    def result(self, rows: Array) -> tuple[Flags, dict[str, Array]]:
        """Flags of runs that reached their end without a remark, (k,), and columns of their statistics.

        rows: (k, T, m), receives the states at the times of the options, NaN from where a run has not come to.
        """
        first = rows.shape[1] - len(self._marks)
        rows[:, :first] = self.x[:, None]
        rows[:, first:] = self._states()
        rows[:, first:][np.arange(len(self._marks)) >= self._passes[:, 1:]] = np.nan
        return self._whole(), self._columns()

    def read(self, name: str) -> Array:
        """A number of each."""
        return self._memories[:, self.code.numbers[name]][:, 0]

    @abstractmethod
    def _left(self) -> float:
        """Number of passes that may be made before a run has to be asked again."""

    @abstractmethod
    def _going(self) -> Flags:
        """Flags of the runs that are not over."""

    @abstractmethod
    def _whole(self) -> Flags:
        """Flags of the runs that reached their end without a remark."""

    @abstractmethod
    def _columns(self) -> dict[str, Array]:
        """Columns of the runs' statistics."""

    @abstractmethod
    def _states(self) -> Array:
        """States (k, marks, m)."""


class EqualInLanes(InLanes):
    """Equal steps of one grid, with parameters p (k, ..)."""

    def __init__(self, lanes: Lanes, options: RunOptions, x: Array, p: Array, grid: EqualSteps) -> None:
        count, every = len(options.row_times), grid.steps // grid.rows
        marks = every * np.arange(1.0, count + 1.0 - (options.row_times[0] == options.t0))
        numbers = {"start": grid.begin, "t": grid.begin, "h": grid.h, "fresh": 1.0}
        super().__init__(lanes, options, x, marks, {"x": x, "p": p, **numbers})
        self._grid = grid

    def _left(self) -> float:
        return float(self._grid.steps - self._passes[self._which[0], 0])

    def _going(self) -> Flags:
        return _both(self.read("nonfinite") == 0.0, self._passes[:, 0] < self._grid.steps)

    def _whole(self) -> Flags:
        return _both(self.read("nonfinite") == 0.0, self._passes[:, 0] == self._grid.steps)

    def _columns(self) -> dict[str, Array]:
        steps, longest = self._passes[:, 0], np.full(len(self.x), abs(self._grid.h))
        return {"steps": steps, "nfev": self.read("evaluations"), "dt": longest}

    def _states(self) -> Array:
        return self._rows[:, :, 1 : 1 + self.program.size]


class ChosenInLanes(InLanes):
    """Chosen steps, with parameters p (k, ..)."""

    def __init__(self, lanes: Lanes, options: RunOptions, x: Array, p: Array) -> None:
        first = int(options.row_times[0] == options.t0)  # the first row that a step makes
        start = beginning(options, max(options.relative, lanes.program.finest)) | over(options.t0, options.t_end)
        states = {"x": x, "p": p, TOLERANCE: tolerance(options), "lanes.toward": options.direction}
        super().__init__(lanes, options, x, options.direction * options.row_times[first:], start | states)

    def _left(self) -> float:
        return self.options.max_steps - float(self.read("trials")[self._which].max())

    def _going(self) -> Flags:
        return _both(self.read("status") == 0.0, self.read("trials") < self.options.max_steps)

    def _whole(self) -> Flags:
        """Flags as of every method, without runs at a stability limit, whose remark depends on their course."""
        return _both(self.read("status") == DONE, self.read("at_limit") < HELD)

    def _columns(self) -> dict[str, Array]:
        rejected, longest = self.read("rejected"), np.minimum(self.read("longest_made"), self.options.longest_step)
        steps = self.read("trials") - rejected
        return {"steps": steps, "rejected": rejected, "nfev": self.read("evaluations"), "dt": longest}

    def _states(self) -> Array:
        m, count = self.program.size, len(self._marks)
        there = np.where(np.isnan(self._rows[:, :, 0]), 0, np.arange(count))
        number = np.maximum.accumulate(there, axis=1)  # the row of the step in which a time lies
        rows = self._rows if count == 1 else np.take_along_axis(self._rows, number[:, :, None], axis=1)
        rows, times = rows.reshape(-1, self.code.width), np.tile(self.options.row_times[-count:], len(self.x))
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m].copy()
        inside = np.flatnonzero(t != times)
        if len(inside) and self.program.dense:
            t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
            block = StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), self.program.normalization)
            x[inside] = block.states_at(inside, (times[inside] - t_old[inside]) / h[inside])
        return x.reshape(len(self.x), count, m)
