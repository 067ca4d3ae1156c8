"""EnsembleRows: the parts of an ensemble, put together as they come."""

from __future__ import annotations

import math

import numpy as np

from cgraph.extend import Array

from ..event_log import Happening, split_crossings
from ..event_program import EventProgram
from ..trajectory import Crossings
from .chunk import INTERRUPTED, Part
from .ensemble import EnsembleStats

REACHED = "reached t_end"


class EnsembleRows:
    """Rows (N, T, m) and statistics of N trajectories, those of them that have come."""

    def __init__(self, count: int, rows: int, m: int) -> None:
        self.rows = np.empty((count, rows, m))
        self.steps, self.rejected, self.evaluations = np.zeros((3, count), dtype=np.int64)
        self.dt, self.status = np.zeros(count), [INTERRUPTED] * count
        self.errors, self.warnings = np.full((2, count), math.nan), [[""][:0] for _ in range(count)]
        self.ended = np.zeros(count, dtype=bool)
        self.happened: list[list[Happening]] = [[] for _ in range(count)]
        self.arrived = np.zeros(count, dtype=bool)

    def add(self, part: Part) -> None:
        """One more part."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        for name in ("steps", "rejected", "evaluations", "dt"):
            getattr(self, name)[here] = getattr(part, name)
        self.status[here] = [status or REACHED for status in part.status]
        self.errors[:, here], self.warnings[here] = part.errors, part.warnings
        self.ended[here], self.happened[here] = part.ended, part.happened
        self.arrived[here] = True

    def check(self) -> None:
        """Raises ValueError unless all parts have come."""
        if not self.arrived.all():
            raise ValueError(
                "workers must give a result for each item, as map does: of "
                f"{len(self.rows)} trajectories came back {self.arrived.sum()}"
            )

    def stats(self, method: str, seconds: float) -> EnsembleStats:
        """How it went. Rows that have not come become NaN."""
        self.rows[~self.arrived] = math.nan
        success = self.ended | np.array([status == REACHED for status in self.status])
        counts = (self.steps, self.rejected, self.evaluations)
        status, texts = (
            np.where(self.ended, 1, np.where(success, 0, -1)),
            tuple([tuple(texts) for texts in self.warnings]),
        )
        said, (largest, last) = tuple(self.status), self.errors
        return EnsembleStats(method, *counts, self.dt, seconds, success, said, status, largest, last, texts)

    def events(self, program: EventProgram, nq: int, p: Array) -> dict[str, tuple[Crossings, ...]]:
        """Of each event by name, where it happened in the trajectories; the first nq numbers of a state are q.

        p: the parameters of the trajectories, (N, k).
        """
        crossings = [split_crossings(program, each, nq, one) for each, one in zip(self.happened, p, strict=True)]
        return {event.name: tuple([named[event.name] for named in crossings]) for event in program.events}
