"""Problem: a model's equations as graphs, xdot = f(x, t, p), which is all that an integrator reads of a model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import is_finite, kept_by_first, memo, require_choice
from cgraph.extend import Builder, topological

from ..equations.constraints.constraint_rank import independent_rows
from ..equations.constraints.constraints import projection
from ..equations.equations_of_motion import energy, momentum
from ..equations.state_equation import FORMS, normalization, state_inputs, with_multipliers
from ..systems.arguments import TIME, Parameters, call_user_function
from ..systems.evaluation import ByRows, Evaluation, evaluation_of, without_graph
from ..systems.kinematics import substitute
from ..systems.model import Equations, Model, as_equations
from ..systems.system import System

if TYPE_CHECKING:
    from .switches import Switches

ROWS = f"{__package__}.rate_by_rows"  # which few motions load
MOST = 60  # moving bodies, beyond which a motion is stepped by rows
KEPT_PROBLEMS = 16  # problems that stay for another run, with what was derived from them


@dataclass(frozen=True, eq=False)
class Problem:
    """xdot = f(x, t, p), derived by `derive`. Graphs are over the states, t and the parameters."""

    model: Equations
    states: tuple[str, ...]  # names, in the order of x (m,)
    components: tuple[str, ...]  # the same in words, for messages
    parameters: tuple[str, ...]  # names of the inputs that stay inputs
    bound: Mapping[str, float]  # {input: number} of those that are built in
    rate: Graph  # f
    normalization: Graph | None  # of states alone: with the constraint of coordinates met, as unit quaternions
    projection: Graph | None  # a state to one nearer to the constraints, and normalized; None without constraints
    multipliers: Graph | None  # of the constraints, by name
    system: System | None  # None for a first-order one
    velocities: Graph | None = None  # qd, of states q and p = dL/dqd; None of states q and qd
    momentum: Graph | None = None  # p of q and qd, inputs in place of the states; None of states q and qd
    missing: Graph | None = None  # what the velocities leave of the momenta; None where they are not iterated
    switches: Switches | None = None  # of a problem in modes, see `switched`
    slides: bool = False  # whether it may slide on some of its surfaces, see `sliding`

    @property
    def size(self) -> int:
        """Numbers in a state, m."""
        return len(self.states)

    @property
    def nq(self) -> int:
        """Numbers in a state that are coordinates, which come first; all of a first-order system."""
        return self.size if self.system is None else self.system.nq

    @property
    def momenta(self) -> bool:
        """Whether the states are q and p in place of q and qd."""
        return self.velocities is not None

    @property
    def canonical(self) -> bool:
        """Whether momenta dL/dqd belong to the coordinates: velocities are their rates, and nothing holds them."""
        system = self.system
        return system is not None and system.kinematics.quasi is None and not len(system.constraints)

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the parameters that a run is given: all but modes."""
        return self.parameters if self.switches is None else self.parameters[: -len(self.switches.modes)]

    @cached_property
    def evaluation(self) -> Evaluation:
        """Statements that evaluate f."""
        return evaluation_of(self.rate)

    @cached_property
    def timed(self) -> bool:
        """Whether f depends on t."""
        return reaches(self.evaluation.called.outputs.values(), [cg.variable(TIME)])

    def bind(self, first: Sequence[str], graph: Graph) -> Graph:
        """The graph over `first`, t and `parameters`, in this order, with the bound inputs built in."""
        return _bind(graph, first, self.parameters, self.bound)

    def observed(self, quantities: Mapping[str, Node]) -> Graph:
        """Quantities, see `quantity`, over the states, t and `parameters`: at the velocities of momenta."""
        nodes = list(quantities.values())
        if self.velocities is not None and self.system is not None:
            nodes = substitute(nodes, dict(zip(self.system.qd, self.velocities.outputs.values(), strict=True)))
        inputs = dict.fromkeys([*cg.variables([*self.states, TIME, *self.parameters]), *quantity_inputs(self)])
        return self.bind(self.states, Graph(list(inputs), dict(zip(quantities, nodes, strict=True))))


