"""Lanes: trajectories by chosen steps in the lanes of a vector, each with steps of its own."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array, Call, FixedPoint, LaneCode, runner

from ...integrators.step_control import DONE
from ..run_options import RunOptions
from ..steps.chosen_steps import HELD, beginning
from ..steps.dense_output import StepBlock
from ..steps.step_program import StepProgram
from .ensemble import Counts

FEW = 32  # trajectories: fewer are done one by one before the machine code of lanes is made
PASSES = 64  # of the first block, before it is known how long one takes
RESULTS = ("status", "t", "trials", "rejected", "evaluations", "at_limit", "lanes.largest")


class Lanes(NamedTuple):
    """A program of chosen steps, and its machine code for lanes."""

    program: StepProgram
    code: LaneCode


def lanes_of(program: StepProgram, backend: str) -> Lanes | None:
    """The lanes of a program; None in Python, and where a statement has no vectors."""
    names = ("lanes.toward", "t", "h", "row", "lanes.largest")
    toward, t, h, row, largest = inputs = cg.variables([f"{k}" for k in range(len(names))])
    ends = {"clock": toward * t, "largest": cg.where(row, cg.maximum(largest, abs(h)), largest)}
    kept = Call(Graph(inputs, ends), names, ("lanes.clock", "lanes.largest"))
    lengths = {**program.steps.registers, **dict.fromkeys(("lanes.toward", "lanes.clock", "lanes.largest"), 1)}
    steps = replace(program.steps, registers=lengths, body=[*program.steps.body, kept])
    code = runner(steps, backend).lane_code("lanes.clock", RESULTS)
    return None if code is None else Lanes(program, code)


def fits_lanes(program: StepProgram, options: RunOptions, count: int) -> bool:
    """Whether so many trajectories of a run without events go in lanes.

    Others go one by one: few, which are sooner done; steps that turn as often as numbers say, so that lanes would wait
    for one another; with constraints, near whose flat positions a run is watched step by step; and tolerances below the
    rounding of a step, of which a warning tells.
    """
    turns = any(isinstance(each, FixedPoint) for each in program.steps.statements())
    watched = program.rows is not None or options.relative < program.finest
    return program.adaptive and count >= FEW and not turns and not watched


class LanesIntegration:
    """Runs of a chunk from states x (k, m) with parameters p (k, ..)."""

    def __init__(self, lanes: Lanes, options: RunOptions, x: Array, p: Array) -> None:
        self.program, self.code, self.options, self.x = lanes.program, lanes.code, options, x
        assert options.times is not None
        self._at = int(options.times[0] == options.t0)  # the first row that a step makes
        self._marks = options.direction * options.times[self._at :]
        self._memories = np.zeros((len(x), self.code.size))
        start = beginning(options, max(options.relative, self.program.finest), options.t_end)
        for name, value in {**start, "x": x, "p": p, "lanes.toward": options.direction}.items():
            if name in self.code.numbers:
                self._memories[:, self.code.numbers[name]] = value
        self._passes = np.zeros((len(x), 2), np.int64)
        self._rows = np.empty((len(x), len(self._marks), self.code.width))
        self._rows[:, :, 0] = np.nan  # the time of a row that is not there
        self._which, self._most = np.arange(len(x)), PASSES

    def _read(self, name: str) -> Array:
        return self._memories[:, self.code.numbers[name]][:, 0]

    def advance(self, seconds: float) -> bool:
        """Make steps for about so long [s]; whether some runs are not over yet."""
        begin, trials = time.perf_counter(), self._read("trials")
        left = self.options.max_steps - trials[self._which].max()
        most = int(min(self._most, left))
        self.code(self._memories, self._which, self._passes, most, self._rows, self._marks)
        going = (self._read("status") == 0.0) & (self._read("trials") < self.options.max_steps)
        self._which = np.flatnonzero(going)
        if most == self._most:
            self._most = max(1, int(most * min(4.0, seconds / max(time.perf_counter() - begin, 1e-9))))
        return len(self._which) > 0

    def result(self, rows: Array) -> tuple[Counts, dict[str, Any]]:
        """The runs that reached their end and have nothing said against them, and columns of how they went.

        rows: (k, T, m), receives the states at the times of the options.
        """
        held = self._read("at_limit") >= HELD  # what is said of such a run depends on its course
        done = np.flatnonzero((self._read("status") == DONE) & ~held)
        rows[:, : self._at] = self.x[:, None]
        rows[:, self._at :] = self._states()
        numbers = {name: self._read(name)[done] for name in ("trials", "rejected", "evaluations", "lanes.largest")}
        columns = {
            "steps": numbers["trials"] - numbers["rejected"],
            "rejected": numbers["rejected"],
            "nfev": numbers["evaluations"],
            "dt": np.minimum(numbers["lanes.largest"], self.options.longest_step),
        }
        return done, columns

    def reached(self, k: int) -> str:
        """How far run k has come, in words; empty before its first step."""
        return f" after t = {self._read('t')[k]:.6g} s" if self._read("trials")[k] else ""

    def _states(self) -> Array:
        """States (k, T, m) at the times of rows that steps make, NaN from where no step has come to."""
        assert self.options.times is not None
        m, count = self.program.size, len(self._marks)
        there = np.where(np.isnan(self._rows[:, :, 0]), 0, np.arange(count))
        number = np.maximum.accumulate(there, axis=1)  # the row of the step in which a time lies
        rows = np.take_along_axis(self._rows, number[:, :, None], axis=1).reshape(-1, self.code.width)
        times = np.tile(self.options.times[self._at :], len(self.x))
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m].copy()
        inside = np.flatnonzero(t != times)
        if len(inside):
            t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
            block = StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), self.program.normalization)
            x[inside] = block.states_at(inside, (times[inside] - t_old[inside]) / h[inside])
        states = x.reshape(len(self.x), count, m)
        states[np.arange(count) >= self._passes[:, 1:]] = np.nan
        return states
