"""Motions of which there are to be derivatives: the problem, the start, the steps, and what to differentiate by."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array, memo, or_nearest, real_array, require_sequence

from ...equations.state_equation import state_inputs
from ...equations.states.initial_value import initial_values
from ...integrators import Method, Problem, derive, in_form
from ...systems.model import Model
from ..applied_force import SampledController, with_applied
from ..events.event import Event, event_program
from ..outcome import MotionError, Recorder, advise
from ..run_options import METHOD, RunOptions, time_span
from ..stepper import stepper_of
from ..steps.equal_steps import step_count
from ..steps.row_values import converted
from ..unreached_momenta import unreached_momenta
from .motion_equations import PARAMETERS, MotionEquations, motion_equations

START, VELOCITY, TORQUE = "q", "qd", "tau"
OPTIONS_KEPT = 16  # options and equal steps that stay for another run
EQUAL = "rk4"  # by which equal steps are, unless another method is asked for
_PLAIN = (float, int, str, bool, type(None))


class Segment(NamedTuple):
    """A part of a motion.

    t: (steps + 1,), where its steps begin and the last one ends.  event: with which it ends, by name, or empty.
    equal: into how many equal steps the time from its begin to `end` is divided; 0 of chosen steps.
    """

    t: Array
    event: str = ""
    equal: int = 0
    end: float = 0.0


@dataclass(frozen=True, eq=False)
class MotionRequest:
    """N motions side by side, whose steps are the same; one alone, N = 1.

    x: (m, N), where they start, in q and qd.  segments: their parts.
    t, h: (steps + 1,), where the steps begin and the last one ends, and (steps,), their lengths.
    tau: the applied forces that are inputs, (forces, N), or where they change with the steps, (steps, forces, N).
    values: of the parameters p that stay inputs, and of the numbers c, (.., N).  wrt: names.
    applied: the whole applied force as nodes.  options: of the run.  said: what speaks against it, a sentence each.
    """

    equations: MotionEquations
    method: Method
    x: Array
    segments: tuple[Segment, ...]
    t: Array
    h: Array
    tau: Array
    each_step: bool
    values: Array
    wrt: tuple[str, ...]
    applied: Sequence[Node] | None
    options: RunOptions
    said: tuple[str, ...] = ()

    @property
    def backend(self) -> str:
        """Back end of the compiled programs."""
        return self.options.backend

    @property
    def problem(self) -> Problem:
        """Problem of the motion."""
        return self.equations.problem

    @property
    def forces(self) -> int:
        """Number of the applied forces that are inputs."""
        return self.equations.forces

    def with_segments(self, events: Sequence[Event] = ()) -> MotionRequest:
        """One motion with the segments that chosen steps and events make, and what speaks against these steps.

        Raises MotionError where the motion does not reach its end, KeyboardInterrupt by Ctrl-C.
        """
        if self.segments:
            return self
        problem, options, start = self.equations.given, self.options, self.x[:, 0]
        parameters = np.concatenate([self.tau, self.values])[: len(problem.parameters), 0]
        program = event_program(problem, events) if events else None
        made = partial(stepper_of, problem, parameters=parameters.tolist(), events=program, between=bool(events))
        x = converted(problem.momentum, options.t0, start, parameters)
        run, recorder = made(options), Recorder(x, None, options.t0, options.direction)
        with np.errstate(all="ignore"):
            for block in run.blocks(x):
                recorder.add(block)
        advise(run, recorder.last, options, x, made)
        if run.status:
            raise MotionError(f"the motion did not reach t_end, {run.status}")
        t, rows = recorder.table()
        log = [] if run.log is None else run.log.happened
        happened = {each.name: np.array([t for k, t, _ in log if k == number]) for number, each in enumerate(events)}
        segments = _segments(t, options, events, happened, ended=bool(run.event))
        unreached = unreached_momenta(problem, t, rows, parameters, start=(options.t0, start, x))
        return replace(self, segments=segments, said=(*run.warnings, *unreached))

    def at_end(self, x: Array, t: float) -> Array:
        """The inputs, (.., N), of a graph over the states, t and parameters, at an instant of the last step."""
        return np.concatenate([x, np.full((1, self.many), t), self.force_at_end, self.values])

    @property
    def by_parameters(self) -> bool:
        """Whether derivatives by parameters are wanted."""
        return not set(self.wrt).isdisjoint(self.equations.names)

    def parameters_at(self, tau: Array) -> dict[str, Array]:
        """The registers of forces and parameters."""
        count = len(self.equations.names)
        return dict(zip(PARAMETERS, (tau, self.values[:count], self.values[count:]), strict=True))

    @property
    def many(self) -> int:
        """Number N of motions side by side."""
        return len(self.x.T)

    @property
    def force_at_start(self) -> Array:
        """The applied forces that are inputs, in the first step."""
        return self.tau[0] if self.each_step else self.tau

    @property
    def force_at_end(self) -> Array:
        """Applied force in the last step."""
        return self.tau[-1] if self.each_step else self.tau


def motion_of(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    span: tuple[float | None, float, ArrayLike | None],
    method: str | None,
    tau: Any,
    parameters: Mapping[str, ArrayLike] | None,
    wrt: str | Iterable[str] | None,
    form: str,
    events: Sequence[Event] = (),
    *,
    many: bool = False,
    **options: Any,
) -> MotionRequest:
    """The motion of checked arguments.  span: t_end, t0, t_span.  options: those of `simulate` besides.

    many: N motions side by side, of which those by chosen steps have no segments yet.
    Raises TypeError or ValueError naming the argument, and MotionError for a motion that does not reach its end.
    """
    if isinstance(tau, SampledController):
        raise TypeError(
            "tau must be numbers or a controller in closed form: a SampledController calls Python, which has no "
            "derivative"
        )
    t0, t_end = time_span(*span)
    rows = None if callable(tau) else _rows(model, tau, many=many)
    run = options_of(t_end, method, t0, options, rows=rows is not None)
    if rows is not None and (run.adaptive or events):
        needed = "equal steps without events" if events else f"equal steps: method {method!r} chooses its steps"
        raise ValueError(f"tau of shape {np.shape(tau)} is one row a step, which needs {needed}")
    applied = with_applied(model, tau if rows is None else 0.0, parameters)
    moving = applied.model
    constant = rows[:, 0] if many and rows is not None else applied.constant  # a motion for each of their first forces
    start = initial_values(moving, q, qd, constant, parameters, t0, many=many)
    run.check(start.states)
    chosen, names = names_of(moving, wrt, closed=callable(tau)), state_inputs(moving).applied
    forced = rows is not None or TORQUE in chosen or not start.varied.keys().isdisjoint(names)
    inputs = names if forced or any([start.bound[name] != 0.0 for name in names]) else ()
    free = {*inputs, *chosen, *(parameters or ())}  # what a caller changes from call to call stays an input
    problem = in_form(derive(moving, {name: value for name, value in start.bound.items() if name not in free}), form)
    equations, columns = motion_equations(problem, len(inputs)), start.bound | start.varied
    count = len(start.x)
    forces, values = (np.empty((len(each), count)) for each in (inputs, equations.names))
    for row, name in zip([*forces, *values], [*inputs, *equations.names], strict=True):
        row[:] = columns[name]
    if rows is not None:
        forces = np.broadcast_to(np.moveaxis(rows, 0, -1), (*rows.shape[1:], count))
    chosen_steps = run.adaptive or events
    motion = MotionRequest(
        equations,
        run.integrator,
        start.x.T.copy(),
        () if chosen_steps else (equal_segment(run, None if rows is None else rows.shape[1]),),
        np.empty(0),  # of steps, before the segments are run
        np.empty(0),
        forces,
        rows is not None,
        equations.values(values, run.backend),
        chosen,
        applied.nodes,
        run,
    )
    return motion if many else motion.with_segments(events)


def options_of(
    t_end: float, method: str | None, t0: float, options: Mapping[str, Any], *, rows: bool = False
) -> RunOptions:
    """The options of a run.

    rows: whether there is a row of forces for each step.  method: None for that of `simulate`, or equal steps.
    """
    if method is None:
        method = EQUAL if rows or options["dt"] is not None else METHOD
    plain = all([type(each) in _PLAIN for each in (t_end, method, t0, *options.values())])
    checked = _checked_options if plain else _checked_options.__wrapped__
    return checked(t_end, method, t0, *options.items())


@memo(OPTIONS_KEPT)
def _checked_options(t_end: float, method: str, t0: float, *options: tuple[str, Any]) -> RunOptions:
    return RunOptions(t_end, method, t0=t0, **dict(options))


def _rows(model: Model, tau: Any, *, many: bool) -> Array | None:
    """tau where it is one row a step, (steps, n), or of many motions (N, steps, n), with the axis N in both."""
    rows = real_array("tau", tau)
    if rows.ndim != (3 if many else 2):
        return None
    n = len(state_inputs(model).applied)
    if not rows.size or rows.shape[-1] != n:
        shapes = "(N, n) or (N, steps, n)" if many else "(n,) or (steps, n)"
        raise ValueError(f"tau must have shape {shapes} with n = {n} velocities, got {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError("tau must be finite")
    return rows if many else rows[None]


def names_of(model: Model, wrt: str | Iterable[str] | None, *, closed: bool) -> tuple[str, ...]:
    """Names to differentiate by: by default the start, and the applied force where it is numbers."""
    inputs = state_inputs(model)
    usual = [START] if not inputs.applied else [START, VELOCITY] if closed else [START, VELOCITY, TORQUE]
    if wrt is None:
        return tuple(usual)
    names = [wrt] if isinstance(wrt, str) else require_sequence("wrt", wrt, "names")
    known = dict.fromkeys([*usual, *inputs.parameters])
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise ValueError(f"wrt: the motion has no input {name!r:.60} ({or_nearest(str(name), list(known))})")
    if clash := [name for name in names if name in usual and name in inputs.parameters]:
        raise ValueError(f"wrt {clash[0]!r} is the start or the applied force, and a parameter: rename the parameter")
    if not names:
        raise ValueError(f"wrt needs at least one of {', '.join(usual)} and the parameters")
    return tuple(dict.fromkeys(names))


def equal_segment(run: RunOptions, rows: int | None) -> Segment:
    """Equal steps; so many where rows say it."""
    count = step_count(run.length, run.step) if rows is None or run.dt is not None else rows
    if rows is not None and rows != count:
        raise ValueError(f"tau has {rows} rows, and there are {count} steps of dt = {run.step:g} s: leave out dt")
    return _equal_segment(run.t0, run.t_end, count)


@memo(OPTIONS_KEPT)
def _equal_segment(t0: float, t_end: float, count: int) -> Segment:
    t = np.append(t0 + np.arange(count) * ((t_end - t0) / count), t_end)
    t.flags.writeable = False  # of all who have it
    return Segment(t, equal=count, end=t_end)


def _segments(
    times: Array, run: RunOptions, events: Sequence[Event], happened: Mapping[str, Array], *, ended: bool
) -> tuple[Segment, ...]:
    """The accepted steps of a motion, between the events that reset its state or end it.

    times: (T,), the start, the ends of the steps, and an instant twice where an event resets the state.
    happened: the instants of the events, by name.  ended: whether one ended the motion.
    """
    starts = np.flatnonzero(np.diff(times) == 0.0) + 1  # rows after a reset
    parts = np.split(times, starts)
    segments = []
    for number, t in enumerate(parts):
        resets = number < len(parts) - 1
        stops = ended and not resets
        at = [
            each.name for each in events if (each.reset if resets else each.terminal) and t[-1] in happened[each.name]
        ]
        if (resets or stops) and len(at) != 1:
            raise ValueError(
                f"events {', '.join(at)} happen at one instant, t = {t[-1]:.6g} s, which has no derivative"
            )
        count = 0 if run.adaptive else step_count(run.t_end - t[0], run.step)
        if len(t) > 1:
            segments.append(Segment(t, at[0] if resets or stops else "", count, run.t_end))
    return tuple(segments)
