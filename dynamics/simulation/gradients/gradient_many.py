"""Gradients of many motions of one model, by programs that are made once."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph.extend import Array, real_array

from ...integrators import METHODS, Problem, derive, in_form
from ...systems.model import Model
from ..applied_forces import with_applied
from ..ensembles.initial_states import starts
from ..run_options import time_span
from ..sampled_controller import SampledController
from ..trajectory import SimulationWarning
from .doubts import doubts
from .gradient import Loss, differentiated
from .motion import (
    START,
    TORQUE,
    VELOCITY,
    MotionError,
    MotionOf,
    changing_forces,
    equal_leg,
    legs_of,
    names_of,
    options_of,
)
from .motion_equations import motion_equations

FEW = 4  # motions: fewer by a method that iterates are done sooner one by one
WIDE = 16  # motions side by side: whole vectors of any processor, of which what is recorded stays in its caches


@dataclass(frozen=True, eq=False)
class MotionGradients:
    """The losses of N motions, and their gradients.

    Attributes
    ----------
    value : ndarray, (N,)
        The losses; NaN, as all else, of a motion that does not stay finite or does not reach its end.
    gradients : dict of str to ndarray
        As of `MotionGradient`, with an axis of N first.
    t : ndarray, (steps + 1,)
        Where equal steps begin, and the last one ends [s]. Of chosen steps, which each motion has for itself, its start
        and end alone, (2,).
    q, qd : ndarray, (N, nq) and (N, n)
        Where the motions end.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.1], [0.2], [0.3]], [0.0], t_end=0.1, dt=0.05)
    >>> fan.value.shape, fan["q"].shape, fan.q.shape
    ((3,), (3, 1), (3, 1))
    """

    value: Array
    gradients: dict[str, Array]
    t: Array
    q: Array
    qd: Array

    def __getitem__(self, name: str) -> Array:
        """The gradients by one of `wrt`. Raises KeyError for another name."""
        return self.gradients[name]


def gradient_many(
    model: Model,
    loss: Loss | None,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str | None = None,
    *,
    running: Loss | None = None,
    wrt: str | Iterable[str] | None = None,
    t0: float = 0.0,
    t_span: ArrayLike | None = None,
    dt: float | None = None,
    max_step: float | None = None,
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    first_step: float | None = None,
    tau: ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    estimate_error: bool | None = None,
    backend: str = "auto",
    form: str = "velocity",
) -> MotionGradients:
    """Losses of N motions and their gradients, each by its own start, forces and parameters: `gradient`, N times.

    Motions in equal steps go side by side, a vector of them at a time; those that choose their steps go one by one, as
    do fewer than four by a method that iterates. One that does not stay finite, whose equations are not solved, or
    which does not reach its end, is NaN, and a `SimulationWarning` says how many are, and of the first when and why.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The starts, (N, nq) and (N, n), or (nq,) and (n,) for all; of an OdeSystem q is the state, and qd None.
    loss, t_end, running, wrt, t0, t_span, dt, max_step, rtol, atol, first_step, estimate_error, backend, form
        As for `gradient`.
    method : str, optional
        As for `gradient`: "dop853", and "rk4" where `dt` or a row of forces a step asks for equal steps.
    tau : float, array_like or callable
        Applied force [N m or N]: constant, (n,) or (N, n); a row a step, (N, steps, n); or a controller in closed form.
    parameters : mapping, optional
        {name: value}, a number for all or one for each motion, (N,).

    Returns
    -------
    MotionGradients
        `value`, (N,), and the gradients by each name of `wrt`.

    Raises
    ------
    TypeError, ValueError, SingularMassMatrixError
        As `gradient` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.5], [1.0], [2.0]], [0.0], t_end=1.0, wrt="q")
    >>> fan["q"].round(4).tolist()
    [[-0.8804], [-1.1123], [-0.595]]
    """
    options = {"dt": dt, "max_step": max_step, "rtol": rtol, "atol": atol, "first_step": first_step, "backend": backend}
    options |= {"estimate_error": estimate_error}
    motions, problem = _motions(model, q, qd, time_span(t_end, t0, t_span), method, tau, parameters, wrt, options, form)
    count, nq, run = motions.many, problem.nq, motions.options
    parts = _parts(motions)
    value, end = np.full(count, np.nan), np.full((count, problem.size), np.nan)
    by_name = {name: np.full((count, *shape), np.nan) for name, shape in _shapes(motions).items()}
    early, said = dict[int, str](), dict[int, str]()
    for part in parts:
        first = part if isinstance(part, int) else part.start
        try:
            motion = _some(motions, problem, part)
            losses, slopes, legs, ends = differentiated(motion, loss, running)
        except MotionError as error:
            if isinstance(part, int):
                early[first] = str(error)
            else:  # one of them has no derivative
                parts += range(first, part.stop)
            continue
        arrived, texts = np.atleast_1d(np.isfinite(legs.end).all(axis=0)), doubts(legs, losses, slopes, ends)
        rows = first + np.flatnonzero(arrived)
        value[rows], end[rows] = np.atleast_1d(losses)[arrived], _by_motion(legs.end, part)[arrived]
        for name, array in slopes.items():
            by_name[name][rows] = _by_motion(array, part)[arrived]
        for k, whole in enumerate(arrived):
            if not whole:
                early[first + k] = f"the motion {legs.runs[0].stopped(k)}"
            elif texts[k]:
                said[first + k] = texts[k][0]
    for sentences, what in ((early, "stopped early"), (said, "doubtful")):
        if sentences:
            first, text = min(sentences.items())
            text = f"{len(sentences)} of {count} motions {what}: motion {first}: {text}"
            warnings.warn(text, SimulationWarning, stacklevel=2)
    t = motions.legs[0].t.copy() if motions.legs else np.array([run.t0, run.t_end])
    return MotionGradients(value, by_name, t, end[:, :nq], end[:, nq:])


def _parts(motions: MotionOf) -> list[int | slice]:
    """The motions that go one by one, or side by side."""
    count = motions.many
    if motions.options.adaptive or (count < FEW and motions.method.step(motions.problem).iterates):
        return [*range(count)]
    return [slice(k, min(k + WIDE, count)) for k in range(0, count, WIDE)]


def _shapes(motions: MotionOf) -> dict[str, tuple[int, ...]]:
    """Of the gradients of a motion, by the names of `wrt`."""
    problem, nq = motions.problem, motions.problem.nq
    n = problem.size - nq
    shapes = {START: (nq if problem.system is None else n,), VELOCITY: (n,), TORQUE: motions.tau.shape[:-1]}
    return {name: shapes.get(name, ()) for name in motions.wrt}


def _by_motion(array: Any, part: int | slice) -> Array:
    """With the axis of the motions, of which there may be one, first."""
    rows = np.asarray(array, dtype=np.float64)
    return np.moveaxis(rows, -1, 0) if isinstance(part, slice) else rows[None]


def _some(motions: MotionOf, problem: Problem, part: int | slice) -> MotionOf:
    """One of the motions, or some of them; one by chosen steps with these. problem: without numbers of parameters."""
    some = replace(motions, x=motions.x[:, part], tau=motions.tau[..., part], values=motions.values[:, part])
    if motions.legs:
        return some
    parameters = np.concatenate([some.tau, some.values])[: len(problem.parameters)]
    legs, said = legs_of(problem, motions.options, (), some.x, parameters)
    return replace(some, legs=legs, said=said)


def _motions(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    span: tuple[float, float],
    method: str | None,
    tau: Any,
    parameters: Mapping[str, ArrayLike] | None,
    wrt: str | Iterable[str] | None,
    options: Mapping[str, Any],
    form: str,
) -> tuple[MotionOf, Problem]:
    """The motions of checked arguments, side by side, those by chosen steps without legs; and their problem."""
    t0, t_end = span
    if isinstance(tau, SampledController):
        raise TypeError("tau must be numbers or a controller in closed form, got a SampledController")
    rows = _rows(tau)
    run = options_of(t_end, method, t0, options, rows=rows is not None)
    if run.adaptive and rows is not None:
        needed = f"equal steps: method {method!r} chooses its steps"
        raise ValueError(f"tau of shape {rows.shape} is one row a step, which needs {needed}")
    moving, applied = with_applied(model, 0.0 if rows is not None or not callable(tau) else tau, parameters)
    constant = 0.0 if rows is not None or callable(tau) else tau
    if rows is not None:  # a motion for each of their first forces
        constant = rows[:, 0]
    start = starts(moving, q, qd, constant, parameters, t0)
    run.check(start.states)
    chosen, count = names_of(moving, wrt, closed=callable(tau)), len(start.x)
    forced = rows is not None or TORQUE in chosen or np.ndim(constant) == 2
    inputs = changing_forces(moving, start.same, forced=forced)
    free = {*inputs, *chosen, *start.varied, *(parameters or ())}
    problem = in_form(derive(moving, {name: value for name, value in start.same.items() if name not in free}), form)
    columns, equations = start.same | start.varied, motion_equations(problem, len(inputs))
    forces, values = (
        np.array([np.broadcast_to(columns[name], count) for name in names], dtype=np.float64).reshape(len(names), count)
        for names in (inputs, equations.names)
    )
    if rows is not None:
        forces = np.broadcast_to(np.moveaxis(rows, 0, -1), (*rows.shape[1:], count))
    motions = MotionOf(
        equations,
        METHODS[run.method],
        start.x.T.copy(),
        () if run.adaptive else (equal_leg(run, None if rows is None else rows.shape[1]),),
        np.empty(0),
        np.empty(0),
        forces,
        rows is not None,
        equations.values(values, run.backend),
        chosen,
        applied.nodes,
        run,
    )
    return motions, problem


def _rows(tau: Any) -> Array | None:
    """tau where it is one row a step, (N, steps, n)."""
    if callable(tau) or (rows := real_array("tau", tau)).ndim != 3:
        return None
    if not rows.size or not np.isfinite(rows).all():
        raise ValueError(f"tau must be finite numbers of the shape (N, steps, n), got shape {rows.shape}")
    return rows
