"""Run: one model, one method and its options, and how its motions from any starts are made."""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, HoldsNodes, floats, real_number, require_kind

from ..equations.state_equation import state_inputs
from ..equations.states.initial_value import initial_values, note_start, other_inputs, start_state
from ..integrators import Problem, derive, force, in_form, quantity_inputs, total_energy
from ..integrators.rate_in_modes import rows_in_modes, switched
from ..systems.arguments import parameter_value
from ..systems.evaluation import ByRows
from ..systems.model import Model, as_equations
from .applied_force import Applied, Hold, Tau, with_applied
from .events.event import Event, EventProgram, event_program
from .events.modes import Modes, Turn
from .outcome import (
    INTERRUPTED,
    REACHED,
    InterruptedMotion,
    MotionEnd,
    MotionError,
    MotionSteps,
    Progress,
    outcome,
    split_crossings,
    unreached_momenta,
)
from .run_options import TABLES, Span, Steps, require_room
from .stepper import Stepper, stepper_of
from .steps.dense_output import Solution, StepBlock
from .steps.equal_steps import step_count
from .steps.row_values import compiled, converted
from .trajectory import Sides, SimulationWarning, Trajectory

if TYPE_CHECKING:
    from .ensembles.task import Workers

Values: TypeAlias = Mapping[str, Any] | None  # {name of a parameter: value}
KEPT = 16  # runs with other parameters, and tasks, that a run keeps


class RunEquations(NamedTuple):
    """What a run moves by: equations and applied force, and as problems with numbers built in."""

    applied: Applied
    numbers: Mapping[str, float]  # of the inputs of the state equation besides states and t
    problem: Problem  # in q and qd
    stepped: Problem  # in the states that are stepped
    watched: EventProgram | None


