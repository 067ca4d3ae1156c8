"""Event location: the instants inside steps at which the sign of a quantity turns, by looks and halvings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cgraph.extend import Array

from .dense_output import StepBlock
from .event import Event

LOOKS = 15  # instants inside a step at which events are looked at
HALVINGS = 60  # of a step: to the last bit of where in it


def crossings(
    values: Callable[[Array, Array], Array], events: Sequence[Event], block: StepBlock
) -> list[tuple[int, float, Array]]:
    """(number of the event, time, state) of each crossing, in the order of the run. values(t, x): (events, k).

    Where the sign differs between two of the ends and `LOOKS` instants inside of a step, halving finds the place.
    """
    steps = len(block.t)
    shares = np.linspace(0.0, 1.0, LOOKS + 2)
    looks = [values(block.t_old, block.x_old)]
    for share in shares[1:-1]:
        inside = block.states_at(np.arange(steps), np.full(steps, share))
        looks.append(values(block.t_old + share * block.h, inside))
    looks.append(values(block.t, block.x))
    signs = np.stack(looks)  # (instants, events, steps)
    result: list[tuple[int, float, Array]] = []
    for number, event in enumerate(events):
        a, b = signs[:-1, number], signs[1:, number]
        rises, falls = (a < 0.0) & (b >= 0.0), (a > 0.0) & (b <= 0.0)
        part, rows = np.nonzero(rises & (event.direction >= 0) | falls & (event.direction <= 0))
        low, high = shares[part], shares[part + 1]
        start, t_old, h = np.sign(a[part, rows]), block.t_old[rows], block.h[rows]
        for _ in range(HALVINGS if len(rows) else 0):
            middle = 0.5 * (low + high)
            same = np.sign(values(t_old + middle * h, block.states_at(rows, middle))[number]) == start
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        times = np.where(high == 1.0, block.t[rows], t_old + high * h)
        result += list(zip([number] * len(rows), times.tolist(), block.states_at(rows, high), strict=True))
    backward = bool(steps and block.h[0] < 0.0)
    return sorted(result, key=lambda crossing: crossing[1], reverse=backward)
