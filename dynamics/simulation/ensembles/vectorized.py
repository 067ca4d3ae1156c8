"""Vectorized integration: steps of many trajectories at once, by a program in which all take the same course."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cgraph.extend import Array, Runner

from ..step_program import StepProgram
from .chunk import INTERRUPTED, Chunk, Part
from .step_grid import StepGrid

WORK = 2**21  # nodes computed in a block: half a millisecond for each vector
NUMBERS = 2**22  # in the rows of a block


class VectorCode(NamedTuple):
    """Machine code for the steps of many trajectories, and for what they do before the first."""

    program: StepProgram
    start: Runner | None  # over the same memory
    one_pass: Runner


def start_memories(code: VectorCode, chunk: Chunk) -> Array:
    """Memories before the first step, (size, k)."""
    memories = code.one_pass.memory({"x": chunk.x.T, "p": chunk.p.T}, len(chunk.x))
    if code.start is not None:
        code.start.run_many(memories, 1)
    return memories


def block_limits(code: VectorCode, count: int) -> tuple[int, int]:
    """Steps, and rows, of `count` trajectories in a block."""
    program = code.one_pass.program
    nodes = sum(len(graph.nodes) for graph in program.graphs())
    return max(1, WORK // nodes), max(1, NUMBERS // (program.width * count))


class VectorizedIntegration:
    """One run of the trajectories of a chunk, into a part, from its row `at` on.

    A trajectory whose state is no longer finite is noticed after the block in which it stopped being so. From there its
    lane repeats a neighbor, since NaN is slow to compute with, and its rows become NaN in the end.
    """

    def __init__(self, code: VectorCode, chunk: Chunk, part: Part, at: int, t0: float) -> None:
        self.program, self.runner, self.part = code.program, code.one_pass, part
        count, total = part.rows.shape[:2]
        self._memories = start_memories(code, chunk)
        self._live = np.ones(count, dtype=bool)
        self._good = np.full(count, total)  # rows that count
        self._at, self._done, self._reached = at, 0, t0  # rows, steps, and the time [s] of the last block
        self._interrupted = False
        self.limits = block_limits(code, count)

    def begin(self, grid: StepGrid) -> None:
        """The steps that follow are of this grid."""
        for name, value in (("start", grid.begin), ("t", grid.begin), ("count", 0.0), ("h", grid.h)):
            self.runner.write(self._memories, name, value)
        self.part.dt[self._live] = np.maximum(self.part.dt[self._live], abs(grid.h))

    def advance(self, steps: int, every: int, due: bool) -> None:
        """Make steps; those after every `every`th are rows if they are due."""
        if not self._live.any():
            return
        before, m = self._memories.copy(), self.program.size
        record = self.runner.run_many(self._memories, steps, every).rows
        if due:
            kept = record[: self.part.rows.shape[1] - self._at]  # t_end itself may be no row
            self.part.rows[:, self._at : self._at + len(kept)] = kept[:, 1 : 1 + m].transpose(2, 0, 1)
            self._at += len(kept)
        failed = self._live & (self.runner.read(self._memories, "nonfinite")[0] != 0.0)
        if failed.any():
            for k in np.flatnonzero(failed).tolist():
                self._locate_failure(k, before[:, [k]], steps)
            self._live &= ~failed
            if self._live.any():
                self._memories[:, ~self._live] = self._memories[:, np.flatnonzero(self._live)[:1]]
        self._done += steps
        self._reached = float(self.runner.read(self._memories, "t")[0, 0])

    @property
    def states(self) -> Array:
        """Where the trajectories are, (k, m)."""
        return self.runner.read(self._memories, "x").T

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
        t, state = rows[row, 0], rows[row, 1 : 1 + self.program.size]
        first = int(np.argmax(~np.isfinite(state)))
        where = f"{self.program.components[first]} is {state[first]} after the step"
        self.part.status[k] = f"stopped at t = {t:.6g} s: {where}"
