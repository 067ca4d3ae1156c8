"""Motion equations: a problem with its numbers taken apart, and the pullback of its rate by inverse dynamics.

The pullback is J^T y_bar of xdot = f(x, tau, t, p) of a mechanical system. From r(q, qd, qdd, tau, p) = M qdd + bias -
tau - forces + D qd = 0 follows dqdd = -M^-1 dr, so that cotangents of the accelerations make mu = M^-1 qdd_bar, and the
others are the slopes of the power -mu . r at constant mu and qdd: one reverse sweep over the virtual power of inverse
dynamics, in place of one over its solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, SingularError, building, cotangents, folded, solve_nodes, tangents, topological

from ...equations.bias_terms import bias_terms
from ...equations.constraints.constraints import constraint_rows
from ...equations.mass_matrix.accelerations import DENSE_UP_TO
from ...equations.substitute import substitute
from ...integrators import Problem
from ...systems.arguments import new_variables
from ...systems.system import System

ONE, ZERO = cg.constant(1.0), cg.constant(0.0)
ARITHMETIC = ("add", "sub", "mul", "neg")
PARAMETERS = ("tau", "p", "c")  # registers: what the parameters of the problem are, end to end


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """A problem whose parameters are applied forces, p, and c.  given: the one without c.

    forces: how many of the parameters are applied forces.  names: of p.  numbers: c, a graph over p, if there are any.
    pullback: of the rate, where there is one.
    start, end: (q, qd) to a state of the steps and back, over states, t, parameters; None where they are the same.
    """

    given: Problem
    problem: Problem
    forces: int
    names: tuple[str, ...]
    numbers: Graph | None
    pullback: RatePullback | None
    start: Graph | None
    end: Graph | None

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the registers of the parameters."""
        count = len(self.problem.parameters) - self.forces - len(self.names)
        return dict(zip(PARAMETERS, (self.forces, len(self.names), count), strict=True))

    def values(self, p: Array, backend: str) -> Array:
        """p and c, (P + C, N), from p (P, N)."""
        if self.numbers is None:
            return p
        return np.concatenate([p, at(compiled(self.numbers, backend), p)])

    def by_parameters(self, p: Array, bars: Array, backend: str) -> Array:
        """Cotangents of p from those of p and c."""
        if self.numbers is None:
            return bars
        count = len(self.names)
        return bars[:count] + at(pulled_back(self.numbers, backend), np.concatenate([p, bars[count:]]))

    def columns(self, p: Array, backend: str) -> Array:
        """Tangents of p and c along every one of p (P,), (P + C, P)."""
        unit = np.eye(len(self.names))
        if self.numbers is None:
            return unit
        return np.concatenate([unit, compiled(self.numbers, backend).jacobian(p)])


@kept_by_first
def motion_equations(problem: Problem, forces: int) -> MotionEquations:
    """The equations of a problem whose first `forces` parameters are applied forces."""
    names, pullback = problem.parameters[forces:], rate_pullback(problem)
    graphs = [problem.rate] if problem.projection is None else [problem.rate, problem.projection]
    parts = [node for graph in graphs for node in graph.outputs.values()]
    if pullback is not None:
        parts += [pullback.power, *pullback.solved, *pullback.q_dot]
    numbers, changed = _apart(parts, cg.variables(list(names)), problem.rate.input_names)
    new = dict(zip(parts, changed, strict=True))
    rate, *projection = [
        Graph([*graph.inputs, *numbers], {name: new[node] for name, node in graph.outputs.items()}) for graph in graphs
    ]
    if pullback is not None:
        solved, q_dot = ([new[node] for node in nodes] for nodes in (pullback.solved, pullback.q_dot))
        pullback = replace(pullback, inputs=rate.inputs, power=new[pullback.power], solved=solved, q_dot=q_dot)
    outputs = {str(variable.name): node for variable, node in numbers.items()}
    parameters, projected = (*problem.parameters, *outputs), projection[0] if projection else None
    made = replace(problem, parameters=parameters, rate=rate, projection=projected, multipliers=None)
    over_p = Graph(cg.variables(list(names)), outputs) if outputs else None
    ways = _whole(made, made.momentum), _whole(made, made.velocities)
    return MotionEquations(problem, made, forces, names, over_p, pullback, *ways)


