"""Stretches: the equal steps, at most dt long, between instants that have to be met."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..run_options import step_count

SAME = 4.0  # units of the last bit of the time, by which instants may miss an even spacing


class Stretch(NamedTuple):
    """From `begin` on, `rows` instants, each after `each` steps of h [s]."""

    begin: float
    h: float
    each: int
    rows: int

    def pieces(self, most_passes: int, most_rows: int) -> Iterator[tuple[int, int, bool]]:
        """(steps, steps for a row, whether the rows are instants) of pieces with at most so many steps and rows."""
        if self.each <= most_passes:
            most = max(1, min(most_passes // self.each, most_rows))
            for done in range(0, self.rows, most):
                yield min(most, self.rows - done) * self.each, self.each, True
            return
        for _ in range(self.rows):
            for done in range(0, self.each, most_passes):
                steps = min(most_passes, self.each - done)
                yield steps, steps, done + steps == self.each


def stretches(instants: Sequence[float], dt: float) -> list[Stretch]:
    """The steps from the first instant through all others; those evenly spaced, to rounding, make one stretch."""
    if len(instants) < 2:
        return []
    times = np.array(instants)
    gaps, ulps = np.diff(times), np.spacing(times[1:])
    breaks = np.flatnonzero(np.abs(np.diff(gaps)) > SAME * ulps[1:]) + 1
    found: list[Stretch] = []
    for first, last in itertools.pairwise([0, *breaks.tolist(), len(gaps)]):
        begin, rows = float(times[first]), last - first
        gap = (float(times[last]) - begin) / rows
        even = np.abs(times[first : last + 1] - (begin + gap * np.arange(rows + 1))).max() <= SAME * ulps[last - 1]
        parts = [(begin, gap, rows)] if even else [(times[k], gaps[k], 1) for k in range(first, last)]
        for start, length, count in parts:
            steps = step_count(length, dt)
            found.append(Stretch(float(start), float(length) / steps, steps, count))
    return found
