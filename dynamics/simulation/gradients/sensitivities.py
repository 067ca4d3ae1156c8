"""Sensitivities of motions: how every state of a motion depends on its start and parameters, by forward mode."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array

from ...systems.model import Model
from ..applied_force import Constant
from ..events.event import Event, as_events
from ..steps.row_values import values_of
from ..trajectory import SimulationWarning
from .doubts import doubts
from .motion import START, TORQUE, VELOCITY, MotionRequest, motion_of
from .segments import segments_of


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """A motion, and the derivatives of its states.

    Attributes
    ----------
    t : ndarray, (T,)
        Times of the rows: the start, and the end of every step [s].
    q, qd : ndarray, (T, nq) and (T, n)
        The motion; of an OdeSystem q is its state and qd has no columns.
    derivatives : dict of str to ndarray
        By the names of `wrt`, those of the state x = (q, qd), of m numbers: (T, m, n) by "q", "qd" and "tau", of an
        OdeSystem (T, m, m) by "q", and (T, m) by a parameter. Where velocities are no rates of coordinates, those by
        "q" are by small displacements xi, dq = G(q) xi.
    times : dict of str to ndarray
        Those of `t`, (T, n), (T, m) or (T,): 0 but where an event is, and at equal steps after it. What a row has at a
        fixed time is `derivatives` less the rate of the state times this.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> result = dyn.sensitivities(arm, [0.5], [0.0], t_end=0.1, dt=0.05, wrt="q")
    >>> result.t.round(3).tolist(), result["q"].shape
    ([0.0, 0.05, 0.1], (3, 2, 1))
    """

    t: Array
    q: Array
    qd: Array
    derivatives: dict[str, Array]
    times: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        """The derivatives by one of `wrt`. Raises KeyError for another name."""
        return self.derivatives[name]


def sensitivities(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str | None = None,
    *,
    wrt: str | Iterable[str] | None = None,
    t0: float = 0.0,
    t_span: ArrayLike | None = None,
    dt: float | None = None,
    max_step: float | None = None,
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    first_step: float | None = None,
    tau: Constant | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, float] | None = None,
    events: Event | Iterable[Event] = (),
    estimate_error: bool | None = None,
    backend: str = "auto",
    form: str = "velocity",
) -> Sensitivities:
    """A motion and the derivatives of all its states, by forward mode through every step.

    The derivatives are those of the numbers that the method computes, exact to rounding; steps that are chosen by error
    count as constants. Their cost grows with the number of columns; `gradient` gives one loss by any number of inputs.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd, t_end, t0, t_span, dt, max_step, rtol, atol, first_step, parameters, backend, form
        As for `simulate`.
    method, estimate_error
        As for `gradient`.
    wrt : str or sequence of str, optional
        What to differentiate by: "q", "qd", "tau" and names of parameters. By default the start and the applied force.
    tau : float, sequence or callable
        Applied force [N m or N], constant, or a controller in closed form.
    events : Event or iterable of Event
        As for `gradient`. Where one resets the state there are two rows, before and after.

    Returns
    -------
    Sensitivities
        `t`, `q`, `qd`, and the derivatives by each name of `wrt`, as `result["q"]`.

    Raises
    ------
    TypeError, ValueError, MotionError, SingularMassMatrixError
        As `gradient` does.

    Examples
    --------
    How a pendulum's angle and velocity depend on its mass after one second and after two:

    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(["m"], [1.0], damping=0.5, parameters={"m": 1.0})
    >>> result = dyn.sensitivities(arm, [0.5], [0.0], t_end=2.0, dt=0.01, wrt=["m"])
    >>> result["m"][[100, 200]].round(4).tolist()
    [[-0.1275, 0.4627], [0.0445, -0.6321]]
    """
    options: dict[str, Any] = {"dt": dt, "max_step": max_step, "rtol": rtol, "atol": atol, "first_step": first_step}
    options |= {"estimate_error": estimate_error, "backend": backend}
    span, watched = (t_end, t0, t_span), as_events(events)
    motion = motion_of(model, q, qd, span, method, tau, parameters, wrt, form, watched, **options)
    if motion.each_step:
        raise ValueError(f"tau must be constant, (n,), got shape {motion.tau.shape[:-1]}: gradient takes a row a step")
    directions, columns = _directions(motion)
    segments = segments_of(motion, watched, forwards=True)
    for text in doubts(segments, np.zeros(1), {})[0]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    t, x, t_dot, x_dot = segments.tangents(directions)
    derivatives = {name: x_dot[:, :, place] for name, place in columns.items()}
    times = {name: t_dot[:, place] for name, place in columns.items()}
    nq = motion.problem.nq
    return Sensitivities(t, x[:, :nq], x[:, nq:], derivatives, times)


def _directions(motion: MotionRequest) -> tuple[dict[str, Array], dict[str, int | slice]]:
    """Tangents of x, tau and p, a column for each number of `wrt`; and where the columns of each name are."""
    problem, nq, equations = motion.problem, motion.problem.nq, motion.equations
    lengths = {"x": problem.size, **equations.lengths}
    begin = dict(zip(lengths, np.cumsum([0, *lengths.values()]), strict=False))  # of rows, those of each register
    units = np.eye(sum(lengths.values()))
    by = {VELOCITY: units[:, nq : problem.size], TORQUE: units[:, begin[TORQUE] :][:, : motion.forces]}
    if motion.by_parameters:
        along = units[:, begin["p"] :] @ equations.columns(motion.values[: len(equations.names), 0], motion.backend)
        by |= {name: along[:, [k]] for k, name in enumerate(equations.names)}
    if START in motion.wrt:
        by[START] = units[:, :nq] @ _displacements(motion)
    columns: dict[str, int | slice] = {}
    at = 0
    for name in motion.wrt:
        columns[name] = slice(at, at + by[name].shape[1]) if name in (START, VELOCITY, TORQUE) else at
        at += by[name].shape[1]
    whole = np.concatenate([by[name] for name in motion.wrt], axis=1)
    return {name: whole[begin[name] :][:length] for name, length in lengths.items()}, columns


def _displacements(motion: MotionRequest) -> Array:
    """dq of displacements of the coordinates, (nq, n): G(q), or 1."""
    system, nq = motion.problem.system, motion.problem.nq
    if system is None or system.kinematics.quasi is None:
        return np.eye(nq)
    rates = cg.jacobian(
        Graph([*system.q, *system.qd], {f"{k}": rate for k, rate in enumerate(system.q_dot)}), system.qd
    )
    return values_of(rates, motion.x[:, 0].tolist()).reshape(nq, system.n)
