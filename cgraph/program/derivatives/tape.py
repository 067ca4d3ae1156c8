"""Tape: what passes record for their way back, all of it, or again from checkpoints."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ...core.evaluation import Array
from ..runners.runner import Record, Runner

Feed = Callable[[int, int], Array]  # first and last pass: what those from the first to before the last are fed


class Block(NamedTuple):
    """Passes first .. last - 1, and what is kept of them: the rows of their record, or the memory before them."""

    first: int
    last: int
    kept: Array


class Tape:
    """Record of passes, block by block.

    forward: runs the program that records, see `Linearization.forward`.  feed: (first, last) -> what the passes first
    .. last - 1 are fed.  checkpoints: passes between two memories from which the record is made again; 0: the record is
    kept.

    >>> import numpy as np
    >>> from cgraph._shared import Tape
    >>> from cgraph.extend import Program, runner
    >>> forward = runner(Program({"x": 1}, [], record=["x"], feed=["x"]), "python")
    >>> tape = Tape(forward, lambda first, last: np.arange(first, last)[:, None] * 1.0, checkpoints=2)
    >>> tape.run(forward.memory({}), 0, 3, most=8)
    >>> [block.kept.ravel().tolist() for block in tape.recorded(backwards=True)]
    [[2.0], [0.0, 1.0]]
    """

    def __init__(self, forward: Runner, feed: Feed, checkpoints: int = 0) -> None:
        self.forward, self.feed, self.checkpoints = forward, feed, checkpoints
        self.blocks: list[Block] = []

    def run(self, memory: Array, begin: int, end: int, most: int, every: int = 1) -> None:
        """Passes begin .. end - 1, at most `most` in a block, of which each `every`th is recorded.

        The memory, (size,) or (size, N), is changed in place.
        """
        size = self.checkpoints or max(1, most // every) * every
        for first in range(begin, end, size):
            last = min(first + size, end)
            before = memory.copy() if self.checkpoints else None
            part = last - first if self.checkpoints else every
            rows = run_passes(self.forward, memory, last - first, part, self.feed(first, last)).rows
            self.blocks.append(Block(first, last, rows if before is None else before))

    def recorded(self, *, backwards: bool) -> Iterator[Block]:
        """The blocks with the rows of every pass, from the last one back if asked."""
        for first, last, kept in reversed(self.blocks) if backwards else self.blocks:
            if self.checkpoints:
                rows = run_passes(self.forward, kept.copy(), last - first, 1, self.feed(first, last)).rows
                yield Block(first, last, rows)
            else:
                yield Block(first, last, kept)


def run_passes(ready: Runner, memory: Array, passes: int, every: int, feed: Array) -> Record:
    """Passes of one memory, or of many side by side, as `Runner.run` and `Runner.run_many`.

    >>> import numpy as np
    >>> from cgraph._shared import run_passes
    >>> from cgraph.extend import Program, runner
    >>> ready = runner(Program({"x": 1}, [], record=["x"]), "python")
    >>> run_passes(ready, ready.memory({"x": 2.0}), 1, 1, np.empty((1, 0))).rows.tolist()
    [[2.0]]
    """
    if memory.ndim == 1:
        return ready.run(memory, passes, every, feed)
    with np.errstate(all="ignore"):
        return ready.run_many(memory, passes, every, feed if feed.ndim == 3 else feed[:, :, None])
