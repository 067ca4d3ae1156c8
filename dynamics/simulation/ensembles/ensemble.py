"""Ensemble: what a simulation of many trajectories gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array, install

from ..outcome import REACHED
from ..trajectory import Crossings

if TYPE_CHECKING:
    import xarray

Counts = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True)
class EnsembleStats:
    """Statistics of N runs: `Stats`, with an entry for each trajectory where they differ.

    Parameters
    ----------
    method : str
        As `simulate_many` was asked for it.
    seconds : float
        Run time of all of them together [s], compiling included.
    steps, rejected, nfev, dt, success, status, error, error_at_end : ndarray
        Those of `Stats`, (N,) each; errors are NaN of a trajectory that has none.
    message, warnings : tuple
        N sentences, "reached t_end", or where and why it stopped; and N tuples of what speaks against each result.

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


COLUMNS: dict[str, type] = {
    **dict.fromkeys(("steps", "rejected", "nfev", "status"), np.int64),
    **dict.fromkeys(("dt", "error", "error_at_end"), np.float64),  # None is NaN
    "success": np.bool_,
    **dict.fromkeys(("message", "warnings"), np.object_),
}


def doubts(stats: EnsembleStats) -> list[str]:
    """Warnings of the first trajectory that stopped early and of the first in doubt, with their numbers."""
    early, many = np.flatnonzero(stats.status < 0), f"of {len(stats.warnings)} trajectories"
    doubtful = [k for k, texts in enumerate(stats.warnings) if texts] if any(stats.warnings) else []
    stopped = [f"trajectory {k} {stats.message[k].removeprefix('stopped ')}" for k in early[:1].tolist()]
    said = [f"trajectory {k}: {stats.warnings[k][0]}" for k in doubtful[:1]]
    return [f"{len(early)} {many} stopped early: {text}" for text in stopped] + [
        f"{len(doubtful)} {many} {'has' if len(doubtful) == 1 else 'have'} a warning: {text}" for text in said
    ]


class Part:
    """Results of trajectories first, first + 1, ..: rows (k, T, m), columns of statistics, and "happened", events."""

    def __init__(self, first: int, rows: Array) -> None:
        self.first, self.rows = first, rows
        kinds = {**COLUMNS, "happened": np.object_}
        self.columns: dict[str, Any] = {name: np.zeros(len(rows), dtype=kind) for name, kind in kinds.items()}
        self.put(slice(None), status=-1, error=np.nan, error_at_end=np.nan, message="")
        self.columns["warnings"].fill(())
        self.columns["happened"].fill(())

    def put(self, which: Any, **columns: Any) -> None:
        """Set columns of these."""
        for name, values in columns.items():
            self.columns[name][which] = values

    def reached(self, which: Any, **columns: Any) -> None:
        """Set columns of these, which reached their end."""
        self.put(which, **columns, success=True, status=0, message=REACHED)

    def place(self, part: Part) -> None:
        """Put the results of a part in their place."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        self.put(here, **part.columns)

    def stats(self, method: str, seconds: float) -> EnsembleStats:
        """The statistics."""
        columns = {name: self.columns[name] for name in COLUMNS}
        columns |= {name: tuple(columns[name].tolist()) for name in ("message", "warnings")}
        return EnsembleStats(method, seconds=seconds, **columns)


@dataclass(frozen=True)
class Ensemble:
    """Many motions of one model, as `simulate_many` gives them.

    q[k] is what trajectory k alone would have, NaN where a state is not finite. For accelerations see `arrays_at`.

    Parameters
    ----------
    t : ndarray
        Times, (T,) [s].
    q, qd : ndarray
        Coordinates, (N, T, nq), and velocities, (N, T, n) [rad or m, per second]; of an OdeSystem q holds the states.
    stats : EnsembleStats
        How the runs went.
    events : mapping
        {name of an event: (Crossings, ..)}, N of them, one for each trajectory.
    p : ndarray, optional
        Momenta dL/dqd, (N, T, n), of runs with `form="momentum"`.
    q_start, qd_start : ndarray
        The states that the trajectories began with, (N, nq) and (N, n), as they were normalized.
    parameters : mapping
        {name: (N,)} of what else differed between them: parameters, and tau0, tau1, .. of an applied force (N, n).
    coordinates, velocities : tuple of str
        Names of the columns of q and of those of qd.

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
    q_start: Array = field(default_factory=lambda: np.empty((0, 0)))
    qd_start: Array = field(default_factory=lambda: np.empty((0, 0)))
    parameters: Mapping[str, Array] = field(default_factory=dict)
    coordinates: tuple[str, ...] = ()
    velocities: tuple[str, ...] = ()

    def __repr__(self) -> str:
        many, rows, n = self.q.shape
        what = f"{n} coordinate(s)" if self.qd.shape[2] else f"{n} state(s)"
        span = f", t = {self.t[0]:g} .. {self.t[-1]:g} s" if rows else ""
        whole = int(np.count_nonzero(self.stats.success))
        return f"<Ensemble of {many}, {what}: {rows} rows{span}; {self.stats.method}, {whole} reached t_end>"

    def to_xarray(self) -> xarray.Dataset:
        """Arrays with names (extra `tables`): all but `events`, whose number differs from trajectory to trajectory.

        Its dimensions are trajectory, t, coordinate and velocity. Memory maps of a store stay what they are.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        ImportError
            Where xarray is not installed.

        Examples
        --------
        >>> import dynamics as dyn
        >>> fan = dyn.simulate_many(dyn.planar_arm([1.0], [1.0]), [[0.1], [0.2]], [0.0], 1.0, t_eval=[0.0, 1.0])
        >>> fan.to_xarray().q.sel(coordinate="joint 1", t=1.0).values.round(4)
        array([-0.077, -0.155])
        """
        try:
            import xarray
        except ImportError:
            raise ImportError(f"this table needs xarray: {install('tables')}") from None
        stats, by_time, of_start = self.stats, ("trajectory", "t"), ("trajectory",)
        texts = {"message": stats.message, "warnings": ["; ".join(said) for said in stats.warnings]}
        variables: dict[str, Any] = {k: (of_start, np.array(texts.get(k, getattr(stats, k)))) for k in COLUMNS}
        columns = {"q": ("coordinate", self.q, self.q_start), "qd": ("velocity", self.qd, self.qd_start)}
        for name, (dimension, rows, start) in columns.items():
            variables |= {name: ((*by_time, dimension), rows), f"{name}_start": ((*of_start, dimension), start)}
        if self.p is not None:
            variables["p"] = ((*by_time, "velocity"), self.p)
        if shared := sorted({"trajectory", "t", "coordinate", "velocity", *variables} & {*self.parameters}):
            raise ValueError(f"the parameter {shared[0]!r} has the name of a column of the table: give it another name")
        coordinates = {
            "trajectory": np.arange(len(self.q)),
            "t": self.t,
            "coordinate": list(self.coordinates),
            "velocity": list(self.velocities),
            **{name: (of_start, values) for name, values in self.parameters.items()},
        }
        return xarray.Dataset(variables, coordinates, {"method": stats.method})
