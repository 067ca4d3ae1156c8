"""Ensemble: what a simulation of many trajectories gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np

from cgraph.extend import Array

from ..trajectory import Crossings, Stats

Counts = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True)
class EnsembleStats:
    """How N runs went: `Stats`, with an entry for each trajectory where they differ.

    Parameters
    ----------
    method : str
        As `simulate_many` was asked for it.
    steps, rejected, nfev : ndarray
        Accepted steps, trials of a step that were not accepted, and evaluations of the rate, (N,) each.
    dt : ndarray
        The largest step taken, (N,) [s].
    seconds : float
        Run time of all of them together [s], compiling included.
    success : ndarray
        Whether it reached t_end, (N,).
    message : tuple of str
        N sentences: "reached t_end", or where and why it stopped.
    status : ndarray
        0: its end was reached; -1: it failed or was interrupted, (N,).
    error, error_at_end : ndarray
        Of equal steps, the estimated errors of `Stats`, (N,); NaN of a trajectory that has none.
    warnings : tuple of tuple of str
        What speaks against each result, N tuples.

    Examples
    --------
    >>> import dynamics as dyn
    >>> fan = dyn.simulate_many(dyn.planar_arm([1.0], [1.0]), [[0.1], [0.2]], [0.0], 1.0, "rk4", dt=0.01)
    >>> fan.stats.steps.tolist(), fan.stats.message
    ([100, 100], ('reached t_end', 'reached t_end'))
    """

    method: str
    steps: Counts
    rejected: Counts
    nfev: Counts
    dt: Array
    seconds: float
    success: np.ndarray[Any, np.dtype[np.bool_]]
    message: tuple[str, ...]
    status: Counts
    error: Array
    error_at_end: Array
    warnings: tuple[tuple[str, ...], ...]


COLUMNS: dict[str, type] = dict.fromkeys(("steps", "rejected", "nfev", "status"), np.int64) | {"success": np.bool_}
COLUMNS |= dict.fromkeys(("dt", "error", "error_at_end"), np.float64)  # None is NaN


def ensemble_stats(each: Sequence[Stats], more: Sequence[Sequence[str]], seconds: float) -> EnsembleStats:
    """The statistics of runs side by side.  more: what speaks against each result besides."""
    names = [*COLUMNS, "message", "warnings"]
    *numbers, messages, warnings = zip(*map(attrgetter(*names), each), strict=True)
    columns: dict[str, Any] = {name: np.array(numbers[k], dtype=kind) for k, (name, kind) in enumerate(COLUMNS.items())}
    said = tuple([(*texts, *others) for texts, others in zip(warnings, more, strict=True)])
    return EnsembleStats(each[0].method, seconds=seconds, message=messages, warnings=said, **columns)


@dataclass(frozen=True)
class Ensemble:
    """Many motions of one model, as `simulate_many` gives them.

    q[k] is what trajectory k alone would have, (T, nq), in one piece of memory, as in MuJoCo's rollout and a vmap. From
    where a state of a trajectory was not finite on its rows are NaN. It keeps states alone: accelerations, and the
    multipliers of constraints, are outputs of `forward_dynamics` at q[k], qd[k], see `arrays_at`.

    Parameters
    ----------
    t : ndarray
        Times, (T,) [s].
    q, qd : ndarray
        Coordinates, (N, T, nq), and velocities, (N, T, n) [rad or m, per second]. Of an OdeSystem q holds the states,
        (N, T, m), and qd has no columns.
    stats : EnsembleStats
        How the runs went.
    events : mapping
        {name of an event: (Crossings, ..)}, N of them, one for each trajectory.
    p : ndarray, optional
        Momenta dL/dqd, (N, T, n), of runs with `form="momentum"`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> fan = dyn.simulate_many(dyn.planar_arm([1.0], [1.0]), [[0.1], [0.2]], [0.0], 1.0, t_eval=[0.0, 1.0])
    >>> fan.q.shape, fan.stats.success.tolist()
    ((2, 2, 1), [True, True])
    """

    t: Array
    q: Array
    qd: Array
    stats: EnsembleStats
    events: Mapping[str, tuple[Crossings, ...]] = field(default_factory=dict)
    p: Array | None = None

    def __repr__(self) -> str:
        many, rows, n = self.q.shape
        what = f"{n} coordinate(s)" if self.qd.shape[2] else f"{n} state(s)"
        span = f", t = {self.t[0]:g} .. {self.t[-1]:g} s" if rows else ""
        whole = int(np.count_nonzero(self.stats.success))
        return f"<Ensemble of {many}, {what}: {rows} rows{span}; {self.stats.method}, {whole} reached t_end>"
