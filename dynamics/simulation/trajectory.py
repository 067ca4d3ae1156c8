"""Trajectory: what a simulation gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from cgraph.extend import Array


class SimulationWarning(UserWarning):
    """A run that has ended, but whose result should not be trusted as it is; `Stats.warnings` has the same text.

    Examples
    --------
    >>> import warnings
    >>> import dynamics as dyn
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", dyn.SimulationWarning)  # such a result is no result
    ...     run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], t_end=1.0)
    """


@dataclass(frozen=True)
class Stats:
    """How a run went, in SciPy's words where it has them.

    Parameters
    ----------
    method : str
        As `simulate` was asked for it.
    steps, rejected : int
        Accepted steps, and trials of a step that were not accepted.
    nfev : int
        Evaluations of the rate of the state.
    dt : float
        The largest step taken [s].
    seconds : float
        Run time of the steps [s], without deriving and compiling.
    success : bool
        Whether the run reached t_end.
    message : str
        "reached t_end", or where and why it stopped.
    warnings : tuple of str
        What speaks against the result, a sentence each; every one is issued as a `SimulationWarning`, too.

    Examples
    --------
    >>> import dynamics as dyn
    >>> stats = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 1.0, "rk4", dt=0.01).stats
    >>> stats.steps, stats.nfev, stats.message
    (100, 400, 'reached t_end')
    """

    method: str
    steps: int
    rejected: int
    nfev: int
    dt: float
    seconds: float
    success: bool
    message: str
    warnings: tuple[str, ...] = ()


class Crossings(NamedTuple):
    """Where an event happened.

    Parameters
    ----------
    t : ndarray
        The instants, (k,) [s].
    q, qd : ndarray
        The states there, (k, n) [rad or m, per second]; of an OdeSystem q holds them, and qd has no columns.

    Examples
    --------
    >>> import dynamics as dyn
    >>> hanging = dyn.Event("hanging", lambda q, qd, t: q[0])
    >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 2.0, events=hanging)
    >>> run.events["hanging"].t.round(4)
    array([0.4097, 1.2292])
    """

    t: Array
    q: Array
    qd: Array


@dataclass(frozen=True)
class Trajectory:
    """The motion that `simulate` gives, a row for each recorded time.

    Parameters
    ----------
    t : ndarray
        Times, (T,) [s].
    q, qd : ndarray
        Coordinates and velocities, (T, n) [rad or m, per second]. Of an OdeSystem q holds the states, (T, m), and
        qd has no columns.
    energy : ndarray
        Kinetic and potential energy, (T,) [J]; NaN for an OdeSystem.
    stats : Stats
        How the run went.
    events : mapping
        {name of an event: Crossings}.

    Examples
    --------
    >>> import dynamics as dyn
    >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 1.0, t_eval=[0.5, 1.0])
    >>> run.q.shape, run.stats.success
    ((2, 1), True)
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
        happened = "".join([f", {len(crossings.t)} of event {name}" for name, crossings in self.events.items()])
        return f"<Trajectory of {what}: {rows}{happened}; {stats.method}, {stats.steps} steps, {stats.message}>"
