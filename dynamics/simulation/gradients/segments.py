"""The segments of a motion, between events that reset its state or end it: run, pulled back, and tangents pushed on.

An event happens where g(x, t) = 0, so that the length h of the step that arrives there depends on where it began:
dh = -(dg/dx dx) / (dg/dx dx/dh + dg/dt). The segment after it begins from the reset state at that instant, and of equal
steps all depend on it. These jumps are those of the numbers that are computed: h is solved for to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, kept_by_first

from ..events.event import Event, WatchedEvent, event_program
from ..outcome import MotionError
from ..steps.row_values import values_of
from .motion import TORQUE, MotionRequest, Segment
from .motion_equations import PARAMETERS
from .motion_programs import LOSS, MotionPrograms, ProgramRequest, motion_programs
from .motion_run import MotionRun

MOST_TURNS = 20  # of Newton's method for the length of a step that arrives at an event


class Bars(NamedTuple):
    """Cotangents (.., N) of a state at an instant, of the instant, and of forces and parameters that stay inputs."""

    x: Array  # (m, N)
    t: Array  # (N,)
    inputs: Array  # forces, then parameters


class Rows(NamedTuple):
    """Rows of a motion: times (T,), states (T, m), and the tangents of both, (T, k) and (T, m, k)."""

    t: Array
    x: Array
    t_dot: Array
    x_dot: Array


@dataclass
class MotionSegments:
    """The segments of a motion, run from its start to its end. With events N = 1.

    events: by name.  every: of each segment, see MotionRun; or nothing.
    x, t: the end of the motion, (m, N) in states of its steps, and all times.  loss: that of all segments, (N,).
    """

    motion: MotionRequest
    programs: MotionPrograms
    events: Mapping[str, WatchedEvent]
    every: Sequence[int] = ()

    def __post_init__(self) -> None:
        motion = self.motion
        self.runs: list[MotionRun] = []
        begin = float(motion.segments[0].t[0])
        x = _through(motion.equations.start, motion, motion.x, begin)
        for number, segment in enumerate(motion.segments):
            t, h = _steps(segment, begin)
            every = self.every[number] if self.every else 0
            run = MotionRun(replace(motion, x=x, t=t, h=h), self.programs, arrives=bool(segment.event), every=every)
            if segment.event:
                _arrive(run, self.events[segment.event])
            self.runs.append(run)
            begin = float(t[-1])
            x = _through(self._reset(number), motion, run.x, begin)
        times = [run.motion.t[:-1] for run in self.runs]
        self.x, self.t = x, np.append(times[0] if len(times) == 1 else np.concatenate(times), begin)
        self.loss = sum([run.loss for run in self.runs[1:]], self.runs[0].loss)

    @property
    def end(self) -> Array:
        """The end of the motion in q and qd, (m, N)."""
        return _through(self.motion.equations.end, self.motion, self.x, float(self.t[-1]))

    def _reset(self, number: int) -> Graph | None:
        """Reset of the state at the end of a segment."""
        event = self.motion.segments[number].event
        return self.events[event].reset if event else None

    def pulled(self, end: Bars) -> tuple[Array, Array, Array]:
        """Cotangents of the start of the motion, of its inputs, and rows of each step, from those of its end."""
        inputs, motion = end.inputs.copy(), self.motion
        names, lengths = self.programs.step.passes.varied, motion.equations.lengths
        for k in reversed(range(len(self.runs))):
            run, segment = self.runs[k], motion.segments[k]
            later = 0.0
            end = self._before_reset(k, end, inputs)
            if segment.event:
                end, later = _before_event(run, self.events[segment.event], end, inputs)
            bars, rows = run.pulled({"x": end.x, LOSS: 1.0})
            more = [bars.get(name, np.zeros((n, motion.many))) for name, n in lengths.items()]
            inputs += np.concatenate(more)
            if k == 0:
                break
            # cotangents of the instants and lengths of the steps, to which the event adds at the last
            t, h = (rows[:, names.index(name), 0].copy() for name in ("t", "h"))
            t[-1] += later
            if segment.event:
                h[-1] = 0.0  # which the event determines
            by_t, by_h = _by_begin(segment)
            # begin_bar = sum over steps of t_bar dt/dbegin + h_bar dh/dbegin
            begin = t @ by_t + h @ by_h + (bars["t"][0] if "t" in bars else np.zeros(1))
            end = Bars(bars["x"], begin, np.zeros(0))
        if motion.equations.start is None:
            return bars["x"], inputs, rows
        start = _pulled_at(motion.equations.start, motion, motion.x, float(motion.segments[0].t[0]), bars["x"])
        return start.x, inputs + start.inputs, rows

    def _before_reset(self, k: int, after: Bars, inputs: Array) -> Bars:
        """Through the reset at the end of a segment, if there is one; adds to the cotangents of the inputs."""
        run, reset = self.runs[k], self._reset(k)
        if reset is None:
            return after
        bars = _pulled_at(reset, run.motion, run.x, float(run.motion.t[-1]), after.x)
        inputs += bars.inputs
        return Bars(bars.x, bars.t + after.t, inputs)

    def tangents(self, directions: Mapping[str, Array]) -> Rows:
        """The rows of all segments, in q and qd, along k directions of the registers x and `PARAMETERS`."""
        motion, watched = self.motion, len(self.events) > 0
        inputs = np.concatenate([directions[name] for name in PARAMETERS])
        begin, t_dot = float(motion.segments[0].t[0]), np.zeros(inputs.shape[1])
        x_dot = _pushed(motion.equations.start, motion, motion.x, begin, directions["x"], t_dot, inputs)
        parts: list[Rows] = []
        for number, (run, segment) in enumerate(zip(self.runs, motion.segments, strict=True)):
            by_t, by_h = _by_begin(segment)
            given, steps = {**directions, "x": x_dot}, np.empty((0, len(t_dot)))
            if watched:
                given["t"], steps = t_dot[None], by_h[:, None] * t_dot
            if segment.event:  # the last column: the length of the last step alone
                steps[-1] = 0.0
                given = {name: np.pad(rows, ((0, 0), (0, 1))) for name, rows in given.items()}
                steps = np.pad(steps, ((0, 0), (0, 1)))
                steps[-1, -1] = 1.0
            states, tangents = run.pushed(given, steps)
            times, end = np.append(by_t, 0.0)[:, None] * t_dot, float(run.motion.t[-1])
            if segment.event:
                g = _pulled_at(self.events[segment.event].values, run.motion, run.x, end, np.ones((1, 1)))
                tangents, slope = tangents[:, :, :-1], tangents[-1, :, -1]
                # dg = dg/dx dx + dg/dt dt + dg/dp dp at fixed h, and dh = -dg / (dg/dx dx/dh + dg/dt)
                at_event = g.x[:, 0] @ tangents[-1] + g.t * times[-2] + g.inputs[:, 0] @ inputs
                length = -at_event / (g.x[:, 0] @ slope + g.t)
                # dx += dx/dh dh, dt += dh
                tangents[-1] += slope[:, None] * length
                times[-1] = times[-2] + length
            parts.append(Rows(run.motion.t, states, times, tangents))
            t_dot = times[-1]
            x_dot = _pushed(self._reset(number), run.motion, run.x, end, tangents[-1], t_dot, inputs)
        if self._reset(-1) is not None:
            parts.append(Rows(self.t[-1:], self.x.T, t_dot[None], x_dot[None]))
        return _observed(motion, Rows(*[np.concatenate(column) for column in zip(*parts, strict=True)]), inputs)


def segments_of(
    motion: MotionRequest, watched: Sequence[Event], running: Graph | None = None, *, forwards: bool
) -> MotionSegments:
    """The segments of a motion, along which tangents are to be pushed forwards, or cotangents pulled back."""
    by = [TORQUE] if TORQUE in motion.wrt else []
    by += ["p", "c"] if motion.by_parameters else []
    by += ["t", "h"] if watched else []
    many, backend = motion.many > 1, motion.backend
    request = ProgramRequest(
        motion.equations, motion.method, motion.each_step, tuple(by), forwards, backend, many, running
    )
    events = {event.name: event for event in event_program(motion.problem, watched).events}
    return MotionSegments(motion, motion_programs(request), events)


def _steps(segment: Segment, begin: float) -> tuple[Array, Array]:
    """Times and lengths of the steps of a segment that begins at this instant."""
    count = len(segment.t) - 1
    if segment.equal and not segment.event and segment.t[0] == begin:
        return segment.t, np.full(count, (segment.end - begin) / segment.equal)
    t = segment.t.copy()
    t[0] = begin
    if segment.equal:
        t[:-1] = begin + np.arange(count) * ((segment.end - begin) / segment.equal)
    h = np.diff(t)
    if segment.equal:
        h[: count - bool(segment.event)] = (segment.end - begin) / segment.equal
    return t, h


def _by_begin(segment: Segment) -> tuple[Array, Array]:
    """Derivatives of the times and lengths of a segment's steps by the time at which it begins."""
    count = len(segment.t) - 1
    if segment.equal:
        return 1.0 - np.arange(count) / segment.equal, np.full(count, -1.0 / segment.equal)
    first = np.arange(count) == 0
    return np.where(first, 1.0, 0.0), np.where(first, -1.0, 0.0)


