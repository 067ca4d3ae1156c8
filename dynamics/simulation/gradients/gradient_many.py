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

from ...integrators import METHODS, derive, in_form
from ...systems.model import Model
from ..applied_forces import with_applied
from ..ensembles.initial_states import starts
from ..run_options import time_span
from ..sampled_controller import SampledController
from ..trajectory import SimulationWarning
from .gradient import Loss, differentiated
from .missed_legs import missed_legs
from .motion import TORQUE, MotionOf, changing_forces, equal_leg, names_of, options_of
from .motion_equations import motion_equations

WIDE = 16  # motions side by side: whole vectors of any processor, of which what is recorded stays in its caches


@dataclass(frozen=True, eq=False)
class MotionGradients:
    """The losses of N motions, and their gradients.

    Attributes
    ----------
    value : ndarray, (N,)
        The losses; NaN of a motion that does not stay finite.
    gradients : dict of str to ndarray
        As of `MotionGradient`, with an axis of N first.
    t : ndarray, (steps + 1,)
        Where the steps begin, and the last one ends [s].
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
    method: str = "rk4",
    *,
    running: Loss | None = None,
    wrt: str | Iterable[str] | None = None,
    t0: float = 0.0,
    t_span: ArrayLike | None = None,
    dt: float | None = None,
    tau: ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    backend: str = "auto",
    form: str = "velocity",
) -> MotionGradients:
    """Losses of N motions and their gradients, each by its own start, forces and parameters: `gradient`, N times.

    Motions go side by side, a vector of them at a time, where the steps do not branch on the state: by explicit methods
    and "verlet" of a constant mass matrix; else one by one.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The starts, (N, nq) and (N, n), or (nq,) and (n,) for all; of an OdeSystem q is the state, and qd None.
    loss, t_end, running, wrt, t0, t_span, dt, backend, form
        As for `gradient`.
    method : str
        As for `gradient`, of equal steps.
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
    TypeError, ValueError, MotionError, SingularMassMatrixError
        As `gradient` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.5], [1.0], [2.0]], [0.0], t_end=1.0, wrt="q")
    >>> fan["q"].round(4).tolist()
    [[-0.8804], [-1.1123], [-0.595]]
    """
    options = {"dt": dt, "backend": backend}
    motions = _motions(model, q, qd, time_span(t_end, t0, t_span), method, tau, parameters, wrt, options, form)
    step = motions.method.step
    assert step is not None
    if step(motions.problem).branches:
        parts: list[int | slice] = list(range(motions.many))
    else:
        parts = [slice(k, k + WIDE) for k in range(0, motions.many, WIDE)]
    values, gradients, ends, said = [], [], [], ""
    for part in parts:
        value, by_name, legs = differentiated(_some(motions, part), loss, running)
        said = said or missed_legs(legs, first=part if isinstance(part, int) else part.start)
        values.append(np.atleast_1d(value))
        gradients.append({name: _by_motion(array, part) for name, array in by_name.items()})
        ends.append(_by_motion(legs.end, part))
    if said:
        warnings.warn(said, SimulationWarning, stacklevel=2)
    rows, nq = np.concatenate(ends), motions.problem.nq
    joined = {name: np.concatenate([each[name] for each in gradients]) for name in motions.wrt}
    return MotionGradients(np.concatenate(values), joined, legs.t, rows[:, :nq], rows[:, nq:])


def _by_motion(array: Any, part: int | slice) -> Array:
    """With the axis of the motions, of which there may be one, first."""
    rows = np.asarray(array, dtype=np.float64)
    return np.moveaxis(rows, -1, 0) if isinstance(part, slice) else rows[None]


def _some(motions: MotionOf, part: int | slice) -> MotionOf:
    return replace(motions, x=motions.x[:, part], tau=motions.tau[..., part], values=motions.values[:, part])


def _motions(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    span: tuple[float, float],
    method: str,
    tau: Any,
    parameters: Mapping[str, ArrayLike] | None,
    wrt: str | Iterable[str] | None,
    options: Mapping[str, Any],
    form: str,
) -> MotionOf:
    """The motions of checked arguments, side by side."""
    t0, t_end = span
    if isinstance(tau, SampledController):
        raise TypeError("tau must be numbers or a controller in closed form, got a SampledController")
    rows = _rows(tau)
    run = options_of(t_end, method, t0, options)
    if run.adaptive:
        raise ValueError(f"gradient_many needs equal steps, and method {method!r} chooses its steps: take gradient")
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
    return MotionOf(
        equations,
        METHODS[method],
        start.x.T.copy(),
        (equal_leg(run, None if rows is None else rows.shape[1]),),
        np.empty(0),
        np.empty(0),
        forces,
        rows is not None,
        equations.values(values, run.backend),
        chosen,
        applied.nodes,
        run.backend,
    )


def _rows(tau: Any) -> Array | None:
    """tau where it is one row a step, (N, steps, n)."""
    if callable(tau) or (rows := real_array("tau", tau)).ndim != 3:
        return None
    if not rows.size or not np.isfinite(rows).all():
        raise ValueError(f"tau must be finite numbers of the shape (N, steps, n), got shape {rows.shape}")
    return rows
