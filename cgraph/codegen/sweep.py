"""Sweep: a derivative of a compiled graph, ready to run along many directions at one point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices
from ..core.evaluation import Array

NO_ENTRIES = np.zeros(0, dtype=np.int64)


class Sweep(ABC):
    """A derivative along groups of directions.

    Directions lie side by side: those of a group are the last axis of an array (groups, entries, lanes), and so are
    their results.  lanes: how many a group has.

    Where an entry of a direction is zero, an infinite slope counts for nothing. To look at the entries makes the
    directions' part longer, of second derivatives by a half. With `guarded`, the split that does, the other one need
    not: `guarded` runs only where a value that the directions' part reads is infinite or NaN, and elsewhere it would
    give the same.
    """

    def __init__(self, split: DirectionSplit, lanes: int, guarded: DirectionSplit | None) -> None:
        self.split, self.lanes, self._guarded = split, lanes, guarded
        self._guard: Sweep | None = None
        self._free: dict[int, list[tuple[Array, Array, Array, Callable[[], None]]]] = {}  # pop and append are atomic
        self.directions, self.results = split.directions, len(split.linear.outputs)  # numbers in one

    @abstractmethod
    def _bound(self, x: Array, s: Array, y: Array, take: Indices, put: Indices, values: Array) -> Callable[[], Any]:
        """As `bind`; the function tells whether a value that the directions' part read is infinite or NaN."""

    @abstractmethod
    def _like(self, split: DirectionSplit) -> Sweep:
        """Another split made ready to run in the same way, without a guard."""

    def bind(
        self,
        x: Array,
        s: Array,
        y: Array,
        take: Indices = NO_ENTRIES,
        put: Indices = NO_ENTRIES,
        values: Array | None = None,
    ) -> Callable[[], None]:
        """A function of nothing: y of the point x along s, then values[put] = y[take], y and values as rows of numbers.

        It keeps the arrays alive. One thread at a time may call it.
        """
        arrays = (x, s, y, take, put, y if values is None else values)
        run = self._bound(*arrays)
        if self._guarded is None:
            return run

        def checked() -> None:
            if run():
                self._careful()._bound(*arrays)()

        return checked

    def _careful(self) -> Sweep:
        """The guarded sweep, made at its first use."""
        if self._guard is None:
            assert self._guarded is not None
            self._guard = self._like(self._guarded)
        return self._guard

    def along(self, x: Array, directions: Array) -> Array:
        """The results, (k, results), along directions, (k, entries), at a point."""
        result = np.empty((len(directions), self.results))
        block = self.lanes * max(1, WORK // (len(self.split.linear.nodes) * self.lanes))
        for start in range(0, len(directions), block):  # between blocks, Ctrl-C is heard
            self._block(x, directions[start : start + block], result[start : start + block])
        return result

    def _block(self, x: Array, directions: Array, result: Array) -> None:
        k, lanes = len(directions), self.lanes
        groups, full = -(-k // lanes), k // lanes
        free = self._free.setdefault(groups, [])
        try:
            buffers = free.pop()
        except IndexError:
            buffers = self._buffers(groups)
        point, s, y, run = buffers
        point[:] = x
        s[:full] = directions[: full * lanes].reshape(full, lanes, self.directions).transpose(0, 2, 1)
        if full < groups:  # the last group is filled up with zeros
            s[full, :, : k % lanes] = directions[full * lanes :].T
            s[full, :, k % lanes :] = 0.0
        run()
        result[: full * lanes] = y[:full].transpose(0, 2, 1).reshape(full * lanes, self.results)
        if full < groups:
            result[full * lanes :] = y[full, :, : k % lanes].T
        if groups <= REUSED:
            free.append(buffers)

    def _buffers(self, groups: int) -> tuple[Array, Array, Array, Callable[[], None]]:
        """What one call at a time has for itself: point, directions, results, and the function from these to those."""
        x = np.empty(len(self.split.primal.inputs))
        s, y = aligned((groups, self.directions, self.lanes)), aligned((groups, self.results, self.lanes))
        return x, s, y, self.bind(x, s, y)


REUSED = 16  # groups, at most, whose buffers stay for another call
WORK = 2**23  # nodes times directions in a block: some milliseconds


def aligned(shape: tuple[int, ...]) -> Array:
    """An array that begins where a line of the cache does: a vector then lies in one."""
    size = int(np.prod(shape))
    memory = np.empty(size + 7)
    start = -(memory.ctypes.data // 8) % 8
    return memory[start : start + size].reshape(shape)
