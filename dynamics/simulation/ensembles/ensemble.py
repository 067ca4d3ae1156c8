"""Ensemble: what a simulation of many trajectories gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..trajectory import Array

Counts = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True)
class EnsembleStats:
    """How N runs went: `Stats`, with an entry for each trajectory where they differ."""

    method: str
    steps: Counts  # (N,), accepted
    rejected: Counts  # (N,), trials of a step that were not accepted
    nfev: Counts  # (N,), of the rate of the state
    dt: Array  # (N,) s, the largest step taken
    seconds: float  # run time of all of them together, making the machine code included
    success: np.ndarray[Any, np.dtype[np.bool_]]  # (N,), it reached t_end
    message: tuple[str, ...]  # N sentences: "reached t_end", or where and why it stopped


@dataclass(frozen=True)
class Ensemble:
    """Many motions of one model: t (T,) [s]; q and qd (N, T, n) [rad or m, per second]; and how the runs went.

    q[k] is what trajectory k alone would have, (T, n), in one piece of memory; so lie the results of MuJoCo's rollout
    and of a vmap. From where a trajectory left the numbers on its rows are NaN. Of an OdeSystem q holds the states,
    and qd has no columns.
    """

    t: Array
    q: Array
    qd: Array
    stats: EnsembleStats

    def __repr__(self) -> str:
        many, rows, n = self.q.shape
        what = f"{n} coordinate(s)" if self.qd.shape[2] else f"{n} state(s)"
        span = f", t = {self.t[0]:g} .. {self.t[-1]:g} s" if rows else ""
        whole = int(np.count_nonzero(self.stats.success))
        return f"<Ensemble of {many}, {what}: {rows} rows{span}; {self.stats.method}, {whole} reached t_end>"
