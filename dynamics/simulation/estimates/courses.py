"""Courses: the steps of runs beside another of equal steps, and what their differences tell by the order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from ..steps.equal_steps import SAME, EqualSteps, doubled, halved, joined
from .state_sizes import Flags

APART = 1.5  # the ratio of errors from which a difference of two runs tells them
LATE, SHARE = 2.0, 0.1  # steps, or of the time since the last reset: a run so much later resets takes another course


class Law(NamedTuple):
    """What follows from differences where the error is a power of the step.

    ratio: of the second difference to the first.  share: of the first one, that is error.
    """

    ratio: float
    share: float


class Course:
    """The steps of a run beside, in each leg: those of the first run, made others."""

    def __init__(self, doublings: int) -> None:
        """doublings: of the length of steps, -1 for half of it."""
        self._doublings = doublings
        self.every = 1 if doublings == 2 else 2  # of how many steps the end is one of those compared
        self.stretches: list[EqualSteps] = []
        self.longest, self.late = 0.0, 0.0  # s; that its resets may differ from those of the first run [s]

    def follow(self, stretches: Sequence[EqualSteps], lasted: float = 0.0) -> None:
        """The first run is in a leg of these steps, after one that lasted so long [s]."""
        made = halved(stretches) if self._doublings < 0 else list(stretches)
        for _ in range(self._doublings):
            made = doubled(made)
        self.stretches, self.longest = made, max(abs(part.h) for part in made)
        self.late = max(LATE * self.longest, SHARE * lasted)

    def meets(self, t: Array) -> Flags:
        """Which of the instants t (r,) are ends of its steps, but for rounding."""
        begins, h = (np.array(column) for column in zip(*[part[:2] for part in self.stretches], strict=True))
        sign = math.copysign(1.0, h[0])
        part = np.maximum(np.searchsorted(sign * begins, sign * t) - 1, 0)
        ends = begins[part] + np.rint((t - begins[part]) / h[part]) * h[part]
        same: Flags = np.abs(ends - t) <= SAME * np.spacing(np.abs(t))
        return same

    def steps(self, t: float) -> list[EqualSteps]:
        """From t on."""
        return joined(t, self.stretches)


def courses(stretches: Sequence[EqualSteps], order: int, *, shorter: bool = False) -> tuple[list[Course], Law]:
    """Those of two runs of longer steps; where there are too few of them, of one of steps half as long.

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
        if two >= APART * one and four - two >= APART * (two - one):
            return [Course(1), Course(2)], Law((four - two) / (two - one), one / (two - one))
    return [Course(-1)], Law(1.0, 1.0 / (1.0 - 0.5**order))
