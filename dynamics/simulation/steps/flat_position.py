"""Flat positions: where the constraints of a linkage say less than elsewhere, so that it can go on in two ways.

The motion may go smoothly through such a position. But what a state is off, its acceleration is by as much over the
distance, and a state on the constraints is off by their rounding over it: steps by error come ever closer, or creep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph._shared import Array

from ..row_values import values_of
from .step_program import StepProgram

NEAR_SINGULAR = 0.1  # of the least singular value at the start: one that is less is on its way to 0
LOST = 1e-6  # of the largest: one that is 0, wherever the run has started
KEPT_STEPS = 16  # of the last steps, the shortest: among these one ended near
FAR_TOLERANCES = 1e3  # tolerances of a step, by which constraints may move what it arrives at
CREEP, SHARE = 2000, 0.1  # steps that together come less far than so much of the longest one
PART = 0.3  # of the largest entry of the singular vector: a row that takes part


class FlatPosition:
    """Looks for one near the states of a run."""

    def __init__(self, program: StepProgram) -> None:
        self.rows, self.nq, self.components = program.rows, program.nq, program.components
        self.lengths, self.least = program.kinds.lengths[self.nq :], 0.0
        self._mark, self._far = (0, 0.0), False

    def begin(self, t: float, x: Array, parameters: Sequence[float]) -> None:
        """Compare with the start."""
        if self.rows is not None:
            self.sizes, self._ends = np.zeros(len(self.rows.outputs)), np.zeros((0, 0))
            self.least, self._mark = self._singular(t, x, parameters)[0], (0, t)

    def look(self, rows: Array, way: float, parameters: Sequence[float]) -> list[str]:
        """Keep where the shortest of these steps ended, rows of t, h, x and more; and what to say, once, of a state.

        way: by how many tolerances of a step constraints moved one so far, at most.
        """
        self._ends = rows[np.abs(rows[:, 1]).argsort()[:KEPT_STEPS], : 2 + len(self.components)].copy()
        if self._far or not way > FAR_TOLERANCES:
            return []
        self._far = True
        text = f"by t = {rows[-1, 0]:.6g} s the constraints moved the state by {way:.3g} times the tolerance of a "
        where = f"step: near a position where it can go on in two ways the motion is not certain{self.near(parameters)}"
        return [text + where]

    def creeping(self, goes_on: bool, steps: int, longest: float, rows: Array, parameters: Sequence[float]) -> str:
        """Sentence on a run that hardly comes on near a flat position, after so many steps; "" of others."""
        if self.rows is None or not goes_on or not len(rows) or steps < self._mark[0] + CREEP:
            return ""
        t, (before, begin) = float(rows[-1, 0]), self._mark
        self._mark = steps, t
        if abs(t - begin) >= SHARE * longest or not (where := self.near(parameters)):
            return ""
        return f"stopped at t = {t:.6g} s: the last {steps - before} steps came {abs(t - begin):.1e} s on{where}"

    def near(self, parameters: Sequence[float]) -> str:
        """The rows that lose rank and the coordinates, where one of the shortest steps ended; "" if none does."""
        if self.rows is None or not len(self._ends):
            return ""
        found = [(*self._singular(float(end[0]), end[2:], parameters), end[2:]) for end in self._ends]
        least, shares, x = min(found, key=lambda each: each[0] if np.isfinite(each[0]) else np.inf)
        if not least < max(NEAR_SINGULAR * self.least, LOST):
            return ""
        taking_part = zip(self.rows.outputs, shares >= PART * shares.max(), strict=True)
        rows = [repr(name) for name, part in taking_part if part]
        place = ", ".join([f"{name} = {value:.6g}" for name, value in zip(self.components, x[: self.nq], strict=False)])
        verb = "says" if len(rows) == 1 else "say"
        return f"; near by {' and '.join(rows)} {verb} nothing that the other constraints do not say: {place:.300}"

    def _singular(self, t: float, x: Array, parameters: Sequence[float]) -> tuple[float, Array]:
        """The least singular value beside the largest, and of how much of each row it is, (m,)."""
        with np.errstate(all="ignore"):
            matrix = self._matrix(t, x, parameters)
            self.sizes = np.maximum(self.sizes, np.linalg.norm(matrix, axis=1))
            matrix = matrix / np.where(self.sizes > 0.0, self.sizes, 1.0)[:, None]
        if not np.isfinite(matrix).all():
            return np.nan, np.ones(len(matrix))
        left, values, _ = np.linalg.svd(matrix, full_matrices=False)
        return float(values[-1] / (values[0] or 1.0)), np.abs(left[:, -1])

    def _matrix(self, t: float, x: Array, parameters: Sequence[float]) -> Array:
        """J, (m, n), from the rates of the rows, which are linear in the velocities."""
        assert self.rows is not None
        n = len(x) - self.nq
        velocities = np.concatenate([np.diag(1.0 / np.array(self.lengths)), np.zeros((n, 1))], axis=1)
        inputs = [*x[: self.nq].tolist(), *velocities, t, *parameters]
        values = values_of(self.rows, inputs, n + 1)
        return np.asarray(values[:, :-1] - values[:, -1:])