@dataclass(eq=False, repr=False)
class Run(HoldsNodes):
    """Motions of one model by one method, all but start, end and parameter values fixed; made by `prepare`.

    A call gives the Trajectory that `simulate` gives, to the bit. Any number of threads may call a run at once.

    Examples
    --------
    >>> import dynamics as dyn
    >>> run = dyn.prepare(dyn.planar_arm([1.0, 0.8], [1.0, 0.8]), rtol=1e-12)
    >>> run([1.0, 0.5], [0.0, 0.0], t_end=1.0, t_eval=[0.5, 1.0]).q.round(3).tolist()
    [[0.31, -0.04], [-0.989, 0.108]]
    """

    _model: Model
    _options: Steps
    _tau: Tau
    _events: Sequence[Event]
    _form: str
    _dense_output: bool
    _varied: tuple[str, ...]
    _parameters: Values = None

    @cached_property
    def _values(self) -> Values:
        if not self._varied:
            return self._parameters
        own = as_equations(self._model).parameters  # also those that stay open, so that a controller knows its own
        return {name: own.get(name, 0.0) for name in self._varied} | dict(self._parameters or {})

    @cached_property
    def applied(self) -> Applied:
        """The equations of the model, and the force that is applied to it."""
        return with_applied(self._model, self._tau, self._values)

    @cached_property
    def _equations(self) -> RunEquations:
        applied = self.applied
        numbers = other_inputs(applied.model, applied.constant, self._values)
        stay = {*self._varied} if applied.controller is None else {*state_inputs(applied.model).applied}
        bound = {name: value for name, value in numbers.items() if name not in stay}
        problem = derive(applied.model, bound, by_rows=self._options.integrator.by_rows)
        stepped = switched(in_form(problem, self._form))
        watched = event_program(stepped, self._events) if self._events else None
        return RunEquations(applied, numbers, problem, stepped, watched)

    def __call__(
        self,
        q: ArrayLike,
        qd: ArrayLike | None,
        t_end: float,
        t0: float = 0.0,
        *,
        t_eval: ArrayLike | None = None,
        parameters: Values = None,
    ) -> Trajectory:
        """The motion from (q, qd) at t0 to t_end, to the bit that of `simulate`; arguments and errors as there.

        Ctrl-C is a KeyboardInterrupt, so that a loop of calls ends; `run` of it is the motion until then.
        """
        return self._bound(parameters)._trajectory(q, qd, Span(t_end, t0=t0, t_eval=t_eval), parameters)

    def end(
        self, q: ArrayLike, qd: ArrayLike | None, t_end: float, t0: float = 0.0, parameters: Values = None
    ) -> MotionEnd:
        """The end of the motion from (q, qd) at t0, alone: the last row of the trajectory, to the bit.

        It takes some microseconds besides the steps; with events, a sampled controller, constraints, momenta,
        `max_steps`, or where the error of equal steps is estimated, as long as the trajectory, and warns as that does.

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
        run = self if parameters is None else self._bound(parameters)
        if (alone := run._memory) is None:
            motion = run._trajectory(q, qd, Span(t_end, t0=t0, t_eval=[t_end]), parameters)
            if not motion.success:
                raise MotionError(f"the motion did not reach t_end, {motion.message}")
            return MotionEnd(float(motion.t[-1]), motion.q[-1], motion.qd[-1])
        if self._varied:
            alone.set_parameters(run._open_values(parameters))
        q, qd = floats(q), floats(qd)
        plain = type(q) is np.ndarray and (qd is None or type(qd) is np.ndarray) and alone.program.normalization is None
        plain = plain and type(t0) is type(t_end) is float and self._options.may_go(t0, t_end)
        if not (plain and alone.try_begin(q, qd, t0, t_end)):  # see what is wrong
            span = Span(t_end, t0=t0)
            alone.begin(run._start(q, qd, span, alone.parameters), span.t0, span.t_end)
            t_end = span.t_end
        alone.advance(t_end)
        if alone.status:
            raise MotionError(f"the motion did not reach t_end, {alone.status}")
        return MotionEnd(t_end, alone.q.copy(), alone.qd.copy())

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

        What is not a step is done in the first call. A motion that stops before its end is NaN, and a
        `SimulationWarning` says of how many and why.

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
        values = parameters if isinstance(parameters, Mapping) else {}
        if several := [name for name, value in values.items() if np.ndim(value) and name not in self._varied]:
            what = f"parameter {several[0]!r} has a value for each motion, and the motion was prepared with one for all"
            raise ValueError(f"{what}: prepare(.., varied=[{several[0]!r}]) keeps it open")
        run = self._bound(parameters)
        applied, _, _, problem, _ = run._equations
        if applied.controller is not None:
            one = "a SampledController may remember what it has seen, and so controls one motion"
            raise TypeError(f"{one}: ends of many are without")
        run._require_controller_values(parameters)
        span = Span(t_end, t0=t0, t_eval=[t_end])
        start = initial_values(applied.model, q, qd, applied.constant, parameters, span.t0)
        p = np.empty((len(start.x), len(problem.given)))
        for k, name in enumerate(problem.given):
            p[:, k] = start.varied[name] if name in start.varied else start.bound[name]

        def task() -> Task:
            self._options.check(span, run._equations.problem.states)
            return Task(problem, self._options, span, len(p), dense=False)

        x = ends_of(
            run._made((len(p), span.t0, span.t_end), task), converted(problem.momentum, span.t0, start.x, p), p, workers
        )
        states = converted(problem.velocities, span.t_end, x, p)
        return MotionEnd(span.t_end, states[:, : problem.nq], states[:, problem.nq :])

    def start(
        self, q: ArrayLike, qd: ArrayLike | None, t_end: float | None = None, t0: float = 0.0, parameters: Values = None
    ) -> MotionSteps:
        """The motion from (q, qd) at t0 as it goes on, step by step or from one instant to the next.

        Parameters
        ----------
        q, qd, t0, parameters
            As of `simulate`.
        t_end : float, optional
            Where `step` goes to, and by which the first step is chosen [s]; by default the first instant propagated to.

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
        >>> going = dyn.prepare(dyn.planar_arm([1.0], [1.0]), rtol=1e-10).start([0.1], [0.0])
        >>> going.propagate_until(0.5)
        >>> going.t, going.q.round(3), going.qd.round(3)
        (0.5, array([-0.034]), array([-0.361]))
        """
        run = self._bound(parameters)
        if not run._is_of_steps_alone:
            raise ValueError("single steps are of motions without events, sampled controllers, momenta and max_steps")
        p, span = run._open_values(parameters), Span(real_number("t0", t0) + 1.0 if t_end is None else t_end, t0=t0)
        x = run._start(q, qd, span, p)
        return MotionSteps(stepper_of(run._equations.stepped, run._options, p, dense=False), x, span.t0, t_end)

    def compile(self) -> None:
        """Make the machine code of an end, and of rows at steps, with the model's own values of parameters."""
        if self._memory is None:
            self._stepper([0.0] * len(self._equations.problem.parameters))

    def _open_values(self, parameters: Mapping[str, Any] | None) -> list[float]:
        """Values of the inputs of the problem that are not built in, with these of parameters."""
        if not self._varied:
            return []
        given = parameters or {}
        self._require_controller_values(given)
        values = dict(self._equations.numbers) | {name: parameter_value(name, each) for name, each in given.items()}
        if given and (system := self._equations.applied.model.system) is not None:
            system.require_values(values)
        return [values[name] for name in self._equations.problem.parameters]

    def _require_controller_values(self, parameters: Mapping[str, Any] | None) -> None:
        """Raises ValueError where a parameter of the controller has no value."""
        own = as_equations(self._model).parameters
        if missing := [name for name in self._varied if name not in own and name not in (parameters or {})]:
            raise ValueError(f"parameter {missing[0]!r} of the controller needs a value")

    @cached_property
    def _kept(self) -> dict[Any, Any]:
        """Runs with other parameters built in, by their values, and tasks of `ends`, by what they are for."""
        return {}

    def _made(self, key: Any, make: Callable[[], Any]) -> Any:
        """What is kept for a key."""
        if (found := self._kept.get(key)) is None:
            if len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)), None)
            found = self._kept[key] = make()
        return found

    def _bound(self, parameters: Mapping[str, Any] | None) -> Run:
        """The run with these values of parameters built in, but for those that stay open."""
        if parameters is None:
            return self
        require_kind("parameters", parameters, Mapping, "a mapping of names to numbers")
        values = {name: parameter_value(name, each) for name, each in parameters.items() if name not in self._varied}
        key = tuple([(name, value.hex()) for name, value in values.items()])  # which tells 0.0 and -0.0 apart
        return self._made(key, partial(replace, self, _parameters=values)) if values else self

    @property
    def _is_of_steps_alone(self) -> bool:
        """Whether nothing is done between the steps."""
        applied, _, _, stepped, watched = self._equations
        return not (watched or applied.controller or stepped.momenta or self._options.max_steps < math.inf)

    @cached_property
    def _memories(self) -> threading.local:
        """The memory of each thread, in which its motions run one after another."""
        return threading.local()

    @property
    def _memory(self) -> Stepper | None:
        """The memory of this thread; None where an end needs more than steps."""
        found: Stepper | Run | None = getattr(self._memories, "made", self)
        if isinstance(found, Run):  # not yet
            options, problem = self._options, self._equations.problem
            rounded = options.adaptive and options.relative < options.integrator.finest
            more = options.estimated or rounded or problem.projection is not None or not self._is_of_steps_alone
            more = more or self._equations.stepped.switches is not None
            zeros = [0.0] * len(problem.parameters)
            found = None if more else stepper_of(self._equations.stepped, options, zeros, dense=False)
            self._memories.made = found
        return found

    def _start(self, q: ArrayLike, qd: ArrayLike | None, span: Span, p: Sequence[float]) -> Array:
        """The state (m,) of q and qd in which a motion over a span starts, all checked."""
        problem = self._equations.problem
        self._options.check(span, problem.states)
        numbers = dict(self._equations.numbers) | dict(zip(problem.parameters, p, strict=False))
        return start_state(self._equations.applied.model, q, qd, numbers, span.t0)

    def _stepper(self, p: Sequence[float], hold: Hold | None = None, *, rows: bool = False) -> Stepper:
        """The stepper of recorded runs; rows: between the ends of chosen steps."""
        _, _, _, stepped, events = self._equations
        dense = self._dense_output or bool(events) or (rows and self._options.adaptive)
        return stepper_of(stepped, self._options, p, dense=dense, control=hold, events=events)

    def _trajectory(self, q: ArrayLike, qd: ArrayLike | None, span: Span, parameters: Values) -> Trajectory:
        """The motion over the span, with parameters built in. Raises InterruptedMotion by Ctrl-C."""
        note_start(self.applied.model, q, qd, span.t0)
        (applied, _, problem, stepped, _), p = self._equations, self._open_values(parameters)
        start, values = self._start(q, qd, span, p), p or 0.0
        if not self._options.adaptive and span.times is None:
            count, m = step_count(span.length, self._options.step), len(start)
            require_room(8 * TABLES * count * m, f"{count} steps of {m} numbers", "record fewer times (t_eval)")

        # Write the steps of the method over the equations, and compile them; the states are (q, qd), or here (q, p)
        hold = None
        if applied.controller is not None:
            if span.direction < 0.0:
                raise ValueError("a SampledController holds what it has seen, so that t_end has to be later than t0")
            observed = None if stepped.velocities is None else compiled(stepped.velocities, self._options.backend)
            hold = Hold(applied.controller, applied.model.velocities, stepped.nq, span.t0, observed)
        run = self._stepper(p, hold, rows=span.has_inner_times)
        x = converted(stepped.momentum, span.t0, start, values)

        # Integrate, noting rows and events
        steps: list[StepBlock] | None = [] if self._dense_output else None
        with Progress("simulate", span.length, self._options.progress) as report:
            stats, recorder = outcome(run, x, span, steps, report)
        if stats.message != REACHED:  # where it ended is its last row, also between the times of t_eval
            recorder.add_last()
        times, rows = recorder.table()

        # Put the result together
        if missed := unreached_momenta(stepped, times, rows, values, start=(span.t0, start, x)):
            stats = replace(stats, warnings=(*stats.warnings, *missed))
        interrupted = stats.message.startswith(INTERRUPTED)
        early = [] if stats.success or interrupted else [f"the run {stats.message}"]
        for text in [*early, *stats.warnings]:
            warnings.warn(text, SimulationWarning, stacklevel=3)
        nq, states = stepped.nq, converted(stepped.velocities, times, rows, values)
        bound, velocities = dict(zip(problem.parameters, p, strict=False)), stepped.velocities
        velocities = None if velocities is None else _specialized(velocities, bound)
        done = Trajectory(
            times,
            states[:, :nq],
            states[:, nq:],
            stats,
            {} if run.log is None else split_crossings(run.log.program, run.log.happened, nq, values),
            RunGraphs(problem, applied, bound, run.modes),
            None if steps is None else Solution(span.t0, x, steps, nq, velocities),
            None if hold is None else hold.held,
            applied.model.coordinates,
            applied.model.velocities,
            rows[:, nq:] if stepped.momenta else None,
            *([] if run.modes is None else [_sides(run.modes)]),
        )
        if interrupted:
            raise InterruptedMotion(done)
        return done


