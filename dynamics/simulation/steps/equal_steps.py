"""Equal steps: the stretches between instants that a run has to meet; and the longer or shorter ones of runs beside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cgraph._shared import Array

Numbers = np.ndarray[Any, np.dtype[np.int64]]

SAME_INSTANT = 8.0  # units of the last bit of the time, by which instants that are meant to be the same may differ
EVEN = 4.0  # units of the last bit of the time, by which instants may miss an even spacing
FOUR = 4  # steps of a run, at whose ends runs of steps twice and four times as long end a step, too
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # its multiples spread evenly, and in step with no oscillation


class EqualSteps(NamedTuple):
    """`steps` steps of h [s] from `begin` on, negative in a run back in time; the last one ends at `end` exactly."""

    begin: float
    h: float
    steps: int
    end: float


def step_count(length: float, dt: float) -> int:
    """The fewest equal steps of at most dt in a length of time; a dt too short by rounding is long enough."""
    return max(1, math.ceil(abs(length) / dt * (1.0 - 1e-12)))


def equal_steps(instants: Sequence[float], dt: float) -> list[EqualSteps]:
    """Steps of at most dt from the first instant through all others."""
    counts = [step_count(end - begin, dt) for begin, end in itertools.pairwise(instants)]
    return [_divided(*ends, count) for ends, count in zip(itertools.pairwise(instants), counts, strict=True)]


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
            result.append(EqualSteps(begin, gap / count, rows * count, float(times[last])))
        else:
            result += equal_steps(times[first : last + 1].tolist(), dt)
    return result


def _divided(begin: float, end: float, count: int) -> EqualSteps:
    """So many steps from begin to end."""
    return EqualSteps(begin, (end - begin) / count, count, end)


def halved(stretches: Iterable[EqualSteps]) -> list[EqualSteps]:
    """Two steps in place of each."""
    return [part._replace(h=0.5 * part.h, steps=2 * part.steps) for part in stretches]


def longer(stretches: Iterable[EqualSteps], times: int) -> list[EqualSteps]:
    """Steps so many times as long in stretches `by_fours`, or as nearly as the stretches allow."""
    return [
        _divided(part.begin, part.end, max(1, round((part.end - part.begin) / (times * part.h)))) for part in stretches
    ]


def by_fours(stretches: Sequence[EqualSteps]) -> list[EqualSteps]:
    """The same way in stretches of a multiple of four steps each, and where there are none of steps of four lengths.

    These, which join stretches, are at least as long as four of the longest steps, but for the last.
    """
    longest, at, result = max([part.h for part in stretches], key=abs), stretches[0].begin, list[EqualSteps]()
    for part in stretches:
        left = FOUR * longest - (part.begin - at) if at != part.begin else 0.0  # of the way of a joint
        ahead = math.ceil(left / part.h - 1e-9)
        if ahead > part.steps:
            continue
        if at != part.begin:
            result.append(EqualSteps(at, longest, FOUR, _instant(part, ahead)))
        fours = (part.steps - ahead) // FOUR * FOUR
        if fours:
            result.append(EqualSteps(_instant(part, ahead), part.h, fours, _instant(part, ahead + fours)))
        at = _instant(part, ahead + fours)
    end = stretches[-1].end
    return result if at == end else [*result, EqualSteps(at, longest, FOUR, end)]


def _instant(part: EqualSteps, steps: int) -> float:
    """Where so many steps end."""
    return part.end if steps == part.steps else part.begin + steps * part.h


def instants_of(stretches: Sequence[EqualSteps], every: int, most: int) -> Array:
    """Instants at which each `every`th step of the stretches ends: of more than so many some, unevenly, and the last."""
    begin, h, end = (np.array([part[k] for part in stretches]) for k in (0, 1, 3))
    counts = np.array([part.steps // every for part in stretches])
    before = np.cumsum(counts) - counts
    total = int(counts.sum())
    k = np.arange(min(total, most))
    chosen = (
        k if total <= most else np.append(((k[:-1] + k[:-1] * GOLDEN % 1.0) * (total / most)).astype(int), total - 1)
    )
    part = np.searchsorted(before, chosen, side="right") - 1
    steps = chosen - before[part] + 1
    instants: Array = np.where(steps == counts[part], end[part], begin[part] + every * steps * h[part])
    return instants


def numbers_of(stretches: Sequence[EqualSteps], instants: Array) -> Numbers:
    """How many of the steps of the stretches are done at instants at which steps end, (T,)."""
    begin, h, steps = (np.array([part[k] for part in stretches]) for k in range(3))
    part = np.maximum(np.searchsorted(np.sign(h[0]) * begin, np.sign(h[0]) * instants) - 1, 0)
    inside = np.rint((instants - begin[part]) / h[part]).astype(np.int64)
    numbers: Numbers = (np.cumsum(steps) - steps)[part] + inside
    return numbers