def _arrive(run: MotionRun, event: WatchedEvent) -> None:
    """The last step of a segment, as long as it takes to where the event happens."""
    motion, last = run.motion, np.inf
    for _ in range(MOST_TURNS):
        x, t = run.tried(), motion.t[-1:]
        point = motion.at_end(x, float(t[0]))
        values = point[len(x) + 1 :, 0].tolist()
        g, x_dot = event.value(t, x.T, values), _evaluated(motion.problem.rate, point)
        # Newton's method: h -= g / (dg/dx xdot + dg/dt)
        step = float(g[0] / event.slope(t, x.T, values, x_dot.T, np.ones(1))[0])
        if not abs(step) < last:
            break
        last = abs(step)
        motion.h[-1] -= step
        motion.t[-1] = motion.t[-2] + motion.h[-1]
    if not np.isfinite(motion.h[-1]):
        raise MotionError(f"event {event.name!r} at t = {motion.t[-2]:.6g} s does not pass through zero with a slope")
    run.finish()


def _before_event(run: MotionRun, event: WatchedEvent, end: Bars, inputs: Array) -> tuple[Bars, float]:
    """Cotangents where a segment arrives at an event, with h as the event determines it; and that of t there."""
    g = _pulled_at(event.values, run.motion, run.x, float(run.motion.t[-1]), np.ones((1, 1)))
    slope = run.last_slope(g.x) + g.t
    # lambda with h_bar = x_bar dx/dh + t_bar + lambda (dg/dx dx/dh + dg/dt) = 0
    share = -(run.last_slope(end.x) + end.t) / slope
    inputs += share * g.inputs
    return Bars(end.x + share * g.x, np.zeros(1), inputs), float((end.t + share * g.t)[0])


