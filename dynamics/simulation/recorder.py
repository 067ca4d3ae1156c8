"""Rows: what of a run becomes a row of its trajectory, every step or the states at the times asked for."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import real_array

from .stepping import Piece
from .trajectory import Array

PAST = 1e-14  # of t_end: some roundings


class Rows:
    """The rows of the trajectory: every step, or the states at the times asked for."""

    def __init__(self, state: Array, asked: Array | None) -> None:
        self.asked = asked
        self.last = 0.0
        at_start = asked is None or asked[0] == 0.0
        self._t = [np.zeros(1 if at_start else 0)]
        self._x = [state[None] if at_start else state[None][:0]]
        self._next = int(at_start)  # of the times asked for
        self.size = 0  # bytes

    def add(self, piece: Piece) -> None:
        """The rows of these steps."""
        if not len(piece.t):
            return
        self.last = float(piece.t[-1])
        if self.asked is None:
            self._append(piece.t, piece.x)
            return
        last = int(np.searchsorted(self.asked, self.last, side="right"))
        times = self.asked[self._next : last]
        self._next = last
        rows = np.searchsorted(piece.t, times)
        exact = piece.t[rows] == times
        states = piece.x[rows]
        if not exact.all():
            inside = rows[~exact]
            states[~exact] = piece.at(inside, (times[~exact] - piece.t_old[inside]) / piece.h[inside])
        self._append(times, states)

    def _append(self, times: Array, states: Array) -> None:
        self._t.append(times)
        self._x.append(states)
        self.size += times.nbytes + states.nbytes

    def table(self) -> tuple[Array, Array]:
        """Times and states."""
        return np.concatenate(self._t), np.concatenate(self._x)


def recorded_times(t_eval: ArrayLike, t_end: float) -> Array:
    """The times asked for, (T,). A last one past t_end by rounding, as that of 0.1 * np.arange(4), becomes t_end.

    Raises ValueError unless they increase and lie in [0, t_end].
    """
    times = real_array("t_eval", t_eval).copy()
    needed = f"t_eval must be increasing times in [0, t_end = {t_end:g} s]"
    if times.ndim != 1 or not len(times):
        raise ValueError(f"{needed}, got shape {times.shape}")
    if t_end < times[-1] <= t_end * (1.0 + PAST):
        times[-1] = t_end
    listed: list[float] = times.tolist()
    outside = [t for t in listed if not 0.0 <= t <= t_end]
    if outside:
        raise ValueError(f"{needed}, got {outside[0]!r}")
    if order := [pair for pair in itertools.pairwise(listed) if not pair[0] < pair[1]]:
        raise ValueError(f"{needed}, got {order[0][0]!r} before {order[0][1]!r}")
    return times


def from_start(times: Array) -> list[float]:
    """The times, with 0 before them."""
    listed: list[float] = times.tolist()
    return listed if listed[0] == 0.0 else [0.0, *listed]
