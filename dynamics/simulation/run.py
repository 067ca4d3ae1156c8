"""Run: one model, one method and its options, and how its motions from any starts are made."""

from __future__ import annotations

import math
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, HoldsNodes, floats, kept_by_first

from ..equations.state_equation import state_inputs
from ..equations.states.initial_value import initial_values, other_inputs, start_state
from ..integrators import Problem, derive, force, in_form, quantity_inputs, total_energy
from ..systems.arguments import parameter_value
from ..systems.model import Equations, Model, as_equations
from .applied_force import Applied, Hold, Tau, with_applied
from .events.event import Event, EventProgram, event_program
from .outcome import (
    INTERRUPTED,
    REACHED,
    InterruptedMotion,
    MotionEnd,
    MotionError,
    MotionSteps,
    outcome,
    split_crossings,
)
from .progress_bar import Progress
from .run_options import RunOptions
from .stepper import Stepper, stepper_of
from .steps.dense_output import Solution, StepBlock
from .steps.row_values import converted
from .steps.step_program import step_program
from .trajectory import SimulationWarning, Trajectory
from .unreached_momenta import unreached_momenta

if TYPE_CHECKING:
    from .ensembles.workers import Workers

KEPT_PARAMETERS = 16  # sets of parameter values, whose equations a run keeps