def _sides(modes: Modes) -> Sides:
    """The sides of a run from each instant at which some of them change."""
    kept = list[Turn]()
    for turn in modes.turns:
        if kept and turn.t == kept[-1].t:
            kept.pop()
        if not kept or turn.modes != kept[-1].modes:
            kept.append(turn)
    spacing = modes.plain.switches.spacing  # type: ignore[union-attr]
    sides = np.array([turn.modes for turn in kept]).reshape(-1, len(spacing))
    return Sides(modes.words, np.array([turn.t for turn in kept]), sides, (sides - 1.0) / spacing % 1.0 != 0.0)


class RunGraphs(Mapping[str, Graph]):
    """The graphs of a trajectory, each made when it is first asked for.  bound: values of parameters."""

    def __init__(self, problem: Problem, applied: Applied, bound: Mapping[str, float], modes: Modes | None) -> None:
        self._made, self._bound = dict[str, Graph](), bound
        self._makers: dict[str, Callable[[], Any]] = {"rate": lambda: problem.rate}
        if problem.system is not None:
            tau = {f"tau{k}": node for k, node in enumerate(applied.nodes or ())}
            self._makers |= {
                "force": lambda: force(problem),
                "tau": lambda: problem.bind(problem.states, Graph(quantity_inputs(problem), tau)),
                "energy": lambda: total_energy(problem),
            }
        if problem.multipliers is not None:
            self._makers["multipliers"] = lambda: problem.multipliers
        if modes is not None:
            among = frozenset[int]().union(*[turn.slides or () for turn in modes.turns])
            for name in {*self._makers} - {"energy"}:
                make = partial(rows_in_modes, modes.plain, self._makers[name], among)
                self._makers[f"{name} in modes"] = make

    def __getitem__(self, name: str) -> Graph:
        if name not in self._made:
            self._made[name] = _specialized(self._makers[name](), self._bound)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


def _specialized(graph: Graph, bound: Mapping[str, float]) -> Graph:
    """The graph with those of its inputs built in that have a value."""
    known = {name: value for name, value in bound.items() if name in graph.input_names}
    if known and isinstance(graph, ByRows):
        return graph.bound(known)
    return cg.specialize(graph, known) if known else graph
