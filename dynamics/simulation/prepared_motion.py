"""PreparedMotion: a model, a method and options fixed once, for motions from many starts, in stages."""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array, real_array, real_number

from ..equations.states.initial_value import other_inputs, start_state
from ..integrators import METHODS, Problem, derive, force, in_form, total_energy
from ..systems.model import Model
from .applied_forces import Applied, Tau, with_applied
from .events.event import Event
from .events.event_program import EventProgram, event_program
from .outcome import INTERRUPTED, REACHED, Recorder, outcome
from .progress_bar import Progress
from .row_values import converted, unreached_momenta
from .run_options import SMALL, TABLES, RunOptions, room
from .steps.dense_output import StepBlock
from .steps.integration import integration_of
from .steps.step_program import compile_steps, step_program
from .steps.stepper import Stepper, stepper
from .steps.stepping import Integration
from .trajectory import MotionError, SimulationWarning, Solution, Stats, Trajectory

KEPT = 16  # sets of parameter values, whose equations a motion keeps


class Moving:
    """What moves in the runs of a motion with these parameters: the equations, bound to numbers, and the events."""

    def __init__(
        self, model: Model, tau: Tau, events: Sequence[Event], form: str, parameters: Mapping[str, Any] | None
    ) -> None:
        self.model, self.applied = with_applied(model, tau, parameters)
        self.numbers = other_inputs(self.model, self.applied.constant, parameters)
        self.problem = derive(self.model, self.applied.bound(self.numbers))
        self.stepped = in_form(self.problem, form)
        self.events: EventProgram | None = event_program(self.stepped, events) if events else None
        self.steppers, self.checked = threading.local(), False
        system = self.model.system
        self._plain = self.problem.normalization is None and (system is None or not len(system.constraints))

    def stepper(self, options: RunOptions) -> Stepper:
        """A memory in which motions run."""
        program = step_program(self.stepped, METHODS[options.method], dense=False)
        return stepper(compile_steps(program, options.backend), options, ())

    def plain_start(self, q: ArrayLike, qd: ArrayLike | None) -> Array | None:
        """The same as `start`, of arrays of the right shape and finite, without constraints; else None."""
        nq, m = self.problem.nq, self.problem.size
        if not self._plain or (qd is None) != (nq == m):
            return None
        x, first = np.empty(m), real_array("q", q)
        last = None if qd is None else real_array("qd", qd)
        if first.shape != (nq,) or (last is not None and last.shape != (m - nq,)):
            return None
        x[:nq] = first
        if last is not None:
            x[nq:] = last
        return x if isfinite(x.dot(x)) else None

    def start(self, q: ArrayLike, qd: ArrayLike | None, t0: float) -> Array:
        """The state (m,) of q and qd in which a run starts."""
        return start_state(self.model, q, qd, self.numbers, t0)

    @cached_property
    def graphs(self) -> RunGraphs:
        """What a trajectory computes accelerations, forces and energies by."""
        return RunGraphs(self.problem, self.applied)


class RunGraphs(Mapping[str, Graph]):
    """The graphs of a trajectory, each made when it is first asked for."""

    def __init__(self, problem: Problem, applied: Applied) -> None:
        self._made: dict[str, Graph] = {}
        makers = {"rate": lambda: problem.rate}
        if problem.system is not None:
            makers |= {"force": lambda: force(problem), "tau": lambda: applied.graph(problem)}
            makers["energy"] = lambda: total_energy(problem)
        if problem.multipliers is not None:
            makers["multipliers"] = lambda: problem.multipliers
        self._makers: dict[str, Callable[[], Any]] = makers

    def __getitem__(self, name: str) -> Graph:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


class MotionEnd(NamedTuple):
    """Where a motion ended, as `PreparedMotion.end` gives it.

    Parameters
    ----------
    t : float
        The end of the run, or the instant of the event that ended it [s].
    q, qd : ndarray
        The state there, (nq,) and (n,) [rad or m, per second]; of an OdeSystem q is the state, and qd empty.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.prepare(dyn.planar_arm([1.0], [1.0])).end([0.1], [0.0], t_end=1.0).q.round(3)
    array([-0.077])
    """

    t: float
    q: Array
    qd: Array