class Run(HoldsNodes):
    """Motions of one model by one method, all but start, end and parameter values fixed; made by `prepare`.

    A call gives the Trajectory that `simulate` gives, to the bit. Any number of threads may call a run at once: the
    memory in which it moves is one for each thread.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    >>> run = dyn.prepare(arm, rtol=1e-12)
    >>> run([1.0, 0.5], [0.0, 0.0], t_end=1.0, t_eval=[0.5, 1.0]).q.round(3).tolist()
    [[0.31, -0.04], [-0.989, 0.108]]
    >>> t, q, qd = run.end([1.0, 0.5], [0.0, 0.0], t_end=1.0)
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
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        self._model, self._tau, self._events, self._parameters = model, tau, events, parameters
        self._options, self._form, self._dense_output, self._varied = options, form, dense_output, varied

    @cached_property
    def applied(self) -> Applied:
        """The equations of the model, and the force that is applied to it."""
        return with_applied(self._model, self._tau, self._values)

    @cached_property
    def _values(self) -> Mapping[str, Any] | None:
        """Values of parameters, those that stay open included, so that a controller knows its own."""
        if not (self._varied and isinstance(self._parameters, Mapping | None)):
            return self._parameters
        own = as_equations(self._model).parameters
        return {name: own.get(name, 0.0) for name in self._varied} | dict(self._parameters or {})

    @property
    def model(self) -> Equations:
        """The equations of the model."""
        return self.applied.model

    @cached_property
    def _numbers(self) -> Mapping[str, float]:
        """Numbers of the inputs of the state equation besides states and t."""
        return other_inputs(self.model, self.applied.constant, self._values)

    def equations(self, numbers: Mapping[str, float]) -> Problem:
        """The equations in the states that are stepped, with these numbers built in."""
        return in_form(derive(self.model, numbers), self._form)

    @cached_property
    def problem(self) -> Problem:
        """The equations with numbers built in, in q and qd."""
        stay = {*self._varied} if self.applied.controller is None else {*state_inputs(self.model).applied}
        return derive(self.model, {name: value for name, value in self._numbers.items() if name not in stay})

    @cached_property
    def stepped(self) -> Problem:
        """The equations in the states that are stepped."""
        return in_form(self.problem, self._form)

    @cached_property
    def watched(self) -> EventProgram | None:
        """The events to look for."""
        return event_program(self.stepped, self._events) if self._events else None

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
        return self._bound(parameters)._trajectory(q, qd, self._options.over(t0, t_end, t_eval), parameters)

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
        return self._bound(parameters)._end(q, qd, t_end, t0, parameters)

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
            As of `simulate_many`, whose options the run has.
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
        from .ensembles.simulate_many import ends_of  # which a trajectory does not need
        from .ensembles.task import Task

        if self._events:
            raise ValueError("ends of many motions are of those without events: simulate_many looks for them")
        run = self._bound(None if parameters is None else _single_values(parameters, self._varied))
        if run.applied.controller is not None:
            one = "a SampledController may remember what it has seen, and so controls one motion"
            raise TypeError(f"{one}: ends of many are without")
        run._require_given(parameters)
        options, problem = self._options.over(t0, t_end, [t_end]), run.stepped
        start = initial_values(run.model, q, qd, run.applied.constant, parameters, options.t0)
        p = np.empty((len(start.x), len(problem.parameters)))
        for k, name in enumerate(problem.parameters):
            p[:, k] = start.varied[name] if name in start.varied else start.bound[name]
        key = len(p), options.t0, options.t_end
        if run._last[0] != key:  # what is done once for calls that are alike
            options.check(run.problem.states)
            run._last = key, Task(step_program(problem, options.integrator, dense=False), options, len(p))
        x = ends_of(run._last[1], converted(problem.momentum, options.t0, start.x, p), p, workers)
        states = converted(problem.velocities, options.t_end, x, p)
        return MotionEnd(options.t_end, states[:, : problem.nq], states[:, problem.nq :])

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
        bound = self._bound(parameters)
        if not bound._is_of_steps_alone:
            raise ValueError(
                "single steps are of motions without events, sampled controllers and max_steps, in "
                'form="velocity": call the motion, which gives its rows'
            )
        x = bound._checked_start(q, qd, t0, t0 + 1.0 if t_end is None else t_end, parameters)
        stepper = bound._unrecorded()
        stepper.set_parameters(bound._open_values(parameters))
        return MotionSteps(stepper, x, float(t0), t_end)

    def compile(self) -> None:
        """Make the machine code of an end, and of rows at steps, with the model's own values of parameters."""
        if self._memory is None:
            self._stepper(self._options, [0.0] * len(self.problem.parameters), self._hold(self._options))

    def _open_values(self, parameters: Mapping[str, Any] | None) -> list[float]:
        """Values of the inputs of the problem that are not built in, with these of parameters."""
        if not self._varied:
            return []
        given = parameters or {}
        self._require_given(given)
        values = dict(self._numbers) | {name: parameter_value(name, value) for name, value in given.items()}
        if given and self.model.system is not None:
            self.model.system.require_values(values)
        return [values[name] for name in self.problem.parameters]

    def _require_given(self, parameters: Mapping[str, Any] | None) -> None:
        """Raises ValueError where a parameter of the controller has no value."""
        own = as_equations(self._model).parameters
        if missing := [name for name in self._varied if name not in own and name not in (parameters or {})]:
            raise ValueError(f"parameter {missing[0]!r} of the controller needs a value")

    @cached_property
    def _last(self) -> tuple[Any, Any]:
        """The task of the last call of `ends`, and what it was for."""
        return None, None

    @cached_property
    def _runs(self) -> dict[Any, Run]:
        """Runs with other parameters built in, by their values."""
        return {}

    def _bound(self, parameters: Mapping[str, Any] | None) -> Run:
        """The run with these values of parameters built in, but for those that stay open."""
        if self._varied and isinstance(parameters, Mapping):
            parameters = {name: value for name, value in parameters.items() if name not in self._varied}
        if parameters is None or (isinstance(parameters, Mapping) and not parameters):
            return self
        key = _values_key(parameters)
        if (found := self._runs.get(key)) is None:
            kept = self._model, self._options, self._tau, self._events, self._form, self._dense_output, self._varied
            found = Run(*kept, parameters)
            if len(self._runs) >= KEPT_PARAMETERS:
                self._runs.pop(next(iter(self._runs)), None)
            self._runs[key] = found
        return found

    @cached_property
    def _is_plain(self) -> bool:
        """Whether any finite q and qd of the right shapes are a start as they are."""
        return self.problem.normalization is None and self.problem.projection is None

    @property
    def _is_of_steps_alone(self) -> bool:
        """Whether nothing is done between the steps."""
        watched = self._events or self.applied.controller is not None
        return not (watched or self.stepped.momenta or self._options.max_steps < math.inf)

    @cached_property
    def _memories(self) -> threading.local:
        """The memory of each thread, in which its motions run one after another."""
        return threading.local()

    def _unrecorded(self) -> Stepper:
        """A memory in which motions run by steps alone."""
        return stepper_of(self.stepped, self._options, [0.0] * len(self.problem.parameters), events=None, between=False)

    @property
    def _memory(self) -> Stepper | None:
        """The memory of this thread; None where an end needs more than steps."""
        try:
            found: Stepper | None = self._memories.made
        except AttributeError:
            options, steps = self._options, self._is_of_steps_alone
            rounded = options.adaptive and steps and options.relative < options.integrator.finest
            plain = steps and not options.estimated and not rounded and self.problem.projection is None
            found = self._memories.made = self._unrecorded() if plain else None
        return found

    def _end(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float,
        t0: float,
        parameters: Mapping[str, float] | None,
    ) -> MotionEnd:
        """As `end`, with parameters built in."""
        alone = self._memory
        if alone is None:
            run = self._trajectory(q, qd, self._options.over(t0, t_end, [t_end]), parameters)
            if not run.success:
                raise MotionError(f"the motion did not reach t_end, {run.message}")
            return MotionEnd(float(run.t[-1]), run.q[-1], run.qd[-1])
        timely = type(t0) is float and type(t_end) is float and self._options.spans(t0, t_end)
        if self._varied:
            alone.set_parameters(self._open_values(parameters))
        q, qd = floats(q), floats(qd)
        plain = timely and self._is_plain and type(q) is np.ndarray and (qd is None or type(qd) is np.ndarray)
        if not (plain and alone.has_begun(q, qd, t0, t_end)):  # see what is wrong
            alone.begin(self._checked_start(q, qd, t0, t_end, parameters), float(t0), float(t_end))
        alone.to_end()
        if alone.status:
            raise MotionError(f"the motion did not reach t_end, {alone.status}")
        return MotionEnd(float(t_end), alone.q.copy(), alone.qd.copy())

    def _start(self, q: ArrayLike, qd: ArrayLike | None, t0: float, p: Sequence[float]) -> Array:
        """The state (m,) of q and qd in which a motion starts."""
        numbers = dict(self._numbers) | dict(zip(self.problem.parameters, p, strict=False))
        return start_state(self.model, q, qd, numbers, t0)

    def _checked_start(
        self, q: ArrayLike, qd: ArrayLike | None, t0: float, t_end: float, parameters: Mapping[str, Any] | None
    ) -> Array:
        """The state (m,) in which a motion starts, all arguments checked."""
        self._options.over(t0, t_end, None).check(self.problem.states)
        return self._start(q, qd, t0, self._open_values(parameters))

    def _hold(self, options: RunOptions) -> Hold | None:
        """The forces that a sampled controller is to hold. Raises ValueError for a motion that it cannot control."""
        controller, velocities = self.applied.controller, self.stepped.velocities
        if controller is None:
            return None
        if options.direction < 0.0:
            raise ValueError("a SampledController holds what it has seen, so that t_end has to be later than t0")
        observed = None if velocities is None else _compiled(velocities, options.backend)
        return Hold(controller, self.model.velocities, self.stepped.nq, options.t0, observed)

    def _stepper(self, options: RunOptions, p: Sequence[float], hold: Hold | None = None) -> Stepper:
        return stepper_of(
            self.stepped, options, p, hold, events=self.watched, between=bool(self._events) or self._dense_output
        )

    def _trajectory(
        self, q: ArrayLike, qd: ArrayLike | None, options: RunOptions, parameters: Mapping[str, float] | None
    ) -> Trajectory:
        """The motion over the span of options, with parameters built in. Raises InterruptedMotion by Ctrl-C."""
        p, stepped = self._open_values(parameters), self.stepped
        start, values = self._start(q, qd, options.t0, p), p or 0.0
        options.check(self.problem.states)
        options.check_room(len(start))

        # Write the steps of the method over the equations, and compile them; the states are (q, qd), or here (q, p)
        hold = self._hold(options)
        run, x = self._stepper(options, p, hold), converted(stepped.momentum, options.t0, start, values)

        # Integrate, noting rows and events
        steps: list[StepBlock] | None = [] if self._dense_output else None
        again = partial(self._stepper, p=p) if hold is None else None
        with Progress("simulate", options.length, options.progress) as report:
            stats, recorder = outcome(run, x, options, again, steps, report)
        if stats.message != REACHED:  # where it ended is its last row, also between the times of t_eval
            recorder.add_last()
        times, rows = recorder.table()

        # Put the result together
        if missed := unreached_momenta(stepped, times, rows, values, start=(options.t0, start, x)):
            stats = replace(stats, warnings=(*stats.warnings, *missed))
        early = not stats.success and not stats.message.startswith(INTERRUPTED)
        for text in [*([f"the run {stats.message}"] if early else []), *stats.warnings]:
            warnings.warn(text, SimulationWarning, stacklevel=_level_of_caller())
        nq, states = stepped.nq, converted(stepped.velocities, times, rows, values)
        bound = dict(zip(self.problem.parameters, p, strict=False))
        done = Trajectory(
            times,
            states[:, :nq],
            states[:, nq:],
            stats,
            {} if run.log is None else split_crossings(run.log.program, run.log.happened, nq, values),
            RunGraphs(self.problem, self.applied, bound) if bound else self._graphs,
            None if steps is None else Solution(options.t0, x, steps, nq, _specialized(stepped.velocities, bound)),
            None if hold is None else hold.held,
            self.model.coordinates,
            self.model.velocities,
            rows[:, nq:] if stepped.momenta else None,
        )
        if stats.message.startswith(INTERRUPTED):
            raise InterruptedMotion(done)
        return done

    @cached_property
    def _graphs(self) -> RunGraphs:
        return RunGraphs(self.problem, self.applied, {})


