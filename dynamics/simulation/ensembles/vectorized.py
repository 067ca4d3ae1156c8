"""Side by side: steps of many trajectories at once, by a program in which all take the same course."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cgraph.extend import Runner

from ..trajectory import Array
from .chunk import Chunk, Part
from .serialized import Portable
from .step_grid import Stretch

WORK = 2**21  # nodes computed in a piece: half a millisecond for each vector
NUMBERS = 2**22  # in the rows of a piece


class Together(NamedTuple):
    """Machine code for the steps of many trajectories, and for what they do before the first."""

    problem: Portable
    start: Runner | None  # over the same memory
    many: Runner


class SideBySide:
    """One run of the trajectories of a chunk, into a part, from its row `at` on.

    A trajectory that leaves the numbers is found after the piece in which it did. From there its lane repeats a
    neighbour, since what is no number is slow to compute with, and its rows are made NaN in the end.
    """

    def __init__(self, code: Together, chunk: Chunk, part: Part, at: int) -> None:
        self.problem, self.many, self.part = code.problem, code.many, part
        count, total = part.rows.shape[:2]
        self._memories = self.many.memory({"x": chunk.x.T, "p": chunk.p.T}, count)
        if code.start is not None:
            code.start.run_many(self._memories, 1)
        self._live = np.ones(count, dtype=bool)
        self._good = np.full(count, total)  # rows that count
        self._at, self._done = at, 0  # rows and steps
        program = self.many.program
        nodes = sum(len(graph.nodes) for graph in program.graphs())
        self.limits = max(1, WORK // nodes), max(1, NUMBERS // (program.width * count))

    def begin(self, stretch: Stretch) -> None:
        """The steps that follow are of this stretch."""
        for name, value in (("start", stretch.begin), ("t", stretch.begin), ("count", 0.0), ("h", stretch.h)):
            self.many.write(self._memories, name, value)
        self.part.dt[self._live] = np.maximum(self.part.dt[self._live], stretch.h)

    def advance(self, steps: int, every: int, due: bool) -> None:
        """Make steps; those after each `every`th are rows if they are due."""
        if not self._live.any():
            return
        before, m = self._memories.copy(), self.problem.size
        record = self.many.run_many(self._memories, steps, every).rows
        if due:
            self.part.rows[:, self._at : self._at + len(record)] = record[:, 1 : 1 + m].transpose(2, 0, 1)
            self._at += len(record)
        lost = self._live & (self.many.read(self._memories, "lost")[0] != 0.0)
        if lost.any():
            for k in np.flatnonzero(lost).tolist():
                self._lose(k, before[:, [k]], steps)
            self._live &= ~lost
            if self._live.any():
                self._memories[:, ~self._live] = self._memories[:, np.flatnonzero(self._live)[:1]]
        self._done += steps

    def end(self) -> None:
        """All steps are made."""
        live, evaluations = self._live, self.many.read(self._memories, "evaluations")[0]
        self.part.steps[live], self.part.evaluations[live] = self._done, evaluations[live]
        for k in np.flatnonzero(~live):
            self.part.rows[k, self._good[k] :] = np.nan

    def _lose(self, k: int, memory: Array, steps: int) -> None:
        """Trajectory k left the numbers in the piece that began with this memory, (size, 1): find where."""
        bad = ~np.isfinite(self.part.rows[k, : self._at]).all(axis=1)
        self._good[k] = np.argmax(bad) if bad.any() else self._at
        evaluations = self.many.read(memory, "evaluations")
        so_far = evaluations[0, 0]
        rows = self.many.run_many(memory, steps, 1).rows[:, :, 0]
        row = int(np.argmax(~np.isfinite(rows).all(axis=1)))
        self.part.steps[k] = self._done + row
        self.part.evaluations[k] = so_far + (row + 1) * (evaluations[0, 0] - so_far) / steps
        t, state = rows[row, 0], rows[row, 1 : 1 + self.problem.size]
        first = int(np.argmax(~np.isfinite(state)))
        where = f"{self.problem.component(first)} is {state[first]} after the step"
        self.part.status[k] = f"stopped at t = {t:.6g} s: {where}"
