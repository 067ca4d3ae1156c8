"""Event: a quantity of a moving system that is watched for its zeros; and the events of a run, graphs that pickle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, HoldsNodes, check_name, columns, is_function, require_kind
from cgraph.extend import Builder, building, topological

from ...integrators import Problem, quantity, quantity_inputs, state_arguments
from ...systems.arguments import call_user_function, new_variables, node_or_number, sequence
from ...systems.kinematics import substitute
from ..steps.dense_output import UNIT
from ..steps.row_values import values_of

ROUNDINGS = 8.0  # that the interpolation of a state, and the sum of a motion, may take


@dataclass(frozen=True)
class Event(HoldsNodes):
    """Event: a quantity that passes through zero, and what happens there.

    What touches zero and turns back counts too, with direction 0. What stays zero for a while has one event, where it
    arrives; what starts there has none before it comes back, but for a contact, with a reset and a direction, if it
    closes. Of events at one instant those without a reset are first; then the first reset in the list that is due,
    again and again: what is zero and moves in its direction. A jump by a reset is no crossing, and a pole is no zero.
    Crossings are found by bounds over each step, however short they are; where bounds stay too wide, a warning says so.

    Parameters
    ----------
    name : str
        By which `Trajectory.events` lists it.
    value : callable
        The quantity, value(q, qd, t) or value(q, qd, t, p) with nodes for arguments, in any unit; of an OdeSystem
        value(x, t) or value(x, t, p). p is {parameter name: node}.
    direction : int
        1 upwards only, -1 downwards only, 0 both.
    terminal : bool
        Whether the run ends there.
    reset : callable, optional
        The state from which the run goes on, reset(q, qd, t) or reset(q, qd, t, p) -> (q, qd) as nodes or numbers; of
        an OdeSystem reset(x, t) or reset(x, t, p) -> x. Both states are rows of the trajectory, the first and the last
        of several resets at an instant; at a time of `t_eval`, the one before is. A run whose resets follow one another
        in no time stops. What starts at zero needs a direction, to know its side; a warning says so.

    Raises
    ------
    TypeError
        For a name that is no text, a value or a reset that is no function, a `terminal` that is neither True nor False.
    ValueError
        For another direction, an event that ends the run and resets the state, a name that is empty or not printable.

    Examples
    --------
    >>> import dynamics as dyn
    >>> ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"])
    >>> ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
    >>> dyn.simulate(ball, [1.0], [0.0], 1.0, events=ground).stats.message
    "event 'ground' at t = 0.451524 s"
    >>> bounce = dyn.Event("bounce", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.5 * qd[0]]))
    >>> dyn.simulate(ball, [1.0], [0.0], 1.2, events=bounce).events["bounce"].t.round(4)
    array([0.4515, 0.903 , 1.1288])
    """

    name: str
    value: Callable[..., Node]
    direction: int = 0
    terminal: bool = False
    reset: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not is_function(self.value) or not isinstance(self.terminal, bool):
            got = f"{self.name!r:.40}, {self.value!r:.40} and {self.terminal!r:.40}"
            raise TypeError(f"an event needs a name, a function, and True or False for `terminal`, got {got}")
        check_name("an event", self.name)
        if not isinstance(self.direction, (int, np.integer)) or self.direction not in (-1, 0, 1):
            raise ValueError(f"event {self.name!r}: direction must be 1, -1 or 0, got {self.direction!r}")
        if self.reset is not None and not is_function(self.reset):
            raise TypeError(f"event {self.name!r}: reset must be a function, got {self.reset!r:.40}")
        if self.reset is not None and self.terminal:
            raise ValueError(f"event {self.name!r}: a run that ends there goes on from no reset state; leave out one")


def as_events(events: Event | Iterable[Event]) -> tuple[Event, ...]:
    """One event or several, as a tuple. Raises TypeError for anything else, ValueError for two of one name."""
    several = (events,) if isinstance(events, Event) else tuple(sequence("events must be", events))
    for k, event in enumerate(several):
        require_kind("events", event, Event, "of the type Event")
        if event.name in [other.name for other in several[:k]]:
            raise ValueError(f"two events have the name {event.name!r}")
    return several


@dataclass(frozen=True, eq=False)
class WatchedEvent:
    """Event as graphs over states x, t and parameters p: of its quantity g, and of the state after it."""

    name: str
    direction: int
    terminal: bool
    values: Graph
    slopes: Graph  # of g, with the tangents of x and t for inputs besides
    errors: Graph  # a bound of the rounding of g, with the errors of x and t for inputs besides
    reset: Graph | None

    def counts(self, side: float, *, touching: bool = False) -> bool:
        """Whether a crossing from a side, a sign, or a touch, is one of the event."""
        return self.direction == 0 or (self.direction * side < 0.0 and not touching)


def numbers_of(graph: Graph, t: Array, x: Array, p: Sequence[float], *more: Array) -> Array:
    """The output, (k,), at times (k,), states (k, m) and parameters, with tangents or errors of states and times."""
    columns = [*x.T, t, *p, *[column for each in more for column in np.atleast_2d(each.T)]]
    numbers: Array = values_of(graph, columns, len(t))[0]
    return numbers


@dataclass(frozen=True, eq=False)
class EventProgram:
    """The events of a run, and of its states the names of the components, the rate and the velocities."""

    events: tuple[WatchedEvent, ...]
    components: tuple[str, ...]
    rate: Graph
    velocities: Graph | None

    def rates(self, t: Array, x: Array, p: Sequence[float]) -> Array:
        """The derivatives of the states by the time, (k, m), at times (k,) and states (k, m)."""
        return values_of(self.rate, [*x.T, t, *p], len(t)).T


def event_program(problem: Problem, events: Sequence[Event]) -> EventProgram:
    """The graphs of these events of a problem. Raises TypeError or ValueError for what is no node of the state."""
    watched = []
    for event in events:
        values = problem.observed({"g": quantity(problem, f"event {event.name!r}", event.value)})
        moving = values.inputs[: problem.size + 1]
        slopes, errors = cg.simplify(cg.jvp(values, list(moving))), rounding_errors(values, moving)
        reset = None if event.reset is None else _reset(problem, f"the reset of event {event.name!r}", event.reset)
        watched.append(WatchedEvent(event.name, event.direction, event.terminal, values, slopes, errors, reset))
    return EventProgram(tuple(watched), problem.components, problem.rate, problem.velocities)


def _reset(problem: Problem, what: str, function: Callable[..., Any]) -> Graph:
    """The state after an event: inputs the states, t, parameters; outputs the states."""
    changed, system, nq = call_user_function(what, function, *state_arguments(problem)), problem.system, problem.nq
    parts = [changed] if system is None else sequence(f"{what} must be (q, qd),", changed)
    halves = [sequence(f"{what} must be" + (" a pair of" if len(parts) == 2 else ""), part) for part in parts]
    lengths, n = [len(half) for half in halves], problem.size - nq
    if lengths != ([nq] if system is None else [nq, n]):
        needed = f"({nq} coordinates, {n} velocities)" if system else f"{nq} states"
        raise ValueError(f"{what} must be {needed}, got lengths {lengths}")
    nodes = [node_or_number(what, node) for half in halves for node in half]
    inputs = quantity_inputs(problem)
    for node in topological(nodes):
        if node.op.name == "variable" and node not in inputs:
            raise ValueError(f"{what} must depend on the state, t and the parameters alone, got {node.name!r}")
    if system is not None:
        nodes[:nq] = system.kinematics.normalized(nodes[:nq])
        if problem.momentum is not None:
            after = dict(zip([*system.q, *system.qd], nodes, strict=True))
            nodes[nq:] = substitute(list(problem.momentum.outputs.values()), after)
    return problem.observed({f"x{k}": node for k, node in enumerate(nodes)})


def rounding_errors(graph: Graph, inputs: Sequence[Node]) -> Graph:
    """The outputs' rounding, to first order, from errors of the inputs, node by node: |partials| times errors."""
    leaves, zero = new_variables("error", len(inputs), graph.input_names), cg.constant(0.0)
    errors: dict[Node, Node] = dict(zip(inputs, leaves, strict=True))
    with building(Builder()):
        for node in graph.nodes:
            if node in errors:
                continue
            total = abs(node) * (UNIT * columns(node.op).rounding) if node.args else zero
            for arg, partial in zip(node.args, node.op.partials(node, *node.args), strict=True):
                if (error := errors[arg]).value != 0.0:
                    total = total + abs(partial) * error
            errors[node] = total
    return Graph([*graph.inputs, *leaves], {name: ROUNDINGS * errors[node] for name, node in graph.outputs.items()})
