"""Trajectory: what a simulation gives, at its rows and, by the dense output of its steps, between them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph, _shared
from cgraph._shared import Array, counted, entry, real_array, require_kind

from ..integrators import METHODS
from .applied_force import HeldForces
from .steps.dense_output import Solution
from .steps.row_values import origin, row_values


class SimulationWarning(UserWarning):
    """A run that stopped early, as `Stats.message` says, or whose result has something against it, `Stats.warnings`.

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
    """Statistics of a run, in SciPy's words where it has them.

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
        "reached t_end", or where and why it stopped, which is issued as a `SimulationWarning`, too.
    status : int
        0: the end was reached; 1: a terminal event; -1: the run failed or was interrupted.
    njev, nlu : int
        Evaluations of the Jacobian and LU factorizations, 0 of methods without.
    error, error_at_end : float, optional
        Of equal steps, the estimated error of the state, phase included, the largest over the run, and that at the end,
        of the component where it is largest over its largest value. It is the difference from a run of steps twice as
        long over 2^k - 1, where one of steps four times as long tells the order k; where it is large, the difference
        itself. Infinite where it is unknown, which a warning explains. None of chosen steps, without `estimate_error`,
        with a SampledController or events that reset the state, and of runs that fail or end in the first steps.
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
    """Crossings of an event: instants and states.

    Parameters
    ----------
    t : ndarray
        The instants, (k,) [s].
    q, qd : ndarray
        The states there, (k, nq) and (k, n) [rad or m, per second]; of an OdeSystem q holds them.

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


class Sides(NamedTuple):
    """Sides of the surfaces on which a rate jumps or kinks, along a run.

    Parameters
    ----------
    surfaces : tuple of str
        The formulas that are zero there, such as "qd.x", or whole, such as "floor(t)". Numbers of the run stand as
        numbers.
    t : ndarray
        The instants from which sides hold, the start among them, (k,) [s].
    sides : ndarray
        -1 or 1, the sign of the formula, or n of a floor, (k, n); half way between two in a slide.
    slides : ndarray
        Whether the motion slides on the surface, as a block that sticks does on that of its velocity, (k, n).

    Examples
    --------
    A block slides to rest.

    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t: qd[0]**2 / 2, "x", forces=lambda q, qd, t: [-2.0 * cg.sign(qd[0])])
    >>> run = dyn.simulate(block, [0.0], [3.0], t_end=4.0)
    >>> run.modes.surfaces, run.modes.t.round(6).tolist(), run.modes.sides.tolist(), run.modes.slides.tolist()
    (('qd.x',), [0.0, 1.5], [[1.0], [0.0]], [[False], [True]])
    """

    surfaces: tuple[str, ...]
    t: Array
    sides: Array
    slides: Array

    def at(self, times: Array) -> Array:
        """The sides at the rows of a run, (T, n); at the first of two rows of one instant, of a reset, those before."""
        times = real_array("times", times).ravel()
        way = -1.0 if self.t[-1] < self.t[0] else 1.0
        after, before = (np.searchsorted(way * self.t, way * times, side) - 1 for side in ("right", "left"))
        twice = np.append(times[1:] == times[:-1], False)
        held: Array = self.sides[np.where(twice, before, after).clip(0)]
        return held


NO_SIDES = Sides((), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0), dtype=bool))