def derive(model: Model, bound: Mapping[str, float], *, by_rows: bool = False) -> Problem:
    """The problem of a model, with these numbers built in; of the last few, the one that was derived before.

    by_rows: whether f may be loops over rows, as it is of `Rows`, and of more than MOST bodies without loops whose
    numbers are known. Raises ValueError for `Rows` where it may not.
    """
    model = as_equations(model)
    inputs, system = state_inputs(model), model.system
    if system is None:
        equations: tuple[Any, ...] = (model.ode and model.ode.rates,)
    else:
        moving, held = system.kinematics, system.constraints
        equations = (system.coordinates, system.partial_lagrangians, system.forces, system.damping, system.lengths)
        equations += (system.velocities, *moving.q_dot, moving.quasi and moving.quasi.normalized, moving.groups)
        equations += (tuple(held.names), held.positions, held.velocities)
    terms, rows = None if system is None else system.body_terms, None
    if terms is not None and terms.bodies is not None:
        given = terms.linearized is not None  # as rows
        if given and not by_rows:
            without_graph()
        if by_rows and (given or len(terms.bodies.moving) > MOST):
            rows = import_module(ROWS).rows_of(system, bound)
    equations += () if rows is None else (terms,)
    numbers = tuple([(name, float(value).hex()) for name, value in bound.items()])  # 0.0 and -0.0 stay apart
    key = (*equations, inputs.states, inputs.applied, tuple(inputs.parameters), numbers)
    return _derived(_Request(key, model, bound, rows))


@dataclass(frozen=True)
class _Request:
    key: tuple[Any, ...]
    model: Equations = field(compare=False)
    bound: Mapping[str, float] = field(compare=False)
    rows: Any = field(compare=False)  # that it moves by, or None


@memo(KEPT_PROBLEMS)
def _derived(request: _Request) -> Problem:
    model, bound = request.model, dict(request.bound)
    inputs, system = state_inputs(model), model.system
    parameters = tuple([name for name in (*inputs.applied, *inputs.parameters) if name not in bound])
    if system is None:
        components = [f"state {name!r}" for name in inputs.states]
    else:
        components = [f"coordinate {name!r}" for name in system.coordinates]
        rated = set(system.coordinates)
        components += [f"velocity {'of ' if name in rated else ''}{name!r}" for name in system.velocities]
    every: tuple[Graph | None, ...]
    if system is not None and request.rows is not None:
        pushes = {f"tau{i}": tau + force for i, (tau, force) in enumerate(zip(system.tau, system.forces, strict=True))}
        every = (Graph(cg.variables([*inputs.states, TIME, *inputs.applied, *inputs.parameters]), pushes), None, None)
    else:
        every = (*with_multipliers(model), None if system is None else projection(system))
    rate, multipliers, step = [graph and _bind(graph, inputs.states, parameters, bound) for graph in every]
    assert rate is not None
    if request.rows is not None:
        rate = import_module(ROWS).rate_by_rows(request.rows, rate, lambda: derive(model, bound).rate)
    graphs = (rate, normalization(model), step, multipliers)
    return Problem(model, inputs.states, tuple(components), parameters, bound, *graphs, system)


def _bind(graph: Graph, first: Sequence[str], parameters: Sequence[str], bound: Mapping[str, float]) -> Graph:
    specialized = cg.specialize(graph, {name: value for name, value in bound.items() if name in graph.input_names})
    return Graph(cg.variables([*first, TIME, *parameters]), specialized.outputs)


@kept_by_first
def total_energy(problem: Problem) -> Graph | None:
    """The energy E of a mechanical system; None for a first-order system."""
    if (system := problem.system) is None or not isinstance(problem.rate, ByRows):
        return None if system is None else problem.bind(problem.states, energy(system))
    by_rows, names = import_module(ROWS), problem.rate.input_names
    straight = lambda: problem.bind(problem.states, energy(system))  # noqa: E731
    found: Graph = by_rows.energy_by_rows(by_rows.rows_of(system, problem.bound), names, straight)
    return found


