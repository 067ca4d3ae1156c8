"""Equal steps: the stretches between instants that a run has to meet."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

SAME = 8.0  # units of the last bit of the time, by which instants that are meant to be the same may differ


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
    result = []
    for begin, end in itertools.pairwise(instants):
        count = step_count(end - begin, dt)
        result.append(EqualSteps(begin, (end - begin) / count, count, end))
    return result