class RunGraphs(Mapping[str, Graph]):
    """The graphs of a trajectory, each made when it is first asked for.  bound: values of parameters."""

    def __init__(self, problem: Problem, applied: Applied, bound: Mapping[str, float]) -> None:
        self._made, self._bound = dict[str, Graph](), bound
        self._makers: dict[str, Callable[[], Graph | None]] = {"rate": lambda: problem.rate}
        if problem.system is not None:
            tau = {f"tau{k}": node for k, node in enumerate(applied.nodes or ())}
            self._makers |= {
                "force": lambda: force(problem),
                "tau": lambda: problem.bind(problem.states, Graph(quantity_inputs(problem), tau)),
                "energy": lambda: total_energy(problem),
            }
        if problem.multipliers is not None:
            self._makers["multipliers"] = lambda: problem.multipliers

    def __getitem__(self, name: str) -> Graph:
        if name not in self._made:
            graph = _specialized(self._makers[name](), self._bound)
            assert graph is not None
            self._made[name] = graph
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


def _specialized(graph: Graph | None, bound: Mapping[str, float]) -> Graph | None:
    """The graph with those of its inputs built in that have a value."""
    known = {} if graph is None else {name: value for name, value in bound.items() if name in graph.input_names}
    return cg.specialize(graph, known) if graph is not None and known else graph


