"""Derivatives of motions: gradients of losses by the discrete adjoint, sensitivities of all states by forward mode."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, entry, kept_by_first

from ...systems.model import Model
from ..applied_force import Constant
from ..events.event import Event
from ..outcome import MotionError
from ..run_options import Options
from ..trajectory import SimulationWarning
from .differentiated_run import DifferentiatedRun
from .doubts import doubts, loss_doubts
from .motion_programs import outputs_at
from .motions import TORQUE, Loss, Motions, motions_of

FEW_MOTIONS = 4  # motions: fewer by a method that iterates are done sooner one by one
WIDE_BLOCK = 16  # motions side by side: whole vectors of any processor, of which what is recorded stays in its caches


@dataclass(frozen=True, eq=False)
class MotionGradient:
    """The value of a loss of a motion, and its gradient; or of N motions, arrays with an axis of N first.

    Attributes
    ----------
    value : float
        The loss; of N motions (N,), NaN as all else of one that does not stay finite or does not reach its end.
    gradients : dict of str to ndarray or float
        By the names of `wrt`: "q" and "qd" (n,), of an OdeSystem "q" (m,); "tau" (n,), or (steps, n) where tau has a
        row a step; of a parameter a number. Where velocities are no rates of coordinates, as of quaternions, "q" is by
        small displacements xi, dq = G(q) xi, (n,).
    t : ndarray, (steps + 1,)
        Where the steps begin, and the last one ends [s]; of N motions in chosen steps start and end alone, (2,).
    q, qd : ndarray, (nq,) and (n,)
        Where the motion ends; of an OdeSystem q is its state and qd is empty.
    checkpoints : int
        Steps between two states that were kept, from which the steps between were made again; 0 where all were kept.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> result = dyn.gradient(arm, lambda q, qd, t: q[0], [0.5], [0.0], t_end=0.1, dt=0.05)
    >>> list(result.gradients), result.t.round(3).tolist(), result.checkpoints
    (['q', 'qd', 'tau'], [0.0, 0.05, 0.1], 0)
    """

    value: Any
    gradients: dict[str, Any]
    t: Array
    q: Array
    qd: Array
    checkpoints: int

    def __getitem__(self, name: str) -> Any:
        """The gradient by one of `wrt`. Raises ValueError for another name."""
        return entry("there is no gradient by", self.gradients, name)


def gradient(
    model: Model,
    loss: Loss | None,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str | None = None,
    *,
    running: Loss | None = None,
    wrt: str | Iterable[str] | None = None,
    tau: Constant | ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, float] | None = None,
    events: Event | Iterable[Event] = (),
    **options: Unpack[Options],
) -> MotionGradient:
    """A loss of a motion and its gradient, by reverse mode through every step, in a few times the motion itself.

    The discrete adjoint: the exact derivative of the numbers that the method computes, to rounding. Steps that are
    chosen by error are those of `simulate`, and count as constants, so that slopes are less exact than the motion: of
    an orbit of eccentricity 0.99 they are good to 7e-5 at the `rtol` by which it is to 2e-8. What `simulate` would warn
    of is a `SimulationWarning`, and so is a loss that is not finite. Where the record of all steps would take more than
    128 MB, one state in every sqrt(steps) is kept, and the steps between are made again.

    Parameters
    ----------
    model, q, qd, t_end
        As for `simulate`.
    loss : callable, optional
        (q, qd, t) or (q, qd, t, p) of the state and time where the motion ends, to a node or a number; of an OdeSystem
        (x, t) or (x, t, p). None for a running loss alone.
    method : str, optional
        A name of `dyn.METHODS`. By default that of `simulate`, "dop853", which chooses its steps; and "rk4" where `dt`
        or a row of forces a step asks for equal ones. Implicit equations and their derivatives are solved to rounding.
    running : callable, optional
        (q, qd, tau, t) or (q, qd, tau, t, p) to a node, summed over the steps, at the state, force and time where each
        begins; of an OdeSystem (x, t) or (x, t, p). An integral is dt times that.
    wrt : str or sequence of str, optional
        What to differentiate by: "q", "qd", "tau" and names of parameters. By default the start and the applied force.
    tau : float, array_like or callable
        Applied force [N m or N]: constant, (n,); of equal steps one row a step, (steps, n), which says how many there
        are; or a controller in closed form, as for `simulate`, whose parameters may be in `wrt`.
    parameters : mapping, optional
        {name: value}, as for `simulate`; and of those that the losses alone read, such as a goal.
    events : Event or iterable of Event
        As for `simulate`: where one ends the motion or resets its state depends on all before. The motion arrives there
        by a step of its own length, so that `value` may differ from that of `simulate` by the error of a step. Not with
        a row of forces a step.
    **options
        Those of `dyn.Options` but `max_steps`, `dense_output`, `fma` and `progress`. The error of equal steps is
        estimated by a motion in steps of half the length, which takes half as long again.

    Returns
    -------
    MotionGradient
        `value`, and the gradient by each name of `wrt`, as `result["q"]`.

    Raises
    ------
    TypeError, ValueError
        For arguments of another type, shape or range, and methods without derivatives.
    MotionError
        For a motion that does not stay finite or does not reach its end.
    SingularMassMatrixError
        For a coordinate without inertia.

    Examples
    --------
    How far a pendulum's angle after a second depends on where it starts, and on torques that change with the steps:

    >>> import numpy as np
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> result = dyn.gradient(arm, lambda q, qd, t: q[0], [0.5], [0.0], t_end=1.0, tau=np.zeros((100, 1)))
    >>> round(result.value, 6), result["q"].round(6).tolist(), result["tau"].shape
    (-0.403412, [-0.880376], (100, 1))
    """
    motions = motions_of(model, q, qd, (loss, running), t_end, method, tau, parameters, wrt, events, options)
    run, values, slopes, said = _gradients(motions)
    for text in said[0]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    nq, x = motions.problem.nq, run.end[:, 0]
    gradients = {name: each[..., 0] if each.ndim > 1 else float(each[0]) for name, each in slopes.items()}
    return MotionGradient(float(values[0]), gradients, run.t, x[:nq], x[nq:], run.checkpoints)


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
    tau: ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    **options: Unpack[Options],
) -> MotionGradient:
    """Losses of N motions and their gradients, each by its own start, forces and parameters: `gradient`, N times.

    Motions in equal steps go side by side, a vector of them at a time; those that choose their steps go one by one, as
    do fewer than four by a method that iterates. One that does not stay finite, whose equations are not solved, or
    which does not reach its end, is NaN, and a `SimulationWarning` says how many are, and of the first when and why.

    Parameters
    ----------
    model, loss, t_end, method, running, wrt, **options
        As for `gradient`.
    q, qd : array_like
        The starts, (N, nq) and (N, n), or (nq,) and (n,) for all; of an OdeSystem q is the state, and qd None.
    tau : float, array_like or callable
        Applied force [N m or N]: constant, (n,) or (N, n); a row a step, (N, steps, n); or a controller in closed form.
    parameters : mapping, optional
        As for `gradient`, a number for all or one for each motion, (N,).

    Returns
    -------
    MotionGradient
        `value`, (N,), and the gradients by each name of `wrt`, with an axis of N first.

    Raises
    ------
    TypeError, ValueError, SingularMassMatrixError
        As `gradient` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.5], [1.0], [2.0]], [0.0], t_end=1.0, wrt="q")
    >>> fan["q"].round(4).tolist(), fan.value.shape
    ([[-0.8804], [-1.1123], [-0.595]], (3,))
    """
    motions = motions_of(model, q, qd, (loss, running), t_end, method, tau, parameters, wrt, (), options, many=True)
    count, problem, settings = motions.many, motions.problem, motions.options
    values, end, checkpoints = np.full(count, np.nan), np.full((count, problem.size), np.nan), 0
    nothing = motions.by_names(np.full_like(motions.point(motions.x, 0.0), np.nan))
    gradients = {name: each.T.copy() for name, each in nothing.items()}
    if motions.each_step and TORQUE in gradients:
        gradients[TORQUE] = np.full((count, *motions.tau.shape[:-1]), np.nan)
    # one by one, or side by side, of which a last one goes with those before it
    alone = (
        settings.adaptive
        or bool(motions.equations.modes)
        or (count < FEW_MOTIONS and settings.integrator.step(problem).iterates)
    )
    begins = [*(range(count) if alone else range(0, max(1, count - 1), WIDE_BLOCK)), count]
    early, said, parts = dict[int, str](), dict[int, str](), [range(*ends) for ends in itertools.pairwise(begins)]
    for part in parts:
        try:
            run, losses_of_part, slopes, sentences = _gradients(motions.of(slice(part.start, part.stop)))
        except MotionError as error:
            if len(part) == 1:
                early[part[0]] = str(error)
            else:  # one of them has no derivative
                parts += [range(k, k + 1) for k in part]
            continue
        checkpoints = max(checkpoints, run.checkpoints)
        arrived = np.asarray(np.isfinite(run.end).all(axis=0))
        results = [(values, losses_of_part), (end, run.end), *[(gradients[name], slopes[name]) for name in slopes]]
        for table, array in results:
            table[part.start : part.stop][arrived] = np.moveaxis(array, -1, 0)[arrived]
        for k, whole, texts in zip(part, arrived, sentences, strict=True):
            if not whole:
                early[k] = f"the motion {run.stopped(k - part[0], run.segments[0])}"
            elif texts:
                said[k] = texts[0]
    for each, what in ((early, "stopped early"), (said, "doubtful")):
        if each:
            first, text = min(each.items())
            text = f"{len(each)} of {count} motions {what}: motion {first}: {text}"
            warnings.warn(text, SimulationWarning, stacklevel=2)
    t = motions.steps[0].t.copy() if motions.steps else np.array([motions.span.t0, motions.span.t_end])
    return MotionGradient(values, gradients, t, end[:, : problem.nq], end[:, problem.nq :], checkpoints)


def _gradients(motions: Motions) -> tuple[DifferentiatedRun, Array, dict[str, Array], list[list[str]]]:
    """The run of motions, losses (N,), their gradients (.., N) by names, and doubts of every motion."""
    if motions.final is None and motions.running is None:
        raise ValueError("a loss is needed: of the end of the motion, `loss`, of how it goes, `running`, or both")
    run, m = DifferentiatedRun(motions), motions.problem.size
    point = motions.point(run.x, float(run.t[-1]))
    value, end = np.zeros(motions.many), np.zeros_like(point)
    if motions.final is not None:
        value, *slopes = outputs_at(_loss_and_slopes(motions.final), motions.options.backend, point)
        end = np.array(slopes)
    start, rows = run.cotangents(end)
    gradients, values = motions.by_names(start), value + run.loss
    if motions.each_step and TORQUE in gradients:
        rows[-1] += end[m + 1 :][: motions.equations.forces]  # what the final loss has of the force itself
        gradients[TORQUE] = rows
    return run, values, gradients, loss_doubts(run, values, gradients, start[:m], end[:m])


@kept_by_first
def _loss_and_slopes(loss: Graph) -> Graph:
    """A loss, and its slopes by all inputs."""
    slopes = {f"slope{k}": node for k, node in enumerate(cg.gradient(loss).outputs.values())}
    return cg.simplify(Graph(loss.inputs, {"loss": loss.only_output()} | slopes))


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
        OdeSystem (T, m, m) by "q", and (T, m) by a parameter. By "q" they are as those of `MotionGradient`.
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
        """The derivatives by one of `wrt`. Raises ValueError for another name."""
        return entry("there is no derivative by", self.derivatives, name)


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
    model, q, qd, t_end, method, wrt, parameters, **options
        As for `gradient`.
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
    motions = motions_of(model, q, qd, (None, None), t_end, method, tau, parameters, wrt, events, options)
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
