"""EventProgram: the events of a run as graphs, their values, slopes, rounding and resets, as data that pickles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, columns, topological

from ...equations.substitute import substitute
from ...integrators import Problem, quantity, quantity_inputs, state_arguments
from ...systems.arguments import call_user_function, node_or_number, sequence
from ..row_values import values_of
from ..steps.dense_output import UNIT
from .event import Event

ROUNDINGS = 8.0  # that the interpolation of a state, and the sum of a motion, may take


@dataclass(frozen=True, eq=False)
class WatchedEvent:
    """Event as its location reads it, with its quantity g over the states x, t and parameters p as graphs.

    values: g.  slopes: g_dot, with the tangents of x and t for inputs besides.  errors: a bound of the rounding of g,
    with the errors of x and t for inputs besides.  reset: the state after it, if it changes.
    """

    name: str
    direction: int
    terminal: bool
    values: Graph
    slopes: Graph
    errors: Graph
    reset: Graph | None

    def counts(self, side: float, *, touching: bool = False) -> bool:
        """Whether a crossing from a side, a sign, or a touch, is one of the event."""
        return self.direction == 0 or (self.direction * side < 0.0 and not touching)

    def value(self, t: Array, x: Array, p: Sequence[float]) -> Array:
        """g, (k,), at times (k,) and states (k, m)."""
        g: Array = values_of(self.values, [*x.T, t, *p], len(t))[0]
        return g

    def slope(self, t: Array, x: Array, p: Sequence[float], x_dot: Array, t_dot: Array) -> Array:
        """The derivative of g, (k,), where x and t have the derivatives x_dot (k, m) and t_dot (k,)."""
        g: Array = values_of(self.slopes, [*x.T, t, *p, *x_dot.T, t_dot], len(t))[0]
        return g

    def error(self, t: Array, x: Array, p: Sequence[float], x_error: Array, t_error: Array) -> Array:
        """Errors of g, (k,), from some roundings, where x and t are off by x_error (k, m) and t_error (k,)."""
        g: Array = values_of(self.errors, [*x.T, t, *p, *x_error.T, t_error], len(t))[0]
        return ROUNDINGS * g


@dataclass(frozen=True, eq=False)
class EventProgram:
    """The events of a run, and of its states the names of the components, the rate, and the velocities, see Problem."""

    events: tuple[WatchedEvent, ...]
    components: tuple[str, ...]
    rate: Graph
    velocities: Graph | None

    def motions(
        self,
        which: np.ndarray[Any, np.dtype[np.bool_]],
        t: Array,
        x: Array,
        p: Sequence[float],
        fastest: Array,
        off: float,
    ) -> Array:
        """The derivatives of quantities by the time (1,) at one state (1, m); 0 of others, and where they are rounding.

        fastest: how far the rates of the states have gone, at least the largest so far, (1, m).  off: what of these is
        rounding.
        """
        x_dot = self.rates(t, x, p)
        fastest = np.fmax(fastest, np.where(np.isfinite(x_dot), np.abs(x_dot), 0.0))
        motions, none = np.zeros(len(self.events)), np.zeros_like(x)
        for number in np.flatnonzero(which):
            event = self.events[number]
            motion = event.slope(t, x, p, x_dot, np.ones(1))
            most = event.error(t, x, p, fastest, np.ones(1)) - event.error(t, x, p, none, np.zeros(1))
            motions[number] = np.where(np.abs(motion) <= off * most, 0.0, motion)[0]
        return motions

    def rates(self, t: Array, x: Array, p: Sequence[float]) -> Array:
        """The derivatives of the states by the time, (k, m), at times (k,) and states (k, m)."""
        return values_of(self.rate, [*x.T, t, *p], len(t)).T

    def reset(self, number: int, t: float, x: Array, p: Sequence[float]) -> Array:
        """The state (m,) after an event; the same where it resets nothing."""
        graph = self.events[number].reset
        return x if graph is None else values_of(graph, [*x, t, *p], 1)[:, 0]


def event_program(problem: Problem, events: Sequence[Event]) -> EventProgram:
    """The graphs of these events of a problem. Raises TypeError or ValueError for what is no node of the state."""
    watched = tuple([_watched(problem, event) for event in events])
    return EventProgram(watched, problem.components, problem.rate, problem.velocities)


def _watched(problem: Problem, event: Event) -> WatchedEvent:
    node = quantity(problem, f"event {event.name!r}", event.value)
    values = problem.observed({"g": node})
    moving = values.inputs[: problem.size + 1]
    slopes = cg.simplify(cg.jvp(values, list(moving)))
    reset = None if event.reset is None else _reset(problem, event.name, event.reset)
    errors = _errors(values, moving)
    return WatchedEvent(event.name, event.direction, event.terminal, values, slopes, errors, reset)


def _reset(problem: Problem, name: str, function: Callable[..., Any]) -> Graph:
    """The state after an event: inputs the states, t, parameters; outputs the states."""
    what = f"the reset of event {name!r}"
    inputs = quantity_inputs(problem)
    changed = call_user_function(what, function, *state_arguments(problem))
    parts = [changed] if problem.system is None else sequence(f"{what} must be (q, qd),", changed)
    halves = [sequence(f"{what} must be" + (" a pair of" if len(parts) == 2 else ""), part) for part in parts]
    nq, n = problem.nq, problem.size - problem.nq
    if [len(half) for half in halves] != ([nq] if problem.system is None else [nq, n]):
        needed = f"({nq} coordinates, {n} velocities)" if problem.system else f"{nq} states"
        raise ValueError(f"{what} must be {needed}, got lengths {[len(half) for half in halves]}")
    nodes = [node_or_number(what, node) for half in halves for node in half]
    for node in topological(nodes):
        if node.op.name == "variable" and node not in inputs:
            raise ValueError(f"{what} must depend on the state, t and the parameters alone, got {node.name!r}")
    if problem.system is not None:
        nodes[:nq] = problem.system.kinematics.normalized(nodes[:nq])
        if problem.momentum is not None:
            after = dict(zip([*problem.system.q, *problem.system.qd], nodes, strict=True))
            nodes[nq:] = substitute(list(problem.momentum.outputs.values()), after)
    return problem.observed({f"x{k}": node for k, node in enumerate(nodes)})


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
            total = abs(node) * (UNIT * columns(node.op).rounding) if node.args else zero
            for arg, partial in zip(node.args, node.op.partials(node, *node.args), strict=True):
                if (error := errors[arg]).value != 0.0:
                    total = total + abs(partial) * error
            errors[node] = total
    outputs = {name: errors[node] for name, node in graph.outputs.items()}
    return Graph([*graph.inputs, *leaves], outputs)
