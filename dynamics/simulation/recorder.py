"""Recorder: what of a run becomes a row of its trajectory, every step or the states at the times of t_eval."""

from __future__ import annotations

import numpy as np

from cgraph.extend import Array

from .dense_output import StepBlock


class Recorder:
    """The rows of a trajectory: every step, or the states at `times`."""

    def __init__(self, x: Array, times: Array | None) -> None:
        self.times = times
        self.last = 0.0  # s, how far the run has come
        at_start = times is None or times[0] == 0.0
        self._t = [np.zeros(1 if at_start else 0)]
        self._x = [x[None] if at_start else x[None][:0]]
        self._next = int(at_start)  # of `times`
        self.size = 0  # bytes

    def add(self, block: StepBlock) -> None:
        """The rows of these steps."""
        if not len(block.t):
            return
        self.last = float(block.t[-1])
        if self.times is None:
            self._append(block.t, block.x)
            return
        last = int(np.searchsorted(self.times, self.last, side="right"))
        times = self.times[self._next : last]
        self._next = last
        rows = np.searchsorted(block.t, times)
        exact = block.t[rows] == times
        states = block.x[rows]
        if not exact.all():
            inside = rows[~exact]
            states[~exact] = block.states_at(inside, (times[~exact] - block.t_old[inside]) / block.h[inside])
        self._append(times, states)

    def _append(self, times: Array, states: Array) -> None:
        self._t.append(times)
        self._x.append(states)
        self.size += times.nbytes + states.nbytes

    def table(self) -> tuple[Array, Array]:
        """Times (T,) and states (T, m)."""
        return np.concatenate(self._t), np.concatenate(self._x)
