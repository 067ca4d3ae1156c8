"""Recorder: what of a run becomes a row of its trajectory, every step or the states at the times of t_eval."""

from __future__ import annotations

import numpy as np

from cgraph.extend import Array

from .steps.dense_output import StepBlock


class Recorder:
    """The rows of a trajectory that starts with x at t0: every step, or the states at `times`.

    direction: 1.0, or -1.0 for a run back in time, whose times decrease.
    """

    def __init__(self, x: Array, times: Array | None, t0: float = 0.0, direction: float = 1.0) -> None:
        self.times, self.direction = times, direction
        self.last, self._last_state = t0, x  # how far the run has come [s]
        at_start = int(times is None or times[0] == t0)
        self._parts = [(np.full(at_start, t0), np.tile(x, (at_start, 1)))]  # times and states
        self._next = at_start  # of `times`
        self.size = 0  # bytes

    def add(self, block: StepBlock) -> None:
        """The rows of these steps."""
        if not len(block.t):
            return
        last, following = float(block.t[-1]), self._next
        if self.times is None:
            self._append(block.t, block.x)
        else:
            following = int(np.searchsorted(self.direction * self.times, self.direction * last, side="right"))
            times = self.times[self._next : following]
            self._append(times, block.at(times))
        self._next, self.last, self._last_state = following, last, block.x[-1].copy()

    def add_last(self) -> None:
        """Where a run stopped becomes its last row, also between the times of t_eval."""
        recorded = [times[-1] for times, _ in self._parts if len(times)]
        if not recorded or self.direction * (self.last - recorded[-1]) > 0.0:
            self._append(np.array([self.last]), self._last_state[None])

    def _append(self, times: Array, states: Array) -> None:
        self._parts.append((times, states))
        self.size += times.nbytes + states.nbytes

    def table(self) -> tuple[Array, Array]:
        """Times (T,) and states (T, m)."""
        times, states = zip(*self._parts, strict=True)
        return np.concatenate(times), np.concatenate(states)
