"""Gradients of motions: a loss of where a motion ends and of how it goes, differentiated by the discrete adjoint."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, memo
from cgraph.extend import Builder, topological

from ...integrators import Problem, quantity
from ...systems.arguments import Parameters, call_user_function
from ...systems.model import Model, as_equations
from ...systems.ode_system import OdeSystem
from ...systems.system import System
from ..applied_force import Constant
from ..events.event import Event, as_events
from ..trajectory import SimulationWarning
from .doubts import doubts
from .motion import START, TORQUE, VELOCITY, MotionRequest, motion_of
from .motion_equations import at
from .segments import Bars, MotionSegments, segments_of

Loss = Callable[..., Node | float]
LOSSES_KEPT = 64  # losses whose graphs stay for another run


@dataclass(frozen=True, eq=False)
class MotionGradient:
    """The value of a loss of a motion, and its gradient.

    Attributes
    ----------
    value : float
        The loss.
    gradients : dict of str to ndarray or float
        By the names of `wrt`: "q" and "qd" (n,), of an OdeSystem "q" (m,); "tau" (n,), or (steps, n) where tau has a
        row a step; of a parameter a number. Where velocities are no rates of coordinates, as of quaternions, "q" is by
        small displacements xi, dq = G(q) xi, (n,).
    t : ndarray, (steps + 1,)
        Where the steps begin, and the last one ends [s].
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

    value: float
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
    t0: float = 0.0,
    t_span: ArrayLike | None = None,
    dt: float | None = None,
    max_step: float | None = None,
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    first_step: float | None = None,
    tau: Constant | ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, float] | None = None,
    events: Event | Iterable[Event] = (),
    estimate_error: bool | None = None,
    backend: str = "auto",
    form: str = "velocity",
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
    q, qd, t_end, t0, t_span, dt, max_step, rtol, atol, first_step, backend, form
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
    estimate_error : bool, optional
        Of equal steps, whether a motion in steps of half the length estimates the error of the state, with a
        `SimulationWarning` where it is beyond `rtol`, 1e-3, and `atol`, 0; which takes half as long again. By
        default it does. The numbers are the same without.

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
    options: dict[str, Any] = {"dt": dt, "max_step": max_step, "rtol": rtol, "atol": atol, "first_step": first_step}
    options |= {"estimate_error": estimate_error, "backend": backend}
    span, watched = (t_end, t0, t_span), as_events(events)
    model = with_loss_parameters(model, parameters, loss, running)
    motion = motion_of(model, q, qd, span, method, tau, parameters, wrt, form, watched, **options)
    values, slopes, segments, ends = differentiated(motion, loss, running, watched)
    for text in doubts(segments, values, slopes, ends)[0]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    nq, x, checkpoints = motion.problem.nq, segments.end[:, 0], max([run.tape.checkpoints for run in segments.runs])
    gradients = {name: each[..., 0] if each.ndim > 1 else float(each[0]) for name, each in slopes.items()}
    return MotionGradient(float(values[0]), gradients, segments.t, x[:nq], x[nq:], checkpoints)


def with_loss_parameters(model: Model, parameters: object, loss: Loss | None, running: Loss | None) -> Model:
    """The model, with those given parameters that it has not and a loss reads: inputs that its equations do not use."""
    own = as_equations(model)
    given = parameters if isinstance(parameters, Mapping) else {}
    new = [name for name in given if name not in own.parameters]
    if not new or not all([isinstance(name, str) for name in new]):
        return model
    p, t, system = Parameters([*own.parameters, *new]), cg.variable("t"), own.system
    state = [cg.variables(list(own.coordinates))] if system is None else [system.q, system.qd]
    force = [] if system is None else [list(system.tau)]
    called = [("loss", loss, state), ("running", running, [*state, *force])]
    read = [call_user_function(what, each, *at, t, p) for what, each, at in called if each is not None]
    used = {node.name for node in topological([node for node in read if isinstance(node, Node)])}
    extended = dict(own.parameters) | {name: 0.0 for name in new if name in used}
    if system is not None:
        return system.changed(parameters=extended)
    ode = own.ode
    assert ode is not None
    return OdeSystem(lambda x, t: ode.rates, ode.states, extended)


