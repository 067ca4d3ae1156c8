"""Moving: what moves in the runs of a motion, its equations and events, with the numbers of its parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array

from ..equations.states.initial_value import other_inputs, start_state
from ..integrators import derive, force, in_form, total_energy
from ..systems.arguments import parameter_value
from ..systems.model import Model, as_equations
from .applied_forces import Tau, with_applied
from .events.event import Event
from .events.event_program import EventProgram, event_program
from .run_options import RunOptions
from .steps.step_program import compile_steps, step_program

if TYPE_CHECKING:
    from .steps.stepper import Stepper

FLOAT = np.dtype(np.float64)


class Moving:
    """Moving parts of the runs of a motion with these parameters: the equations, bound to numbers, and the events.

    varied: parameters whose values stay open.  p: values of the inputs of the problem that are not built in.
    """

    def __init__(
        self,
        model: Model,
        tau: Tau,
        events: Sequence[Event],
        form: str,
        varied: tuple[str, ...],
        parameters: Mapping[str, Any] | None,
    ) -> None:
        own = as_equations(model).parameters
        self._needed = [name for name in varied if name not in own]  # of a controller
        if varied and isinstance(parameters, Mapping | None):
            parameters = {name: own.get(name, 0.0) for name in varied} | dict(parameters or {})
        self.model, self.applied = with_applied(model, tau, parameters)
        self.numbers = other_inputs(self.model, self.applied.constant, parameters)
        built_in = {name: value for name, value in self.numbers.items() if name not in varied}
        self.problem = derive(self.model, self.applied.bound(built_in))
        self.stepped, self._varied = in_form(self.problem, form), bool(varied)
        self.events: EventProgram | None = event_program(self.stepped, events) if events else None
        self.steppers = threading.local()
        system, nq, m = self.model.system, self.problem.nq, self.problem.size
        plain = self.problem.normalization is None and (system is None or not len(system.constraints))
        self._nq = nq
        self._shapes = ((nq,) if plain else None, None if system is None else (m - nq,))  # of q and qd

    def values(self, parameters: Mapping[str, Any] | None) -> list[float]:
        """p with these values of parameters that are varied."""
        if not self._varied:
            return []
        given = parameters or {}
        if missing := [name for name in self._needed if name not in given]:
            raise ValueError(f"parameter {missing[0]!r} of the controller needs a value")
        values = self.numbers | {name: parameter_value(name, value) for name, value in given.items()}
        if given and self.model.system is not None:
            self.model.system.require_values(values)
        return [values[name] for name in self.problem.parameters]

    def stepper(self, options: RunOptions) -> Stepper:
        """A memory in which motions run."""
        from .steps.stepper import stepper  # without it a trajectory is all that is asked for

        program = step_program(self.stepped, options.integrator, dense=False)
        return stepper(compile_steps(program, options.backend), options, [0.0] * len(self.problem.parameters))

    def start(self, q: ArrayLike, qd: ArrayLike | None, t0: float, p: Sequence[float]) -> Array:
        """The state (m,) of q and qd in which a run starts."""
        numbers = self.numbers | dict(zip(self.problem.parameters, p, strict=False))
        return start_state(self.model, q, qd, numbers, t0)

    def graphs(self, p: Sequence[float]) -> Mapping[str, Graph]:
        """Graphs by which a trajectory computes accelerations, forces and energies."""
        return RunGraphs(self, dict(zip(self.problem.parameters, p, strict=True))) if p else self._graphs

    def velocities(self, p: Sequence[float]) -> Graph | None:
        """qd of states (q, p), see Problem; None where states have it."""
        graph = self.stepped.velocities
        bound = dict(zip(self.problem.parameters, p, strict=False))
        return cg.specialize(graph, bound) if graph is not None and bound else graph

    @cached_property
    def _graphs(self) -> RunGraphs:
        return RunGraphs(self, {})

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


class RunGraphs(Mapping[str, Graph]):
    """The graphs of a trajectory, each made when it is first asked for."""

    def __init__(self, moving: Moving, values: Mapping[str, float]) -> None:
        problem, applied = moving.problem, moving.applied
        self._made, self._values = dict[str, Any](), values
        makers: dict[str, Callable[[], Any]] = {"rate": lambda: problem.rate}
        if problem.system is not None:
            makers |= {"force": lambda: force(problem), "tau": lambda: applied.graph(problem)}
            makers["energy"] = lambda: total_energy(problem)
        if problem.multipliers is not None:
            makers["multipliers"] = lambda: problem.multipliers
        self._makers = makers

    def __getitem__(self, name: str) -> Graph:
        if name not in self._made:
            graph = self._makers[name]()
            bound = {each: value for each, value in self._values.items() if each in graph.input_names}
            self._made[name] = cg.specialize(graph, bound) if bound else graph
        made: Graph = self._made[name]
        return made

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)