@kept_by_first
def _compiled(velocities: Graph, backend: str) -> cg.Compiled:
    """The velocities of momenta, for a controller."""
    return cg.compile(velocities, backend)


def _single_values(parameters: Mapping[str, Any], varied: Sequence[str]) -> dict[str, Any]:
    """The parameters that are the same for all motions. Raises ValueError for another that has many values."""
    if not isinstance(parameters, Mapping):
        raise TypeError(f"parameters must be a mapping of names to numbers, got {parameters!r:.60}")
    if several := [name for name, value in parameters.items() if np.ndim(value) and name not in varied]:
        raise ValueError(
            f"parameter {several[0]!r} has a value for each motion, and the motion was prepared with one for all: "
            f"prepare(.., varied=[{several[0]!r}]) keeps it open"
        )
    return {name: value for name, value in parameters.items() if not np.ndim(value)}


def _values_key(parameters: Mapping[str, Any]) -> Any:
    """Key that tells parameter values apart, 0.0 and -0.0 too; a key of its own for what are none."""
    try:
        return tuple([(name, type(value), float(value).hex()) for name, value in parameters.items()])
    except (TypeError, ValueError, OverflowError, AttributeError):
        return object()


def _level_of_caller() -> int:
    """Level of the stack, above who asks, from which these files were called."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals["__name__"].startswith("dynamics.simulation."):
        level, frame = level + 1, frame.f_back
    return level
