"""Vectorized integration: steps of many trajectories at once, each in a lane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array, Runner

from ..estimates.courses import Course
from ..estimates.error_estimate import Estimator
from ..estimates.state_difference import States
from ..steps.step_program import StepProgram
from ..steps.stepping import begin_equal, failed_step, nonfinite
from .chunk import INTERRUPTED, Chunk, Part
from .step_grid import StepGrid

WORK = 2**21  # nodes computed in a block: half a millisecond for each vector
NUMBERS = 2**22  # in the rows of a block
SEEN = 4  # steps that one of the longest of runs beside stands for


class VectorCode(NamedTuple):
    """Machine code for the steps of many trajectories, and for what they do before the first."""

    program: StepProgram
    start: Runner | None  # over the same memory
    one_pass: Runner
    stops: bool  # see `LaneSteps`


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
    """So many steps: the record of each `every`th, and its states."""
    record = code.one_pass.run_many(memories, steps, every).rows
    states = record[:, 1 : 1 + code.program.size].transpose(2, 0, 1)
    return record, States(np.ascontiguousarray(record[:, 0, 0]), states)


def beside(code: VectorCode, course: Course, x: Array, p: Array) -> Iterator[States]:
    """The states of runs from x (k, m) with parameters p (k, ..) on another course."""
    memories, most = _start_memories(code, x, p), min(_block_limits(code, len(x)))
    for number, stretch in enumerate(course.stretches):
        begin_equal(code.one_pass, memories, stretch.begin, stretch.h)
        for done in range(0, stretch.steps, most):
            steps = min(most, stretch.steps - done)
            yield _advanced(code, memories, steps, math.gcd(steps, 1 if number else course.every))[1]


class VectorizedIntegration:
    """One run of the trajectories of a chunk, into a part, from its row `at` on.

    estimator: is told the states after all steps, or, where the grid is even, after those that it looks at.
    A trajectory whose state is no longer finite is noticed after the block in which it stopped being so. From there its
    lane repeats a neighbor, since NaN is slow to compute with, and its rows become NaN in the end.
    """

    def __init__(
        self, code: VectorCode, chunk: Chunk, part: Part, at: int, t0: float, estimator: Estimator | None, *, even: bool
    ) -> None:
        self.code, self.program, self.runner, self.part = code, code.program, code.one_pass, part
        self.estimator, self._seen = estimator, SEEN if even and estimator and not estimator.every else 1
        count, total = part.rows.shape[:2]
        self._memories = _start_memories(code, chunk.x, chunk.p)
        self._live = np.ones(count, dtype=bool)
        self._good = np.full(count, total)  # rows that count
        self._at, self._done, self._reached = at, 0, t0  # rows, steps, and the time [s] of the last block
        self._interrupted = False
        passes, rows = _block_limits(code, count)
        self.limits = passes if estimator is None else min(passes, rows), rows

    def begin(self, grid: StepGrid) -> None:
        """The steps that follow are of this grid."""
        begin_equal(self.runner, self._memories, grid.begin, grid.h)
        self.part.dt[self._live] = np.maximum(self.part.dt[self._live], abs(grid.h))

    def advance(self, steps: int, every: int, due: bool) -> None:
        """Make steps; those after every `every`th are rows if they are due."""
        if not self._live.any():
            return
        before, at, m = self._memories.copy(), self._at, self.program.size
        if self.estimator is None:
            record = self.runner.run_many(self._memories, steps, every).rows
        else:
            seen = math.gcd(every, self._seen)
            record, states = _advanced(self.code, self._memories, steps, seen)
            record = record[every // seen - 1 :: every // seen]
            self.estimator.add(states)
        if due:
            kept = record[: self.part.rows.shape[1] - self._at]  # t_end itself may be no row
            self.part.rows[:, self._at : self._at + len(kept)] = kept[:, 1 : 1 + m].transpose(2, 0, 1)
            self._at += len(kept)
        failed = self._live & (self.runner.read(self._memories, "nonfinite")[0] != 0.0)
        if failed.any():
            for k in np.flatnonzero(failed).tolist():
                if self.code.stops:
                    self._failed_step(k, before[:, [k]], at, every if due else 0)
                else:
                    self._locate_failure(k, before[:, [k]], steps)
            self._live &= ~failed
            if self._live.any():
                self._memories[:, ~self._live] = self._memories[:, np.flatnonzero(self._live)[:1]]
        self._done += steps
        self._reached = float(self.runner.read(self._memories, "t")[0, 0])

    def interrupt(self) -> None:
        """Those that have not failed end here, with the rows that they have."""
        for k in np.flatnonzero(self._live).tolist():
            self.part.status[k] = f"{INTERRUPTED} after t = {self._reached:.6g} s"
        self._good[self._live] = self._at
        self._interrupted = True

    def end(self) -> None:
        """Count the steps, and end what has failed."""
        live, evaluations = self._live, self.runner.read(self._memories, "evaluations")[0]
        self.part.steps[live], self.part.evaluations[live] = self._done, evaluations[live]
        for k in range(len(live)) if self._interrupted else np.flatnonzero(~live):
            self.part.rows[k, self._good[k] :] = np.nan

    def _failed_step(self, k: int, memory: Array, at: int, every: int) -> None:
        """Of trajectory k, which stopped in the block that began with this memory, (size, 1), and row `at`."""
        runner, after = self.runner, self._memories[:, [k]]
        t, count, evaluations = (runner.read(after, name)[0, 0] for name in ("t", "count", "evaluations"))
        steps = int(count - runner.read(memory, "count")[0, 0]) - 1
        self._good[k] = at + steps // every if every else at
        self.part.steps[k], self.part.evaluations[k] = self._done + steps, evaluations
        runner.run_many(memory, steps, max(1, steps))
        singular = runner.read(after, "singular")[0, 0] if "singular" in runner.program.registers else 0.0
        before, x = (runner.read(each, "x")[:, 0] for each in (memory, after))
        self.part.status[k] = failed_step(self.program.components, t, before, x, int(singular))

    def _locate_failure(self, k: int, memory: Array, steps: int) -> None:
        """Where trajectory k stopped being finite in the block that began with this memory, (size, 1)."""
        bad = ~np.isfinite(self.part.rows[k, : self._at]).all(axis=1)
        self._good[k] = np.argmax(bad) if bad.any() else self._at
        evaluations = self.runner.read(memory, "evaluations")
        so_far = evaluations[0, 0]
        rows = self.runner.run_many(memory, steps, 1).rows[:, :, 0]
        row = int(np.argmax(~np.isfinite(rows).all(axis=1)))
        self.part.steps[k] = self._done + row
        self.part.evaluations[k] = so_far + (row + 1) * (evaluations[0, 0] - so_far) / steps
        what = nonfinite(self.program.components, rows[row, 1 : 1 + self.program.size])
        self.part.status[k] = f"stopped at t = {rows[row, 0]:.6g} s: {what}"
