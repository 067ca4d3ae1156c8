"""Outcome: one run made to its end, its rows, and its statistics."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, real_number

from ..integrators import Problem
from .error_estimate import RunEstimate
from .events.event import EventProgram
from .events.event_log import Happening
from .run_options import SMALL_MEMORY, TABLES, Span, room
from .stepper import Stepper
from .steps.dense_output import StepBlock
from .steps.row_values import converted, row_values
from .steps.state_sizes import OTHERS as SMALLEST_SHARE
from .trajectory import Crossings, SimulationWarning, Stats, Trajectory

REACHED = "reached t_end"
LOOSE = 1e-6  # of a momentum, or so much of the largest: what an iteration may leave of it; of a velocity the same
SLOW = 1e-2  # of the largest velocity: below, one counts as no smaller
INTERRUPTED = "interrupted"  # what the message of a run that Ctrl-C ended begins with

QUIET = 1.0  # s: a run shorter than this has no progress line


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
        The state there, (nq,) and (n,) [rad or m, per second], or (N, nq) and (N, n); of an OdeSystem q alone.

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

    By `step` it has the states of the trajectory's rows, to the bit; an instant of `propagate_until` cuts a step.

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
        self._run.go(t, single=single)
        for text in self._run.warnings:
            warnings.warn(text, SimulationWarning, stacklevel=3)
        self._run.warnings.clear()
        if self._run.status:
            raise MotionError(f"the motion {self._run.status}")


class Progress:
    """A progress line on the terminal for runs that take long.

    `with Progress("simulate", total=10.0) as progress: progress(3.2)`; show: None asks if it is a terminal.
    """

    def __init__(
        self, what: str, total: float, show: bool | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.what, self.total, self.clock = what, total, clock
        self.show = sys.stderr.isatty() if show is None else show
        self.start = self.last = clock()
        self.written = False

    def __call__(self, done: float) -> None:
        """Say how far the run is, at most ten times a second."""
        now = self.clock()
        if self.show and now - self.start >= QUIET and now - self.last >= 0.1:
            self.last, self.written = now, True
            share = min(done / self.total, 1.0) if self.total else 1.0
            bar = "#" * int(24 * share)
            sys.stderr.write(f"\r{self.what} [{bar:24}] {share:4.0%}  {now - self.start:.0f} s")
            sys.stderr.flush()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        if self.written:
            sys.stderr.write("\n")


class Recorder:
    """The rows of a trajectory that starts with x: every step, or the states at the times of a span."""

    def __init__(self, x: Array, span: Span) -> None:
        self._times, self._direction = span.times, span.direction
        self.last, self._last_state = span.t0, x  # how far the run has come [s]
        at_start = self._next = int(span.times is None or span.times[0] == span.t0)  # of the times
        self._parts = [(np.array([span.t0])[:at_start], np.array([x])[:at_start])]  # times and states
        self.size = 0  # bytes

    def record(self, block: StepBlock) -> None:
        """The rows of these steps."""
        if self._times is None:
            self._append(block.t, block.x)
        else:
            following = int(np.searchsorted(self._direction * self._times, self._direction * block.t[-1], side="right"))
            times = self._times[self._next : following]
            self._append(times, block.at(times))
            self._next = following
        self.last, self._last_state = float(block.t[-1]), block.x[-1].copy()

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
    run: Stepper, x: Array, span: Span, steps: list[StepBlock] | None = None, report: Progress | None = None
) -> tuple[Stats, Recorder]:
    """How a run from x (m,) goes, and its rows; steps: receives all; report: is told how far it is [s]."""
    begin, kept, most = time.perf_counter(), 0, SMALL_MEMORY
    recorder, estimate = Recorder(x, span), RunEstimate(run, x, span)
    found: tuple[float | None, float | None, tuple[str, ...]] = None, None, ()
    try:
        with np.errstate(all="ignore"):
            for block in run.blocks(x, span):
                made = block if steps is None else run.with_dense(block)
                recorder.record(made)
                estimate.note(made)
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
                found = estimate.result()
    except KeyboardInterrupt:
        run.status = f"{INTERRUPTED} after t = {recorder.last:.6g} s"
    counts = run.steps, run.rejected, run.evaluations, run.largest, time.perf_counter() - begin - estimate.seconds
    ended = not run.status, run.status or run.event or REACHED, -1 if run.status else int(bool(run.event))
    work, (error, at_end, doubts) = (run.jacobians, run.factorizations), found
    return Stats(run.options.method, *counts, *ended, *work, error, at_end, (*run.warnings, *doubts)), recorder


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


def unreached_momenta(
    problem: Problem, times: Array, rows: Array, parameters: ArrayLike = 0.0, *, start: tuple[float, Array, Array]
) -> list[str]:
    """Doubts of rows (T, m) of a problem in momenta; start: the instant, q and qd, and the state (m,) they make."""
    if problem.missing is None or not len(rows):
        return []
    said, instead, nq, (t, begin, x) = [], "take form='velocity'", problem.nq, start
    # Of an L that is not convex several velocities have the same momenta
    qd, back = begin[nq:], converted(problem.velocities, t, x, parameters)[nq:]
    off = np.abs(back - qd) > LOOSE * np.maximum(np.abs(qd), SLOW * np.abs(qd).max(initial=0.0))
    for k in np.flatnonzero(off)[:1] if qd.any() else ():
        other = f"of the {problem.components[nq + k]} it is {back[k]:.6g} in place of {qd[k]:.6g}"
        said.append(f"the momenta of the start belong to other velocities too: {other}; {instead}")
    momenta, missing = rows[:, nq:], row_values(problem.missing, times, rows, parameters)
    sizes = np.abs(momenta).max(axis=0, initial=0.0)
    allowed = LOOSE * np.maximum(sizes, SMALLEST_SHARE * sizes.max(initial=0.0))
    for row, k in np.argwhere(~(np.abs(missing) <= allowed))[:1]:
        left = f"{missing[row, k]:.2g} of {momenta[row, k]:.2g}, {problem.components[nq + k]}"
        text = f"at t = {times[row]:.6g} s the velocities do not have the momenta: the iteration leaves {left}"
        said.append(f"{text}; {instead}")
    return said