class PreparedMotion:
    """Motions of one model by one method, all but start, end and parameter values fixed; made by `prepare`.

    A call gives the Trajectory that `simulate` gives, to the bit. Any number of threads may call a motion at once: the
    memory in which it runs is one for each thread.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    >>> motion = dyn.prepare(arm, rtol=1e-12)
    >>> motion([1.0, 0.5], [0.0, 0.0], t_end=1.0, t_eval=[0.5, 1.0]).q.round(3).tolist()
    [[0.31, -0.04], [-0.989, 0.108]]
    >>> t, q, qd = motion.end([1.0, 0.5], [0.0, 0.0], t_end=1.0)
    >>> q.round(3).tolist()
    [-0.989, 0.108]
    """

    def __init__(
        self, model: Model, options: RunOptions, tau: Tau, events: Sequence[Event], form: str, dense_output: bool
    ) -> None:
        self._options, self._dense, self._events = options, dense_output, bool(events)
        self._moving = partial(Moving, model, tau, events, form)
        self._known: dict[Any, Moving] = {}

    def __call__(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float,
        t0: float = 0.0,
        *,
        t_eval: ArrayLike | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> Trajectory:
        """The motion from (q, qd) at t0 to t_end, to the bit that of `simulate`; arguments and errors as there."""
        return self.run(q, qd, self._options.over(t0, t_end, t_eval), parameters, stacklevel=3)

    def end(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float,
        t0: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> MotionEnd:
        """The end of the motion from (q, qd) at t0, alone: the last row of the trajectory, to the bit.

        It takes some microseconds besides the steps: a memory is kept, and the machine code entered once for a short
        run. With events, a sampled controller, constraints, momenta, `max_steps`, or where the error of equal steps is
        estimated, it takes as long as the trajectory, and warns of what that warns of; else it does not judge whether
        another method would be faster.

        Parameters
        ----------
        q, qd, t_end, t0, parameters
            As of `simulate`.

        Returns
        -------
        MotionEnd
            t, q, qd: at t_end, or at the event that ended the run.

        Raises
        ------
        MotionError
            Where the run stopped before its end, in the words of `Stats.message`.
        TypeError, ValueError
            As of `simulate`.

        Examples
        --------
        >>> import dynamics as dyn
        >>> decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
        >>> motion = dyn.prepare(decay, "rk4", dt=0.01, estimate_error=False)
        >>> motion.end([1.0], None, t_end=1.0).q.round(6)
        array([0.367879])
        """
        moving = self.moving(parameters)
        stepper = self._stepper(moving)
        if stepper is None:
            run = self.run(q, qd, self._options.over(t0, t_end, [t_end]), parameters, stacklevel=3)
            if not run.success:
                raise MotionError(f"the motion did not reach t_end, {run.message}")
            return MotionEnd(float(run.t[-1]), run.q[-1], run.qd[-1])
        stepper.begin(self._start(moving, q, qd, t0, t_end), t0, t_end)
        stepper.until(t_end)
        if stepper.failed:
            raise MotionError(f"the motion did not reach t_end, {stepper.failed}")
        x, nq = stepper.state, moving.stepped.nq
        return MotionEnd(stepper.t, x[:nq], x[nq:])

    def start(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> MotionSteps:
        """The motion from (q, qd) at t0 as it goes on, step by step or from one instant to the next.

        Parameters
        ----------
        q, qd, t0, parameters
            As of `simulate`.
        t_end : float, optional
            Where `step` goes to, and by which the first step is chosen [s]; without it the first instant that
            `propagate_until` is asked for.

        Returns
        -------
        MotionSteps
            With a memory of its own, for one thread at a time.

        Raises
        ------
        TypeError, ValueError
            As of `simulate`, and for a motion with events, a sampled controller, momenta, `max_steps`, or by one of
            SciPy's solvers.

        Examples
        --------
        >>> import dynamics as dyn
        >>> motion = dyn.prepare(dyn.planar_arm([1.0], [1.0]), rtol=1e-10)
        >>> going = motion.start([0.1], [0.0])
        >>> for k in range(3):
        ...     going.propagate_until(0.5 * (k + 1))
        ...     print(going.t, going.q.round(3), going.qd.round(3))
        0.5 [0.004] [-0.312]
        1.0 [-0.1] [-0.023]
        1.5 [-0.01] [0.311]
        """
        moving = self.moving(parameters)
        if not self._steps(moving):
            raise ValueError(
                "single steps are of motions without events, sampled controllers, max_steps and SciPy's solvers, in "
                'form="velocity": call the motion, which gives its rows'
            )
        x = self._start(moving, q, qd, t0, t0 + 1.0 if t_end is None else t_end)
        return MotionSteps(moving.stepper(self._options), x, float(t0), t_end, moving.stepped.nq)

    def _steps(self, moving: Moving) -> bool:
        """Whether its steps are ours alone, with nothing done between them."""
        options = self._options
        return not (
            self._events
            or moving.applied.controller is not None
            or options.scipy_solver is not None
            or moving.stepped.momenta
            or options.max_steps < math.inf
        )

    def _stepper(self, moving: Moving) -> Stepper | None:
        """That of this thread; None where an end needs more than steps."""
        steppers = moving.steppers
        try:
            found: Stepper | None = steppers.found
        except AttributeError:
            options = self._options
            rounded = options.adaptive and self._steps(moving) and options.relative < METHODS[options.method].finest
            plain = self._steps(moving) and not options.estimated and not rounded and moving.problem.projection is None
            found = steppers.found = moving.stepper(options) if plain else None
        return found

    def _start(self, moving: Moving, q: ArrayLike, qd: ArrayLike | None, t0: float, t_end: float) -> Array:
        """The state (m,) in which a run starts, all arguments checked."""
        if not (type(t0) is float and type(t_end) is float and isfinite(t_end - t0) and t_end != t0 and moving.checked):
            self._options.over(t0, t_end, None).check(moving.problem.states)
            moving.checked = self._options.adaptive
        x = moving.plain_start(q, qd)
        return moving.start(q, qd, t0) if x is None else x

    def moving(self, parameters: Mapping[str, Any] | None) -> Moving:
        """What moves with these parameter values, of the last few the same again."""
        key = None if parameters is None else _key(parameters)
        if (found := self._known.get(key)) is None:
            found = self._moving(parameters)
            if len(self._known) >= KEPT:
                self._known.pop(next(iter(self._known)), None)
            self._known[key] = found
        return found

    def run(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        options: RunOptions,
        parameters: Mapping[str, float] | None,
        stacklevel: int,
    ) -> Trajectory:
        """The motion over the span of options; warnings are those of the caller at a level of the stack."""
        moving = self.moving(parameters)
        start = moving.start(q, qd, options.t0)
        options.check(moving.problem.states)
        options.check_room(len(start))

        # Write the steps of the method over the equations, and compile them; the states are (q, qd), or here (q, p)
        stepped, hold = moving.stepped, moving.applied.hold(options, moving.stepped)
        between = moving.events is not None or self._dense
        made = partial(integration_of, stepped, events=moving.events, between=between)
        run, x = made(options, hold=hold), converted(stepped.momentum, options.t0, start)

        # Integrate, noting rows and events
        steps: list[StepBlock] | None = [] if self._dense else None
        stats, rows = _integrate(run, x, options, steps, made if hold is None else None)

        # Put the result together
        if missed := unreached_momenta(stepped, *rows, start=(options.t0, start, x)):
            stats = replace(stats, warnings=(*stats.warnings, *missed))
        early = not stats.success and not stats.message.startswith(INTERRUPTED)
        for text in [*([f"the run {stats.message}"] if early else []), *stats.warnings]:
            warnings.warn(text, SimulationWarning, stacklevel=stacklevel)
        nq, names = stepped.nq, moving.model
        times, states = rows[0], converted(stepped.velocities, *rows)
        return Trajectory(
            times,
            states[:, :nq],
            states[:, nq:],
            stats,
            run.crossings(nq),
            moving.graphs,
            None if steps is None else Solution(options.t0, x, steps, nq, stepped.velocities),
            None if hold is None else hold.held,
            names.coordinates,
            names.velocities,
            rows[1][:, nq:] if stepped.momenta else None,
        )


class MotionSteps:
    """A motion as it goes on, made by `PreparedMotion.start`. One thread at a time may move it.

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
    0.5 [0.004]
    0.75 [-0.055]
    1.0 [-0.076]
    """

    def __init__(self, stepper: Stepper, x: Array, t0: float, t_end: float | None, nq: int) -> None:
        self._stepper, self._nq, self._t_end = stepper, nq, None if t_end is None else float(t_end)
        self._x, self._begun, self._direction = x, False, 0.0
        stepper.begin(x, t0, t0 + 1.0 if t_end is None else t_end)

    @property
    def t(self) -> float:
        """Where the motion is [s]."""
        return self._stepper.t

    @property
    def q(self) -> Array:
        """Coordinates, (nq,)."""
        return self._stepper.state[: self._nq]

    @property
    def qd(self) -> Array:
        """Velocities, (n,)."""
        return self._stepper.state[self._nq :]

    def step(self) -> None:
        """One step more on the way to t_end.

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
        self._go(self._t_end)
        self._stepper.step()
        self._judge()

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
        t = real_number("t", t)
        if t == self.t:
            return
        self._go(t)
        self._stepper.until(t)
        self._judge()

    def _go(self, t: float) -> None:
        if not isfinite(t):
            raise ValueError(f"t must be finite, got {t!r} s")
        if self._direction * (t - self.t) < 0.0:
            raise ValueError(f"the motion is at t = {self.t:g} s and does not go back to t = {t:g} s: start it anew")
        if not self._begun:
            self._stepper.begin(self._x, self.t, t if self._t_end is None else self._t_end)
            self._direction, self._begun = math.copysign(1.0, t - self.t), True

    def _judge(self) -> None:
        if failed := self._stepper.failed:
            raise MotionError(f"the motion {failed}")


def _key(parameters: Mapping[str, Any]) -> Any:
    """What tells parameter values apart, 0.0 and -0.0 too; of what are none, a key of its own."""
    try:
        return tuple([(name, type(value), float(value).hex()) for name, value in parameters.items()])
    except (TypeError, ValueError, OverflowError, AttributeError):
        return object()


def _integrate(
    run: Integration,
    x: Array,
    options: RunOptions,
    steps: list[StepBlock] | None,
    again: Callable[[RunOptions], Integration] | None,
) -> tuple[Stats, tuple[Array, Array]]:
    """How a run from x goes, and its rows, times and states.  steps: see `_noted`.  again: see `outcome`."""
    recorder = Recorder(x, options.times, options.t0, options.direction)
    stats = outcome(run, x, recorder, options, _noted(run, x, recorder, options, steps), again)
    if stats.message != REACHED:  # where it ended is its last row, also between the times of t_eval
        recorder.add_last()
    return stats, recorder.table()


def _noted(
    run: Integration, x: Array, recorder: Recorder, options: RunOptions, steps: list[StepBlock] | None
) -> Iterator[StepBlock]:
    """The blocks of a run, until rows and steps fill the memory.  steps: receives them, with their dense output."""
    kept, most = 0, SMALL
    with Progress("simulate", options.length, options.progress) as report:
        for block in run.blocks(x):
            if steps is not None:
                steps.append(block if block.dense is not None else run.with_dense(block))
                kept += steps[-1].nbytes
            yield block if steps is None else steps[-1]
            if recorder.size + kept > most:
                most = room() / TABLES if most == SMALL else most
                if recorder.size + kept > most:
                    last = f"{recorder.last:.6g} s"
                    run.status = f"stopped at t = {last}: the rows fill the memory; t_eval records fewer"
                    return
            report(abs(float(block.t[-1]) - options.t0))
