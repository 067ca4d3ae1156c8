"""Outcome: one run made to its end, its rows, its statistics, and the advice of another method."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, counted, real_number

from .estimates.error_estimate import RunEstimate
from .run_options import SMALL_MEMORY, TABLES, Span, Steps, room
from .stepper import Stepper
from .steps.dense_output import StepBlock
from .steps.row_values import converted
from .trajectory import Crossings, SimulationWarning, Stats, Trajectory

if TYPE_CHECKING:
    from .events.event import EventProgram
    from .events.event_log import Happening

IMPLICIT = ("radau", "rodas")
OTHERS = ("radau", "dop853")  # of the rate the first takes no derivative by the time, and the second none at all
TRIED = 1000  # trials of steps of a method, at most
LONGER_STEPS = 4.0  # times as long as those of the run are steps that are worth a word
REACHED = "reached t_end"
INTERRUPTED = "interrupted"  # what the message of a run that Ctrl-C ended begins with


class MotionError(ValueError):
    """A motion that did not reach its end, or whose equations were not solved, where only the end or slopes count.

    Examples
    --------
    >>> import dynamics as dyn
    >>> runaway = dyn.OdeSystem(lambda x, t: [x[0] * x[0]], ["x"])
    >>> dyn.gradient(runaway, lambda x, t: x[0], [1.0], None, t_end=2.0)
    Traceback (most recent call last):
    dynamics.simulation.outcome.MotionError: the motion did not reach t_end, stopped at t = 1 s: ...
    """


class MotionEnd(NamedTuple):
    """End of a motion, as `Run.end` gives it, or of N, as `ends` does.

    Parameters
    ----------
    t : float
        The end of the run, or the instant of the event that ended it [s].
    q, qd : ndarray
        The state there, (nq,) and (n,) [rad or m, per second], or (N, nq) and (N, n); of an OdeSystem q is the state,
        and qd empty.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.prepare(dyn.planar_arm([1.0], [1.0])).end([0.1], [0.0], t_end=1.0).q.round(3)
    array([-0.077])
    """

    t: float
    q: Array
    qd: Array


class InterruptedMotion(KeyboardInterrupt):
    """Ctrl-C in a motion, whose rows until then are `run`."""

    def __init__(self, run: Trajectory) -> None:
        super().__init__(f"the motion was {run.message}")
        self.run = run


class MotionSteps:
    """A motion as it goes on, made by `Run.start`. One thread at a time may move it.

    By `step` to its end it has the states of the trajectory's rows, to the bit. An instant of `propagate_until` cuts a
    step, so that those that follow are others, within the same tolerance.

    Attributes
    ----------
    t : float
        Where the motion is [s].
    q, qd : ndarray
        The state there, (nq,) and (n,) [rad or m, per second]; of an OdeSystem q is the state, and qd empty.

    Examples
    --------
    >>> import dynamics as dyn
    >>> motion = dyn.prepare(dyn.planar_arm([1.0], [1.0]), "rk4", dt=0.25)
    >>> going = motion.start([0.1], [0.0], t_end=1.0)
    >>> while going.t < 1.0:
    ...     going.step()
    ...     print(going.t, going.q.round(3))
    0.25 [0.058]
    0.5 [-0.033]
    0.75 [-0.095]
    1.0 [-0.077]
    """

    def __init__(self, run: Stepper, x: Array, t0: float, t_end: float | None) -> None:
        self._run, self._x, self._t_end = run, x, None if t_end is None else float(t_end)
        self._direction = 0.0  # before the first step
        run.begin(x, t0, t0 + 1.0 if t_end is None else t_end)

    @property
    def t(self) -> float:
        """Time that the motion has reached [s]."""
        return self._run.t

    @property
    def q(self) -> Array:
        """Coordinates, (nq,)."""
        return self._run.q.copy()

    @property
    def qd(self) -> Array:
        """Velocities, (n,)."""
        return self._run.qd.copy()

    def step(self) -> None:
        """Take one step on the way to t_end.

        Raises
        ------
        MotionError
            Where the step cannot be made; the motion stays where it is.
        ValueError
            At t_end, and for a motion that was started without one.
        """
        if self._t_end is None or self._t_end == self.t:
            where = "was started without one" if self._t_end is None else f"is there, at t = {self.t:g} s"
            raise ValueError(f"a step goes on to t_end, and the motion {where}: propagate_until(t) goes on to a time")
        self._advance(self._t_end, single=True)

    def propagate_until(self, t: float) -> None:
        """Steps to an instant, the last of which ends there.

        Parameters
        ----------
        t : float
            The instant [s], in the direction in which the motion goes.

        Raises
        ------
        MotionError
            Where the motion stops before; it stays there.
        TypeError, ValueError
            For what is no time, or one that the motion has left behind.
        """
        if (t := real_number("t", t)) != self.t:
            self._advance(t, single=False)

    def _advance(self, t: float, *, single: bool) -> None:
        if not math.isfinite(t):
            raise ValueError(f"t must be finite, got {t!r} s")
        if self._direction * (t - self.t) < 0.0:
            raise ValueError(f"the motion is at t = {self.t:g} s and does not go back to t = {t:g} s: start it anew")
        if not self._direction:
            self._run.begin(self._x, self.t, t if self._t_end is None else self._t_end)
            self._direction = math.copysign(1.0, t - self.t)
        self._run.advance(t, single=single)
        for text in self._run.warnings:
            warnings.warn(text, SimulationWarning, stacklevel=3)
        self._run.warnings.clear()
        if self._run.status:
            raise MotionError(f"the motion {self._run.status}")


class Recorder:
    """The rows of a trajectory that starts with x: every step, or the states at the times of a span."""

    def __init__(self, x: Array, span: Span) -> None:
        self._times, self._direction = span.times, span.direction
        self.last, self._last_state = span.t0, x  # how far the run has come [s]
        at_start = self._next = int(span.times is None or span.times[0] == span.t0)  # of the times
        self._parts = [(np.array([span.t0])[:at_start], np.array([x])[:at_start])]  # times and states
        self.size = 0  # bytes

    def add(self, block: StepBlock) -> None:
        """The rows of these steps."""
        if not len(block.t):
            return
        last, following = float(block.t[-1]), self._next
        if self._times is None:
            self._append(block.t, block.x)
        else:
            following = int(np.searchsorted(self._direction * self._times, self._direction * last, side="right"))
            times = self._times[self._next : following]
            self._append(times, block.at(times))
        self._next, self.last, self._last_state = following, last, block.x[-1].copy()

    def add_last(self) -> None:
        """Add the state at which a run stopped as its last row, also between the times of t_eval."""
        recorded = [times[-1] for times, _ in self._parts if len(times)]
        if not recorded or self._direction * (self.last - recorded[-1]) > 0.0:
            self._append(np.array([self.last]), self._last_state[None])

    def _append(self, times: Array, states: Array) -> None:
        self._parts.append((times, states))
        self.size += times.nbytes + states.nbytes

    def table(self) -> tuple[Array, Array]:
        """Times (T,) and states (T, m)."""
        times, states = zip(*self._parts, strict=True)
        return np.concatenate(times), np.concatenate(states)


def outcome(
    run: Stepper,
    x: Array,
    span: Span,
    again: Callable[[Steps], Stepper] | None = None,
    steps: list[StepBlock] | None = None,
    report: Callable[[float], None] | None = None,
) -> tuple[Stats, Recorder]:
    """How a run from x (m,) goes, and its rows; steps: receives all; report: is told how far it is [s]."""
    recorder, estimate = Recorder(x, span), RunEstimate(run, x, span)
    begin, kept, most = time.perf_counter(), 0, SMALL_MEMORY
    error, at_end, end = None, None, None
    doubts: tuple[str, ...] = ()
    try:
        with np.errstate(all="ignore"):
            for block in run.blocks(x, span):
                made = block if steps is None else run.with_dense(block)
                recorder.add(made)
                estimate.add(made)
                if steps is not None:
                    steps.append(made)
                    kept += made.nbytes
                if report is None:
                    continue
                report(abs(recorder.last - span.t0))
                most = room() / TABLES if recorder.size + kept > most == SMALL_MEMORY else most
                if recorder.size + kept > most:
                    run.status = f"stopped at t = {recorder.last:.6g} s: the rows fill the memory; t_eval records fewer"
                    break
            if not run.status:
                error, at_end, doubts = estimate.result()
        end = time.perf_counter()
        advise(run, recorder.last, span, x, again)
    except KeyboardInterrupt:
        run.status = f"{INTERRUPTED} after t = {recorder.last:.6g} s"
    stats = Stats(
        run.options.method,
        run.steps,
        run.rejected,
        run.evaluations,
        run.largest,
        (time.perf_counter() if end is None else end) - begin - estimate.seconds,
        not run.status,
        run.status or run.event or REACHED,
        -1 if run.status else int(bool(run.event)),
        run.jacobians,
        run.factorizations,
        error,
        at_end,
        (*run.warnings, *doubts),
        *run.compiled.prices,
    )
    return stats, recorder


def advise(run: Stepper, reached: float, span: Span, x: Array, again: Callable[[Steps], Stepper] | None) -> None:
    """Name a method that does better in the warning of a stiff run, or in the status of one that lacks a derivative."""
    if not (run.stiff or run.slope) or again is None:
        return
    length = LONGER_STEPS * abs(reached - span.t0) / max(run.steps, 1)
    for name in OTHERS if run.slope else IMPLICIT:
        t = span.t0
        try:
            trial = again(replace(run.options, method=name, max_steps=TRIED))
            with np.errstate(all="ignore"):
                for block in trial.blocks(x, Span(span.t_end, t0=span.t0)):
                    t = float(block.t[-1]) if len(block.t) else t
        except Exception:  # noqa: BLE001, S112 -- whatever another method lacks: the run that was asked for is done
            continue
        text = f"; try method={name!r}, which comes to t = {t:.6g} s in {counted(trial.steps, 'step')}"
        if run.slope and not trial.status:
            run.status += text
            return
        whole = trial.steps + trial.rejected < TRIED
        if not run.slope and not (trial.status and whole) and abs(t - span.t0) >= length * trial.steps > 0.0:
            run.warnings[run.warnings.index(run.stiff)] += text
            return


def split_crossings(
    program: EventProgram, happened: Sequence[Happening], nq: int, parameters: ArrayLike = 0.0
) -> dict[str, Crossings]:
    """Crossings by the event's name, from (number, t, x), with states split after nq numbers into q and qd."""
    result = {}
    for number, event in enumerate(program.events):
        matching = [(t, x) for k, t, x in happened if k == number]
        times = np.array([t for t, _ in matching])
        states = np.array([x for _, x in matching]).reshape(len(matching), len(program.components))
        states = converted(program.velocities, times, states, parameters)
        result[event.name] = Crossings(times, states[:, :nq], states[:, nq:])
    return result
