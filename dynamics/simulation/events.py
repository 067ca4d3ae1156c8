"""Events: instants at which a quantity of a moving system passes through zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cgraph import Graph, Node

from ..integrators import Problem
from .stepping import Piece
from .trajectory import Array

LOOKS = 15  # instants inside a step at which events are looked at
HALVINGS = 60  # of a step: to the last bit of where in it


@dataclass(frozen=True)
class Event:
    """Where value(q, qd, t) or (q, qd, t, p) passes through zero; of an OdeSystem value(x, t) or (x, t, p).

    It is looked at sixteen times in each step. Of two crossings closer than that both may be missed: limit the steps by
    `dt` where a quantity changes faster than the motion does.

    name: by which the trajectory lists it.  direction: 1 upwards only, -1 downwards only, 0 both.
    terminal: the run ends there.
    """

    name: str
    value: Callable[..., Node]
    direction: int = 0
    terminal: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not callable(self.value) or not isinstance(self.terminal, bool):
            raise TypeError(
                "an event needs a name, a function, and True or False for `terminal`, got "
                f"{self.name!r:.40}, {self.value!r:.40} and {self.terminal!r:.40}"
            )
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
    """(number of the event, time, state) of each crossing, in order of time. values(t, x): (events, k).

    Where the sign differs between two of the ends and `LOOKS` instants inside of a step, halving finds the place.
    """
    steps = len(piece.t)
    shares = np.linspace(0.0, 1.0, LOOKS + 2)
    looks = [values(piece.t_old, piece.x_old)]
    for share in shares[1:-1]:
        inside = piece.at(np.arange(steps), np.full(steps, share))
        looks.append(values(piece.t_old + share * piece.h, inside))
    looks.append(values(piece.t, piece.x))
    signs = np.stack(looks)  # (instants, events, steps)
    found: list[tuple[int, float, Array]] = []
    for number, event in enumerate(events):
        a, b = signs[:-1, number], signs[1:, number]
        rises, falls = (a < 0.0) & (b >= 0.0), (a > 0.0) & (b <= 0.0)
        part, rows = np.nonzero(rises & (event.direction >= 0) | falls & (event.direction <= 0))
        low, high = shares[part], shares[part + 1]
        start, t_old, h = np.sign(a[part, rows]), piece.t_old[rows], piece.h[rows]
        for _ in range(HALVINGS if len(rows) else 0):
            middle = 0.5 * (low + high)
            same = np.sign(values(t_old + middle * h, piece.at(rows, middle))[number]) == start
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        times = np.where(high == 1.0, piece.t[rows], t_old + high * h)
        found += list(zip([number] * len(rows), times.tolist(), piece.at(rows, high), strict=True))
    return sorted(found, key=lambda each: each[1])
