"""StepGrid: equal steps, at most dt long, between instants that have to be met."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..run_options import RunOptions
from ..steps.equal_steps import step_count

SAME = 4.0  # units of the last bit of the time, by which instants may miss an even spacing


class StepGrid(NamedTuple):
    """From `begin` on, `rows` evenly spaced instants, each after `steps` steps of h [s], negative back in time."""

    begin: float
    h: float
    steps: int
    rows: int

    def blocks(self, most_passes: int, most_rows: int) -> Iterator[tuple[int, int, bool]]:
        """(steps, steps for a row, whether the rows are instants) of blocks with at most so many steps and rows."""
        if self.steps <= most_passes:
            most = max(1, min(most_passes // self.steps, most_rows))
            for done in range(0, self.rows, most):
                yield min(most, self.rows - done) * self.steps, self.steps, True
            return
        full, last = divmod(self.steps - 1, most_passes)
        for _ in range(self.rows):
            for _ in range(full):
                yield most_passes, most_passes, False
            yield last + 1, last + 1, True


def step_grids(options: RunOptions) -> list[StepGrid]:
    """The equal steps of a run: one grid where every step is a row, else those between its instants."""
    if options.times is not None:
        return grids_between(options.instants, options.step)
    length = options.t_end - options.t0
    steps = step_count(length, options.step)
    return [StepGrid(options.t0, length / steps, 1, steps)]


def grids_between(instants: Sequence[float], dt: float) -> list[StepGrid]:
    """The steps from the first instant through all others; those evenly spaced, to rounding, make one grid."""
    if len(instants) < 2:
        return []
    times = np.array(instants)
    gaps, ulps = np.diff(times), np.spacing(np.maximum(np.abs(times[:-1]), np.abs(times[1:])))
    breaks = np.flatnonzero(np.abs(np.diff(gaps)) > SAME * ulps[1:]) + 1
    grids: list[StepGrid] = []
    for first, last in itertools.pairwise([0, *breaks.tolist(), len(gaps)]):
        begin, rows = float(times[first]), last - first
        gap = (float(times[last]) - begin) / rows
        off = np.abs(times[first : last + 1] - (begin + gap * np.arange(rows + 1))).max()
        even = off <= SAME * ulps[first:last].max()
        parts = [(begin, gap, rows)] if even else [(times[k], gaps[k], 1) for k in range(first, last)]
        for start, length, count in parts:
            steps = step_count(length, dt)
            grids.append(StepGrid(float(start), float(length) / steps, steps, count))
    return grids
