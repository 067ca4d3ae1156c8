"""Gradients of motions, one or many: losses of where they end and how they go, by the discrete adjoint."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, memo
from cgraph.extend import topological

from ...integrators import Problem, quantity
from ...systems.model import Model
from ..applied_force import Constant
from ..events.event import Event, as_events
from ..outcome import MotionError
from ..run_options import Options
from ..trajectory import SimulationWarning
from .differentiated_run import DifferentiatedRun
from .doubts import doubts
from .motion_programs import outputs_at
from .motions import TORQUE, Loss, Motions, motions_of

LOSSES_KEPT = 64  # losses whose graphs stay for another run
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
        Where the steps begin, and the last one ends [s]. Of N motions in chosen steps, which each has for itself, start
        and end alone, (2,).
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
        """The gradient by one of `wrt`. Raises KeyError for another name."""
        return self.gradients[name]


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
    of is a `SimulationWarning` here, too, and so is a loss that is not finite. Every step is run once and pulled back
    once, as machine code; where what that needs of all of them would take more than 128 MB, one state in every
    sqrt(steps) is kept, and the steps between are made again.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    loss : callable, optional
        (q, qd, t) or (q, qd, t, p) of the state and time where the motion ends, to a node or a number; of an OdeSystem
        (x, t) or (x, t, p). None for a running loss alone.
    q, qd, t_end
        As for `simulate`.
    parameters : mapping, optional
        {name: value} in place of the model's own, and of those of a controller, as for `simulate`; and of those that
        the losses alone read, such as a goal.
    method : str, optional
        A name of `dyn.METHODS`, of equal or chosen steps. By default that of `simulate`, "dop853", which chooses its
        steps; and "rk4" where `dt` or a row of forces a step asks for equal ones. Equations that are
        iterated are solved to rounding, of implicit methods and of their derivatives.
    running : callable, optional
        (q, qd, tau, t) or (q, qd, tau, t, p) to a node, summed over the steps, at the state, force and time where each
        begins; of an OdeSystem (x, t) or (x, t, p). An integral is dt times that.
    wrt : str or sequence of str, optional
        What to differentiate by: "q", "qd", "tau" and names of parameters. By default the start and the applied force.
    tau : float, array_like or callable
        Applied force [N m or N]: constant, (n,); of equal steps one row a step, (steps, n), which says how many there
        are; or a controller in closed form, as for `simulate`, whose parameters may be in `wrt`.
    events : Event or iterable of Event
        Those of `simulate`: where one ends the motion or resets its state depends on all before, and so do the steps
        after it. The motion arrives there by a step of its own length, where `simulate` reads the state off its dense
        output: `value` may differ from that of its run by the error of a step. Not with a row of forces a step.
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
    losses = loss, running
    motions = motions_of(model, q, qd, t_end, method, tau, parameters, wrt, as_events(events), losses, options)
    run, values, slopes, bars = losses_and_gradients(motions, *losses)
    for text in doubts(run, values, slopes, bars)[0]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    nq, x = motions.problem.nq, run.end[:, 0]
    gradients = {name: each[..., 0] if each.ndim > 1 else float(each[0]) for name, each in slopes.items()}
    return MotionGradient(float(values[0]), gradients, run.t, x[:nq], x[nq:], run.checkpoints)


def losses_and_gradients(
    motions: Motions, loss: Loss | None, running: Loss | None
) -> tuple[DifferentiatedRun, Array, dict[str, Array], tuple[Array, Array]]:
    """The run of motions, losses (N,), their gradients (.., N) by names, and their slopes by start and end, (m, N)."""
    problem, equations = motions.problem, motions.equations
    if loss is None and running is None:
        raise ValueError("a loss is needed: of the end of the motion, `loss`, of how it goes, `running`, or both")
    final = None if loss is None else loss_graph(problem, quantity(problem, "loss", loss, constant=True))
    total = None
    if running is not None:
        total = loss_graph(problem, quantity(problem, "running", running, motions.applied, constant=True))
    run = DifferentiatedRun(motions, total)
    point = run.motions.point(run.x, float(run.t[-1]))
    value, *slopes = (
        np.zeros_like(point[:1])
        if final is None
        else outputs_at(loss_and_slopes(final, motions.options.backend), point)
    )
    end = np.array(slopes) if slopes else np.zeros_like(point)
    start, rows = run.cotangents(end)
    gradients = motions.by_names(start)
    if motions.each_step and TORQUE in gradients:
        rows[-1] += end[problem.size + 1 :][: equations.forces]  # what the final loss has of the force itself
        gradients[TORQUE] = rows
    return run, value + run.loss, gradients, (start[: problem.size], end[: problem.size])


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
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The starts, (N, nq) and (N, n), or (nq,) and (n,) for all; of an OdeSystem q is the state, and qd None.
    loss, t_end, running, wrt, **options
        As for `gradient`.
    method : str, optional
        As for `gradient`: "dop853", and "rk4" where `dt` or a row of forces a step asks for equal steps.
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
    losses = loss, running
    motions = motions_of(model, q, qd, t_end, method, tau, parameters, wrt, (), losses, options, many=True)
    count, problem, run_options = motions.many, motions.problem, motions.options
    value, end, checkpoints = np.full(count, np.nan), np.full((count, problem.size), np.nan), 0
    by_name = {name: each.T.copy() for name, each in motions.by_names(np.full_like(motions.point(), np.nan)).items()}
    if motions.each_step and TORQUE in by_name:
        by_name[TORQUE] = np.full((count, *motions.tau.shape[:-1]), np.nan)
    # one by one, or side by side, of which a last one goes with those before it
    alone = run_options.adaptive or (count < FEW_MOTIONS and run_options.integrator.step(problem).iterates)
    begins = [*(range(count) if alone else range(0, max(1, count - 1), WIDE_BLOCK)), count]
    early, said, parts = dict[int, str](), dict[int, str](), [range(*ends) for ends in itertools.pairwise(begins)]
    for part in parts:
        try:
            run, losses_of_part, slopes, bars = losses_and_gradients(motions.of(slice(part.start, part.stop)), *losses)
        except MotionError as error:
            if len(part) == 1:
                early[part[0]] = str(error)
            else:  # one of them has no derivative
                parts += [range(k, k + 1) for k in part]
            continue
        checkpoints = max(checkpoints, run.checkpoints)
        arrived = np.asarray(np.isfinite(run.end).all(axis=0))
        rows = part.start + np.flatnonzero(arrived)
        results = [(value, losses_of_part), (end, run.end), *[(by_name[name], slopes[name]) for name in slopes]]
        for table, array in results:
            table[rows] = np.moveaxis(array, -1, 0)[arrived]
        for number, whole, sentences in zip(part, arrived, doubts(run, losses_of_part, slopes, bars), strict=True):
            if not whole:
                early[number] = f"the motion {run.stopped(number - part[0], run.segments[0])}"
            elif sentences:
                said[number] = sentences[0]
    for each, what in ((early, "stopped early"), (said, "doubtful")):
        if each:
            first, text = min(each.items())
            text = f"{len(each)} of {count} motions {what}: motion {first}: {text}"
            warnings.warn(text, SimulationWarning, stacklevel=2)
    t = motions.steps[0].t.copy() if motions.steps else np.array([run_options.t0, run_options.t_end])
    return MotionGradient(value, by_name, t, end[:, : problem.nq], end[:, problem.nq :], checkpoints)


@dataclass(frozen=True)
class _Quantity:
    """A quantity of a problem, known by its operations, so that what is derived from it is derived once."""

    problem: Problem
    key: tuple[object, ...]
    node: Node = field(compare=False)


def loss_graph(problem: Problem, node: Node) -> Graph:
    """The loss over the states, t and parameters; the same object for an equal one."""
    order = topological([node])
    places = {each: k for k, each in enumerate(order)}
    leaves = [each.name if each.value is None else float(each.value).hex() for each in order]  # 0.0 and -0.0 apart
    key = [(each.op.name, leaf, *[places[arg] for arg in each.args]) for each, leaf in zip(order, leaves, strict=True)]
    return _bound(_Quantity(problem, tuple(key), node))


@memo(LOSSES_KEPT)
def _bound(quantity: _Quantity) -> Graph:
    return quantity.problem.observed({"loss": quantity.node})


@kept_by_first
def loss_and_slopes(graph: Graph, backend: str) -> Any:
    """The loss, and its slopes by all inputs, as a function."""
    slopes = cg.gradient(graph)
    both = {"loss": graph.only_output()} | {f"slope{k}": node for k, node in enumerate(slopes.outputs.values())}
    return cg.compile(cg.simplify(Graph(graph.inputs, both)), backend)
