"""Sensitivities of motions: how every state of a motion depends on its start and parameters, by forward mode."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array

from ...systems.model import Model
from ..applied_force import Constant
from ..events.event import Event
from ..run_options import Options
from ..trajectory import SimulationWarning
from .differentiated_run import DifferentiatedRun
from .doubts import doubts
from .motions import Differentiation


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
    tau: Constant | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, float] | None = None,
    events: Event | Iterable[Event] = (),
    **options: Unpack[Options],
) -> Sensitivities:
    """A motion and the derivatives of all its states, by forward mode through every step.

    The derivatives are those of the numbers that the method computes, exact to rounding; steps that are chosen by error
    count as constants. Their cost grows with the number of columns; `gradient` gives one loss by any number of inputs.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd, t_end, parameters
        As for `simulate`.
    method, **options
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
    motions = Differentiation(model, (None, None), t_end, method, tau, parameters, wrt, events, options)(q, qd)
    if motions.each_step:
        raise ValueError(f"tau must be constant, (n,), got shape {motions.tau.shape[:-1]}: gradient takes a row a step")
    run = DifferentiatedRun(motions, forwards=True)
    for text in doubts(run)[0]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    # a column for each number of `wrt`: the transpose of how cotangents of it are made of those of x, t and inputs
    units = np.eye(motions.problem.size + 1 + len(motions.inputs))
    by = {name: np.atleast_2d(rows) for name, rows in motions.of([0] * len(units)).by_names(units).items()}
    t, x, t_dot, x_dot = run.tangents(np.concatenate([*by.values()]).T)
    ends, nq = np.cumsum([len(rows) for rows in by.values()]), motions.problem.nq
    columns: dict[str, Any] = {name: slice(end - len(by[name]), end) for name, end in zip(by, ends, strict=True)}
    columns |= {name: end - 1 for name, end in zip(by, ends, strict=True) if name in motions.equations.names}
    derivatives = {name: x_dot[:, :, place] for name, place in columns.items()}
    times = {name: t_dot[:, place] for name, place in columns.items()}
    return Sensitivities(t, x[:, :nq], x[:, nq:], derivatives, times)
