"""Flat positions: where the constraints of a linkage say less than elsewhere, so that it can go on in two ways.

Accelerations are off by what a state is off over the distance to one: steps by error come ever closer, or creep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph._shared import Array

from .row_values import values_of
from .step_program import StepProgram

NEAR_SINGULAR = 0.1  # of the least singular value at the start: one that is less is on its way to 0
LOST = 1e-6  # of the largest: one that is 0, wherever the run has started
KEPT_STEPS = 16  # of the last steps, the shortest: among these one ended near
FAR_TOLERANCES = 1e3  # tolerances of a step, by which constraints may move what it arrives at
CREEP, SHARE = 2000, 0.1  # steps that together come less far than so much of the longest one
PART = 0.3  # of the largest entry of the singular vector: a row that takes part


class FlatPosition:
    """Looks for one near the states of a run with constraints, from its start x (m,) at t on."""

    def __init__(self, program: StepProgram, t: float, x: Array, parameters: Sequence[float]) -> None:
        assert program.rows is not None
        self._rows, self._nq, self._components = program.rows, program.nq, program.components
        self._parameters, self._lengths = parameters, program.kinds.lengths[program.nq :]
        self._sizes, self._ends = np.zeros(len(program.rows.outputs)), np.empty((0, 0))
        self._least, self._mark = self._singular(t, x)[0], (0, t)

    def reason(self, rows: Array, steps: int, way: float, longest: float) -> str:
        """Reason to stop near one, by rows (t, h, x, ..) of steps.  way: tolerances that constraints moved one by."""
        self._ends = rows[np.abs(rows[:, 1]).argsort()[:KEPT_STEPS], : 2 + len(self._components)].copy()
        t, (before, begin), text = float(rows[-1, 0]), self._mark, ""
        if steps >= before + CREEP:
            self._mark = steps, t
            if abs(t - begin) < SHARE * longest:
                text = f"the last {steps - before} steps came {abs(t - begin):.1e} s on"
        elif way > FAR_TOLERANCES:
            text = f"the constraints moved the state by {way:.3g} times the tolerance of a step"
        return f"{text}{where}" if text and (where := self.near()) else ""

    def near(self) -> str:
        """The rows that lose rank and the coordinates, where one of the shortest steps ended; "" if none does."""
        found = [(*self._singular(float(end[0]), end[2:]), end[2:]) for end in self._ends]
        lost = [each for each in found if each[0] < max(NEAR_SINGULAR * self._least, LOST)]
        if not lost:
            return ""
        _, shares, x = min(lost, key=lambda each: each[0])
        rows = [
            f"{name!r}" for name, share in zip(self._rows.outputs, shares, strict=True) if share >= PART * shares.max()
        ]
        place = [f"{name} = {value:.6g}" for name, value in zip(self._components, x[: self._nq], strict=False)]
        verb = "says" if len(rows) == 1 else "say"
        said = f"{' and '.join(rows)} {verb} nothing that the other constraints do not say"
        return f"; near by {said}: {', '.join(place):.300}"

    def _singular(self, t: float, x: Array) -> tuple[float, Array]:
        """The least singular value of J beside the largest, and of how much of each row it is, (m,)."""
        n = len(x) - self._nq
        velocities = np.concatenate([np.diag(1.0 / np.array(self._lengths)), np.zeros((n, 1))], axis=1)
        with np.errstate(all="ignore"):  # the rates of the rows are linear in the velocities
            rates = values_of(self._rows, [*x[: self._nq].tolist(), *velocities, t, *self._parameters], n + 1)
            matrix = rates[:, :-1] - rates[:, -1:]
            self._sizes = np.maximum(self._sizes, np.linalg.norm(matrix, axis=1))
            matrix = matrix / np.where(self._sizes > 0.0, self._sizes, 1.0)[:, None]
        if not np.isfinite(matrix).all():
            return np.nan, np.ones(len(matrix))
        left, values, _ = np.linalg.svd(matrix, full_matrices=False)
        return float(values[-1] / (values[0] or 1.0)), np.abs(left[:, -1])
