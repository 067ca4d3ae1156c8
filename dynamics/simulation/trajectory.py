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
        Whether the run reached t_end or ended at a terminal event.
    message : str
        "reached t_end", or where and why it stopped.
    status : int
        0: the end was reached; 1: a terminal event; -1: the run failed or was interrupted.
    njev, nlu : int
        Evaluations of the Jacobian and LU factorizations, 0 of methods without.
    error, error_at_end : float, optional
        Of equal steps, the estimated error of the state, the largest over the rows and that of the last row: in units
        of the largest value that a component has over the run, and of the component where it is largest. It is the
        difference from a second run, of steps twice as long (whose evaluations are not counted in nfev), divided by
        2^order - 1 as of a run whose error goes with a power of the step; infinite where the second run fails. The
        phase of a motion is part of its state: of symplectic methods this error grows, while the energy is kept. None
        of methods that choose their steps, and of runs without `estimate_error`.
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
    status: int = 0
    njev: int = 0
    nlu: int = 0
    error: float | None = None
    error_at_end: float | None = None
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
        How the run went; its `success`, `status`, `message`, `nfev`, `njev` and `nlu` are attributes of the trajectory
        too, as in SciPy.
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

    @property
    def success(self) -> bool:
        """Whether the run reached t_end or ended at a terminal event."""
        return self.stats.success

    @property
    def status(self) -> int:
        """0: the end was reached; 1: a terminal event; -1: the run failed or was interrupted."""
        return self.stats.status

    @property
    def message(self) -> str:
        """That it reached t_end, or where and why the run stopped."""
        return self.stats.message

    @property
    def nfev(self) -> int:
        """Evaluations of the rate of the state."""
        return self.stats.nfev

    @property
    def njev(self) -> int:
        """Evaluations of its Jacobian."""
        return self.stats.njev

    @property
    def nlu(self) -> int:
        """LU factorizations."""
        return self.stats.nlu

    def __repr__(self) -> str:
        n, stats = self.q.shape[1], self.stats
        what = f"{n} coordinate(s)" if self.qd.shape[1] else f"{n} state(s)"
        rows = f"{len(self.t)} rows, t = {self.t[0]:g} .. {self.t[-1]:g} s" if len(self.t) else "no rows"
        happened = "".join([f", {len(crossings.t)} of event {name}" for name, crossings in self.events.items()])
        said = "; ".join([stats.message, *[f"warning: {text}" for text in stats.warnings]])
        return f"<Trajectory of {what}: {rows}{happened}; {stats.method}, {stats.steps} steps, {said}>"
