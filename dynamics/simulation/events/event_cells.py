"""Event cells: parts of steps, split until the cubics through their ends show how often a quantity is zero there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..estimates.state_sizes import Flags
from ..steps.dense_output import Indices, StepBlock
from .event import WatchedEvent

CELLS = 8  # of a step before the first split, so that it is looked at sixteen times at least
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(CELLS + 1) / CELLS)  # not evenly spaced: no oscillation hides between them
MOST_CELLS = 1024  # cells of a step
COARSER = 8.0  # than a neighbor a cell may not be: it would agree by chance
SHORTEST = 2.0**-48  # of a step, a cell
DECAY = 16.0  # of what a cubic misses, from a cell to its halves
MARGIN = 12.0  # by which a cubic has to tell more than it misses


class WatchedSteps(NamedTuple):
    """Consecutive steps with dense output, and the quantity of an event along them: at rows (k,) and shares s (k,).

    noise: what the rounding of the quantity is at least.
    """

    event: WatchedEvent
    parameters: Sequence[float]
    block: StepBlock
    noise: float = 0.0

    def values(self, rows: Indices, s: Array) -> Array:
        """(k,)."""
        return self.event.value(self.block.times_at(rows, s), self.block.states_at(rows, s), self.parameters)

    def slopes(self, rows: Indices, s: Array) -> Array:
        """The derivatives by the share of the step, (k,)."""
        block = self.block
        t, x = block.times_at(rows, s), block.states_at(rows, s)
        return self.event.slope(t, x, self.parameters, block.slopes_at(rows, s), block.h[rows])

    def rounding(self, rows: Indices, s: Array) -> Array:
        """Rounding errors of values, (k,)."""
        t, x = self.block.times_at(rows, s), self.block.states_at(rows, s)
        return np.maximum(self.noise, self.event.error(t, x, self.parameters, *self.block.rounding(rows, t, x)))


class Cells(NamedTuple):
    """Parts of steps, from share a to share b, with values and slopes of a quantity at both, (k,) each."""

    rows: Indices
    a: Array
    b: Array
    g_a: Array
    g_b: Array
    slope_a: Array
    slope_b: Array
    miss: Array  # an estimate of how far the cubic through both ends is off
    rounding: Array

    def take(self, which: Flags | Indices) -> Cells:
        """Subset of the cells."""
        return Cells._make([array[which] for array in self])

    def beside(self, extreme: Callable[[Array, Array], Array], values: Array) -> Array:
        """Smallest or largest of a cell's value and its neighbors'."""
        result = values.copy()
        left = np.flatnonzero((self.rows[:-1] == self.rows[1:]) & (self.b[:-1] == self.a[1:]))
        result[left] = extreme(result[left], values[left + 1])
        result[left + 1] = extreme(result[left + 1], values[left])
        return result

    def control_points(self) -> Array:
        """Control points, (4, k), of the cubics through values and slopes at the ends, which their hull contains."""
        third = (self.b - self.a) / 3.0
        inner = self.g_a + self.slope_a * third, self.g_b - self.slope_b * third
        return np.stack([self.g_a, *inner, self.g_b])

    def clear(self) -> Flags:
        """Whether the quantity cannot be zero there, (k,).

        It stays in the hull of the control points, and where it turns between the ends, as |x| may do at once, also on
        this side of the point where the tangents at the ends meet.
        """
        points, sign = self.control_points(), np.sign(self.g_a)
        hull = (points * sign > MARGIN * self.miss).all(axis=0)
        turns = (self.slope_a * sign < 0.0) & (self.slope_b * sign > 0.0)
        bend = np.where(turns, self.slope_b - self.slope_a, 1.0)
        meet = self.g_a + self.slope_a * (self.slope_b * (self.b - self.a) - (self.g_b - self.g_a)) / bend
        clear: Flags = hull & ~(turns & (meet * sign <= MARGIN * self.miss))
        return clear

    def resolved(self) -> Flags:
        """Whether the ends tell how often it is zero, (k,).

        It is not; or it is monotone; or its slope is, so that it has one extremum; or it is zero all over; or it is no
        number, and nothing can be told.
        """
        points, margin = self.control_points(), MARGIN * self.miss
        first = np.diff(points, axis=0)
        second = np.diff(first, axis=0)
        monotone = (first > margin).all(axis=0) | (first < -margin).all(axis=0)
        bent = (second > margin).all(axis=0) | (second < -margin).all(axis=0)
        zero = np.abs(points).max(axis=0) <= 2.0 * self.rounding
        resolved: Flags = self.clear() | monotone | bent | zero | ~np.isfinite(points).all(axis=0)
        return resolved


def event_cells(steps: WatchedSteps) -> tuple[Cells, Flags]:
    """The cells of all steps in order, and for which steps, (steps,), `MOST_CELLS` were too few."""
    count = len(steps.block.t)
    cells = _split(steps, _whole(steps), bounded=False)
    worst = cells.miss.reshape(count, 2 * CELLS).max(axis=1)
    cells = cells._replace(miss=np.maximum(cells.miss, worst[cells.rows] / DECAY))
    beyond = np.zeros(count, dtype=bool)
    while True:
        width = cells.b - cells.a
        unresolved = ~cells.resolved() & (width > SHORTEST)
        split = unresolved | (cells.beside(np.minimum, width) * COARSER < width)
        size = np.bincount(cells.rows, minlength=count) + np.bincount(cells.rows[split], minlength=count)
        late = (size > MOST_CELLS)[cells.rows]
        beyond[cells.rows[unresolved & late]] = True
        split &= ~late
        if not split.any():
            return cells, beyond
        parts = cells.take(~split), _split(steps, cells.take(split), bounded=True)
        cells = Cells._make([np.concatenate(pair) for pair in zip(*parts, strict=True)])
        cells = cells.take(np.lexsort((cells.a, cells.rows)))


def _whole(steps: WatchedSteps) -> Cells:
    """The cells before the first split."""
    count = len(steps.block.t)
    rows, s = np.repeat(np.arange(count), CELLS + 1), np.tile(NODES, count)
    tables = (steps.values(rows, s).reshape(count, -1), steps.slopes(rows, s).reshape(count, -1))
    g_a, g_b, slope_a, slope_b = (table[:, part].ravel() for table in tables for part in (slice(-1), slice(1, None)))
    a, b = np.tile(NODES[:-1], count), np.tile(NODES[1:], count)
    none = np.zeros_like(g_a)
    return Cells(np.repeat(np.arange(count), CELLS), a, b, g_a, g_b, slope_a, slope_b, none, none)


def _split(steps: WatchedSteps, cells: Cells, *, bounded: bool) -> Cells:
    """Halves of cells. The cubic of a cell, compared with value and slope in its middle, tells how far theirs are off.

    bounded: whether the rounding is asked for; that of whole steps seldom matters.
    """
    width = cells.b - cells.a
    middle = cells.a + 0.5 * width
    g, slope = steps.values(cells.rows, middle), steps.slopes(cells.rows, middle)
    g_off = g - 0.5 * (cells.g_a + cells.g_b) - 0.125 * width * (cells.slope_a - cells.slope_b)
    slope_off = width * (slope + 0.25 * (cells.slope_a + cells.slope_b)) - 1.5 * (cells.g_b - cells.g_a)
    off = np.maximum(np.abs(g_off), 0.25 * np.abs(slope_off))
    wide = 4.0 * cells.beside(np.maximum, cells.beside(np.maximum, off))  # one that is far off may agree by chance
    miss = np.maximum(wide, cells.miss) / DECAY
    rounding = steps.rounding(cells.rows, middle) if bounded else cells.rounding
    left = cells._replace(b=middle, g_b=g, slope_b=slope, miss=miss, rounding=rounding)
    right = cells._replace(a=middle, g_a=g, slope_a=slope, miss=miss, rounding=rounding)
    return Cells._make([np.stack(pair, axis=1).ravel() for pair in zip(left, right, strict=True)])
