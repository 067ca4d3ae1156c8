"""Trajectory: what a simulation gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Stats:
    """How a run went. success: it reached t_end; if not, `message` says where and why it stopped."""

    method: str
    steps: int  # accepted
    rejected: int  # trials of a step that were not accepted
    nfev: int  # of the rate of the state
    dt: float  # s, the largest step taken
    seconds: float  # run time of the steps, without building and compiling
    success: bool
    message: str


class Crossings(NamedTuple):
    """Where an event happened: t (k,), and the states there, q and qd (k, n)."""

    t: Array
    q: Array
    qd: Array


@dataclass(frozen=True)
class Trajectory:
    """The motion: t (T,) [s]; q and qd (T, n) [rad or m, per second]; energy (T,) [J]; and how the run went.

    Of an OdeSystem q holds the states, qd has no columns, and the energy is NaN. events: {name: Crossings}.
    """

    t: Array
    q: Array
    qd: Array
    energy: Array
    stats: Stats
    events: Mapping[str, Crossings] = field(default_factory=dict)

    def __repr__(self) -> str:
        n, stats = self.q.shape[1], self.stats
        what = f"{n} coordinate(s)" if self.qd.shape[1] else f"{n} state(s)"
        rows = f"{len(self.t)} rows, t = {self.t[0]:g} .. {self.t[-1]:g} s" if len(self.t) else "no rows"
        happened = "".join([f", {len(found.t)} of event {name}" for name, found in self.events.items()])
        return f"<Trajectory of {what}: {rows}{happened}; {stats.method}, {stats.steps} steps, {stats.message}>"
