"""Products of a derivative with many directions at one point."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..autodiff.direction_split import DirectionSplit
from ..core.evaluation import Array
from .colored_matrix import Derivative

KEPT = 128  # directions, at most, whose buffers stay for another call


class Buffers(NamedTuple):
    """What one call at a time has for itself: from a point, and directions in rows, `run` makes results in rows."""

    x: Array
    directions: Array
    results: Array
    run: Callable[[], Any]


Make = Callable[[int], Buffers]  # for so many directions


class DirectionProducts:
    """What writes products; any number of threads may call it at once.

    prepare: makes of a split what makes buffers.  lanes, block: these are for a multiple of `lanes` up to `block`.
    """

    def __init__(
        self, derivative: Derivative, prepare: Callable[[DirectionSplit], Make], lanes: int, block: int
    ) -> None:
        self._derivative, self._how = derivative, (prepare, lanes, block)
        self._make, self._lanes, self._block = prepare(derivative.split), lanes, block
        self._careful: DirectionProducts | None = None
        self._free: dict[int, list[Buffers]] = {}  # pop and append are atomic

    def __call__(self, x: Array, directions: Array, result: Array) -> None:
        """The results, (k, results), along directions, (k, entries), at a point."""
        for start in range(0, len(directions), self._block):  # between blocks, Ctrl-C is heard
            here = directions[start : start + self._block]
            count = len(here)
            size = -(-count // self._lanes) * self._lanes
            free = self._free.setdefault(size, [])
            try:
                buffers = free.pop()
            except IndexError:
                buffers = self._make(size)
                buffers.directions[...] = 0.0
            buffers.x[:] = x
            buffers.directions[:count] = here
            buffers.run()
            result[start : start + self._block] = buffers.results[:count]
            if size <= KEPT:
                free.append(buffers)
        if self._derivative.guarded is not None and not math.isfinite(np.vdot(result, result)):
            if self._careful is None:
                self._careful = DirectionProducts(self._derivative.careful, *self._how)
            self._careful(x, directions, result)
