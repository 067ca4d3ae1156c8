"""Dense output: consecutive steps of a run, and the states between their ends."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Compiled, Graph
from cgraph.extend import Array

from ..integrators import Problem

KEPT = 16  # compiled rates that stay for another block

Indices = np.ndarray[Any, np.dtype[np.intp]]


class StepBlock(NamedTuple):
    """Consecutive steps. With dense output: x(t_old + s h) = x_old + sum_k dense_k s^k for 0 <= s <= 1."""

    t: Array  # (T,) ends of the steps
    x: Array  # (T, m)
    t_old: Array  # (T,)
    h: Array  # (T,), negative in a run back in time
    x_old: Array  # (T, m)
    dense: Array | None  # (T, degree, m)

    def states_at(self, rows: Indices, s: Array) -> Array:
        """States (k, m) at the shares s (k,) of the steps `rows` (k,)."""
        assert self.dense is not None
        total = np.zeros((len(rows), self.x.shape[1]))
        for k in reversed(range(self.dense.shape[1])):
            total = (total + self.dense[rows, k]) * s[:, None]
        inside: Array = np.where((s == 1.0)[:, None], self.x[rows], self.x_old[rows] + total)
        return inside

    def until(self, t: float, x: Array) -> StepBlock:
        """The steps up to an instant inside one, which becomes the last."""
        direction = np.sign(self.h[0])
        keep = int(np.searchsorted(direction * self.t, direction * t)) + 1
        dense = None if self.dense is None else self.dense[:keep].copy()
        t_old, h, x_old = (array[:keep].copy() for array in (self.t_old, self.h, self.x_old))
        cut = StepBlock(self.t[:keep].copy(), self.x[:keep].copy(), t_old, h, x_old, dense)
        cut.t[-1], cut.x[-1] = t, x
        return cut


@lru_cache(KEPT)
def _compiled(rate: Graph) -> Compiled:
    """The rate, for states at many times; of the last few, the one compiled before."""
    return cg.compile(rate)


def with_hermite(block: StepBlock, problem: Problem) -> StepBlock:
    """The steps with dense output where the method has none: the cubic through states and rates at both ends."""
    f = _compiled(problem.rate)
    first = f.batch(np.concatenate([block.x_old.T, block.t_old[None]])).T
    last = f.batch(np.concatenate([block.x.T, block.t[None]])).T
    h, change = block.h[:, None], block.x - block.x_old
    dense = np.stack([h * first, 3 * change - h * (2 * first + last), h * (first + last) - 2 * change], axis=1)
    return block._replace(dense=dense)
