"""Runs beside another of equal steps: their steps, and by how much their states differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..steps.dense_output import Indices
from ..steps.equal_steps import SAME_INSTANT, EqualSteps, doubled, halved, joined
from .state_sizes import Flags

APART_RATIO = 1.5  # the ratio of errors from which a difference of two runs tells them
LATE, SHARE = 2.0, 0.1  # steps, or of the time since the last reset: a run so much later resets takes another course


class Law(NamedTuple):
    """Ratios of differences where the error is a power of the step.

    ratio: of the second difference to the first.  share: of the first one, that is error.
    """

    ratio: float
    share: float


class Course:
    """The steps of a run beside, in each segment: those of the first run, made others."""

    def __init__(self, doublings: int) -> None:
        """doublings: of the length of steps, -1 for half of it."""
        self._doublings = doublings
        self.every = 1 if doublings == 2 else 2  # of how many steps the end is one of those compared
        self.stretches: list[EqualSteps] = []
        self.longest, self.late = 0.0, 0.0  # s; that its resets may differ from those of the first run [s]

    def follow(self, stretches: Sequence[EqualSteps], lasted: float = 0.0) -> None:
        """The first run is in a segment of these steps, after one that lasted so long [s]."""
        made = halved(stretches) if self._doublings < 0 else list(stretches)
        for _ in range(self._doublings):
            made = doubled(made)
        self.stretches, self.longest = made, max(abs(part.h) for part in made)
        self.late = max(LATE * self.longest, SHARE * lasted)

    def meets(self, t: Array) -> Flags:
        """Flags of the instants t (r,) that are ends of its steps, but for rounding."""
        begins, h = (np.array(column) for column in zip(*[part[:2] for part in self.stretches], strict=True))
        sign = math.copysign(1.0, h[0])
        part = np.maximum(np.searchsorted(sign * begins, sign * t) - 1, 0)
        ends = begins[part] + np.rint((t - begins[part]) / h[part]) * h[part]
        same: Flags = np.abs(ends - t) <= SAME_INSTANT * np.spacing(np.abs(t))
        return same

    def steps(self, t: float) -> list[EqualSteps]:
        """Steps from t on."""
        return joined(t, self.stretches)


def courses(stretches: Sequence[EqualSteps], order: int, *, shorter: bool = False) -> tuple[list[Course], Law]:
    """Courses of two runs of longer steps; where there are too few of them, of one of steps half as long.

    shorter: of half, for every stretch has to end where it does.
    """
    if not shorter:
        longest = max(abs(part.h) for part in stretches)
        longer = doubled(stretches)
        sums = [
            sum(part.steps * (abs(part.h) / longest) ** (order + 1) for part in each)
            for each in (stretches, longer, doubled(longer))
        ]
        one, two, four = sums
        if two >= APART_RATIO * one and four - two >= APART_RATIO * (two - one):
            return [Course(1), Course(2)], Law((four - two) / (two - one), one / (two - one))
    return [Course(-1)], Law(1.0, 1.0 / (1.0 - 0.5**order))


class States(NamedTuple):
    """States of k runs side by side: instants (r,) and states (k, r, m), after so many resets."""

    t: Array
    x: Array
    resets: int = 0


def matches(times: Array, others: Array) -> tuple[Indices, Indices]:
    """Indices of the instants that two courses of time share but for rounding; both go the same way."""
    direction = 1.0 if len(times) < 2 or times[-1] > times[0] else -1.0
    near = np.searchsorted(direction * times, direction * others)
    near = np.clip(near, 0, len(times) - 1)
    before = np.maximum(near - 1, 0)
    near = np.where(np.abs(times[before] - others) < np.abs(times[near] - others), before, near)
    same = np.flatnonzero(np.abs(times[near] - others) <= SAME_INSTANT * np.spacing(np.abs(others)))
    return near[same], same


def even(rows: Indices) -> slice | Indices:
    """Index of rows as a slice, which copies nothing, where they are evenly spaced."""
    if not len(rows):
        return slice(0)
    apart = int(rows[1] - rows[0]) if len(rows) > 1 else 1
    even = bool((np.diff(rows) == apart).all())
    return slice(int(rows[0]), int(rows[-1]) + 1, apart) if even and apart else rows


class Difference:
    """Difference of two streams of states at common instants, (k, m): the largest so far, and the last.

    lost: the time since which it is infinite, for one of the runs is not finite or takes another course, (k,); NaN
    before.
    """

    def __init__(self, k: int, m: int, direction: float) -> None:
        self.largest, self.last, self._before = np.zeros((3, k, m))
        self.lost = np.full(k, math.nan)
        self.compared = 0  # instants
        self._direction = direction
        self._streams: tuple[list[States], list[States]] = [], []

    def add(self, which: int, states: States) -> None:
        """Add states of one of the streams."""
        self._streams[which].append(states)

    def restart(self) -> None:
        """The streams begin anew, at states that do not differ: what comes is added to the last difference."""
        self._before = self.last
        for stream in self._streams:
            stream.clear()

    def lose(self, t: float, runs: Flags | bool = True) -> None:
        """Mark these runs as unknown from t on."""
        new = np.isnan(self.lost) & runs
        self.lost[new] = t
        self.largest[new] = self.last[new] = math.inf

    def compare(self, resets: int) -> None:
        """The states that both have of the segment after so many resets."""
        first, other = (together(stream, resets) for stream in self._streams)
        if first is None or other is None:
            return
        here, there = matches(first.t, other.t)
        if len(here):
            self.compared += len(here)
            change = other.x[:, even(there)] - first.x[:, even(here)]
            np.abs(change, out=change)
            most = change.max(axis=1)
            if len(bad := np.flatnonzero(~np.isfinite(most).all(axis=1))):
                finite = np.isfinite(change[bad]).all(axis=(0, 2))
                self.lose(float(first.t[here[np.argmin(finite)]]), np.isin(np.arange(len(most)), bad))
            known = np.isnan(self.lost)
            self.last[known] = self._before[known] + change[known, -1]
            self.largest[known] = np.maximum(self.largest, self._before + most)[known]
        end = min(self._direction * first.t[-1], self._direction * other.t[-1])
        for stream, states in zip(self._streams, (first, other), strict=True):
            left = self._direction * states.t > end
            stream[:1] = [States(states.t[left], states.x[:, left], resets)] if left.any() else []


def together(stream: list[States], resets: int) -> States | None:
    """The states of a segment as one, which alone stay in the stream with later ones; None if there are none."""
    here = [states for states in stream if states.resets == resets]
    stream[:] = [states for states in stream if states.resets > resets]
    if not here:
        return None
    whole = here[0]
    if len(here) > 1:
        t, x = np.concatenate([each.t for each in here]), np.concatenate([each.x for each in here], axis=1)
        whole = States(t, x, resets)
    stream.insert(0, whole)
    return whole
