"""Sensitivity: how much the flow of a case makes a small error of its start grow by its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dynamics.experiments.stability.cases import StabilityCase
from dynamics.multiprecision import Reference, reference
from tests.dynamics.split_state import split_state

STEP = 2.0**-36  # of the start; a growth up to 10^6 is still a matter of first order
DIGITS = 15


def growth(case: StabilityCase, folder: str | Path | None = None) -> float:
    """The largest relative change of a state at t_end for a small relative change of one state at the start.

    At the start relative to the state's value, or its size where that is zero; at t_end to its size. By differences of
    reference solutions. Raises ValueError for a case that no reference method carries to t_end.
    """
    if case.method is None:
        raise ValueError(f"no reference method carries {case.name!r} to its end")
    model, size, worst = case.model, np.array(case.sizes(case.solution(folder=folder))), 0.0

    def end(start: tuple[float, ...]) -> Reference:
        at = split_state(model, start)
        return reference(model, *at, [case.t_end], digits=DIGITS, method=str(case.method), folder=folder)

    there = end(case.start)
    for i, value in enumerate(case.start):
        around = abs(value) or float(size[i])
        moved = value + STEP * around
        if moved == value:  # next to the smallest number
            continue
        beside = end((*case.start[:i], moved, *case.start[i + 1 :]))
        change = beside.deviation(there.x)[0] - there.deviation(there.x)[0]
        worst = max(worst, float(np.max(np.abs(change) / size)) / ((moved - value) / around))
    return worst
