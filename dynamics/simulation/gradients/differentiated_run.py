"""A run of motions along which derivatives go: through its steps, and through the events that reset or end it.

An event happens where g(x, t) = 0, so that the length h of the step that arrives there depends on where it began:
dh = -(dg/dx dx) / (dg/dx dx/dh + dg/dt). The steps after it begin from the reset state at that instant, and equal
steps all depend on it. These jumps are those of the numbers that are computed: h is solved for to rounding.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cgraph import Graph
from cgraph._shared import Array, Tape, run_passes
from cgraph.extend import Runner

from ..outcome import MotionError
from ..stepper import nonfinite, unsolved
from ..steps.row_values import tangent, values_of
from .motion_programs import LOSS, motion_programs, pullback
from .motions import TORQUE, Arrival, Motions, Stretch

MOST_RECORDED = 128 * 2**20  # bytes of what is recorded of steps; of more, checkpoints are kept
PIECE = 4096  # passes between two looks at Python
FEW_DIRECTIONS = 4  # directions: of fewer, iterations one after another are done sooner than a vector of them
MOST_TURNS = 20  # of Newton's method for the length of a step that arrives at an event
SHORTER = 1e-3  # of a step that ends at a surface beyond which a law has no value, at most


@dataclass(eq=False)
class Segment:
    """Steps that were run: tapes of what is before the first one, if anything, and of them; (m, N) before and after."""

    motions: Motions  # by the equations of these steps
    steps: Stretch
    before: list[Array]  # states to which graphs of their entry are applied
    start: Tape | None
    tape: Tape
    failed: str
    begin: Array
    x: Array


class DifferentiatedRun:
    """N motions from their starts to their ends, once; then along them. With events N = 1.

    forwards: tangents are to be pushed on, else cotangents pulled back.
    every: keep the states after every so many steps alone, of each segment; nothing goes along the motion.
    x, t: the end, (m, N), not finite of one among others that failed, and all times.  loss: the running one, (N,).
    checkpoints: steps between two states that were kept; 0 where all were.
    """

    def __init__(self, motions: Motions, *, forwards: bool = False, every: Sequence[int] = ()) -> None:
        self.motions, self.forwards = motions.with_steps(), forwards
        motions = self.motions
        self._wrt = [TORQUE] if TORQUE in motions.wrt else []
        moves = len(motions.steps) > 1 or motions.steps[0].arrival is not None
        self._wrt += (["p", "c"] if motions.by_parameters else []) + (["t", "h"] if moves else [])
        self.moves, self.segments, x = moves, list[Segment](), motions.x
        begin = float(motions.steps[0].t[0])
        for stretch, kept in zip(motions.steps, every or itertools.repeat(0), strict=False):
            segment = self._segment(stretch.beginning_at(begin), x, kept)
            self.segments.append(segment)
            begin, x = float(segment.steps.t[-1]), segment.x
        *self._before_end, x = self._made(self.segments[-1].motions, motions.after, x, begin)
        self.x, self.t = x, np.append(np.concatenate([each.steps.t[:-1] for each in self.segments]), begin)
        self.loss = np.zeros(motions.many)
        if motions.running is not None:
            self.loss = sum([each.tape.value(LOSS)[0] for each in self.segments], self.loss)

    @property
    def end(self) -> Array:
        """The end of the motions in q and qd, (m, N)."""
        motions, graph = self.segments[-1].motions, self.motions.equations.end
        return self._made(motions, [graph] if graph else [], self.x, float(self.t[-1]))[-1]

    @property
    def checkpoints(self) -> int:
        """Steps between two states that were kept; 0 where all were."""
        return max([each.tape.checkpoints for each in self.segments])

    def _segment(self, steps: Stretch, x: Array, every: int) -> Segment:
        """Run steps from the state x on."""
        motions, many, count = self.motions.in_stretch(steps), self.motions.many, len(steps.h)
        *entered, x = self._made(motions, steps.entry, x, float(steps.t[0]))
        before, step, failed = motion_programs(
            motions.equations,
            motions.options.integrator,
            tuple(self._wrt),
            motions.running,
            motions.options.backend,
            each_step=motions.each_step,
            forwards=self.forwards,
            many=many > 1,
        )
        tau = motions.tau[0] if motions.each_step else motions.tau
        values = motions.equations.registers(np.concatenate([tau, motions.values])) | {"t": steps.t[:1], "x": x}
        if motions.options.adaptive and not failed:  # rtol = 0: what is iterated is solved to rounding
            tolerances = {"rtol": motions.options.relative, "atol": motions.options.absolute}
            values |= {name: np.asarray(value) for name, value in tolerances.items()}
        start = None
        if before is not None:
            start = Tape(before, values, lambda first, last: np.empty((last - first, 0, 1)), many)
            start.run(0, 1)
            values |= {name: start.value(name) for name in before.passes.handed}

        def fed(first: int, last: int) -> Array:
            """Inputs of the steps first .. last - 1, (.., width, N), or one for all motions without own forces."""
            rows = np.stack([steps.t[first:last], steps.h[first:last]], axis=1)[:, :, None]
            if not motions.each_step:
                return rows
            return np.concatenate([np.broadcast_to(rows, (*rows.shape[:2], many)), motions.tau[first:last]], axis=1)

        fits = every > 0 or 8 * step.forward.program.width * count * many <= MOST_RECORDED
        tape = Tape(step, values, fed, many, 0 if fits else math.ceil(math.sqrt(count)), every or 1)
        segment = Segment(motions, steps, entered, start, tape, failed, tape.value("x"), x)
        tape.run(0, count - bool(steps.arrival))
        if steps.arrival:
            self._arrive(segment, steps.arrival)
        segment.x = tape.value("x")
        bad = ~np.isfinite(segment.x).all(axis=0)
        if failed:
            bad |= tape.value(failed)[0] != 0.0
        if bad.any() and many == 1:
            raise MotionError(f"the motion {self.stopped(0, segment)}")
        segment.x[:, bad] = np.nan
        return segment

    def _arrive(self, segment: Segment, event: Arrival) -> None:
        """Make the last step of a segment, as long as it takes to where the event happens."""
        motions = segment.motions
        t, h, tape, count, last = segment.steps.t, segment.steps.h, segment.tape, len(segment.steps.h), np.inf
        before = float(t[-2])

        def arrived(length: float) -> tuple[Array, Array, float]:
            h[-1], t[-1] = length, before + length
            memory = tape.memory.copy()
            run_passes(tape.of.forward, memory, 1, 1, tape.feed(count - 1, count))
            x = tape.value("x", memory)
            point = motions.point(x, t[-1])
            return x, point, float(_outputs(event.values, point)[0, 0]) + 0.0 * float(x.sum())

        tried, short = float(h[-1]), np.finfo(float).eps
        while event.beyond and math.isnan(arrived(tried)[2]) and short < SHORTER:  # by rounding beyond a surface
            tried, short = float(h[-1]) * (1.0 - short), 4.0 * short
        kept = tried
        for _ in range(MOST_TURNS):
            x, point, value = arrived(tried)
            slopes, x_dot = self._slopes(motions, event, x, t[-1]), _outputs(motions.problem.rate, point)
            # Newton's method: h -= g / (dg/dx xdot + dg/dt)
            change = float((value / (slopes[: len(x)].T @ x_dot + slopes[len(x)]))[0, 0])
            if not abs(change) < last:
                break
            kept, last, tried = tried, abs(change), tried - change
        if event.beyond and math.isfinite(value):
            kept, further = tried, math.copysign(np.spacing(abs(t[-1])), tried)
            while value > 0.0 and abs(further) < abs(tried):
                tried, further = tried + further, 2.0 * further
                value = arrived(tried)[2]
        if not math.isfinite(value):  # where a law has no value beyond its surface
            arrived(kept)
        if not np.isfinite(h[-1]):
            raise MotionError(f"{event.name} at t = {before:.6g} s does not pass through zero with a slope")
        tape.run(count - 1, count)

    def stopped(self, k: int, segment: Segment) -> str:
        """Place where motion k went wrong in a segment: the first step after which it has, in words."""
        tape, m, names = segment.tape, len(segment.x), self.motions.problem.components
        memory, before = tape.first.copy(), segment.begin[:, k]
        for first in range(0, len(segment.steps.h), PIECE):
            last = min(first + PIECE, len(segment.steps.h))
            # a row ends with the state after the step
            rows = run_passes(tape.of.forward, memory, last - first, 1, tape.feed(first, last))[:, :, k]
            bad = ~np.isfinite(rows[:, -m:]).all(axis=1) | (rows[:, -m - 1] != 0.0 if segment.failed else False)
            if bad.any():
                break
            before = rows[-1, -m:]
        step = int(np.argmax(bad))
        x, before = rows[step, -m:], rows[step - 1, -m:] if step else before
        what = nonfinite(names, x) or unsolved(names, before, x)
        return f"stopped at t = {segment.steps.t[first + step + 1]:.6g} s: {what}"

    def states(self, segment: Segment) -> Array:
        """States (T, m, N) from the start to the end: all that are kept."""
        tape, m = segment.tape, len(segment.x)
        if tape.checkpoints:
            return np.array([*[tape.value("x", memory) for *_, memory in tape.blocks], segment.x])
        rows = np.concatenate([segment.begin[None], *[kept[:, -m:] for *_, kept in tape.blocks]])
        whole = (len(rows) - 1) * tape.every == len(segment.steps.h)
        return rows if whole else np.concatenate([rows, segment.x[None]])

    def cotangents(self, bars: Array) -> tuple[Array, Array]:
        """Cotangents (m + 1 + .., N) of start, t and inputs, from those of the end; and rows of forces of each step."""
        m, rows = len(self.x), np.empty((0, 0, 0))
        last, forces = self.segments[-1], self.motions.equations.forces
        total = np.zeros_like(self.motions.tau) if self.motions.each_step else None
        for graph, x in zip(reversed(self.motions.after), reversed(self._before_end), strict=True):
            bars = self._cotangents_at(last.motions, graph, x, float(self.t[-1]), bars)
        for k, segment in reversed(list(enumerate(self.segments))):
            motions, steps, end, later = segment.motions, segment.steps, segment.steps.t[-1], 0.0
            if steps.arrival:
                g = self._slopes(motions, steps.arrival, segment.x, end)
                # lambda with h_bar = x_bar dx/dh + t_bar + lambda (dg/dx dx/dh + dg/dt) = 0
                slope = self._by_last_length(segment, g[:m]) + g[m]
                bars = bars - (self._by_last_length(segment, bars[:m]) + bars[m]) / slope * g
                later = float(bars[m, 0])
            vectors, rows, failed = segment.tape.cotangents({"x": bars[:m], LOSS: np.ones(1)})
            self._require_solved(failed)
            if segment.start is not None:
                vectors, _, failed = segment.start.cotangents(vectors)
                self._require_solved(failed)
            t_bar = vectors.get("t", np.zeros((1, motions.many)))
            if total is not None and rows.size:
                np.add.at(total, np.arange(len(rows)) if steps.rows is None else steps.rows, rows[:, :forces])
            if k:
                # cotangents of the instants and lengths of the steps, to which the event adds at the last
                t, h = rows[:, -2:, 0].T.copy()
                t[-1] += later
                if steps.arrival:
                    h[-1] = 0.0  # which the event determines
                # begin_bar = sum over steps of t_bar dt/dbegin + h_bar dh/dbegin
                t_bar = t_bar + (t @ steps.by_t[:-1] + h @ steps.by_h)
            registers = motions.equations.registers(np.zeros_like(bars[m + 1 :]))
            inputs = np.concatenate([vectors.get(name, zero) for name, zero in registers.items()])
            bars = np.concatenate([vectors["x"], t_bar, bars[m + 1 :] + inputs])
            for graph, x in zip(reversed(steps.entry), reversed(segment.before), strict=True):
                bars = self._cotangents_at(motions, graph, x, float(steps.t[0]), bars)
        return bars, rows if total is None else total

    def _by_last_length(self, segment: Segment, seed: Array) -> float:
        """Cotangent of h of the last step of one motion, from that of x (m, 1) after it: t and h are what varies."""
        tape, derivative = segment.tape, segment.tape.of.derivative
        memory, (_, _, rows) = tape.derivative_memory({"x": seed}, 1), next(tape.records(backwards=True))
        return float(run_passes(derivative, memory, 1, 1, rows[-1:, : derivative.program.feed_width])[0, -1, 0])

    def tangents(self, dots: Array) -> tuple[Array, Array, Array, Array]:
        """Rows of one motion, t (T,) and q with qd (T, m), and the tangents of both, (T, k) and (T, m, k).

        dots: tangents (m + 1 + .., k) of the start, of t and of inputs, along k directions.
        """
        m, motions = len(self.x), self.motions
        parts = []
        for segment in self.segments:
            steps, end = segment.steps, float(segment.steps.t[-1])
            for graph, x in zip(steps.entry, segment.before, strict=True):
                dots = self._tangents_at(segment.motions, graph, x, float(steps.t[0]), dots)
            lengths = steps.by_h[:, None] * dots[m] if self.moves else np.empty((0, 0))
            times, moved = steps.by_t[:, None] * dots[m], dots
            if steps.arrival:  # the last column: the length of the last step alone
                moved, lengths = (np.pad(each, ((0, 0), (0, 1))) for each in (dots, lengths))
                lengths[-1], lengths[-1, -1] = 0.0, 1.0
            states, tangents = self._along(segment, moved, lengths)
            if steps.arrival:
                g = self._slopes(segment.motions, steps.arrival, segment.x, end)[:, 0]
                tangents, slope = tangents[:, :, :-1], tangents[-1, :, -1]
                # dg = dg/dx dx + dg/dt dt + dg/dp dp at fixed h, and dh = -dg / (dg/dx dx/dh + dg/dt)
                length = -(g @ np.concatenate([tangents[-1], times[-2:-1], dots[m + 1 :]])) / (g[:m] @ slope + g[m])
                # dx += dx/dh dh, dt += dh
                tangents[-1] += slope[:, None] * length
                times[-1] = times[-2] + length
            parts.append((steps.t, states, times, tangents))
            dots = np.concatenate([tangents[-1], times[-1:], dots[m + 1 :]])
        for graph, x in zip(motions.after, self._before_end, strict=True):
            dots = self._tangents_at(self.segments[-1].motions, graph, x, float(self.t[-1]), dots)
        if motions.after:
            parts.append((self.t[-1:], self.x.T, dots[m : m + 1], dots[None, :m]))
        t, x, t_dot, x_dot = (np.concatenate(column) for column in zip(*parts, strict=True))
        if (end_graph := motions.equations.end) is not None:
            points = [*x.T[:, :, None], t[:, None], *motions.inputs[:, :, None]]
            moving = [*points, *x_dot.swapaxes(0, 1), t_dot, *dots[m + 1 :]]
            x = values_of(end_graph, points, len(t), 1)[:, :, 0].T
            x_dot = values_of(tangent(end_graph), moving, *t_dot.shape).swapaxes(0, 1)
        return t, x, t_dot, x_dot

    def _along(self, segment: Segment, dots: Array, lengths: Array) -> tuple[Array, Array]:
        """States (steps + 1, m), and tangents (steps + 1, m, k), from those of start, t and inputs.

        lengths: (steps, k), tangents of the lengths of the steps; none where these are constants.
        """
        tape, start, m, many = segment.tape, segment.start, len(self.x), dots.shape[1]
        vectors = {"x": dots[:m], "t": dots[m : m + 1], **segment.motions.equations.registers(dots[m + 1 :])}
        if start is not None:
            memory = start.derivative_memory(vectors, many)
            _run_all(start.of.derivative, memory, next(start.records(backwards=False))[2])
            found, failed = start.vectors(memory)
            self._require_solved(failed)
            vectors |= found
        push, names, memory = tape.of.derivative, tape.of.linear.vectors, tape.derivative_memory(vectors, many)
        states, tangents = [segment.begin.T], [push.read(memory, names["x"]).copy()[None]]
        changes = set((np.flatnonzero((np.diff(lengths, axis=0) != 0.0).any(axis=1)) + 1).tolist())
        for first, last, rows in tape.records(backwards=False):
            states.append(rows[:, -m:, 0])
            for begin, end in itertools.pairwise([first, *[k for k in range(first + 1, last) if k in changes], last]):
                if len(lengths):
                    push.read(memory, names["h"])[...] = lengths[begin]
                tangents.append(_run_all(push, memory, rows[begin - first : end - first]))
        self._require_solved(tape.vectors(memory)[1])
        return np.concatenate(states), np.concatenate(tangents)

    def _require_solved(self, failed: Array) -> None:
        """Raises MotionError where tangents or cotangents are those of equations that were not solved."""
        if ((failed != 0.0) & np.isfinite(self.x).all(axis=0)).any():
            raise MotionError("the equations of a step's derivative were not solved: the step is too long")

    def _slopes(self, motions: Motions, event: Arrival, x: Array, t: float) -> Array:
        """Slopes of an event's quantity by x, t and inputs, (m + 1 + .., 1)."""
        return _outputs(pullback(event.values), np.append(motions.point(x, t), [[1.0]], axis=0))

    def _cotangents_at(self, motions: Motions, graph: Graph, x: Array, t: float, bars: Array) -> Array:
        """Cotangents (m + 1 + .., N) of x, t and inputs, from those of the state that a graph makes of them."""
        before = _outputs(pullback(graph), np.concatenate([motions.point(x, t), bars[: len(x)]]))
        before[len(x) :] += bars[len(x) :]
        return before

    def _tangents_at(self, motions: Motions, graph: Graph, x: Array, t: float, dots: Array) -> Array:
        """Tangents (m + 1 + .., k) of the state that a graph makes of x, t and inputs, and of t and inputs."""
        moved = values_of(tangent(graph), [*motions.point(x, t), *dots], dots.shape[1])
        return np.concatenate([moved, dots[len(x) :]])

    def _made(self, motions: Motions, graphs: Iterable[Graph], x: Array, t: float) -> list[Array]:
        """States (m, N), and what graphs over states, t and parameters make of them, one after another."""
        return [*itertools.accumulate(graphs, lambda x, graph: _outputs(graph, motions.point(x, t)), initial=x)]


def _run_all(ready: Runner, memories: Array, rows: Array) -> Array:
    """The rows (passes, width, k) of k memories that are fed the same."""
    feed, many = rows[:, : ready.program.feed_width], memories.shape[1]
    if ready.masked is ready.program or many >= FEW_DIRECTIONS:
        return run_passes(ready, memories, len(feed), 1, feed)
    found = np.empty((len(feed), ready.program.width, many))
    for k in range(many):
        memory = memories[:, [k]]
        found[:, :, [k]] = run_passes(ready, memory, len(feed), 1, feed)
        memories[:, [k]] = memory
    return found


def _outputs(graph: Graph, points: Array) -> Array:
    """The outputs, (k, N), of a graph at points (n, N)."""
    count = points.shape[1]
    return values_of(graph, points if count > 1 else points[:, 0].tolist(), count)
