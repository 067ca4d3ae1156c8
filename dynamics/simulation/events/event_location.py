"""Event location: the instants inside steps at which a quantity reaches zero, from the cells of the steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..estimates.state_sizes import Flags
from ..steps.dense_output import Indices
from .event_cells import Cells, WatchedSteps, event_cells

PARTS, AT_ONCE = 32, 8192  # into which a cell is divided again and again, and those of all cells together
WHILE = 2.0**-20  # of a step
BITS = 56.0  # of where in a cell
PROBES = 0.5 ** np.arange(50, 0, -5)  # of a cell: how far from a zero the sign beside it is asked for


class Crossing(NamedTuple):
    """Crossing of zero by a quantity."""

    row: int  # of the step
    s: float  # share of the step
    side: float  # the sign with which it comes; 0 of one that has none, and leaves zero
    touching: bool  # whether it turns back
    resting: bool = False  # whether it was at rest there, and leaves


@dataclass
class Side:
    """Side of zero on which a quantity is, between one part of a run and the next.

    sign: its last, 0 before it has one; of one at rest on zero, that of the side that it belongs to, if there is one.
    slope: at the end of the last step; NaN at a start.  left: of a run that starts on zero, the sign with which the
    quantity leaves, 0 as long as it rests there; NaN elsewhere.
    waiting: whether it is zero at the last instant, and what it does there is for the next step to tell.
    """

    sign: float = 0.0
    slope: float = math.nan
    left: float = math.nan
    waiting: bool = False

    @property
    def resting(self) -> bool:
        """Whether the quantity has been zero, to rounding, since the start of the run or the last reset."""
        return self.left == 0.0


def crossings(steps: WatchedSteps, side: Side) -> tuple[list[Crossing], Flags]:
    """Crossings in these steps, and flags of (steps,) in which more may have happened; moves `side` on.

    A quantity crosses zero where its sign turns, and touches it where an extremum is zero to the rounding of its
    evaluation. One that stays zero does so from where it arrives; one that rests there, and leaves to the other side
    than its own, crosses zero where it leaves.
    """
    cells, beyond = event_cells(steps)
    _join(cells, side)
    chain = _Chain(steps, cells, side)
    return [*chain.at_signs(side), *chain.at_extrema()], beyond


def _join(cells: Cells, side: Side) -> None:
    """Give the quantity, where steps meet, its slope at the end of the step before: a turn counts once."""
    first = np.flatnonzero(np.diff(cells.rows)) + 1
    cells.slope_a[first] = cells.slope_b[first - 1]
    if not math.isnan(side.slope):
        cells.slope_a[0] = side.slope
    side.slope = float(cells.slope_b[-1])


Table = Callable[[Indices, Array], Array]


class _Chain:
    """The quantity along the cells: looks 0 .. k at their ends, and the signs beside them."""

    def __init__(self, steps: WatchedSteps, cells: Cells, side: Side) -> None:
        self.steps, self.cells = steps, cells
        self.rows = np.concatenate([cells.rows[:1], cells.rows])  # of the looks
        self.shares = np.concatenate([cells.a[:1], cells.b])
        g = np.concatenate([cells.g_a[:1], cells.g_b])
        self.exact = g == 0.0
        signs = np.nan_to_num(np.sign(g))
        self.zero = self._zeros(g, np.concatenate([[side.sign], signs]), start=not math.isnan(side.left))
        looks = np.flatnonzero(self.zero)
        before, after = signs.copy(), signs.copy()
        before[looks], after[looks] = self._beside(looks, -1), self._beside(looks, 1)
        if side.left and not math.isnan(side.left):
            after[0], side.left = side.left, math.nan
        # [sign before look 0, start of cell 0, its end, start of cell 1, ..]: even entries stand before their look
        self.signs = np.empty(2 * len(cells.a) + 1)
        self.signs[0] = side.sign
        self.signs[1::2], self.signs[2::2] = after[:-1], before[1:]

    def _zeros(self, g: Array, signs: Array, *, start: bool) -> Flags:
        """Flags of the looks at zero: exactly, or, beside a change of sign or such a look, to rounding.

        signs: from the side before the first look on.  start: whether the first look is.
        """
        zero: Flags = g == 0.0
        zero[0] |= start
        tested, seeds = np.zeros(len(g), dtype=bool), np.flatnonzero(zero)
        beside = np.concatenate([np.flatnonzero(signs[:-1] * signs[1:] < 0.0), seeds, seeds + 1])
        while True:
            looks = np.unique(np.concatenate([beside - 1, beside]))
            looks = looks[(looks >= 0) & (looks < len(g))]
            looks = looks[~tested[looks]]
            if not len(looks):
                return zero
            tested[looks] = True
            rounding = self.steps.rounding(self.rows[looks], self.shares[looks])
            near = looks[np.abs(g[looks]) <= rounding]
            zero[near] = True
            beside = np.concatenate([near, near + 1])

    def _beside(self, looks: Indices, direction: int) -> Array:
        """The signs of the quantity just before or after looks at which it is zero; 0 where it stays zero."""
        cells = self.cells
        if not len(looks):
            return np.zeros(0)
        cell = np.clip(looks - (direction < 0), 0, len(cells.a) - 1)
        start, end = (cells.a, cells.b)[::direction]
        s = np.clip(start[cell, None] + (end - start)[cell, None] * PROBES, 0.0, 1.0)
        rows = np.repeat(cells.rows[cell], len(PROBES))
        g, rounding = (table(rows, s.ravel()).reshape(s.shape) for table in (self.steps.values, self.steps.rounding))
        sure = np.abs(g) > rounding
        nearest = np.take_along_axis(g, np.argmax(sure, axis=1)[:, None], axis=1)[:, 0]
        outside = looks == (0 if direction < 0 else len(cells.a))
        beside: Array = np.where(sure.any(axis=1) & ~outside, np.sign(nearest), 0.0)
        return beside

    def at_signs(self, side: Side) -> list[Crossing]:
        """Crossings where signs turn, and touches of a quantity that was zero at a look and goes back."""
        signs = self.signs
        known = np.flatnonzero(signs)
        if side.resting:
            return self._after_rest(side, known[known > 0])
        return self._turns(side, known) if len(known) else []

    def _after_rest(self, side: Side, known: Indices) -> list[Crossing]:
        """Crossing of a quantity at rest on zero that leaves to a side that is not its own."""
        if not len(known):
            return []
        side.left, last = math.nan, (int(known[0]) - 1) // 2  # look at which it is zero
        leaves = Crossing(int(self.rows[last]), float(self.shares[last]), side.sign, touching=False, resting=True)
        own = side.sign == self.signs[known[0]]
        return [*([] if own else [leaves]), *self._turns(side, known)]

    def _turns(self, side: Side, known: Indices) -> list[Crossing]:
        """Turns of sign from entries with signs alone."""
        signs = self.signs
        i, j, last = known[:-1], known[1:], int(known[-1])
        at_zero = (i % 2 == 0) & self.zero[i // 2]
        pairs = np.flatnonzero((signs[i] != signs[j]) | (j > i + 1) | at_zero)
        arrivals, touches = [], []
        for start, end in zip(i[pairs].tolist(), j[pairs].tolist(), strict=True):
            looks = slice((start + 1) // 2, (end + 1) // 2)  # between
            if signs[start] != signs[end] or self._stays(looks):
                arrivals.append(start)
            else:
                touches.append((start, end))
        side.sign = float(signs[last])
        if self._stays(slice((last + 1) // 2, None)):
            arrivals.append(last)
            side.sign = 0.0
        side.waiting = bool(self.zero[-1]) and side.sign != 0.0
        found = [self._touch(start, end) for start, end in touches]
        return found + self._arrivals(np.array(arrivals, dtype=np.intp))

    def _stays(self, looks: slice) -> bool:
        """Whether the quantity is exactly zero for a while, not only at looks that lie side by side at a touch."""
        zeros = np.flatnonzero(self.exact[looks]) + looks.start
        place = self.rows[zeros] + self.shares[zeros]
        return len(zeros) > 1 and bool(place[-1] - place[0] > WHILE)

    def _touch(self, start: int, end: int) -> Crossing:
        """Touch where the slope turns between two entries, or, where no turn is seen, at a look between them."""
        sign, first, last = float(self.signs[start]), start // 2, end // 2
        look = (first + last + start % 2) // 2
        row, s = self.rows[[look]], self.shares[[look]]
        if start % 2 and self.rows[first + 1] == self.rows[last]:
            low, high = self.cells.a[[first]], self.shares[[last]]

            def toward(s: Array) -> Flags:
                toward: Flags = self._along(self.steps.slopes, row, s) * sign < 0.0
                return toward

            if toward(low[:, None])[0, 0] and not toward(high[:, None])[0, 0]:
                s = _turn(toward, low, high)[0]
        return Crossing(int(row[0]), float(s[0]), sign, touching=True)

    def _arrivals(self, entries: Indices) -> list[Crossing]:
        """First instants at which the quantity has not the sign that it has at these entries."""
        signs, looks = self.signs[entries], entries // 2
        rows, s = self.rows[looks], self.shares[looks]
        inside = entries % 2 == 1
        cells, rows[inside] = self.cells.take(looks[inside]), self.cells.rows[looks[inside]]
        s[inside] = self._turn(cells.rows, cells.a, cells.b, signs[inside])
        places = zip(rows.tolist(), s.tolist(), signs.tolist(), strict=True)
        return [Crossing(row, share, sign, touching=False) for row, share, sign in places]

    def _turn(self, rows: Indices, low: Array, high: Array, signs: Array) -> Array:
        """The first shares, to the last bit, at which the quantity has not these signs, which it has at `low`."""
        return _turn(lambda s: self._along(self.steps.values, rows, s) * signs[:, None] > 0.0, low, high)[1]

    def _along(self, table: Table, rows: Indices, s: Array) -> Array:
        """The values, or slopes, at several shares s (k, parts) of rows (k,)."""
        along: Array = table(np.repeat(rows, s.shape[1]), s.ravel()).reshape(s.shape)
        return along

    def at_extrema(self) -> Iterator[Crossing]:
        """Crossings of a quantity that comes near zero and turns back within a cell: two, a touch, or none."""
        cells, sign = self.cells, self.signs[1::2]
        ends = (sign != 0.0) & (sign == self.signs[2::2]) & ~self.zero[:-1] & ~self.zero[1:]
        dips = ends & (cells.slope_a * sign < 0.0) & (cells.slope_b * sign >= 0.0) & ~cells.clear()
        if not dips.any():
            return
        few = cells.take(dips)
        rows, signs = few.rows, sign[dips]
        pair = _turn(lambda s: self._along(self.steps.slopes, rows, s) * signs[:, None] < 0.0, few.a, few.b)
        at, g = np.stack(pair), np.stack([self.steps.values(rows, s) for s in pair])
        nearest = np.argmin(g * signs, axis=0)[None]
        s, value = (np.take_along_axis(table, nearest, axis=0)[0] for table in (at, g))
        touching = np.abs(value) <= self.steps.rounding(rows, s)
        through = (value * signs < 0.0) & ~touching
        out, back = self._turn(rows, few.a, s, signs), self._turn(rows, s, few.b, -signs)
        for k in np.flatnonzero(touching | through).tolist():
            row, side = int(rows[k]), float(signs[k])
            if touching[k]:
                yield Crossing(row, float(s[k]), side, touching=True)
            else:
                yield Crossing(row, float(out[k]), side, touching=False)
                yield Crossing(row, float(back[k]), -side, touching=False)


def _turn(same: Callable[[Array], Flags], low: Array, high: Array) -> tuple[Array, Array]:
    """The shares (k,) between which `same`, true at `low` and false at `high`, first turns: one apart in the last bit.

    same: of shares (k, parts) whether it is true.
    """
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