def _whole(problem: Problem, last: Graph | None) -> Graph | None:
    """States to states, whose coordinates stay and whose last numbers a graph gives."""
    if last is None:
        return None
    q = {str(node.name): node for node in last.inputs[: problem.nq]}
    return problem.bind(last.input_names[: problem.size], Graph(last.inputs, q | last.outputs))


def sharing(equations: MotionEquations) -> tuple[Graph, RatePullback] | None:
    """The rate with values that its pullback needs as outputs besides, and the pullback that takes them over, if any.

    These are what slopes of the power by the state, and what is solved, read; of them the cheap are made again.
    """
    pullback, rate = equations.pullback, equations.problem.rate
    if pullback is None:
        return None
    here = {node for node in rate.nodes if node.args}
    moving, needed = {*rate.inputs[: equations.problem.size]}, set(pullback.solved)
    for node in topological([pullback.power]):
        moves = [arg in moving for arg in node.args]
        moving |= {node} if any(moves) else set()
        if node.op.name == "mul":
            needed |= {arg for arg, other in zip(node.args, reversed(moves), strict=True) if other}
        elif any(moves) and node.op.name not in ARITHMETIC:
            needed |= {node, *node.args}
    order = topological([pullback.power, *pullback.solved])
    for node in reversed(order):
        if node in needed and node not in here:
            needed |= {*node.args}
    recorded, known = list[Node](), set(rate.inputs)
    for node in [node for node in order if node in here and node in needed]:
        if node.op.name not in ARITHMETIC or not known.issuperset(node.args):
            recorded.append(node)
        known.add(node)
    shared = dict(zip(recorded, new_variables("shared", len(recorded), rate.input_names), strict=True))
    more = {str(variable.name): node for node, variable in shared.items()}
    return Graph(rate.inputs, {**rate.outputs, **more}), replace(pullback, shared=shared)


def _apart(
    nodes: Sequence[Node], parameters: Sequence[Node], taken: Sequence[str]
) -> tuple[dict[Node, Node], list[Node]]:
    """{variable c: what it is of the parameters alone, where others use it}, and the nodes over these variables.

    taken: names that the variables do not get.
    """
    build = Builder()
    copies = folded(nodes, build)
    order = topological(copies)
    alone, edge = set(parameters), dict.fromkeys(copies)
    for node in order:
        if node.args and all([arg in alone or arg.op.name == "constant" for arg in node.args]):
            alone.add(node)
        else:
            edge |= dict.fromkeys(node.args)
    used = [node for node in edge if node in alone]
    numbers = dict(zip(used, new_variables("number", len(used), taken), strict=True))
    return {variable: node for node, variable in numbers.items()}, substitute(copies, numbers)


@kept_by_first
def compiled(graph: Graph, backend: str) -> Any:
    """The graph as a function."""
    return cg.compile(graph, backend)


@kept_by_first
def pulled_back(graph: Graph, backend: str) -> Any:
    """J^T y_bar as a function of the inputs, then y_bar."""
    return cg.compile(cg.simplify(cg.vjp(graph)), backend)


def at(function: Any, x: Array) -> Array:
    """The outputs, (k, N), at points (n, N)."""
    values: Array = function(x[:, 0])[:, None] if x.shape[1] == 1 else function.batch(x)
    return values


