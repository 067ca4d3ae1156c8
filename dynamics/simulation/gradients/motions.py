"""Motions of which derivatives are taken: equations, starts, steps, losses, and what to differentiate by, checked."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, entry, is_function, kept_by_first, memo, real_array, require_sequence
from cgraph.extend import Builder, topological

from ...equations.state_equation import FORMS, state_inputs
from ...equations.states.initial_value import initial_values
from ...integrators import Problem, derive, in_form, quantity, quantity_inputs
from ...integrators.rate_in_modes import switched
from ...systems.arguments import TIME, Parameters, call_user_function
from ...systems.kinematics import numbered_graph
from ...systems.model import Equations, Model, as_equations
from ...systems.ode_system import OdeSystem
from ...systems.system import System
from ..applied_force import Hold, SampledController, with_applied
from ..events.event import Event, EventProgram, as_events, event_program
from ..events.modes import Modes, Turn, entries, is_zero
from ..outcome import MotionError, Recorder
from ..run_options import METHOD, Options, Span, Steps, known_options, time_span
from ..stepper import Stepper, stepper_of
from ..steps.dense_output import Indices
from ..steps.equal_steps import step_count
from ..steps.row_values import converted
from .motion_programs import MotionEquations, motion_equations, outputs_at, pullback, sliding_equations

Loss = Callable[..., Node | float]
START, VELOCITY, TORQUE = "q", "qd", "tau"
LOSSES_KEPT = 64  # losses whose graphs stay for another run
OPTIONS_KEPT = 16  # options and equal steps that stay for another run
EQUAL = "rk4"  # by which equal steps are, unless another method is asked for
NOT_TAKEN = "max_steps", "dense_output", "fma", "progress"
SAME_ROW = 1e-6  # of a step, by which it may begin before the row of its force
CREPT = 1e-4  # of the longest step before a surface, steps so near to it
_PLAIN = (float, int, str, bool, type(None))


class Arrival(NamedTuple):
    """What is zero at the end of steps: an event, or a surface that is crossed."""

    name: str
    values: Graph
    beyond: bool = False  # whether the motion goes on where it is negative, before which a law may have no value


class Stretch(NamedTuple):
    """Steps of a motion without an event between them.

    t, h: (steps + 1,) and (steps,), where they begin and the last one ends, and their lengths.
    by_t, by_h: the derivatives of both by the instant at which they begin.
    arrival: with which they end, if any; the last step is then as long as it takes to there.
    slides, modes: surfaces among which the motion slides, if it does, and the sides of all.  rows: of forces, of steps.
    entry: graphs of the state from which they start, made of that before one after another.
    """

    t: Array
    h: Array
    by_t: Array
    by_h: Array
    arrival: Arrival | None = None
    slides: frozenset[int] | None = None
    modes: tuple[float, ...] = ()
    rows: Indices | None = None
    entry: tuple[Graph, ...] = ()

    def beginning_at(self, t: float) -> Stretch:
        """The steps where they begin at another instant."""
        later = t - self.t[0]
        if not (later or self.arrival):
            return self
        return self._replace(t=self.t + self.by_t * later, h=self.h + self.by_h * later)

    def half_steps(self) -> Stretch:
        """Steps of half the length."""
        half, by_half = 0.5 * self.h, 0.5 * self.by_h
        ways = [(self.t, half), (self.by_t, by_half)]
        t, by_t = [np.append(np.stack([at[:-1], at[:-1] + each], axis=1), at[-1]) for at, each in ways]
        rows = None if self.rows is None else np.repeat(self.rows, 2)
        return self._replace(t=t, h=np.repeat(half, 2), by_t=by_t, by_h=np.repeat(by_half, 2), rows=rows)


def _stretch(t: Array, h: Array) -> Stretch:
    """Steps that begin at t, whose first one ends where it does, wherever it begins."""
    by_t, by_h = np.zeros(len(t)), np.zeros(len(h))
    by_t[0], by_h[0] = 1.0, -1.0
    return Stretch(t, h, by_t, by_h)


@memo(OPTIONS_KEPT)
def _equal_stretch(t0: float, t_end: float, count: int) -> Stretch:
    t = t0 + np.arange(count) * ((t_end - t0) / count)
    return _stretch(np.append(t, t_end), np.full(count, (t_end - t0) / count))


@dataclass(frozen=True, eq=False)
class Motions:
    """N motions side by side, whose steps are the same; one alone, N = 1.

    x: (m, N), where they start, in q and qd.  steps: none of chosen steps before they are run.
    tau: the applied forces that are inputs, (forces, N), or where they change with the steps, (steps, forces, N).
    values: of the parameters p that stay inputs, of the numbers c and of modes, (.., N).
    said: doubts, a sentence each.  after: graphs of a reset at the end of the last steps.
    """

    equations: MotionEquations
    options: Steps
    span: Span
    x: Array
    tau: Array
    values: Array
    wrt: tuple[str, ...]
    final: Graph | None
    running: Graph | None
    events: EventProgram | None
    steps: tuple[Stretch, ...]
    said: tuple[str, ...] = ()
    after: tuple[Graph, ...] = ()

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

    def point(self, x: Array, t: float) -> Array:
        """The inputs, (.., N), of a graph over the states, t and parameters, at an instant of the last step."""
        return np.concatenate([x, np.full((1, self.many), t), self.inputs])

    def by_names(self, bars: Array) -> dict[str, Array]:
        """Derivatives (k, N) by the names of `wrt`, of cotangents (m + 1 + .., N) of the start, of t and of `inputs`.

        Those of coordinates whose rates velocities are not are by small displacements xi, dq = G(q) xi: G^T q_bar.
        """
        problem, equations, backend = self.problem, self.equations, self.options.backend
        q, x, inputs = bars[: problem.nq], bars[: problem.size], bars[problem.size + 1 :]
        if START in self.wrt and problem.system is not None and problem.system.kinematics.quasi is not None:
            q = outputs_at(_by_displacements(problem.system), backend, np.concatenate([self.x[: problem.nq], q]))
        by = {START: q, VELOCITY: x[problem.nq :], TORQUE: inputs[: equations.forces]}
        if self.by_parameters:
            of_p = inputs[equations.forces : len(inputs) - equations.modes]
            if equations.numbers is not None:
                values = np.concatenate([self.values[: len(equations.names)], of_p])
                of_p = outputs_at(pullback(equations.numbers), backend, values)
            by |= dict(zip(equations.names, of_p, strict=True))
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
        problem, p, rows = self.problem, self.inputs[: len(self.inputs) - self.equations.modes, 0], None
        x = converted(problem.momentum, self.span.t0, self.x[:, 0], p)
        if self.each_step:
            forces, h = self.tau[:, :, 0], self.span.length / len(self.tau)
            held = SampledController(lambda q, qd, t: forces[min(round(abs(t - self.span.t0) / h), len(forces) - 1)], h)
            rows = Hold(held, problem.parameters[: self.equations.forces], problem.nq, self.span.t0)
        options = self.options if rows is None else replace(self.options, dt=rows.controller.period)
        run = stepper_of(problem, options, p.tolist(), events=self.events, dense=bool(self.events), control=rows)
        recorder = Recorder(x, self.span)
        with np.errstate(all="ignore"):
            for block in run.blocks(x, self.span):
                recorder.record(block)
        if run.status:
            raise MotionError(f"the motion did not reach t_end, {run.status}")
        steps, after = self._cut(*recorder.table(), run)
        return replace(self, steps=steps, after=after, said=tuple(run.warnings))

    def in_stretch(self, steps: Stretch) -> Motions:
        """The motion by the equations that hold in some of its steps."""
        if not steps.modes:
            return self
        values = np.concatenate([self.values[: len(self.values) - len(steps.modes)], np.array(steps.modes)[:, None]])
        equations = self.equations if steps.slides is None else sliding_equations(self.equations, steps.slides)
        tau = self.tau if steps.rows is None else self.tau[steps.rows]
        return replace(self, equations=equations, values=values, tau=tau)

    def _cut(self, times: Array, states: Array, run: Stepper) -> tuple[tuple[Stretch, ...], tuple[Graph, ...]]:
        """The accepted steps, between the events that reset the state or end the motion, and crossings of surfaces.

        And graphs of a reset after the last.

        times: (T,), the start, the ends of the steps, and an instant twice where an event resets the state, (T, m).
        """
        happened = [] if run.log is None else [(run.log.program.events[k], t) for k, t, _ in run.log.happened]
        breaks = [0, *(np.flatnonzero(np.diff(times) == 0.0) + 1).tolist(), len(times)]
        stretches, entry = list[Stretch](), () if self.equations.start is None else (self.equations.start,)
        for first, last in itertools.pairwise(breaks):
            resets, t_end = last < len(times), times[last - 1]
            at = [each for each, when in happened if when == t_end and (each.reset if resets else each.terminal)]
            if (resets or run.event) and len(at) != 1:
                names = ", ".join([each.name for each in at])
                raise ValueError(f"events {names} happen at one instant, t = {t_end:.6g} s, which has no derivative")
            made = self._turned(times[first:last], states[first:last], run.modes, entry)
            if made and at:
                made[-1] = made[-1]._replace(arrival=Arrival(f"event {at[0].name!r}", at[0].values))
            stretches += made
            entry = (at[0].reset,) if resets and at[0].reset else () if made else entry
        return tuple(stretches), entry

    def _turned(self, t: Array, x: Array, modes: Modes | None, entry: tuple[Graph, ...]) -> list[Stretch]:
        """Steps that end at t (T,) and x (T, m), from an entry on, between crossings of surfaces."""
        turns = [] if modes is None else modes.turns
        met = np.flatnonzero(np.isin(t[1:-1], [turn.t for turn in turns])) + 1 if turns else np.zeros(0, dtype=np.intp)
        ends = [*met.tolist(), len(t) - 1][: len(t) - 1]
        result = list[Stretch]()
        for first, last in itertools.pairwise([0, *ends]):
            instants = t[first : last + 1]
            if last < len(t) - 1:  # steps that creep to a surface beyond which a law has no value are one
                far = np.abs(instants[-1] - instants) > CREPT * np.abs(np.diff(instants)).max()
                instants = instants[far | (np.arange(len(far)) % (len(far) - 1) == 0)]
            made = _stretch(instants, np.diff(instants))
            if self.each_step:
                place = np.abs(made.t[:-1] - self.span.t0) / self.span.length * len(self.tau)
                made = made._replace(rows=np.minimum((place + SAME_ROW).astype(np.intp), len(self.tau) - 1))
            if modes is not None:
                turn = _turn_at(turns, t[first])
                if turn.slides is not None and not first:
                    onto = sliding_equations(self.equations, turn.slides).problem.projection
                    entry = (*entry, onto) if onto else entry
                made = made._replace(slides=turn.slides, modes=turn.modes)
            result.append(made._replace(entry=entry))
            if modes is not None and last < len(t) - 1:
                after = _turn_at(turns, t[last])
                (k, number), *_ = modes.crossed(turn, after)
                inputs, margin = self.in_stretch(result[-1]).inputs[:, 0], modes.margin(turn, number)
                point, entry = np.concatenate([x[last], t[last : last + 1], inputs]), ()
                if not self.each_step or is_zero(margin, point, modes.sizes):  # else the next row of forces turns it
                    result[-1] = result[-1]._replace(
                        arrival=Arrival(f"surface {modes.words[k]!r}", margin, beyond=True)
                    )
                    entry = entries(modes, turn, after, point)
        return result


def _turn_at(turns: Sequence[Turn], t: float) -> Turn:
    """The turn at an instant: of several the modes after the last, and what was zero at the first."""
    at = [turn for turn in turns if turn.t == t]
    return at[-1]._replace(number=at[0].number)


def motions_of(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    losses: tuple[Loss | None, Loss | None],
    t_end: float | None,
    method: str | None,
    tau: Any,
    parameters: Mapping[str, ArrayLike] | None,
    wrt: str | Iterable[str] | None,
    events: Event | Iterable[Event],
    options: Options,
    *,
    many: bool = False,
) -> Motions:
    """The motions from starts.

    losses: of the end, and of each step.  many: N motions, else one, whose arguments have no axis N.
    """
    if isinstance(tau, SampledController):
        cause = "a SampledController calls Python, which has no derivative"
        raise TypeError(f"tau must be numbers or a controller in closed form: {cause}")
    watched, closed, form = as_events(events), is_function(tau), options.pop("form", FORMS[0])
    own = _with_loss_parameters(as_equations(model), parameters, *losses)
    t0, t_end = time_span(t_end, options.pop("t0", 0.0), options.pop("t_span", None))
    rows = None if closed else real_array("tau", tau)
    rows = rows if rows is not None and rows.ndim == 2 + many else None
    if method is None:
        method = EQUAL if rows is not None or options.get("dt") is not None else METHOD
    plain = all([type(each) in _PLAIN for each in (t_end, method, t0, *options.values())])
    steps, span = (_options if plain else _options.__wrapped__)(t_end, method, t0, *options.items())
    if rows is not None:
        _require_rows(rows, len(state_inputs(own).applied), steps, span, many=many, watched=bool(watched))
        rows = rows if many else rows[None]
    applied = with_applied(own, tau if rows is None else 0.0, parameters)

    # What stays an input, and the equations over these
    inputs, constant = state_inputs(applied.model), applied.constant if rows is None or not many else rows[:, 0]
    start = initial_values(applied.model, q, qd, constant, parameters, span.t0, many=many)
    steps.check(span, start.states)
    names, count = inputs.applied, len(start.x)
    wanted = _names(wrt, [START, VELOCITY, TORQUE][: 3 - closed] if names else [START], inputs.parameters)
    forced = rows is not None or TORQUE in wanted or not start.varied.keys().isdisjoint(names)
    forces = names if forced or any([start.bound[name] != 0.0 for name in names]) else ()
    free = {*forces, *wanted, *(parameters or ())}  # what a caller changes from call to call stays an input
    known = {name: value for name, value in start.bound.items() if name not in free}
    problem = switched(in_form(derive(applied.model, known, by_rows=steps.integrator.by_rows), form))
    equations, columns = motion_equations(problem, len(forces)), start.bound | start.varied
    problem = equations.problem

    # Numbers, losses and steps
    numbers = np.empty((len(forces) + len(equations.names), count))
    for row, name in zip(numbers, [*forces, *equations.names], strict=True):
        row[:] = columns[name]
    force, values = numbers[: len(forces)], numbers[len(forces) :]
    if rows is not None:
        force = np.broadcast_to(np.moveaxis(rows, 0, -1), (*rows.shape[1:], count))
    if equations.numbers is not None:
        values = outputs_at(equations.numbers, steps.backend, values)
    values = np.concatenate([values, np.ones((equations.modes, count))])
    final = _loss_graph(problem, "loss", losses[0])
    running = _loss_graph(problem, "running", losses[1], applied.nodes)
    program = event_program(problem, watched) if watched else None
    stretches: tuple[Stretch, ...] = ()
    if not (steps.adaptive or program or equations.modes):
        made = len(force) if rows is not None and steps.dt is None else step_count(span.length, steps.step)
        entry = () if equations.start is None else (equations.start,)
        stretches = (_equal_stretch(span.t0, span.t_end, made)._replace(entry=entry),)
    return Motions(equations, steps, span, start.x.T.copy(), force, values, wanted, final, running, program, stretches)


def _names(wrt: str | Iterable[str] | None, usual: Sequence[str], parameters: Iterable[str]) -> tuple[str, ...]:
    """Names to differentiate by: by default the start, and the applied force where it is numbers."""
    names = usual if wrt is None else [wrt] if isinstance(wrt, str) else require_sequence("wrt", wrt, "names")
    known = dict.fromkeys([*usual, *parameters])
    for name in () if wrt is None else names:
        entry("wrt: the motion has no input", known, name)
        if name in usual and name in parameters:
            both = "the start or the applied force, and a parameter"
            raise ValueError(f"wrt {name!r} is {both}: rename the parameter")
    if not names:
        raise ValueError(f"wrt needs at least one of {', '.join(usual)} and the parameters")
    return tuple(dict.fromkeys(names))


def _require_rows(rows: Array, n: int, options: Steps, span: Span, *, many: bool, watched: bool) -> None:
    """Raises ValueError for rows of forces, one a step, that are of another shape or no steps."""
    if options.adaptive or watched:
        needed = " without events" if watched else f": method {options.method!r} chooses its steps"
        raise ValueError(f"tau of shape {rows.shape} is one row a step, which needs equal steps{needed}")
    if not rows.size or rows.shape[-1] != n:
        shapes = "(N, n) or (N, steps, n)" if many else "(n,) or (steps, n)"
        raise ValueError(f"tau must have shape {shapes} with n = {n} velocities, got {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError("tau must be finite")
    if options.dt is not None and (count := step_count(span.length, options.step)) != rows.shape[-2]:
        steps = f"{count} steps of dt = {options.step:g} s"
        raise ValueError(f"tau has {rows.shape[-2]} rows, and there are {steps}: leave out dt")


def _with_loss_parameters(own: Equations, parameters: object, loss: Loss | None, running: Loss | None) -> Equations:
    """The model, with those given parameters that it has not and a loss reads: inputs that its equations do not use."""
    new = [name for name in parameters if name not in own.parameters] if isinstance(parameters, Mapping) else []
    if not new or not all([isinstance(name, str) for name in new]):
        return own
    p, t = Parameters([*own.parameters, *new]), cg.variable(TIME)
    system, ode = own.system, own.ode
    state = [cg.variables(list(own.coordinates))] if system is None else [system.q, system.qd]
    force = [] if system is None else [list(system.tau)]
    called = [("loss", loss, state), ("running", running, [*state, *force])]
    read = [call_user_function(what, each, *at, t, p) for what, each, at in called if each is not None]
    used = {node.name for node in topological([node for node in read if isinstance(node, Node)])}
    extended = dict(own.parameters) | {name: 0.0 for name in new if name in used}
    if system is not None:
        return system.changed(parameters=extended)
    assert ode is not None
    return OdeSystem(lambda x, t: ode.rates, ode.states, extended)


def _loss_graph(problem: Problem, what: str, loss: Loss | None, tau: Sequence[Node] | None = None) -> Graph | None:
    """A loss over the states, t and parameters; the same object for equal operations."""
    if loss is None:
        return None
    node = quantity(problem, what, loss, tau, constant=True)
    if not (kept := _place(problem, cg.structure_hash(Graph(quantity_inputs(problem), {"loss": node})))):
        kept.append(problem.observed({"loss": node}))
    return kept[0]


@memo(LOSSES_KEPT)
def _place(problem: Problem, key: str) -> list[Graph]:
    """Place for the graph of a loss of these operations."""
    return []


@kept_by_first
def _by_displacements(system: System) -> Graph:
    """(q, q_bar) -> G^T q_bar."""
    bars = cg.variables([f"bar{k}" for k in range(system.nq)])
    return numbered_graph([*system.q, *bars], system.kinematics.pulled_back(bars, Builder()))


@memo(OPTIONS_KEPT)
def _options(t_end: float, method: str, t0: float, *options: tuple[str, Any]) -> tuple[Steps, Span]:
    return Steps(method, **known_options(dict(options), NOT_TAKEN)), Span(t_end, t0=t0)
