"""Moving: what moves in the runs of a motion, its equations and events, with the numbers of its parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array

from ..equations.states.initial_value import other_inputs, start_state
from ..integrators import METHODS, Problem, derive, force, in_form, total_energy
from ..systems.model import Model
from .applied_forces import Applied, Tau, with_applied
from .events.event import Event
from .events.event_program import EventProgram, event_program
from .run_options import RunOptions
from .steps.step_program import compile_steps, step_program

if TYPE_CHECKING:
    from .steps.stepper import Stepper

FLOAT = np.dtype(np.float64)


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
        self.steppers = threading.local()
        system, nq, m = self.model.system, self.problem.nq, self.problem.size
        plain = self.problem.normalization is None and (system is None or not len(system.constraints))
        self._nq = nq
        self._shapes = ((nq,) if plain else None, None if system is None else (m - nq,))  # of q and qd

    def stepper(self, options: RunOptions) -> Stepper:
        """A memory in which motions run."""
        from .steps.stepper import stepper  # without it a trajectory is all that is asked for

        program = step_program(self.stepped, METHODS[options.method], dense=False)
        return stepper(compile_steps(program, options.backend), options, ())

    def halves(self, x: Array) -> tuple[Array, Array]:
        """q and qd of a state (m,)."""
        return x[: self._nq], x[self._nq :]

    def fits(self, q: ArrayLike, qd: ArrayLike | None) -> bool:
        """Whether q and qd are arrays that need nothing but to be finite."""
        shapes = self._shapes
        return (
            type(q) is np.ndarray
            and q.dtype == FLOAT
            and q.shape == shapes[0]
            and (qd is shapes[1] or (type(qd) is np.ndarray and qd.dtype == FLOAT and qd.shape == shapes[1]))
        )

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
        self._made: dict[str, Any] = {}
        makers: dict[str, Callable[[], Any]] = {"rate": lambda: problem.rate}
        if problem.system is not None:
            makers |= {"force": lambda: force(problem), "tau": lambda: applied.graph(problem)}
            makers["energy"] = lambda: total_energy(problem)
        if problem.multipliers is not None:
            makers["multipliers"] = lambda: problem.multipliers
        self._makers = makers

    def __getitem__(self, name: str) -> Graph:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        made: Graph = self._made[name]
        return made

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)
