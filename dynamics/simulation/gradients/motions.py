"""Motions of which derivatives are taken: equations, starts, steps, and what to differentiate by, checked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, memo, or_nearest, real_array, require_sequence
from cgraph.extend import Builder, topological

from ...equations.state_equation import FORMS, state_inputs
from ...equations.states.initial_value import initial_values
from ...integrators import Problem, derive, in_form
from ...systems.arguments import Parameters, call_user_function
from ...systems.model import Equations, Model, as_equations
from ...systems.ode_system import OdeSystem
from ...systems.system import System
from ..applied_force import SampledController, with_applied
from ..events.event import Event, event_program
from ..outcome import MotionError, Recorder
from ..run_options import METHOD, Options, RunOptions, known_options, time_span
from ..stepper import stepper_of
from ..steps.equal_steps import step_count
from ..steps.row_values import converted
from .motion_programs import MotionEquations, motion_equations, outputs_at

Loss = Callable[..., Node | float]
START, VELOCITY, TORQUE = "q", "qd", "tau"
OPTIONS_KEPT = 16  # options and equal steps that stay for another run
EQUAL = "rk4"  # by which equal steps are, unless another method is asked for
NOT_TAKEN = "max_steps", "dense_output", "fma", "progress"
_PLAIN = (float, int, str, bool, type(None))


class Stretch(NamedTuple):
    """Steps of a motion without an event between them.

    t, h: (steps + 1,) and (steps,), where they begin and the last one ends, and their lengths.
    by_t, by_h: the derivatives of both by the instant at which they begin.
    event: with which they end, by name, or empty; the last step is then as long as it takes to there.
    """

    t: Array
    h: Array
    by_t: Array
    by_h: Array
    event: str = ""

    def beginning_at(self, t: float) -> Stretch:
        """The steps where they begin at another instant."""
        later = t - self.t[0]
        if not (later or self.event):
            return self
        return self._replace(t=self.t + self.by_t * later, h=self.h + self.by_h * later)

    def half_steps(self) -> Stretch:
        """Steps of half the length."""
        half, by_half = 0.5 * self.h, 0.5 * self.by_h
        ways = [(self.t, half), (self.by_t, by_half)]
        t, by_t = [np.append(np.stack([at[:-1], at[:-1] + each], axis=1), at[-1]) for at, each in ways]
        return Stretch(t, np.repeat(half, 2), by_t, np.repeat(by_half, 2), self.event)


def _stretch(t: Array, equal: int, end: float, event: str = "") -> Stretch:
    """Steps that begin at t: chosen, or some of so many `equal` ones to the end."""
    count = len(t) - 1
    h, by_t, by_h = np.diff(t), np.zeros(count + 1), np.zeros(count)
    if equal:
        h[: count - bool(event)] = (end - t[0]) / equal
        by_t[:-1], by_h[:] = 1.0 - np.arange(count) / equal, -1.0 / equal
    else:
        by_t[0], by_h[0] = 1.0, -1.0
    return Stretch(t, h, by_t, by_h, event)


@dataclass(frozen=True, eq=False)
class Motions:
    """N motions side by side, whose steps are the same; one alone, N = 1.

    x: (m, N), where they start, in q and qd.  steps: of the motions, none of chosen steps before they are run.
    tau: the applied forces that are inputs, (forces, N), or where they change with the steps, (steps, forces, N).
    values: of the parameters p that stay inputs, and of the numbers c, (.., N).  wrt: names.
    applied: the whole applied force as nodes.  options: of the run.  said: what speaks against it, a sentence each.
    """

    equations: MotionEquations
    options: RunOptions
    x: Array
    tau: Array
    values: Array
    wrt: tuple[str, ...]
    applied: Sequence[Node] | None
    events: Sequence[Event] = ()
    steps: tuple[Stretch, ...] = ()
    said: tuple[str, ...] = ()

    @property
    def problem(self) -> Problem:
        """Problem of the motion."""
        return self.equations.problem

    @property
    def many(self) -> int:
        """Number N of motions side by side."""
        return len(self.x.T)

    @property
    def each_step(self) -> bool:
        """Whether the applied force is another in every step."""
        return self.tau.ndim == 3

    @property
    def by_parameters(self) -> bool:
        """Whether derivatives by parameters are wanted."""
        return not set(self.wrt).isdisjoint(self.equations.names)

    @property
    def inputs(self) -> Array:
        """Forces of the last step, and values of parameters, (.., N)."""
        return np.concatenate([self.tau[-1] if self.each_step else self.tau, self.values])

    def point(self, x: Array | None = None, t: float = 0.0) -> Array:
        """The inputs, (.., N), of a graph over the states, t and parameters, at an instant of the last step."""
        return np.concatenate([self.x if x is None else x, np.full((1, self.many), t), self.inputs])

    def by_names(self, bars: Array) -> dict[str, Array]:
        """Derivatives (k, N) by the names of `wrt`, of cotangents (m + 1 + .., N) of the start, of t and of `inputs`.

        Those of coordinates whose rates velocities are not are by small displacements xi, dq = G(q) xi: G^T q_bar.
        """
        problem, equations = self.problem, self.equations
        q, x, inputs = bars[: problem.nq], bars[: problem.size], bars[problem.size + 1 :]
        if START in self.wrt and problem.system is not None and problem.system.kinematics.quasi is not None:
            q = outputs_at(
                _by_displacements(problem.system, self.options.backend), np.concatenate([self.x[: problem.nq], q])
            )
        by = {START: q, VELOCITY: x[problem.nq :], TORQUE: inputs[: equations.forces]}
        if self.by_parameters:
            p, of_p = self.values[: len(equations.names)], inputs[equations.forces :]
            by |= dict(zip(equations.names, equations.by_parameters(p, of_p, self.options.backend), strict=True))
        return {name: by[name] for name in self.wrt}

    def of(self, part: slice | list[int]) -> Motions:
        """Some of the motions, by number."""
        return replace(self, x=self.x[..., part], tau=self.tau[..., part], values=self.values[..., part])

    def with_steps(self) -> Motions:
        """One motion with the steps that are chosen and cut by events, and what speaks against these.

        Raises MotionError where the motion does not reach its end, KeyboardInterrupt by Ctrl-C.
        """
        if self.steps:
            return self
        problem, options, start = self.equations.given, self.options, self.x[:, 0]
        parameters = self.inputs[: len(problem.parameters), 0]
        program = event_program(problem, self.events) if self.events else None
        x = converted(problem.momentum, options.t0, start, parameters)
        run = stepper_of(problem, options, parameters.tolist(), events=program, dense=bool(self.events))
        recorder = Recorder(x, options)
        with np.errstate(all="ignore"):
            for block in run.blocks(x, options):
                recorder.add(block)
        if run.status:
            raise MotionError(f"the motion did not reach t_end, {run.status}")
        happened = [] if run.log is None else [(self.events[k], t) for k, t, _ in run.log.happened]
        steps = _stretches(recorder.table()[0], options, happened, ended=bool(run.event))
        return replace(self, steps=steps, said=tuple(run.warnings))


def motions_of(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None,
    method: str | None,
    tau: Any,
    parameters: Mapping[str, ArrayLike] | None,
    wrt: str | Iterable[str] | None,
    events: Sequence[Event],
    losses: tuple[Loss | None, Loss | None],
    options: Options,
    *,
    many: bool = False,
) -> Motions:
    """The motions of checked arguments.

    losses: of the end, and of each step.  many: N motions, else one, whose arguments have no axis N.
    Raises TypeError or ValueError naming the argument.
    """
    if isinstance(tau, SampledController):
        raise TypeError(
            "tau must be numbers or a controller in closed form: a SampledController calls Python, which has no "
            "derivative"
        )
    own = _with_loss_parameters(as_equations(model), parameters, *losses)
    t0, t_end = time_span(t_end, options.pop("t0", 0.0), options.pop("t_span", None))
    form = options.pop("form", FORMS[0])
    rows = None if callable(tau) else _rows(tau, len(state_inputs(own).applied), many=many)
    if method is None:
        method = EQUAL if rows is not None or options.get("dt") is not None else METHOD
    plain = all([type(each) in _PLAIN for each in (t_end, method, t0, *options.values())])
    run = (_options if plain else _options.__wrapped__)(t_end, method, t0, *options.items())
    if rows is not None and (run.adaptive or events):
        needed = "equal steps without events" if events else f"equal steps: method {method!r} chooses its steps"
        raise ValueError(f"tau of shape {np.shape(tau)} is one row a step, which needs {needed}")
    applied = with_applied(own, tau if rows is None else 0.0, parameters)
    moving = applied.model
    constant = rows[:, 0] if many and rows is not None else applied.constant  # a motion for each of their first forces
    start = initial_values(moving, q, qd, constant, parameters, t0, many=many)
    run.check(run, start.states)
    inputs = state_inputs(moving)
    chosen, names = _names(wrt, inputs.applied, inputs.parameters, closed=callable(tau)), inputs.applied
    forced = rows is not None or TORQUE in chosen or not start.varied.keys().isdisjoint(names)
    forces = names if forced or any([start.bound[name] != 0.0 for name in names]) else ()
    free = {*forces, *chosen, *(parameters or ())}  # what a caller changes from call to call stays an input
    problem = in_form(derive(moving, {name: value for name, value in start.bound.items() if name not in free}), form)
    equations, columns, count = motion_equations(problem, len(forces)), start.bound | start.varied, len(start.x)
    numbers = np.empty((len(forces) + len(equations.names), count))
    for row, name in zip(numbers, [*forces, *equations.names], strict=True):
        row[:] = columns[name]
    held = numbers[: len(forces)]
    if rows is not None:
        held = np.broadcast_to(np.moveaxis(rows, 0, -1), (*rows.shape[1:], count))
    values, x = equations.values(numbers[len(forces) :], run.backend), start.x.T.copy()
    steps = () if run.adaptive or events else (_equal_steps(run, None if rows is None else rows.shape[1]),)
    return Motions(equations, run, x, held, values, chosen, applied.nodes, events, steps)


def _with_loss_parameters(own: Equations, parameters: object, loss: Loss | None, running: Loss | None) -> Equations:
    """The model, with those given parameters that it has not and a loss reads: inputs that its equations do not use."""
    given = parameters if isinstance(parameters, Mapping) else {}
    new = [name for name in given if name not in own.parameters]
    if not new or not all([isinstance(name, str) for name in new]):
        return own
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


@kept_by_first
def _by_displacements(system: System, backend: str) -> Any:
    """(q, q_bar) -> G^T q_bar as a function."""
    bars = cg.variables([f"bar{k}" for k in range(system.nq)])
    pulled = system.kinematics.pulled_back(bars, Builder())
    return cg.compile(Graph([*system.q, *bars], {f"{k}": node for k, node in enumerate(pulled)}), backend)


@memo(OPTIONS_KEPT)
def _options(t_end: float, method: str, t0: float, *options: tuple[str, Any]) -> RunOptions:
    return RunOptions(t_end, method, t0=t0, **known_options(dict(options), NOT_TAKEN))


def _rows(tau: Any, n: int, *, many: bool) -> Array | None:
    """tau where it is one row a step, (steps, n), or of many motions (N, steps, n), with the axis N in both."""
    rows = real_array("tau", tau)
    if rows.ndim != (3 if many else 2):
        return None
    if not rows.size or rows.shape[-1] != n:
        shapes = "(N, n) or (N, steps, n)" if many else "(n,) or (steps, n)"
        raise ValueError(f"tau must have shape {shapes} with n = {n} velocities, got {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError("tau must be finite")
    return rows if many else rows[None]


def _names(
    wrt: str | Iterable[str] | None, applied: Sequence[str], parameters: Iterable[str], *, closed: bool
) -> tuple[str, ...]:
    """Names to differentiate by: by default the start, and the applied force where it is numbers."""
    usual = [START] if not applied else [START, VELOCITY] if closed else [START, VELOCITY, TORQUE]
    if wrt is None:
        return tuple(usual)
    names = [wrt] if isinstance(wrt, str) else require_sequence("wrt", wrt, "names")
    known = dict.fromkeys([*usual, *parameters])
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise ValueError(f"wrt: the motion has no input {name!r:.60} ({or_nearest(str(name), list(known))})")
    if clash := [name for name in names if name in usual and name in parameters]:
        raise ValueError(f"wrt {clash[0]!r} is the start or the applied force, and a parameter: rename the parameter")
    if not names:
        raise ValueError(f"wrt needs at least one of {', '.join(usual)} and the parameters")
    return tuple(dict.fromkeys(names))


def _equal_steps(run: RunOptions, rows: int | None) -> Stretch:
    """Equal steps; so many where rows say it."""
    count = step_count(run.length, run.step) if rows is None or run.dt is not None else rows
    if rows is not None and rows != count:
        raise ValueError(f"tau has {rows} rows, and there are {count} steps of dt = {run.step:g} s: leave out dt")
    return _equal_stretch(run.t0, run.t_end, count)


@memo(OPTIONS_KEPT)
def _equal_stretch(t0: float, t_end: float, count: int) -> Stretch:
    t = t0 + np.arange(count) * ((t_end - t0) / count)
    return _stretch(np.append(t, t_end), count, t_end)


def _stretches(
    times: Array, run: RunOptions, happened: Sequence[tuple[Event, float]], *, ended: bool
) -> tuple[Stretch, ...]:
    """The accepted steps of a motion, between the events that reset its state or end it.

    times: (T,), the start, the ends of the steps, and an instant twice where an event resets the state.
    happened: events, and when they did.  ended: whether one ended the motion.
    """
    parts = np.split(times, np.flatnonzero(np.diff(times) == 0.0) + 1)
    stretches = []
    for number, t in enumerate(parts):
        resets = number < len(parts) - 1
        at = [event.name for event, when in happened if when == t[-1] and (event.reset if resets else event.terminal)]
        if (resets or ended) and len(at) != 1:
            raise ValueError(
                f"events {', '.join(at)} happen at one instant, t = {t[-1]:.6g} s, which has no derivative"
            )
        count = 0 if run.adaptive else step_count(run.t_end - t[0], run.step)
        if len(t) > 1:
            stretches.append(_stretch(t, count, run.t_end, at[0] if resets or ended else ""))
    return tuple(stretches)
