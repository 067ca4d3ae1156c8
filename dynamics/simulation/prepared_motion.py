"""PreparedMotion: a model, a method and options fixed once, for motions from many starts, in stages."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array

from ..equations.states.initial_value import other_inputs, start_state
from ..integrators import Problem, derive, force, in_form, total_energy
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
from .steps.stepping import Integration
from .trajectory import SimulationWarning, Solution, Stats, Trajectory

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


class PreparedMotion:
    """Motions of one model by one method, all but start, end and parameter values fixed; made by `prepare`."""

    def __init__(
        self, model: Model, options: RunOptions, tau: Tau, events: Sequence[Event], form: str, dense_output: bool
    ) -> None:
        self._options, self._dense = options, dense_output
        self._moving = partial(Moving, model, tau, events, form)
        self._known: dict[Any, Moving] = {}

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
