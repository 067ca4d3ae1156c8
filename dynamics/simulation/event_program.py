"""EventProgram: the events of a run as graphs, their values, slopes, rounding and resets, as data that pickles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, topological

from ..integrators import Problem, quantity, quantity_inputs, state_arguments
from ..systems.system import call_user_function, node_or_number, sequence
from .event import Event

UNIT = 2.0**-53  # relative error of one rounding


@dataclass(frozen=True)
class WatchedEvent:
    """What the location of an event reads of it."""

    name: str
    direction: int
    terminal: bool

    def counts(self, rising: bool) -> bool:
        """Whether a crossing in this direction is one of the event."""
        return self.direction in (0, 1 if rising else -1)


@dataclass(frozen=True, eq=False)
class EventProgram:
    """The quantities g(x, t, p) of some events over the states, t and the parameters that are not built in.

    values: g of each.  slopes: g_dot, with the tangents of x and t for inputs besides.  errors: a bound of the rounding
    of g, with the errors of x and t for inputs besides.  resets: by number of the event, the state after it.
    """

    events: tuple[WatchedEvent, ...]
    components: tuple[str, ...]
    values: Graph
    slopes: Graph
    errors: Graph
    resets: dict[int, Graph]
    rate: Graph

    def motion(self, t: float, x: Array, p: Sequence[float]) -> Array:
        """The derivatives of g by the time along the motion, (events,)."""
        at, state = np.array([t]), x[None]
        return self.slope(at, state, p, _table(self.rate, [*x, t, *p], 1).T, np.ones(1))[:, 0]

    def reset(self, number: int, t: float, x: Array, p: Sequence[float]) -> Array:
        """The state (m,) after event `number`."""
        return _table(self.resets[number], [*x[None].T, np.array([t]), *p], 1)[:, 0]

    def value(self, t: Array, x: Array, p: Sequence[float]) -> Array:
        """g, (events, k), at times (k,) and states (k, m)."""
        return _table(self.values, [*x.T, t, *p], len(t))

    def slope(self, t: Array, x: Array, p: Sequence[float], x_dot: Array, t_dot: Array) -> Array:
        """The derivative of g, (events, k), where x and t have the derivatives x_dot (k, m) and t_dot (k,)."""
        return _table(self.slopes, [*x.T, t, *p, *x_dot.T, t_dot], len(t))

    def error(self, t: Array, x: Array, p: Sequence[float], x_error: Array, t_error: Array) -> Array:
        """A bound of the rounding error of g, (events, k), where x and t are off by x_error (k, m) and t_error (k,)."""
        return _table(self.errors, [*x.T, t, *p, *x_error.T, t_error], len(t))


def event_program(problem: Problem, events: Sequence[Event]) -> EventProgram:
    """The graphs of these events of a problem. Raises TypeError or ValueError for what is no node of the state."""
    nodes = {f"g{k}": quantity(problem, f"event {event.name!r}", event.value) for k, event in enumerate(events)}
    values = problem.bind(problem.states, Graph(quantity_inputs(problem), nodes))
    moving = values.inputs[: problem.size + 1]
    resets = {k: _reset(problem, event.name, event.reset) for k, event in enumerate(events) if event.reset is not None}
    watched = tuple([WatchedEvent(event.name, event.direction, event.terminal) for event in events])
    slopes = cg.simplify(cg.jvp(values, list(moving)))
    return EventProgram(watched, problem.components, values, slopes, _errors(values, moving), resets, problem.rate)


def _reset(problem: Problem, name: str, function: Callable[..., Any]) -> Graph:
    """The state after an event: inputs the states, t, parameters; outputs the states."""
    what = f"the reset of event {name!r}"
    inputs = quantity_inputs(problem)
    changed = call_user_function(what, function, *state_arguments(problem))
    parts = [changed] if problem.system is None else sequence(f"{what} must be (q, qd),", changed)
    halves = [sequence(f"{what} must be" + (" a pair of" if len(parts) == 2 else ""), part) for part in parts]
    n = problem.size // (1 if problem.system is None else 2)
    if len(halves) != problem.size // n or any(len(half) != n for half in halves):
        needed = f"({n} coordinates, {n} velocities)" if problem.system else f"{n} states"
        raise ValueError(f"{what} must be {needed}, got lengths {[len(half) for half in halves]}")
    nodes = [node_or_number(what, node) for half in halves for node in half]
    for node in topological(nodes):
        if node.op.name == "variable" and node not in inputs:
            raise ValueError(f"{what} must depend on the state, t and the parameters alone, got {node.name!r}")
    return problem.bind(problem.states, Graph(inputs, {f"x{k}": node for k, node in enumerate(nodes)}))


def _errors(graph: Graph, inputs: Sequence[Node]) -> Graph:
    """The outputs' rounding, to first order, from errors of the inputs: a running bound, node by node.

    An error passes on through the local partials, in absolute value, and each operation adds its own.
    """
    suffix = "_error"
    while any(f"{node.name}{suffix}" in graph.input_names for node in inputs):
        suffix += "_"
    errors: dict[Node, Node] = {node: cg.variable(f"{node.name}{suffix}") for node in inputs}
    leaves = list(errors.values())
    zero = cg.constant(0.0)
    with building(Builder()):
        for node in graph.nodes:
            if node in errors:
                continue
            total = abs(node) * (UNIT * node.op.rounding) if node.args else zero
            for arg, partial in zip(node.args, node.op.partials(node, *node.args), strict=True):
                if (error := errors[arg]).value != 0.0:
                    total = total + abs(partial) * error
            errors[node] = total
    outputs = {name: errors[node] for name, node in graph.outputs.items()}
    return Graph([*graph.inputs, *leaves], outputs)


def _table(graph: Graph, columns: Sequence[Array | float], k: int) -> Array:
    values = graph.evaluate(dict(zip(graph.input_names, columns, strict=True)))
    return np.array([np.broadcast_to(value, k) for value in values.values()]).reshape(len(values), k)
