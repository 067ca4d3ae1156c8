"""Events: instants at which a quantity of a moving system passes through zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cgraph import Graph, Node

from .integrators import Problem
from .run import Piece
from .trajectory import Array

HALVINGS = 60  # of a step: to the last bit of where in it


@dataclass(frozen=True)
class Event:
    """Where value(q, qd, t) or (q, qd, t, p) passes through zero; of an OdeSystem value(x, t) or (x, t, p).

    name: by which the trajectory lists it.  direction: 1 upwards only, -1 downwards only, 0 both.
    terminal: the run ends there.
    """

    name: str
    value: Callable[..., Node]
    direction: int = 0
    terminal: bool = False

    def __post_init__(self) -> None:
        if self.direction not in (-1, 0, 1):
            raise ValueError(f"event {self.name!r}: direction must be 1, -1 or 0, got {self.direction!r}")


def event_graph(events: Sequence[Event], problem: Problem) -> Graph:
    """The values of events: inputs the states, t and parameters, as of the problem's other graphs."""
    outputs: dict[str, Node] = {}
    for event in events:
        if event.name in outputs:
            raise ValueError(f"two events have the name {event.name!r}")
        outputs[event.name] = problem.value(f"event {event.name!r}", event.value)
    return problem.bind(problem.states, Graph(problem.inputs, outputs))


def crossings(
    values: Callable[[Array, Array], Array], events: Sequence[Event], piece: Piece
) -> list[tuple[int, float, Array]]:
    """(number of the event, time, state) of each crossing, in order of time. values(t, x): (events, k)."""
    before, after = values(piece.t_old, piece.x_old), values(piece.t, piece.x)
    found: list[tuple[int, float, Array]] = []
    for number, event in enumerate(events):
        a, b = before[number], after[number]
        rises, falls = (a < 0.0) & (b >= 0.0), (a > 0.0) & (b <= 0.0)
        met = rises & (event.direction >= 0) | falls & (event.direction <= 0)
        rows = np.flatnonzero(met)
        low, high = np.zeros(len(rows)), np.ones(len(rows))
        start = np.sign(a[met])
        for _ in range(HALVINGS if len(rows) else 0):
            middle = 0.5 * (low + high)
            here = values(piece.t_old[met] + middle * piece.h[met], piece.at(rows, middle))[number]
            same = np.sign(here) == start
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        times = np.where(high == 1.0, piece.t[met], piece.t_old[met] + high * piece.h[met])
        found += list(zip([number] * len(rows), times.tolist(), piece.at(rows, high), strict=True))
    return sorted(found, key=lambda each: each[1])
