"""Problem: the graphs of a model that integrators are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents, hessian_nodes, solve_nodes, topological

from ..equations.equations_of_motion import energy
from ..equations.state_equation import state_equation, state_inputs
from ..systems.model import Model, as_ode, as_system
from ..systems.system import TIME, Parameters, System, call_user_function

ONE = cg.constant(1.0)
KEPT = 16  # problems whose graphs stay for another run


class Mechanics(NamedTuple):
    """A mechanical system for methods that keep p = dL/dqd. Inputs of each graph: what is named, then t, parameters."""

    momentum: Graph  # (q, qd) -> p
    force: Graph  # (q, qd) -> p_dot = dL/dq + tau + forces - damping qd
    velocity: Graph  # (q, qd, p) -> qd, nearer to the velocity that belongs to p: a step of Newton, exact when K is
    # quadratic in qd


class Problem:
    """xdot = f(x, t, p): what an integrator runs on.

    model: a System or what has one, or an OdeSystem.
    bound: {input: number} of parameters and applied forces that are built in; the others stay inputs, `parameters`.
    """

    def __init__(self, model: Model, bound: Mapping[str, float]) -> None:
        inputs = state_inputs(model)
        self.model = model
        self.states = inputs.states
        self.parameters = tuple([name for name in (*inputs.applied, *inputs.parameters) if name not in bound])
        self._bound = dict(bound)
        self.system: System | None = None if as_ode(model) else as_system(model)

    @property
    def size(self) -> int:
        """Numbers in a state."""
        return len(self.states)

    @property
    def inputs(self) -> list[Node]:
        """What a graph of this problem may depend on, before anything is bound."""
        model = state_inputs(self.model)
        return cg.variables([*self.states, TIME, *model.applied, *model.parameters])

    def value(self, what: str, function: Callable[..., Any]) -> Node:
        """A quantity of the state, function(q, qd, t[, p]) or (x, t[, p]), as a node.

        Raises TypeError for what is no such function, ValueError for a result that is no node of the state.
        """
        p = Parameters(state_inputs(self.model).parameters)
        if self.system is None:
            arguments: tuple[Any, ...] = (cg.variables(list(self.states)), cg.variable(TIME), p)
        else:
            arguments = (self.system.q, self.system.qd, self.system.t, p)
        node = call_user_function(what, function, *arguments)
        known = set(self.inputs)
        if not isinstance(node, Node) or any(
            each.op.name == "variable" and each not in known for each in topological([node])
        ):
            raise ValueError(f"{what} must be a node of the state, t and the parameters, got {node!r:.60}")
        return node

    @cached_property
    def rate(self) -> Graph:
        """f: inputs the states, t, parameters; outputs the rates of the states."""
        return self.bind(self.states, state_equation(self.model))

    @cached_property
    def energy(self) -> Graph | None:
        """The total energy E of a mechanical system: inputs the states, t, parameters."""
        return None if self.system is None else self.bind(self.states, energy(self.system))

    @cached_property
    def timed(self) -> bool:
        """Whether f depends on t."""
        return _reaches(self.rate.outputs.values(), [cg.variable(TIME)])

    @cached_property
    def jacobian(self) -> Graph:
        """df/dx, row by row: inputs the states, t, parameters."""
        return cg.simplify(cg.jacobian(self.rate, list(self.states)))

    @cached_property
    def time_slope(self) -> Graph:
        """df/dt at fixed x: inputs the states, t, parameters."""
        return cg.simplify(cg.jacobian(self.rate, [TIME]))

    @cached_property
    def mechanics(self) -> Mechanics:
        """The graphs of momenta. Raises ValueError for a system of first order, which has none."""
        system = self.system
        if system is None:
            raise ValueError("this method keeps momenta, which a system of first order does not have")
        build = Builder()
        p = cg.variables([f"p{i}" for i in range(system.n)])
        bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd], build)
        slopes, momenta = bars[: system.n], bars[system.n :]
        with building(build):
            force = [
                slope + tau + applied - damping * qd
                for slope, tau, applied, damping, qd in zip(
                    slopes, system.tau, system.forces, system.damping, system.qd, strict=True
                )
            ]
            missing = [wanted - here for wanted, here in zip(p, momenta, strict=True)]
        steps = solve_nodes(system.lagrangian, system.qd, missing, build)
        with building(build):
            velocity = [qd + step for qd, step in zip(system.qd, steps, strict=True)]
        state = [*system.q, *system.qd]
        return Mechanics(
            self._mechanical(system, state, momenta),
            self._mechanical(system, state, force),
            self._mechanical(system, [*state, *p], velocity),
        )

    @cached_property
    def quadratic(self) -> bool:
        """Whether the momenta are linear in the velocities: the mass matrix does not depend on them."""
        assert self.system is not None
        return not _reaches(self._mass_matrix, self.system.qd)

    @cached_property
    def separable(self) -> bool:
        """Whether p = M qd with a constant M, and the forces do not depend on the velocities."""
        assert self.system is not None
        mechanics = self.mechanics
        free = not _reaches(mechanics.force.outputs.values(), self.system.qd)
        fixed = not _reaches([*self._mass_matrix, *mechanics.momentum.outputs.values()], self.system.q)
        return free and fixed and self.quadratic

    @cached_property
    def _mass_matrix(self) -> list[Node]:
        assert self.system is not None
        return [node for row in hessian_nodes(self.system.lagrangian, self.system.qd) for node in row]

    def _mechanical(self, system: System, inputs: Sequence[Node], outputs: Sequence[Node]) -> Graph:
        named = {f"{k}": node for k, node in enumerate(outputs)}
        graph = Graph([*inputs, *system.tau, *system.extra_inputs], named)
        return self.bind([str(node.name) for node in inputs], graph)

    def bind(self, first: Sequence[str], graph: Graph) -> Graph:
        """The graph with what is bound built in, and its inputs in the order that every method relies on."""
        found = cg.specialize(graph, {name: value for name, value in self._bound.items() if name in graph.input_names})
        return Graph(cg.variables([*first, TIME, *self.parameters]), found.outputs)


def problem_of(model: Model, bound: Mapping[str, float]) -> Problem:
    """The problem of a model; asked for again, while it is among the last few, the one that has its graphs already."""
    inputs, ode = state_inputs(model), as_ode(model)
    if ode is not None:
        what: tuple[Any, ...] = (ode.rates,)
    else:
        system = as_system(model)
        what = (system.coordinates, system.partial_lagrangians, system.forces, system.damping)
    numbers = tuple([(name, float(value).hex()) for name, value in bound.items()])  # 0.0 and -0.0 stay apart
    return _kept(_Request((*what, inputs.states, inputs.applied, tuple(inputs.parameters), numbers), model, bound))


@dataclass(frozen=True)
class _Request:
    key: tuple[Any, ...]
    model: Model = field(compare=False)
    bound: Mapping[str, float] = field(compare=False)


@lru_cache(KEPT)
def _kept(request: _Request) -> Problem:
    return Problem(request.model, request.bound)


def _reaches(nodes: Iterable[Node], variables: Iterable[Node]) -> bool:
    return not set(variables).isdisjoint(topological(nodes))
