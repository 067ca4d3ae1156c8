"""Crossings: where a quantity is zero in a block of steps, by bounds on cells of the steps, in order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..steps.dense_output import Indices, StepBlock
from ..steps.state_sizes import Flags
from .event import WatchedEvent, numbers_of

CELLS = 8  # of a step before the first split, so that it is looked at sixteen times at least
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(CELLS + 1) / CELLS)  # not evenly spaced: no oscillation hides between them
MOST_CELLS = 1024  # cells of a step
COARSER = 8.0  # than a neighbor a cell may not be: it would agree by chance
SHORTEST = 2.0**-48  # of a step, a cell
DECAY = 16.0  # of what a cubic misses, from a cell to its halves
MARGIN = 12.0  # by which a cubic has to tell more than it misses
PARTS, AT_ONCE = 32, 8192  # into which a cell is divided again and again, and those of all cells together
WHILE = 2.0**-20  # of a step
SMALL = 2.0**-10  # of what a quantity is in a cell: an end that is less may be zero to rounding
BITS = 56.0  # of where in a cell


class Crossing(NamedTuple):
    """Crossing of zero by a quantity."""

    row: int  # of the step
    s: float  # share of the step
    side: float  # the sign with which it comes; 0 of one that has none, and leaves zero
    touching: bool  # whether it turns back
    resting: bool = False  # whether it was at rest there, and leaves


@dataclass
class Side:
    """Side of zero on which a quantity is, between one part of a run and the next."""

    sign: float = 0.0  # its last, 0 before it has one; at rest on zero that of the side that it belongs to, if any
    slope: float = math.nan  # at the end of the last step
    leaving: bool = False  # whether it starts on zero and moves to this side
    resting: bool = False  # whether it has been zero, to rounding, since the start or the last reset
    waiting: bool = False  # whether it is zero at the last instant: the next step tells what it does there


class WatchedSteps(NamedTuple):
    """Steps with dense output, and the quantity of an event at shares s, (k,) or (k, parts), of rows (k,)."""

    event: WatchedEvent
    parameters: Sequence[float]
    block: StepBlock
    noise: float = 0.0  # what the rounding of the quantity is at least

    def _points(self, rows: Indices, s: Array) -> tuple[Indices, Array, Array, Array]:
        rows, s = np.repeat(rows, s.size // max(1, len(rows))), s.ravel()
        return rows, s, self.block.times_at(rows, s), self.block.states_at(rows, s)

    def values(self, rows: Indices, s: Array) -> Array:
        """The quantity."""
        _, _, t, x = self._points(rows, s)
        return numbers_of(self.event.values, t, x, self.parameters).reshape(s.shape)

    def slopes(self, rows: Indices, s: Array) -> Array:
        """Its derivatives by the share of the step."""
        rows, shares, t, x = self._points(rows, s)
        x_dot, t_dot = self.block.slopes_at(rows, shares), self.block.h[rows]
        return numbers_of(self.event.slopes, t, x, self.parameters, x_dot, t_dot).reshape(s.shape)

    def rounding(self, rows: Indices, s: Array) -> Array:
        """Rounding errors of its values."""
        rows, _, t, x = self._points(rows, s)
        error = numbers_of(self.event.errors, t, x, self.parameters, *self.block.rounding(rows, t, x))
        return np.maximum(self.noise, error).reshape(s.shape)


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

    def replaced(self, split: Flags, *halves: Cells) -> Cells:
        """The cells with left and right parts in place of those of `split`, in order."""
        cells = Cells._make([np.concatenate(parts) for parts in zip(self.take(~split), *halves, strict=True)])
        return cells.take(np.lexsort((cells.a, cells.rows)))

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
        return np.stack([self.g_a, self.g_a + self.slope_a * third, self.g_b - self.slope_b * third, self.g_b])

    def clear(self) -> Flags:
        """Whether the quantity cannot be zero there, (k,)."""
        # It stays in the hull of the control points, and where it turns, as |x| may do at once, also on this side of
        # the point where the tangents at the ends meet.
        points, sign = self.control_points(), np.sign(self.g_a)
        hull = (points * sign > MARGIN * self.miss).all(axis=0)
        turns = (self.slope_a * sign < 0.0) & (self.slope_b * sign > 0.0)
        bend = np.where(turns, self.slope_b - self.slope_a, 1.0)
        meet = self.g_a + self.slope_a * (self.slope_b * (self.b - self.a) - (self.g_b - self.g_a)) / bend
        clear: Flags = hull & ~(turns & (meet * sign <= MARGIN * self.miss))
        return clear

    def resolved(self) -> Flags:
        """Whether the ends tell how often it is zero, (k,): not, everywhere, or nothing can be told of what is NaN."""
        points, margin = self.control_points(), MARGIN * self.miss
        zero, none = np.abs(points).max(axis=0) <= 2.0 * self.rounding, ~np.isfinite(points).all(axis=0)
        told: Flags = self.clear() | zero | none
        for order in (1, 2):  # or it is monotone, or its slope is, so that it has one extremum
            differences = np.diff(points, order, axis=0)
            told |= (differences > margin).all(axis=0) | (differences < -margin).all(axis=0)
        return told


def event_cells(steps: WatchedSteps) -> tuple[Cells, Flags]:
    """The cells of all steps in order, and for which steps, (steps,), `MOST_CELLS` were too few."""
    count = len(steps.block.t)
    rows, s = np.arange(count), np.tile(NODES, (count, 1))
    ends = [(each[:, :-1].ravel(), each[:, 1:].ravel()) for each in (s, steps.values(rows, s), steps.slopes(rows, s))]
    none = np.zeros(CELLS * count)
    cells = Cells._make([np.repeat(rows, CELLS), *[end for pair in ends for end in pair], none, none])
    cells = cells.replaced(none == 0.0, *_halves(steps, cells, bounded=False))
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
        cells = cells.replaced(split, *_halves(steps, cells.take(split), bounded=True))


def _halves(steps: WatchedSteps, cells: Cells, *, bounded: bool) -> tuple[Cells, Cells]:
    """Halves of cells; how far their cubics miss is told by value and slope in the middle. bounded: with rounding."""
    width = cells.b - cells.a
    middle = cells.a + 0.5 * width
    g, slope = steps.values(cells.rows, middle), steps.slopes(cells.rows, middle)
    g_off = g - 0.5 * (cells.g_a + cells.g_b) - 0.125 * width * (cells.slope_a - cells.slope_b)
    slope_off = width * (slope + 0.25 * (cells.slope_a + cells.slope_b)) - 1.5 * (cells.g_b - cells.g_a)
    off = np.maximum(np.abs(g_off), 0.25 * np.abs(slope_off))
    wide = 4.0 * cells.beside(np.maximum, cells.beside(np.maximum, off))  # one that is far off may agree by chance
    miss = np.maximum(wide, cells.miss) / DECAY
    rounding = steps.rounding(cells.rows, middle) if bounded else cells.rounding
    halves = cells._replace(miss=miss, rounding=rounding)
    return halves._replace(b=middle, g_b=g, slope_b=slope), halves._replace(a=middle, g_a=g, slope_a=slope)


def crossings(steps: WatchedSteps, side: Side) -> tuple[list[Crossing], Flags]:
    """Crossings in these steps, and flags of (steps,) in which more may have happened; moves `side` on.

    Touching is an extremum that is zero to rounding. What stays zero arrives once; what rests and leaves to the other
    side than its own crosses zero where it leaves.
    """
    cells, beyond = event_cells(steps)
    # where steps meet, the slope is that at the end of the step before: a turn counts once
    first = np.flatnonzero(np.diff(cells.rows)) + 1
    cells.slope_a[first] = cells.slope_b[first - 1]
    if not math.isnan(side.slope):
        cells.slope_a[0] = side.slope
    side.slope = float(cells.slope_b[-1])
    cells, extrema = _at_extrema(steps, cells)
    rows, s = np.concatenate([cells.rows[:1], cells.rows]), np.concatenate([cells.a[:1], cells.b])  # of looks
    g = np.concatenate([cells.g_a[:1], cells.g_b])
    # the sign before the first look, and those at looks; 0 of a quantity at zero
    signs = np.nan_to_num(np.sign(np.append(side.sign, g)))
    zero = g == 0.0
    zero[0] |= side.leaving or side.resting
    beside = np.concatenate([np.flatnonzero(signs[:-1] * signs[1:] < 0.0), extrema])
    _add_rounded_zeros(zero, beside, lambda looks: np.abs(g[looks]) <= steps.rounding(rows[looks], s[looks]))
    signs[1:][zero] = 0.0
    if side.leaving:
        signs[1], side.leaving = side.sign, False
    found, arrivals = list[Crossing](), list[int]()

    def stays(begin: int, end: int) -> bool:
        """Whether the quantity is exactly zero for a while, not only at looks that lie side by side at a touch."""
        zeros = begin + np.flatnonzero(g[begin:end] == 0.0)
        place = rows[zeros] + s[zeros]
        return len(zeros) > 1 and bool(place[-1] - place[0] > WHILE)

    known = np.flatnonzero(signs)
    known = known[known > 0] if side.resting else known
    if not len(known):
        return [], beyond
    if side.resting:
        side.resting, look = False, max(int(known[0]) - 2, 0)
        if side.sign != signs[known[0]]:
            found.append(Crossing(int(rows[look]), float(s[look]), side.sign, touching=False, resting=True))
    here, there, last = known[:-1], known[1:], int(known[-1])
    turns = np.flatnonzero((signs[here] != signs[there]) | (there > here + 1))
    for i, j in zip(here[turns].tolist(), there[turns].tolist(), strict=True):
        if signs[i] != signs[j] or stays(i, j - 1):
            arrivals.append(i)
        else:
            between = [look for look in extrema.tolist() if i <= look < j - 1]
            look = between[0] if between else (i + j - 2) // 2
            found.append(Crossing(int(rows[look]), float(s[look]), float(signs[i]), touching=True))
    side.sign = float(signs[last])
    if stays(last, len(g)):
        arrivals.append(last)
        side.sign = 0.0
    side.waiting = bool(zero[-1]) and side.sign != 0.0
    # an arrival is at the next look, if that is zero or the first, or within the cell before it
    looks = np.array(arrivals, dtype=np.intp)
    inside = (looks > 0) & ~zero[np.minimum(looks, len(g) - 1)]
    places, few, sign = s[looks], cells.take(looks[inside] - 1), signs[looks]
    places[inside] = _turn(lambda s: steps.values(few.rows, s) * sign[inside, None] > 0.0, few.a, few.b)[1]
    at = zip(rows[looks].tolist(), places.tolist(), sign.tolist(), strict=True)
    return [*found, *[Crossing(row, share, side, touching=False) for row, share, side in at]], beyond


def _at_extrema(steps: WatchedSteps, cells: Cells) -> tuple[Cells, Indices]:
    """The cells, parted at extrema where a quantity may come to zero and turn back; and the looks there."""
    turns = (cells.slope_a != 0.0) & (cells.slope_a * cells.slope_b <= 0.0)
    few = cells.take(turns)
    ends, points = np.stack([few.g_a, few.g_b]), few.control_points()
    toward = (ends * np.sign(few.slope_a) < 0.0).all(axis=0)
    at_zero = np.abs(ends).min(axis=0) <= SMALL * np.abs(points).max(axis=0)
    turns[turns] = (toward | at_zero) & ~few.clear()
    few = cells.take(turns)
    if not len(few.a):
        return cells, np.zeros(0, dtype=np.intp)
    sign = -np.sign(few.slope_a)
    pair = _turn(lambda s: steps.slopes(few.rows, s) * sign[:, None] < 0.0, few.a, few.b)
    at, g = np.stack(pair), np.stack([steps.values(few.rows, s) for s in pair])
    nearest = np.argmin(g * sign, axis=0)[None]
    s, value = (np.take_along_axis(table, nearest, axis=0)[0] for table in (at, g))
    parted = cells.replaced(turns, few._replace(b=s, g_b=value), few._replace(a=s, g_a=value))
    return parted, np.flatnonzero(turns) + np.arange(1, len(s) + 1)


def _add_rounded_zeros(zero: Flags, beside: Indices, rounded: Callable[[Indices], Flags]) -> None:
    """Flag looks that are zero to rounding near another at zero or `beside`: at an extremum, or after a sign turns."""
    tested, near = np.zeros(len(zero), dtype=bool), np.flatnonzero(zero)
    while True:
        looks = np.unique(np.concatenate([near - 1, near, near + 1, beside - 1, beside]))
        looks = looks[(looks >= 0) & (looks < len(zero))]
        looks, beside = looks[~tested[looks]], beside[:0]
        if not len(looks):
            return
        tested[looks] = True
        near = looks[rounded(looks)]
        zero[near] = True


def _turn(same: Callable[[Array], Flags], low: Array, high: Array) -> tuple[Array, Array]:
    """Shares (k,), one apart in the last bit, between which `same`, true at `low` and false at `high`, first turns."""
    if not len(low):
        return low, high
    parts = max(2, min(PARTS, AT_ONCE // len(low)))
    for _ in range(math.ceil(BITS / math.log2(parts))):
        s = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, parts + 1)
        s[:, -1] = high
        turned = ~same(s[:, 1:-1])
        first = np.where(turned.any(axis=1), np.argmax(turned, axis=1) + 1, parts)[:, None]
        low, high = (np.take_along_axis(s, at, axis=1)[:, 0] for at in (first - 1, first))
    return low, high