def differentiated(
    motion: MotionRequest, loss: Loss | None, running: Loss | None, watched: Sequence[Event] = ()
) -> tuple[Array, dict[str, Array], MotionSegments, tuple[Array, Array]]:
    """Losses (N,) of motions, their gradients (.., N) by names, the motions, and the losses' slopes by both ends."""
    problem = motion.problem
    if loss is None and running is None:
        raise ValueError("a loss is needed: of the end of the motion, `loss`, of how it goes, `running`, or both")
    final = None if loss is None else loss_graph(problem, quantity(problem, "loss", loss, constant=True))
    total = None
    if running is not None:
        total = loss_graph(problem, quantity(problem, "running", running, motion.applied, constant=True))
    segments = segments_of(motion, watched, total, forwards=False)
    values, end = _final(final, motion, segments)
    start, inputs, rows = segments.pulled(end)
    return values + segments.loss, _gradients(motion, start, inputs, rows, end), segments, (start, end.x)


def _final(graph: Graph | None, motion: MotionRequest, segments: MotionSegments) -> tuple[Array, Bars]:
    """The final losses, (N,), and their slopes."""
    m, many = segments.x.shape
    if graph is None:
        inputs = np.zeros((motion.forces + len(motion.values), many))
        return np.zeros(many), Bars(np.zeros_like(segments.x), np.zeros(many), inputs)
    values = at(with_slopes(graph, motion.backend), motion.at_end(segments.x, float(segments.t[-1])))
    return values[0], Bars(values[1 : m + 1], values[m + 1], values[m + 2 :])


def _gradients(motion: MotionRequest, start: Array, inputs: Array, rows: Array, end: Bars) -> dict[str, Array]:
    """Gradients by the names of `wrt`, of cotangents of the start, of the inputs, and of the forces of each step."""
    nq, forces, equations = motion.problem.nq, motion.forces, motion.equations
    result: dict[str, Array] = {}
    if motion.by_parameters:
        p = motion.values[: len(equations.names)]
        result = dict(zip(equations.names, equations.by_parameters(p, inputs[forces:], motion.backend), strict=True))
    if TORQUE in motion.wrt:
        if motion.each_step:
            rows[-1] += end.inputs[:forces]  # what the final loss has of the force itself
        result[TORQUE] = rows if motion.each_step else inputs[:forces]
    result |= {START: _displaced(motion, start), VELOCITY: start[nq:]}
    return {name: result[name] for name in motion.wrt}


def _displaced(motion: MotionRequest, bar: Array) -> Array:
    """The cotangent of the coordinates; of quasi-velocities by displacements, G^T q_bar."""
    system, nq = motion.problem.system, motion.problem.nq
    if system is None or system.kinematics.quasi is None or START not in motion.wrt:
        return bar[:nq]
    return at(_by_displacements(system, motion.backend), np.concatenate([motion.x[:nq], bar[:nq]]))


@kept_by_first
def _by_displacements(system: System, backend: str) -> Any:
    """(q, q_bar) -> G^T q_bar as a function."""
    bars = cg.variables([f"bar{k}" for k in range(system.nq)])
    pulled = system.kinematics.pulled_back(bars, Builder())
    return cg.compile(Graph([*system.q, *bars], {f"{k}": node for k, node in enumerate(pulled)}), backend)


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
    key: list[object] = []  # in a third of the time of a hash
    for each in order:
        if each.args:
            key.append((each.op.name, *[places[arg] for arg in each.args]))
        else:
            key.append(each.name if each.value is None else float(each.value).hex())  # 0.0 and -0.0 stay apart
    return _bound(_Quantity(problem, tuple(key), node))


@memo(LOSSES_KEPT)
def _bound(quantity: _Quantity) -> Graph:
    return quantity.problem.observed({"loss": quantity.node})


@kept_by_first
def with_slopes(graph: Graph, backend: str) -> Any:
    """The loss, and its slopes by all inputs, as a function."""
    slopes = cg.gradient(graph)
    both = {"loss": graph.only_output()} | {f"slope{k}": node for k, node in enumerate(slopes.outputs.values())}
    return cg.compile(cg.simplify(Graph(graph.inputs, both)), backend)
