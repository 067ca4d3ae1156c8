"""Equal steps: the stretches between instants that a run has to meet; and the longer or shorter ones of runs beside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

SAME_INSTANT = 8.0  # units of the last bit of the time, by which instants that are meant to be the same may differ
EVEN = 4.0  # units of the last bit of the time, by which instants may miss an even spacing
ENOUGH_LONGER = 1.5  # times the longest of the steps that make up one twice as long


class EqualSteps(NamedTuple):
    """`steps` steps of h [s] from `begin` on, negative in a run back in time; the last one ends at `end` exactly.

    rows: of how many instants, evenly spaced, `end` is the last, at all of which a step ends.
    """

    begin: float
    h: float
    steps: int
    end: float
    rows: int = 1

    def blocks(self, most_passes: int, most_rows: int) -> Iterator[tuple[int, int, bool]]:
        """(steps, steps for a row, whether the rows are instants) of blocks with at most so many steps and rows."""
        every = self.steps // self.rows
        if every <= most_passes:
            most = max(1, min(most_passes // every, most_rows))
            for done in range(0, self.rows, most):
                yield min(most, self.rows - done) * every, every, True
            return
        full, last = divmod(every - 1, most_passes)
        for _ in range(self.rows):
            for _ in range(full):
                yield most_passes, most_passes, False
            yield last + 1, last + 1, True


def step_count(length: float, dt: float) -> int:
    """The fewest equal steps of at most dt in a length of time; a dt too short by rounding is long enough."""
    return max(1, math.ceil(abs(length) / dt * (1.0 - 1e-12)))


def equal_steps(instants: Sequence[float], dt: float) -> list[EqualSteps]:
    """Steps of at most dt from the first instant through all others."""
    result = []
    for begin, end in itertools.pairwise(instants):
        count = step_count(end - begin, dt)
        result.append(EqualSteps(begin, (end - begin) / count, count, end))
    return result


def even_steps(instants: Sequence[float], dt: float) -> list[EqualSteps]:
    """Equal steps as of `equal_steps`, with instants that are evenly spaced, to rounding, in one stretch."""
    times = np.array(instants)
    gaps, ulps = np.diff(times), np.spacing(np.maximum(np.abs(times[:-1]), np.abs(times[1:])))
    breaks = np.flatnonzero(np.abs(np.diff(gaps)) > EVEN * ulps[1:]) + 1
    result: list[EqualSteps] = []
    for first, last in itertools.pairwise([0, *breaks.tolist(), len(gaps)]):
        begin, rows = float(times[first]), last - first
        gap = (float(times[last]) - begin) / rows
        off = np.abs(times[first : last + 1] - (begin + gap * np.arange(rows + 1))).max()
        if off <= EVEN * ulps[first:last].max():
            count = step_count(gap, dt)
            result.append(EqualSteps(begin, gap / count, rows * count, float(times[last]), rows))
        else:
            result += equal_steps(times[first : last + 1].tolist(), dt)
    return result


def halved(stretches: Iterable[EqualSteps]) -> list[EqualSteps]:
    """Two steps in place of each."""
    return [part._replace(h=0.5 * part.h, steps=2 * part.steps) for part in stretches]


def doubled(stretches: Sequence[EqualSteps]) -> list[EqualSteps]:
    """Two steps as one; of shorter ones between close instants, as many as it takes."""
    return _merged(_doubled(stretches))


def _doubled(stretches: Sequence[EqualSteps]) -> Iterable[EqualSteps]:
    at = begin = stretches[0].begin
    longest = 0.0  # of the steps since `begin`, which are not one yet
    for part in stretches:
        done = 0
        while done < part.steps:
            pairs = (part.steps - done) // 2 if at == begin else 0
            done += 2 * pairs or 1
            at = part.end if done == part.steps else part.begin + done * part.h
            longest = max(longest, abs(part.h))
            if pairs:
                yield EqualSteps(begin, 2.0 * part.h, pairs, at)
            elif abs(at - begin) >= ENOUGH_LONGER * longest:
                yield EqualSteps(begin, at - begin, 1, at)
            else:
                continue
            begin, longest = at, 0.0
    if at != begin:
        yield EqualSteps(begin, at - begin, 1, at)


def _merged(stretches: Iterable[EqualSteps]) -> list[EqualSteps]:
    """Stretches of the same step, but for rounding of the times, as one."""
    result: list[EqualSteps] = []
    for part in stretches:
        if result and abs(part.h - result[-1].h) <= SAME_INSTANT * np.spacing(max(abs(part.begin), abs(part.end))):
            before = result.pop()
            steps = before.steps + part.steps
            part = EqualSteps(before.begin, (part.end - before.begin) / steps, steps, part.end)
        result.append(part)
    return result


def joined(t: float, stretches: Sequence[EqualSteps]) -> list[EqualSteps]:
    """Steps from t on, of which one, of half a step to one and a half, ends where one of these does."""
    begin, h = stretches[0][:2]
    if (begin - t) / h > 0.5:
        return [*equal_steps([t, begin], abs(h)), *stretches]
    if t == begin:
        return list(stretches)
    for number, part in enumerate(stretches):
        ahead = max(1, math.ceil((t - part.begin) / part.h + 0.5))
        if ahead > part.steps and number < len(stretches) - 1:
            continue
        left = part.steps - ahead
        at = part.end if left <= 0 else part.begin + ahead * part.h
        rest = [EqualSteps(at, part.h, left, part.end)] if left > 0 else []
        return [EqualSteps(t, at - t, 1, at), *rest, *stretches[number + 1 :]]
    return []
