"""Equal steps: the stretches between instants that a run has to meet; and the longer or shorter ones of runs beside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cgraph._shared import Array

Numbers = np.ndarray[Any, np.dtype[np.int64]]

SAME_INSTANT = 8.0  # units of the last bit of the time, by which instants that are meant to be the same may differ
EVEN = 4.0  # units of the last bit of the time, by which instants may miss an even spacing
ALIKE = 1e-9  # of a step, by which steps of runs beside may differ that are meant to be the same
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
    return [_divided(begin, end, step_count(end - begin, dt)) for begin, end in itertools.pairwise(instants)]


def steps_after(stretches: Sequence[EqualSteps], t: float) -> list[EqualSteps]:
    """What is left of steps after an instant, from which the first goes on to where the step around it ends."""
    left, near = list[EqualSteps](), SAME_INSTANT * math.ulp(t)
    for part in stretches:
        forth = math.copysign(1.0, part.h)
        done = math.floor((t - part.begin) / part.h + ALIKE) if forth * (t - part.begin) > 0.0 else 0
        after = part.end if done + 1 >= part.steps else part.begin + (done + 1) * part.h
        if forth * (part.end - t) <= near or t == part.begin or forth * (t - part.begin) < 0.0:
            left += [part] if forth * (part.end - t) > near else []
            continue
        if forth * (after - t) > near:
            left.append(EqualSteps(t, after - t, 1, after))
        if done + 1 < part.steps:
            left.append(EqualSteps(after, part.h, part.steps - done - 1, part.end))
    return left


def _divided(begin: float, end: float, count: int) -> EqualSteps:
    return EqualSteps(begin, (end - begin) / count, count, end)


def even_steps(instants: Sequence[float], dt: float) -> tuple[list[EqualSteps], Numbers]:
    """Equal steps with instants that are evenly spaced, to rounding, in one stretch; and how many are done at them."""
    times = np.array(instants)
    gaps, ulps = np.diff(times), np.spacing(np.maximum(np.abs(times[:-1]), np.abs(times[1:])))
    breaks = np.flatnonzero(np.abs(np.diff(gaps)) > EVEN * ulps[1:]) + 1
    result, counts = list[EqualSteps](), [0]
    for first, last in itertools.pairwise([0, *breaks.tolist(), len(gaps)]):
        begin, rows = float(times[first]), last - first
        gap = (float(times[last]) - begin) / rows
        off = np.abs(times[first : last + 1] - (begin + gap * np.arange(rows + 1))).max()
        if off <= EVEN * ulps[first:last].max():
            count = step_count(gap, dt)
            result.append(EqualSteps(begin, gap / count, rows * count, float(times[last])))
            counts += [count] * rows
        else:
            uneven = equal_steps(times[first : last + 1].tolist(), dt)
            result += uneven
            counts += [part.steps for part in uneven]
    return result, np.cumsum(counts)


def sampled_numbers(steps: int, every: int, most: int) -> Numbers:
    """0, steps, and multiples of `every` inside, `most` of them: half uneven over the run, half denser at its start."""
    count = steps // every
    chosen = np.arange(1.0, min(count, most) + 1.0)
    if count > most:
        k = chosen[: most // 2]
        chosen = np.append((k - 1.0 + k * GOLDEN % 1.0) * (count / len(k)), np.geomspace(1.0, count, len(k)))
    return np.unique(np.concatenate([[0], every * chosen.astype(np.int64), [steps]]))


def instants_of(stretches: Sequence[EqualSteps], numbers: Numbers) -> Array:
    """When so many steps are done."""
    begin, h, steps, end = (np.array(column) for column in zip(*stretches, strict=True))
    ends = np.cumsum(steps)
    part = np.searchsorted(ends, numbers)
    inside = numbers - (ends - steps)[part]
    return np.where(inside == steps[part], end[part], begin[part] + inside * h[part])


def longer_steps(t: Array, numbers: Numbers, times: int) -> tuple[list[EqualSteps], Numbers]:
    """Steps some times as long as those of which so many are done at t; and how many of them are done there."""
    counts = np.maximum(1, np.rint(np.diff(numbers) / times)).astype(np.int64)
    h, done = np.diff(t) / counts, np.append(0, np.cumsum(counts))
    new = np.flatnonzero(~(np.abs(np.diff(h, prepend=math.inf)) <= ALIKE * np.abs(h))).tolist()
    ends = itertools.pairwise([*new, len(h)])
    return [_divided(float(t[a]), float(t[b]), int(done[b] - done[a])) for a, b in ends], done