@dataclass(frozen=True, eq=False)
class RatePullback:
    """Inputs to differentiate by -> graph: inputs those of the rate, values, cotangents of the rate's outputs.

    inputs: of the rate.  values, bars: of its outputs.  mu: variables.  power: -mu . r over these and the inputs.
    solved: what mu is, over the inputs and bars.  q_dot: rates of the coordinates.
    shared: {node of the rate and of these: variable}, which are values besides.
    """

    inputs: Sequence[Node]
    values: Sequence[Node]
    bars: Sequence[Node]
    mu: Sequence[Node]
    power: Node
    solved: Sequence[Node]
    q_dot: Sequence[Node]
    shared: Mapping[Node, Node] = field(default_factory=dict)

    @property
    def residuals(self) -> int:
        """Number of the last outputs of the rate that are there for this rule alone."""
        return len(self.shared)

    def __call__(self, wrt: Sequence[Node]) -> Graph:
        """The graph for these inputs."""
        build = Builder()
        n = len(self.mu)
        power, *rest = folded([self.power, *self.solved, *self.q_dot, *self.shared], build)
        solved, q_dot, shared = rest[:n], rest[n : len(rest) - len(self.shared)], rest[len(rest) - len(self.shared) :]
        seeds: dict[Node, Node] = {power: ONE}
        with building(build):
            for node, bar in zip(q_dot, self.bars, strict=False):  # the other bars are those of accelerations
                seeds[node] = seeds[node] + bar if node in seeds else bar
        known = dict(zip(shared, self.shared.values(), strict=True))
        known |= dict(zip(self.mu, substitute(solved, known), strict=True))
        pulled = substitute(cotangents(seeds, wrt, build), known)
        outputs = {f"{k}": node for k, node in enumerate(pulled)}
        return cg.simplify(Graph([*self.inputs, *self.values, *self.shared.values(), *self.bars], outputs))


def rate_pullback(problem: Problem) -> RatePullback | None:
    """None for first-order systems and momenta, and where constraints or a singular mass matrix need more."""
    system, m = problem.system, problem.size
    if system is None or problem.momenta or len(system.constraints):
        return None
    taken = [*problem.rate.input_names, *system.parameters]
    values, bars, mu = (new_variables(what, n, taken) for what, n in (("value", m), ("bar", m), ("mu", system.n)))
    of_accelerations = slice(m - system.n, m)
    try:
        power = _power(system, mu, values[of_accelerations])
        ways = [by(system, bars[of_accelerations]) for by in (_eliminated, _factored)[: 1 + (system.n <= DENSE_UP_TO)]]
    except SingularError:
        return None
    more = [*values, *bars, *mu]
    inputs = [*system.q, *system.qd, *more, *system.tau, *system.extra_inputs]
    names = [*problem.states, *[str(node.name) for node in more]]

    def bound(nodes: Sequence[Node]) -> list[Node]:
        return [*problem.bind(names, Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)})).outputs.values()]

    power, *q_dot = bound([power, *system.q_dot])
    solved = min([bound(way) for way in ways], key=lambda nodes: _more_than(problem.rate, nodes))
    return RatePullback(problem.rate.inputs, values, bars, mu, power, solved, q_dot)


def _eliminated(system: System, rhs: Sequence[Node]) -> list[Node]:
    """M^-1 rhs by elimination, as long chains are solved."""
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], build)
    return solve_nodes(lagrangian, system.qd, rhs, build)


def _factored(system: System, rhs: Sequence[Node]) -> list[Node]:
    """M^-1 rhs by the factors of the whole M, as short chains are solved."""
    build = Builder()
    rows, lagrangian = constraint_rows(system, []), bias_terms(system).lagrangian
    return rows.solve_densely(system, lagrangian, rhs, build, composites=True)


def _more_than(rate: Graph, nodes: Sequence[Node]) -> int:
    """Number of nodes of these besides those of the rate, whose solution they may share."""
    copies = folded([*rate.outputs.values(), *nodes], Builder())
    return len(topological(copies)) - len(topological(copies[: len(rate.outputs)]))


def _power(system: System, mu: Sequence[Node], qdd: Sequence[Node]) -> Node:
    """-mu . (M qdd + bias - tau - forces + D qd), each force where it works: on the velocity that mu makes of it."""
    terms, build = bias_terms(system, qdd), Builder()
    along = tangents(dict(zip(system.qd, mu, strict=True)), list(terms.inertial), build)
    power = ZERO
    with building(build):
        for velocity, force in terms.inertial.items():
            power = power - force * along.get(velocity, ZERO)
        rows = zip(mu, terms.gradient, system.tau, terms.forces, system.damping, system.qd, strict=True)
        for speed, slope, tau, applied, damping, qd in rows:
            power = power + speed * (slope + tau + applied - damping * qd)
    return power
