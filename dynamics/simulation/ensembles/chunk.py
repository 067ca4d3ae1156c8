"""Chunks: some trajectories of an ensemble, before they are run and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cgraph.extend import Array

from ..events.event_log import Happening
from ..outcome import INTERRUPTED
from ..trajectory import Stats


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


@dataclass(frozen=True)
class Part:
    """What a chunk gives, or all: rows (k, T, m), NaN from where a trajectory stopped on, and how each run went."""

    first: int
    rows: Array
    stats: list[Stats]
    happened: list[list[Happening]]  # the events of each

    def put(self, part: Part) -> None:
        """What a part gives, in its place."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        self.stats[here], self.happened[here] = part.stats, part.happened

    @property
    def interrupted(self) -> bool:
        """Whether the chunk was not run to its end."""
        return any(each.message.startswith(INTERRUPTED) for each in self.stats)


def not_begun(method: str, first: int, rows: Array) -> Part:
    """The part of the chunk whose rows are to be here, before its first step."""
    none = Stats(method, 0, 0, 0, 0.0, 0.0, success=False, message=INTERRUPTED, status=-1)
    return Part(first, rows, [none] * len(rows), [[] for _ in rows])