def constraint_rates(problem: Problem) -> Graph | None:
    """The rates of the constraints that are kept, by their names; None without constraints."""
    system = problem.system
    if system is None or not len(system.constraints):
        return None
    constraints = system.constraints
    rates = {constraints.names[k]: constraints.rates[k] for k in independent_rows(constraints)}
    return problem.bind(problem.states, Graph([*system.q, *system.qd, *system.extra_inputs], rates))


@kept_by_first
def force(problem: Problem) -> Graph | None:
    """tau + forces - damping qd; None for a first-order system."""
    system = problem.system
    if system is None:
        return None
    parts = zip(system.tau, system.forces, system.braking(Builder()), strict=True)
    outputs = {f"force{i}": tau + forces - brake for i, (tau, forces, brake) in enumerate(parts)}
    return problem.bind(problem.states, Graph(quantity_inputs(problem), outputs))


@kept_by_first
def state_jacobian(problem: Problem) -> Graph:
    """df/dx, row by row."""
    return cg.simplify(cg.jacobian(problem.rate, list(problem.states)))


@kept_by_first
def time_derivative(problem: Problem) -> Graph:
    """df/dt at fixed x."""
    return cg.simplify(cg.jacobian(problem.rate, [TIME]))


def quantity(
    problem: Problem,
    what: str,
    function: Callable[..., Any],
    tau: Sequence[Node] | None = None,
    *,
    constant: bool = False,
) -> Node:
    """function(q, qd, [tau,] t[, p]) or (x, t[, p]) as a node over `quantity_inputs`; constant: or a number."""
    arguments = list(state_arguments(problem))
    if tau is not None:
        arguments.insert(2, list(tau))
    node = call_user_function(what, function, *arguments)
    if constant and is_finite(node):
        node = cg.constant(float(node))
    known = _known(problem)
    if not isinstance(node, Node) or any(
        other.op.name == "variable" and other not in known for other in topological([node])
    ):
        raise ValueError(f"{what} must be a node of the state, t and the parameters, got {node!r:.60}")
    return node


def state_arguments(problem: Problem) -> tuple[Any, ...]:
    """Arguments of a function of the state: (q, qd, t, p) as nodes, or (x, t, p) of a first-order system."""
    p = Parameters(state_inputs(problem.model).parameters)
    if problem.system is None:
        return cg.variables(list(problem.states)), cg.variable(TIME), p
    return problem.system.q, problem.system.qd, problem.system.t, p


@kept_by_first
def _known(problem: Problem) -> frozenset[Node]:
    return frozenset(quantity_inputs(problem))


def quantity_inputs(problem: Problem) -> list[Node]:
    """Inputs of a `quantity`: the states of the model, t, applied forces and the model's parameters."""
    inputs = state_inputs(problem.model)
    return cg.variables([*inputs.states, TIME, *inputs.applied, *inputs.parameters])


def reaches(nodes: Iterable[Node], variables: Iterable[Node]) -> bool:
    """Whether any of the nodes depends on any of the variables."""
    return not set(variables).isdisjoint(topological(nodes))


def in_form(problem: Problem, form: str) -> Problem:
    """The problem that the steps of a run are of. Raises ValueError for a form that it has not."""
    return problem if require_choice("form", form, FORMS) == "velocity" else momentum_form(problem)


@kept_by_first
def momentum_form(problem: Problem) -> Problem:
    """The motion in q and p = dL/dqd. Raises ValueError for a first-order system, and as `hamilton_equations`."""
    from ..equations.momentum.hamiltonian import hamilton_equations, missing_momenta, velocities

    system = problem.system
    if system is None:
        raise ValueError('form="momentum" needs a Lagrangian, which a system of first order does not have')
    states = (*problem.states[: problem.nq], *[f"p{i}" for i in range(system.n)])
    names = [f"momentum of {name!r}" for name in system.velocities]
    missing = missing_momenta(system)
    return replace(
        problem,
        states=states,
        components=(*problem.components[: problem.nq], *names),
        rate=problem.bind(states, hamilton_equations(system)),
        velocities=problem.bind(states, velocities(system)),
        momentum=problem.bind(problem.states, momentum(system)),
        missing=missing and problem.bind(states, missing),
    )
