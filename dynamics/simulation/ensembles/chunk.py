"""Chunks: some trajectories of an ensemble, before they are run and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cgraph.extend import Array

from ..estimates.error_estimate import ErrorEstimate
from ..events.event_log import Happening
from .ensemble import Counts

INTERRUPTED = "interrupted"  # what the status of a trajectory that Ctrl-C ended begins with


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


@dataclass(frozen=True)
class Part:
    """What a chunk gives, or all: rows (k, T, m), NaN from where a trajectory stopped on; then its `status` says so."""

    first: int
    rows: Array
    steps: Counts
    rejected: Counts
    evaluations: Counts
    dt: Array  # (k,) s, the largest steps
    status: list[str]  # empty while all is well
    errors: Array  # (2, k): of equal steps, the largest estimated error and that of the last row; NaN where unknown
    warnings: list[list[str]]  # what speaks against a trajectory
    ended: list[bool]  # whether an event has ended it; then its status says which
    happened: list[list[Happening]]  # the events of each

    def put(self, part: Part) -> None:
        """What a part gives, in its place."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        self.errors[:, here] = part.errors
        for name in ("steps", "rejected", "evaluations", "dt", "status", "warnings", "ended", "happened"):
            getattr(self, name)[here] = getattr(part, name)

    def tell(self, k: int, error: ErrorEstimate) -> None:
        """The error of trajectory k."""
        self.errors[:, k] = error.largest, error.last
        self.warnings[k] += [error.warning] if error.warning else []

    def interrupt(self, k: int, t: float, rows: int) -> None:
        """Trajectory k ends at t [s], after so many rows, and those after it did not begin."""
        self.rows[k, rows:], self.rows[k + 1 :] = np.nan, np.nan
        self.status[k] = f"{INTERRUPTED} after t = {t:.6g} s"
        self.status[k + 1 :] = [INTERRUPTED] * (len(self.status) - k - 1)

    @property
    def interrupted(self) -> bool:
        """Whether the chunk was not run to its end."""
        return any(status.startswith(INTERRUPTED) for status in self.status)


def empty(first: int, rows: Array) -> Part:
    """The part of the chunk whose rows are to be here, before its first step."""
    k = len(rows)
    steps, rejected, evaluations = np.zeros((3, k), dtype=np.int64)
    counts, errors = (steps, rejected, evaluations), np.full((2, k), np.nan)
    return Part(
        first,
        rows,
        *counts,
        np.zeros(k),
        [""] * k,
        errors,
        [[] for _ in range(k)],
        [False] * k,
        [[] for _ in range(k)],
    )
