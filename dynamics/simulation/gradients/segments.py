"""Legs: the parts of a motion between events that reset its state or end it, run one after another and pulled back.

An event happens where g(x, t) = 0, so that the length h of the step that arrives there depends on where it began:
dh = -(dg/dx dx) / (dg/dx dx/dh + dg/dt). The leg after it begins from the reset state at that instant, and of equal
steps all depend on it. These jumps are those of the numbers that are computed: h is solved for to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array, kept_by_first

from ..events.event import Event
from ..events.event_program import WatchedEvent, event_program
from .motion import TORQUE, Leg, MotionError, MotionRequest
from .motion_equations import PARAMETERS
from .motion_programs import LOSS, MotionPrograms, Request, motion_programs
from .motion_run import MotionRun

MOST_TURNS = 20  # of Newton's method for the length of a step that arrives at an event


class Bars(NamedTuple):
    """Cotangents of a state at an instant, of the instant, and of the forces and parameters that stay inputs."""

    x: Array
    t: Any  # float, or (N,) of N motions side by side
    inputs: Array  # forces, then parameters


@dataclass
class Legs:
    """The legs of a motion, run from its start to its end.

    events: by name.  every: of each leg, see MotionRun; or nothing.
    x, t: the end of the motion, in states of its steps.  loss: the running loss of all legs.
    """

    motion: MotionRequest
    programs: MotionPrograms
    events: Mapping[str, WatchedEvent]
    every: Sequence[int] = ()

    def __post_init__(self) -> None:
        motion = self.motion
        self.runs: list[MotionRun] = []
        begin = float(motion.legs[0].t[0])
        x = converted(motion.equations.start, motion, motion.x, begin)
        for number, leg in enumerate(motion.legs):
            t, h = _steps(leg, begin)
            every = self.every[number] if self.every else 0
            run = MotionRun(replace(motion, x=x, t=t, h=h), self.programs, arrives=bool(leg.event), every=every)
            if leg.event:
                self._arrive(run, self.events[leg.event])
            self.runs.append(run)
            x, begin = run.x, float(t[-1])
            if leg.event and (reset := self.events[leg.event].reset) is not None:
                x = values_at(reset, motion, x, begin)
        times = [run.motion.t[:-1] for run in self.runs]
        self.x, self.t = x, np.append(times[0] if len(times) == 1 else np.concatenate(times), begin)
        self.loss = sum([run.loss for run in self.runs[1:]], self.runs[0].loss)

    @property
    def end(self) -> Array:
        """The end of the motion in q and qd."""
        return converted(self.motion.equations.end, self.motion, self.x, float(self.t[-1]))

    def _arrive(self, run: MotionRun, event: WatchedEvent) -> None:
        """The last step of a leg, as long as it takes to where the event happens."""
        motion, last = run.motion, np.inf
        for _ in range(MOST_TURNS):
            x, t = run.tried(), motion.t[-1:]
            g, values = event.value(t, x[None], _inputs(motion)), _inputs(motion)
            x_dot = values_at(motion.problem.rate, motion, x, float(t[0]))
            step = float(g[0] / event.slope(t, x[None], values, x_dot[None], np.ones(1))[0])
            if not abs(step) < last:
                break
            last = abs(step)
            motion.h[-1] -= step
            motion.t[-1] = motion.t[-2] + motion.h[-1]
        if not np.isfinite(motion.h[-1]):
            raise MotionError(
                f"event {event.name!r} at t = {motion.t[-2]:.6g} s does not pass through zero with a slope"
            )
        run.finish()

    def pulled(self, end: Bars) -> tuple[Array, Array, Array]:
        """Cotangents of the start of the motion, of its inputs, and rows of each step, from those of its end."""
        inputs = end.inputs.copy()
        names, lengths = self.programs.step.passes.varied, self.motion.equations.lengths
        last = self.motion.legs[-1].event
        if last and self.events[last].reset is not None:
            end = self._before(len(self.runs), end, inputs)
        for k in reversed(range(len(self.runs))):
            run, leg = self.runs[k], self.motion.legs[k]
            later = 0.0
            if leg.event:
                end, later = self._through(run, self.events[leg.event], end, inputs)
            bars, rows = run.pulled({"x": end.x, LOSS: 1.0})
            more = [bars.get(name, np.zeros((n, *inputs.shape[1:]))) for name, n in lengths.items()]
            inputs += np.concatenate(more)
            if k == 0:
                return self._started(bars["x"], inputs), inputs, rows
            t, h = (rows[:, names.index(name)].copy() for name in ("t", "h"))
            t[-1] += later
            if leg.event:
                h[-1] = 0.0  # which the event determines
            by_t, by_h = leg_slopes(leg)
            begin = float(t @ by_t + h @ by_h) + (float(bars["t"][0]) if "t" in bars else 0.0)
            end = self._before(k, Bars(bars["x"], begin, np.zeros(0)), inputs)
        raise AssertionError("a motion has at least one leg")

    def _started(self, bar: Array, inputs: Array) -> Array:
        """The cotangent of the start, from that of the first state; adds to the cotangents of the inputs."""
        graph, motion = self.motion.equations.start, self.motion
        if graph is None:
            return bar
        bars = pulled_at(graph, motion, motion.x, float(motion.legs[0].t[0]), list(bar))
        inputs += bars.inputs
        return bars.x

    def _before(self, k: int, after: Bars, inputs: Array) -> Bars:
        """Through the reset with which leg k begins; adds to the cotangents of the inputs."""
        run, event = self.runs[k - 1], self.events[self.motion.legs[k - 1].event]
        assert event.reset is not None
        bars = pulled_at(event.reset, run.motion, run.x, float(run.motion.t[-1]), after.x.tolist())
        inputs += bars.inputs
        return Bars(bars.x, bars.t + after.t, inputs)

    def _through(self, run: MotionRun, event: WatchedEvent, end: Bars, inputs: Array) -> tuple[Bars, float]:
        """Cotangents where a leg arrives at an event, with h as the event determines it; and that of t there."""
        g = pulled_at(event.values, run.motion, run.x, float(run.motion.t[-1]), [1.0])
        slope = run.last_slope(g.x) + g.t
        share = -(run.last_slope(end.x) + end.t) / slope
        inputs += share * g.inputs
        return Bars(end.x + share * g.x, 0.0, inputs), end.t + share * g.t


def legs_of(motion: MotionRequest, watched: Sequence[Event], running: Graph | None = None, *, forwards: bool) -> Legs:
    """The legs of a motion, along which tangents are to be pushed forwards, or cotangents pulled back."""
    by = [TORQUE] if TORQUE in motion.wrt else []
    by += ["p", "c"] if motion.by_parameters else []
    by += ["t", "h"] if watched else []
    many, backend = motion.many > 0, motion.backend
    request = Request(motion.equations, motion.method, motion.each_step, tuple(by), forwards, backend, many, running)
    events = {event.name: event for event in event_program(motion.problem, watched).events}
    return Legs(motion, motion_programs(request), events)


def _steps(leg: Leg, begin: float) -> tuple[Array, Array]:
    """Times and lengths of the steps of a leg that begins at this instant."""
    count = len(leg.t) - 1
    if leg.equal and not leg.event and leg.t[0] == begin:
        return leg.t, np.full(count, (leg.end - begin) / leg.equal)
    t = leg.t.copy()
    t[0] = begin
    if leg.equal:
        t[:-1] = begin + np.arange(count) * ((leg.end - begin) / leg.equal)
    h = np.diff(t)
    if leg.equal:
        h[: count - bool(leg.event)] = (leg.end - begin) / leg.equal
    return t, h


def leg_slopes(leg: Leg) -> tuple[Array, Array]:
    """How the times of the steps of a leg and their lengths depend on where it begins."""
    count = len(leg.t) - 1
    if leg.equal:
        return 1.0 - np.arange(count) / leg.equal, np.full(count, -1.0 / leg.equal)
    first = np.arange(count) == 0
    return np.where(first, 1.0, 0.0), np.where(first, -1.0, 0.0)


@kept_by_first
def _pullback(graph: Graph) -> Graph:
    return cg.vjp(graph)


def pulled_at(graph: Graph, motion: MotionRequest, x: Array, t: float, seeds: Sequence[float]) -> Bars:
    """J^T seeds of a graph over the states, t and parameters, at a state and an instant."""
    pulled = _pullback(graph)
    bars = dict(zip(pulled.input_names[len(graph.inputs) :], seeds, strict=True))
    values, m = _arrays(pulled.evaluate(point(graph, motion, x, t) | bars), motion), motion.problem.size
    return Bars(values[:m], values[m] if motion.many else float(values[m]), values[m + 1 :])


def values_at(graph: Graph, motion: MotionRequest, x: Array, t: float) -> Array:
    """The outputs of a graph over the states, t and parameters, at a state and an instant."""
    return _arrays(graph.evaluate(point(graph, motion, x, t)), motion)


def converted(graph: Graph | None, motion: MotionRequest, x: Array, t: float) -> Array:
    """The same where there is a graph, else the state itself."""
    return x if graph is None else values_at(graph, motion, x, t)


def _arrays(values: Mapping[str, Any], motion: MotionRequest) -> Array:
    """(k,), or (k, N) of N motions side by side."""
    shape = (motion.many,) if motion.many else ()
    rows = [np.broadcast_to(np.asarray(value, dtype=np.float64), shape) for value in values.values()]
    return np.array(rows).reshape(len(rows), *shape)


def _inputs(motion: MotionRequest) -> list[Any]:
    """Forces and parameters that stay inputs, at the end."""
    values = np.concatenate([motion.force_at_end, motion.values])
    return [*values] if motion.many else values.tolist()


def point(graph: Graph, motion: MotionRequest, x: Array, t: float) -> dict[str, Any]:
    """The inputs of a graph over the states, t and parameters, at a state and an instant."""
    return dict(zip(graph.input_names, [*(x if motion.many else x.tolist()), t, *_inputs(motion)], strict=True))


class Rows(NamedTuple):
    """Rows of a motion: times (T,), states (T, m), and the tangents of both, (T, k) and (T, m, k)."""

    t: Array
    x: Array
    t_dot: Array
    x_dot: Array


def pushed_legs(legs: Legs, directions: Mapping[str, Array]) -> Rows:
    """The rows of all legs, along k directions of the registers x and `PARAMETERS`."""
    motion, watched = legs.motion, len(legs.events) > 0
    inputs = np.concatenate([directions[name] for name in PARAMETERS])
    begin, t_dot = float(motion.legs[0].t[0]), np.zeros(inputs.shape[1])
    x_dot = _through(motion.equations.start, motion, motion.x, begin, directions["x"], t_dot, inputs)
    parts: list[Rows] = []
    for run, leg in zip(legs.runs, motion.legs, strict=True):
        by_t, by_h = leg_slopes(leg)
        given, steps = {**directions, "x": x_dot}, np.empty((0, len(t_dot)))
        if watched:
            given["t"], steps = t_dot[None], by_h[:, None] * t_dot
        if leg.event:  # the last column: the length of the last step alone
            steps[-1] = 0.0
            given = {name: np.pad(rows, ((0, 0), (0, 1))) for name, rows in given.items()}
            steps = np.pad(steps, ((0, 0), (0, 1)))
            steps[-1, -1] = 1.0
        states, tangents = run.pushed(given, steps)
        times = np.append(by_t, 0.0)[:, None] * t_dot
        if leg.event:
            g = pulled_at(legs.events[leg.event].values, run.motion, run.x, float(run.motion.t[-1]), [1.0])
            tangents, slope = tangents[:, :, :-1], tangents[-1, :, -1]
            at_event = g.x @ tangents[-1] + g.t * times[-2] + g.inputs @ inputs
            length = -at_event / (g.x @ slope + g.t)
            tangents[-1] += slope[:, None] * length
            times[-1] = times[-2] + length
        parts.append(Rows(run.motion.t, states, times, tangents))
        x_dot, t_dot = tangents[-1], times[-1]
        if leg.event and (reset := legs.events[leg.event].reset) is not None:
            x_dot = _through(reset, run.motion, run.x, float(run.motion.t[-1]), x_dot, t_dot, inputs)
    last = motion.legs[-1].event
    if last and legs.events[last].reset is not None:
        parts.append(Rows(legs.t[-1:], legs.x[None], t_dot[None], x_dot[None]))
    return _observed(motion, Rows(*[np.concatenate(column) for column in zip(*parts, strict=True)]), inputs)


def _through(
    graph: Graph | None, motion: MotionRequest, x: Array, t: float, x_dot: Array, t_dot: Array, inputs: Array
) -> Array:
    """Tangents of the state that a graph makes of one; the same without a graph."""
    if graph is None:
        return x_dot
    rows: list[Bars] = [pulled_at(graph, motion, x, t, unit.tolist()) for unit in np.eye(len(x))]
    return np.stack([row.x @ x_dot + row.t * t_dot + row.inputs @ inputs for row in rows])


def _observed(motion: MotionRequest, rows: Rows, inputs: Array) -> Rows:
    """Rows of states (q, qd), of those of the steps."""
    graph = motion.equations.end
    if graph is None:
        return rows
    moved = cg.jvp(graph)
    values = [*rows.x.T, rows.t, *motion.force_at_end, *motion.values]
    tangents = [*rows.x_dot.swapaxes(0, 1), rows.t_dot, *inputs]
    points = dict(zip(graph.input_names, [np.reshape(each, (-1, 1)) for each in values], strict=True))
    along = points | dict(zip(moved.input_names[len(values) :], tangents, strict=True))
    x, x_dot = (
        np.stack([np.broadcast_to(each, (len(rows.t), count)) for each in values.values()], axis=1)
        for values, count in ((graph.evaluate(points), 1), (moved.evaluate(along), len(inputs.T)))
    )
    return rows._replace(x=x[:, :, 0], x_dot=x_dot)