@kept_by_first
def _pullback(graph: Graph) -> Graph:
    return cg.vjp(graph)


def _pulled_at(graph: Graph, motion: MotionRequest, x: Array, t: float, seeds: Array) -> Bars:
    """J^T seeds, (k, N), of a graph over the states, t and parameters, at states and an instant."""
    bars, m = _evaluated(_pullback(graph), np.concatenate([motion.at_end(x, t), seeds])), len(x)
    return Bars(bars[:m], bars[m], bars[m + 1 :])


def _through(graph: Graph | None, motion: MotionRequest, x: Array, t: float) -> Array:
    """The states (m, N) that a graph over the states, t and parameters makes of some; the same without a graph."""
    return x if graph is None else _evaluated(graph, motion.at_end(x, t))


def _evaluated(graph: Graph, points: Array) -> Array:
    """The outputs, (k, N), of a graph at points (n, N)."""
    count = points.shape[1]
    return values_of(graph, points if count > 1 else points[:, 0].tolist(), count)


def _pushed(
    graph: Graph | None, motion: MotionRequest, x: Array, t: float, x_dot: Array, t_dot: Array, inputs: Array
) -> Array:
    """Tangents (m, k) of the state that a graph makes of one; the same without a graph."""
    if graph is None:
        return x_dot
    rows = [_pulled_at(graph, motion, x, t, unit[:, None]) for unit in np.eye(len(x))]
    return np.stack([row.x[:, 0] @ x_dot + row.t * t_dot + row.inputs[:, 0] @ inputs for row in rows])


def _observed(motion: MotionRequest, rows: Rows, inputs: Array) -> Rows:
    """Rows of states (q, qd), of those of the steps."""
    graph = motion.equations.end
    if graph is None:
        return rows
    moved = cg.jvp(graph)
    values = [*rows.x.T, rows.t, *motion.force_at_end, *motion.values]
    tangents = [*rows.x_dot.swapaxes(0, 1), rows.t_dot, *inputs]
    points, shape = [np.reshape(each, (-1, 1)) for each in values], rows.t_dot.shape
    x, x_dot = values_of(graph, points, len(rows.t), 1), values_of(moved, [*points, *tangents], *shape)
    return rows._replace(x=x[:, :, 0].T, x_dot=x_dot.swapaxes(0, 1))
