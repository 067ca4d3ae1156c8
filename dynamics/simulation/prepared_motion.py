"""Prepared motions: one model, one method and its options, and how its motions from many starts are run."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, HoldsNodes, floats

from ..systems.model import Model
from .events.event import Event
from .moving import Moving, Tau, values_key
from .outcome import INTERRUPTED, REACHED, InterruptedMotion, MotionEnd, MotionError, outcome
from .progress_bar import Progress
from .row_values import converted, unreached_momenta
from .run_options import RunOptions
from .steps.dense_output import Solution, StepBlock
from .steps.integration import integration_of
from .steps.stepping import NativeIntegration
from .trajectory import SimulationWarning, Trajectory

if TYPE_CHECKING:
    from .ensembles.workers import Workers
    from .motion_steps import MotionSteps

KEPT_PARAMETERS = 16  # sets of parameter values, whose equations a motion keeps


class PreparedMotion(HoldsNodes):
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
        self,
        model: Model,
        options: RunOptions,
        tau: Tau,
        events: Sequence[Event],
        form: str,
        dense_output: bool,
        varied: tuple[str, ...],
    ) -> None:
        self._options, self._dense, self._events, self._varied = options, dense_output, bool(events), varied
        self._make = partial(Moving, model, tau, events, form, varied)
        self._known: dict[Any, Moving] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_known": {}}  # another process makes its own memory

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
        """The motion from (q, qd) at t0 to t_end, to the bit that of `simulate`; arguments and errors as there.

        Ctrl-C is a KeyboardInterrupt, so that a loop of calls ends; `run` of it is the motion until then.
        """
        return self._run(q, qd, self._options.over(t0, t_end, t_eval), parameters)

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
        moving = self._moving(parameters)
        alone = self._alone(moving)
        if alone is None:
            run = self._run(q, qd, self._options.over(t0, t_end, [t_end]), parameters)
            if not run.success:
                raise MotionError(f"the motion did not reach t_end, {run.message}")
            return MotionEnd(float(run.t[-1]), run.q[-1], run.qd[-1])
        timely = type(t0) is float and type(t_end) is float and self._options.spans(t0, t_end)
        if self._varied:
            alone.set_parameters(moving.values(parameters))
        q, qd = floats(q), floats(qd)
        plain = timely and moving.plain and type(q) is np.ndarray and (qd is None or type(qd) is np.ndarray)
        if not (plain and alone.begins(q, qd, t0, t_end)):  # see what is wrong
            alone.begin(self._start(moving, q, qd, t0, t_end, parameters), float(t0), float(t_end))
        alone.to_end()
        if alone.status:
            raise MotionError(f"the motion did not reach t_end, {alone.status}")
        return MotionEnd(float(t_end), alone.q.copy(), alone.qd.copy())

    def ends(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        workers: Workers = 1,
    ) -> MotionEnd:
        """The ends of motions from N starts at t0, side by side: the last rows of `simulate_many`, to the bit.

        All that is not a step is done once, in the first call: what follows, as in a loop of control, pays the steps.
        A motion that stops before its end is NaN, and a `SimulationWarning` says of how many and why.

        Parameters
        ----------
        q, qd, workers
            As of `simulate_many`, whose options the motion has.
        t_end, t0
            As of `simulate`.
        parameters : mapping, optional
            {name: value}; of those that the motion keeps open, `varied`, also one for each start, (N,).

        Returns
        -------
        MotionEnd
            t_end, q (N, nq) and qd (N, n).

        Raises
        ------
        TypeError, ValueError
            As of `simulate_many`, for a parameter with many values that is not kept open, and for a motion with events.

        Examples
        --------
        >>> import dynamics as dyn
        >>> spring = dyn.System(lambda q, qd, t, p: qd[0]**2 / 2 - p["k"] * q[0]**2 / 2, "x", parameters={"k": 1.0})
        >>> motion = dyn.prepare(spring, "rk4", dt=0.01, varied="k", estimate_error=False)
        >>> motion.ends([1.0], [0.0], t_end=1.0, parameters={"k": [1.0, 4.0]}).q.round(6).tolist()
        [[0.540302], [-0.416147]]
        """
        from .ensembles.simulate_many import ends_of, single_values  # which a trajectory does not need

        if self._events:
            raise ValueError("ends of many motions are of those without events: simulate_many looks for them")
        moving = self._moving(None if parameters is None else single_values(parameters, self._varied))
        options = self._options.over(t0, t_end, [t_end])
        return MotionEnd(options.t_end, *ends_of(moving, options, q, qd, parameters, workers))

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
            As of `simulate`, and for a motion with events, a sampled controller, momenta, or `max_steps`.

        Examples
        --------
        >>> import dynamics as dyn
        >>> motion = dyn.prepare(dyn.planar_arm([1.0], [1.0]), rtol=1e-10)
        >>> going = motion.start([0.1], [0.0])
        >>> for k in range(3):
        ...     going.propagate_until(0.5 * (k + 1))
        ...     print(going.t, going.q.round(3), going.qd.round(3))
        0.5 [-0.034] [-0.361]
        1.0 [-0.077] [0.245]
        1.5 [0.086] [0.195]
        """
        from .motion_steps import MotionSteps  # which a trajectory does not need

        moving = self._moving(parameters)
        if not self._steps(moving):
            raise ValueError(
                "single steps are of motions without events, sampled controllers and max_steps, in "
                'form="velocity": call the motion, which gives its rows'
            )
        x = self._start(moving, q, qd, t0, t0 + 1.0 if t_end is None else t_end, parameters)
        run = self._native(moving)
        run.set_parameters(moving.values(parameters))
        return MotionSteps(run, x, float(t0), t_end)

    def compile(self) -> None:
        """Make the machine code of an end, and of rows at steps, with the model's own values of parameters."""
        moving, options = self._moving(None), self._options
        if self._alone(moving) is None:
            zeros, hold = [0.0] * len(moving.problem.parameters), moving.applied.hold(options, moving.stepped)
            between = moving.events is not None or self._dense
            integration_of(moving.stepped, options, zeros, hold, events=moving.events, between=between)

    def _steps(self, moving: Moving) -> bool:
        """Whether nothing is done between the motion's steps."""
        watched = self._events or moving.applied.controller is not None
        return not (watched or moving.stepped.momenta or self._options.max_steps < math.inf)

    def _native(self, moving: Moving) -> NativeIntegration:
        """A memory in which motions run by steps alone."""
        zeros = [0.0] * len(moving.problem.parameters)
        run = integration_of(moving.stepped, self._options, zeros, events=None, between=False)
        assert isinstance(run, NativeIntegration)
        return run

    def _alone(self, moving: Moving) -> NativeIntegration | None:
        """The memory of this thread; None where an end needs more than steps."""
        try:
            found: NativeIntegration | None = moving.kept.run
        except AttributeError:
            options = self._options
            rounded = options.adaptive and self._steps(moving) and options.relative < options.integrator.finest
            plain = self._steps(moving) and not options.estimated and not rounded and moving.problem.projection is None
            found = moving.kept.run = self._native(moving) if plain else None
        return found

    def _start(
        self, moving: Moving, q: ArrayLike, qd: ArrayLike | None, t0: float, t_end: float, parameters: Any
    ) -> Array:
        """The state (m,) in which a run starts, all arguments checked."""
        self._options.over(t0, t_end, None).check(moving.problem.states)
        return moving.start(q, qd, t0, moving.values(parameters))

    def _moving(self, parameters: Mapping[str, Any] | None) -> Moving:
        """Moving parts with these values of built-in parameters, kept for the last few values."""
        if self._varied and isinstance(parameters, Mapping):
            parameters = {name: value for name, value in parameters.items() if name not in self._varied}
        if isinstance(parameters, Mapping) and not parameters:
            parameters = None
        key = None if parameters is None else values_key(parameters)
        if (found := self._known.get(key)) is None:
            found = self._make(parameters)
            if len(self._known) >= KEPT_PARAMETERS:
                self._known.pop(next(iter(self._known)), None)
            self._known[key] = found
        return found

    def _run(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        options: RunOptions,
        parameters: Mapping[str, float] | None,
    ) -> Trajectory:
        """The motion over the span of options. Raises InterruptedMotion by Ctrl-C."""
        moving = self._moving(parameters)
        p = moving.values(parameters)
        start, values = moving.start(q, qd, options.t0, p), p or 0.0
        options.check(moving.problem.states)
        options.check_room(len(start))

        # Write the steps of the method over the equations, and compile them; the states are (q, qd), or here (q, p)
        stepped, hold = moving.stepped, moving.applied.hold(options, moving.stepped)
        between = moving.events is not None or self._dense
        made = partial(integration_of, stepped, parameters=p, events=moving.events, between=between)
        run, x = made(options, hold=hold), converted(stepped.momentum, options.t0, start, values)

        # Integrate, noting rows and events
        steps: list[StepBlock] | None = [] if self._dense else None
        with Progress("simulate", options.length, options.progress) as report:
            stats, recorder = outcome(run, x, options, made if hold is None else None, steps, report)
        if stats.message != REACHED:  # where it ended is its last row, also between the times of t_eval
            recorder.add_last()
        rows = recorder.table()
        # Put the result together
        if missed := unreached_momenta(stepped, *rows, values, start=(options.t0, start, x)):
            stats = replace(stats, warnings=(*stats.warnings, *missed))
        early = not stats.success and not stats.message.startswith(INTERRUPTED)
        for text in [*([f"the run {stats.message}"] if early else []), *stats.warnings]:
            warnings.warn(text, SimulationWarning, stacklevel=_level_of_caller())
        nq, names = stepped.nq, moving.model
        times, states = rows[0], converted(stepped.velocities, *rows, values)
        done = Trajectory(
            times,
            states[:, :nq],
            states[:, nq:],
            stats,
            run.crossings(nq, values),
            moving.graphs(p),
            None if steps is None else Solution(options.t0, x, steps, nq, moving.velocities(p)),
            None if hold is None else hold.held,
            names.coordinates,
            names.velocities,
            rows[1][:, nq:] if stepped.momenta else None,
        )
        if stats.message.startswith(INTERRUPTED):
            raise InterruptedMotion(done)
        return done


def _level_of_caller() -> int:
    """Level of the stack, above who asks, from which these files were called."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals["__name__"].startswith("dynamics.simulation."):
        level, frame = level + 1, frame.f_back
    return level
