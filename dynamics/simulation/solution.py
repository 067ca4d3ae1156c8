"""Solution: the state of a run at any time, by the dense output of its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array, real_array

from .row_values import converted
from .steps.dense_output import StepBlock


@dataclass(frozen=True, eq=False)
class Solution:
    """The state at any time of a run that began with x at t0 and made these steps; the first nq numbers of it are q.

    velocities: qd of states (q, p), see Problem.
    """

    t0: float
    x: Array
    steps: Sequence[StepBlock]
    nq: int
    velocities: Graph | None = None

    def __call__(self, t: ArrayLike) -> tuple[Array, Array]:
        """q and qd at a time, or at times (k,). Raises ValueError for a time that the run did not come to."""
        times = real_array("t", t)
        if times.ndim > 1:
            raise ValueError(f"t must be a number or times, (k,), got shape {times.shape}")
        wanted = times.reshape(-1)
        end = float(self.steps[-1].t[-1]) if self.steps else self.t0
        inside = (min(self.t0, end) <= wanted) & (wanted <= max(self.t0, end))
        if not inside.all():
            first = float(wanted[~inside][0])
            raise ValueError(f"t must be between {self.t0:g} and {end:g} s, where the run was, got {first!r} s")
        states = converted(self.velocities, wanted, self._states(wanted)).reshape(*times.shape, len(self.x))
        return states[..., : self.nq], states[..., self.nq :]

    def _states(self, times: Array) -> Array:
        states = np.tile(self.x, (len(times), 1))
        direction = 1.0 if self.steps and self.steps[-1].t[-1] > self.t0 else -1.0
        ends = np.array([block.t[-1] for block in self.steps])
        block_of = np.searchsorted(direction * ends, direction * times)
        later = times != self.t0
        for number in np.unique(block_of[later]):
            here = later & (block_of == number)
            states[here] = self.steps[number].at(times[here])
        return states
