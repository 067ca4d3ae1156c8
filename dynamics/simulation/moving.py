"""Moving: what moves in the runs of a motion, its applied force, equations and events, with numbers of parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, or_nearest

from ..equations.state_equation import state_inputs
from ..equations.states.initial_value import other_inputs, start_state
from ..integrators import Problem, derive, force, in_form, quantity_inputs, total_energy
from ..systems.arguments import parameter_value
from ..systems.controller import with_closed_form
from ..systems.model import Equations, Model, as_equations
from .events.event import Event, EventProgram, event_program
from .run_options import RunOptions
from .sampled_controller import Hold, SampledController

Made = TypeVar("Made")
Constant: TypeAlias = float | Sequence[float]
Tau: TypeAlias = Constant | Callable[..., Sequence[Node | float]] | SampledController


@dataclass(frozen=True)
class Applied:
    """The applied force of a run of a model, which has the forces of a controller in closed form.

    constant: force besides.  nodes: tau, of the state, t, tau0, .. and parameters; None of a first-order system.
    controller: a sampled one.
    """

    model: Equations
    constant: Any
    nodes: Sequence[Node] | None
    controller: SampledController | None = None

    def bound(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """The inputs of the state equation that are built into a run; of a sampled controller without tau0, .."""
        varied = () if self.controller is None else state_inputs(self.model).applied
        return {name: value for name, value in numbers.items() if name not in varied}

    def hold(self, options: RunOptions, problem: Problem) -> Hold | None:
        """The forces that a sampled controller is to hold along steps of a problem.

        Raises ValueError for a run that it cannot control.
        """
        if self.controller is None:
            return None
        if options.direction < 0.0:
            raise ValueError("a SampledController holds what it has seen, so that t_end has to be later than t0")
        observed = None if problem.velocities is None else _compiled(problem.velocities, options.backend)
        return Hold(self.controller, self.model.velocities, problem.nq, options.t0, observed)

    def graph(self, problem: Problem) -> Graph:
        """tau as a graph over the states, t and parameters of a problem of the model."""
        assert self.nodes is not None
        outputs = {f"tau{k}": node for k, node in enumerate(self.nodes)}
        return problem.bind(problem.states, Graph(quantity_inputs(problem), outputs))


@kept_by_first
def _compiled(velocities: Graph, backend: str) -> cg.Compiled:
    """The velocities of momenta, for a controller."""
    return cg.compile(velocities, backend)


def with_applied(model: Model, tau: Any, parameters: Mapping[str, Any] | None) -> tuple[Equations, Applied]:
    """The system that moves, with a controller in closed form, and what is applied to it.

    parameters: of the run; those that the model does not have are the controller's.
    """
    moving = as_equations(model)
    if isinstance(tau, SampledController):
        if moving.system is None:
            raise TypeError("a controller gives forces, and none act on a system of first order")
        return moving, Applied(moving, 0.0, moving.system.tau, tau)
    moving, constant, forces = with_closed_form(moving, tau, parameters)
    return moving, Applied(moving, constant, forces)


def check_varied(model: Equations, tau: Tau, varied: Sequence[str]) -> None:
    """Raise for parameters that cannot be varied. Those of a controller that is a function are what a run gives it."""
    if varied and isinstance(tau, SampledController):
        raise ValueError(f"varied = {varied} cannot be with a SampledController, which holds its forces")
    if unknown := [name for name in varied if name not in model.parameters and not callable(tau)]:
        known = or_nearest(unknown[0], list(model.parameters))
        raise ValueError(f"varied: the system has no parameter {unknown[0]!r:.80}; {known}")


def values_key(parameters: Mapping[str, Any]) -> Any:
    """Key that tells parameter values apart, 0.0 and -0.0 too; a key of its own for what are none."""
    try:
        return tuple([(name, type(value), float(value).hex()) for name, value in parameters.items()])
    except (TypeError, ValueError, OverflowError, AttributeError):
        return object()


class Moving:
    """Moving parts of the runs of a motion with these parameters: the equations, bound to numbers, and the events.

    varied: parameters whose values stay open.  p: values of the inputs of the problem that are not built in.
    plain: whether any finite q and qd of the right shapes are a start as they are.
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
        self.kept = threading.local()  # the run of each thread, one after another
        self._shared: tuple[Any, Any] = None, None
        self.plain = self.problem.normalization is None and self.problem.projection is None

    def values(self, parameters: Mapping[str, Any] | None) -> list[float]:
        """p with these values of parameters that are varied."""
        if not self._varied:
            return []
        given = parameters or {}
        self.require_given(given)
        values = self.numbers | {name: parameter_value(name, value) for name, value in given.items()}
        if given and self.model.system is not None:
            self.model.system.require_values(values)
        return [values[name] for name in self.problem.parameters]

    def shared_out(self, key: Any, make: Callable[[], Made]) -> Made:
        """How many motions are run side by side, made once for calls that are alike: that of the last is kept."""
        known, made = self._shared
        if known != key:
            made = make()
            self._shared = key, made
        result: Made = made
        return result

    def require_given(self, parameters: Mapping[str, Any] | None) -> None:
        """Raises ValueError where a parameter of the controller has no value."""
        if missing := [name for name in self._needed if name not in (parameters or {})]:
            raise ValueError(f"parameter {missing[0]!r} of the controller needs a value")

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