@dataclass(frozen=True)
class Trajectory:
    """The motion that `simulate` gives, a row for each recorded time.

    Parameters
    ----------
    t : ndarray
        Times, (T,) [s].
    q, qd : ndarray
        Coordinates, (T, nq), and velocities, (T, n) [rad or m, per second]; of an OdeSystem q holds the states, (T, m).
    stats : Stats
        How the run went; `success`, `status`, `message`, `nfev`, `njev` and `nlu` are attributes, too, as in SciPy.
    events : mapping
        {name of an event: Crossings}.
    graphs : mapping
        {"rate": xdot, "force": tau + forces - damping qd, "energy": E}, "tau" and "multipliers": graphs over the states
        and t, and forces of a SampledController, with the numbers of the run built in. An OdeSystem has the rate alone.
    dense : Solution, optional
        The steps with their dense output, which `solution` reads; of a run with `dense_output=True`.
    held : HeldForces, optional
        What a SampledController has given, `held.t` and `held.tau`, a row for each period.
    coordinates, velocities : tuple of str
        Names of the columns of q and of those of qd, qdd, tau and forces: `run["q.elbow"]` is such a column.
    p : ndarray, optional
        Momenta dL/dqd, (T, n), of a run with `form="momentum"`; `run["p.elbow"]` is a column.
    modes : Sides
        The surfaces on which the rate jumps or kinks, and which sides of them held, or where the motion slid on them:
        by these are qdd, forces, tau and multipliers. The graphs are the plain equations.

    Examples
    --------
    >>> import dynamics as dyn
    >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 1.0, t_eval=[0.5, 1.0])
    >>> run.q.shape, run.stats.success
    ((2, 1), True)
    >>> run["q.joint 1"].round(3)
    array([-0.034, -0.077])
    """

    t: Array
    q: Array
    qd: Array
    stats: Stats
    events: Mapping[str, Crossings] = field(default_factory=dict)
    graphs: Mapping[str, Graph] = field(default_factory=dict)
    dense: Solution | None = None
    held: HeldForces | None = None
    coordinates: tuple[str, ...] = ()
    velocities: tuple[str, ...] = ()
    p: Array | None = None
    modes: Sides = NO_SIDES

    def __getitem__(self, name: str) -> Array:
        """A column by its name, (T,): "q.elbow", "qd.elbow", "qdd.elbow", "tau.elbow", "forces.elbow", or a state.

        Velocities with names of their own have these, as in "qd.base.wx"; the graphs' names, as "q3", do too.

        Raises
        ------
        TypeError
            For what is no text.
        ValueError
            For a name that no column has.
        """
        require_kind("the name of a column", name, str, "a string")
        kinds = ("qd", "qdd", "tau", "forces") if self.p is None else ("qd", "qdd", "tau", "forces", "p")
        known = {"q": self.coordinates} | dict.fromkeys(kinds, self.velocities)
        places = {f"{kind}.{each}": (kind, i) for kind, names in known.items() for i, each in enumerate(names)}
        by_number = {f"{kind}{i}": (kind, i) for kind, names in known.items() for i in range(len(names))}
        states = {} if self.velocities else {each: ("q", i) for i, each in enumerate(self.coordinates)}
        kind, i = entry("the trajectory has no column", states | places | by_number, name)
        table: Array = getattr(self, kind)
        return table[:, i]

    def solution(self, t: ArrayLike) -> tuple[Array, Array]:
        """The motion at any time of the run, by the dense output of its steps.

        At the ends of steps it is their states exactly; between, it has the order of the method's own dense output.

        Parameters
        ----------
        t : float or array_like
            A time, or times (k,), between the start and where the run came to [s].

        Returns
        -------
        tuple of ndarray
            q and qd, (nq,) and (n,), or (k, nq) and (k, n); of an OdeSystem its state and an array without columns.

        Raises
        ------
        ValueError
            For a time outside, and for a run without `dense_output=True`.

        Examples
        --------
        >>> import dynamics as dyn
        >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], t_end=1.0, dense_output=True)
        >>> q, qd = run.solution(0.25)
        >>> float(q[0].round(6)), float(qd[0].round(6))
        (0.057491, -0.313696)
        """
        if self.dense is None:
            raise ValueError("the run kept its rows alone: simulate(.., dense_output=True) keeps what is between them")
        return self.dense(t)

    def to_csv(self) -> str:
        """The rows as CSV: t, coordinates, velocities, energy and applied forces by their names, with every digit.

        Returns
        -------
        str
            A line of names, as "t", "q.elbow", "qd.elbow", "energy", and "tau.elbow" of applied forces (of an OdeSystem
            "t" and its states), and a line for each row.

        Examples
        --------
        >>> import dynamics as dyn
        >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.5], [0.0], t_end=1.0, t_eval=[0.0, 1.0])
        >>> run.to_csv().splitlines()[0]
        't,q.joint 1,qd.joint 1,energy'
        """
        names, columns = ["t"], [self.t[:, np.newaxis], self.q]
        if self.velocities:
            names += [f"q.{name}" for name in self.coordinates]
            names += [*[f"qd.{name}" for name in self.velocities], "energy"]
            columns += [self.qd, self.energy[:, np.newaxis]]
            applied = self.graphs["tau"].outputs.values() if "tau" in self.graphs else ()
            if self.held is not None or any([node.value != 0.0 for node in applied]):
                names += [f"tau.{name}" for name in self.velocities]
                columns.append(self.tau)
        else:
            names += self.coordinates
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(names)
        table = np.concatenate(columns, axis=1)
        for i in range(0, len(table), 10_000):  # as Python's numbers they are four times as large
            rows.writerows(table[i : i + 10_000].tolist())
        return text.getvalue()

    @cached_property
    def qdd(self) -> Array:
        """Accelerations at the rows, (T, n); of an OdeSystem without columns."""
        return self._rows("rate")[:, self.q.shape[1] :]

    @cached_property
    def forces(self) -> Array:
        """Generalized forces besides those of the Lagrangian at the rows, tau + forces - damping qd, (T, n)."""
        return self._rows("force")

    @cached_property
    def multipliers(self) -> dict[str, Array]:
        """Multipliers of constraints at the rows, {name: (T,)}: M qdd = tau + forces - damping qd - bias + J^T lambda.

        The force [N] or torque [N m] of a `Loop`, whose rows are named after it; of other rows J qd + a = 0 the power
        [W] over the unit of J qd. 0 of rows that follow from others.

        Examples
        --------
        A mass of 1 kg hangs on a rod, in x and y, and pulls at it with its weight.

        >>> import dynamics as dyn
        >>> def energy(q, qd, t):
        ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1]
        >>> rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": 0.5 * (q[0] ** 2 + q[1] ** 2 - 1.0)})
        >>> run = dyn.simulate(rod, [0.0, -1.0], [0.0, 0.0], t_end=1.0, t_eval=[0.0, 1.0])
        >>> run.multipliers["rod"].tolist()
        [-9.81, -9.81]
        """
        if "multipliers" not in self.graphs:
            return {}
        return dict(zip(self.graphs["multipliers"].outputs, self._rows("multipliers").T, strict=True))

    @cached_property
    def energy(self) -> Array:
        """Kinetic and potential energy at the rows, (T,) [J]; NaN for an OdeSystem."""
        return self._rows("energy")[:, 0] if "energy" in self.graphs else np.full(len(self.t), np.nan)

    @cached_property
    def tau(self) -> Array:
        """Applied forces at the rows, (T, n); of a SampledController those held from there on."""
        return self._rows("tau")

    def why_nan(self) -> _shared.WhyNan:
        """Where a rate that is not finite comes from, or of finite rates a derivative of one; `print` it for the words.

        The first row with a rate that is not finite is looked at; of a run that stopped, then half a step and a step
        beyond its last row; and then the first row with such a derivative. Numbers of the run stand as numbers.

        Returns
        -------
        WhyNan
            As of `cgraph.why_nan`; its `node` is None where all is finite.

        Examples
        --------
        >>> import warnings
        >>> import cgraph as cg
        >>> import dynamics as dyn
        >>> melt = dyn.OdeSystem(lambda x, t: [-cg.sqrt(x[0]) - 0.1], "depth")
        >>> with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        ...     run = dyn.simulate(melt, [0.01], None, 1.0, "rk4", dt=0.05)
        >>> print(run.why_nan())
        depth_dot is nan at depth = -0.00201144 and t = 0.075.
        It begins with %1 = sqrt(depth), which is nan, where depth = -0.00201144.
        On its way: %1 -> %2 -> %3 -> depth_dot.
        """
        graph = self.graphs["rate"]
        kinds = {"q": self.coordinates, "qd": self.velocities} if self.velocities else {}
        names = {f"{kind}{i}{end}": f"{kind}{end}.{name}" for kind, known in kinds.items()
                 for i, name in enumerate(known) for end in ("", "_dot")}  # fmt: skip
        states = self.q if not self.velocities else np.concatenate([self.q, self.qd], axis=1)
        held = () if self.held is None else self.held.at(self.t)
        return origin(graph, self.t, states, held, names, 0.0 if self.success else self.stats.dt)

    def _rows(self, name: str) -> Array:
        if name not in self.graphs:
            return np.empty_like(self.qd)
        held = np.empty((len(self.t), 0)) if self.held is None else self.held.at(self.t)
        qd, graph = self.qd, self.graphs[name]
        if (in_modes := f"{name} in modes") in self.graphs:
            graph, qd = self.graphs[in_modes], qd if self.p is None else self.p
            held = np.concatenate([held, self.modes.at(self.t)], axis=1)
        return row_values(graph, self.t, np.concatenate([self.q, qd], axis=1), held)

    success = property(attrgetter("stats.success"), doc="Whether the run reached t_end or ended at a terminal event.")
    status = property(attrgetter("stats.status"), doc="0: the end was reached; 1: a terminal event; -1: it failed.")
    message = property(
        attrgetter("stats.message"), doc="Sentence that the run reached t_end, or where and why it stopped."
    )
    nfev = property(attrgetter("stats.nfev"), doc="Evaluations of the rate of the state.")
    njev = property(attrgetter("stats.njev"), doc="Evaluations of its Jacobian.")
    nlu = property(attrgetter("stats.nlu"), doc="LU factorizations.")

    def _repr_html_(self) -> str | None:
        """The plot that a notebook shows, when a drawing package is installed (extra `viz`)."""
        return _shared.render_html("trajectory", self)

    def __repr__(self) -> str:
        n, stats = self.q.shape[1], self.stats
        what = f"{n} coordinate(s)" if self.qd.shape[1] else f"{n} state(s)"
        rows = f"{counted(len(self.t), 'row')}, t = {self.t[0]:g} .. {self.t[-1]:g} s" if len(self.t) else "no rows"
        happened = "".join([f", {len(crossings.t)} of event {name}" for name, crossings in self.events.items()])
        happened += f", {counted(turns, 'turn')} at surfaces" if (turns := len(self.modes.t) - 1) > 0 else ""
        unknown = ["error not estimated"] if stats.error is None and not METHODS[stats.method].adaptive else []
        said = "; ".join([stats.message, *unknown, *[f"warning: {text}" for text in stats.warnings]])
        return f"<Trajectory of {what}: {rows}{happened}; {stats.method}, {counted(stats.steps, 'step')}, {said}>"
