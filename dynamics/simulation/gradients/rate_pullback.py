"""Pullback of the rate xdot = f(x, tau, t, p) of a mechanical system by inverse dynamics.

It is J^T y_bar. From r(q, qd, qdd, tau, p) = M qdd + bias - tau - forces + D qd = 0 follows dqdd = -M^-1 dr, so that
cotangents of the accelerations make mu = M^-1 qdd_bar, and the others are the slopes of the power -mu . r at constant
mu and qdd: one reverse sweep over the virtual power of inverse dynamics, in place of one over its solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import cgraph as cg
from cgraph import Graph, Node
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


def sharing(rate: Graph, pullback: RatePullback) -> tuple[Graph, RatePullback]:
    """The rate with values that its pullback needs as outputs besides, and the pullback that takes them over.

    These are what slopes of the power by the state, and what is solved, read; of them the cheap are made again.
    """
    here = {node for node in rate.nodes if node.args}
    moving, needed = {*rate.inputs[: len(rate.outputs)]}, set(pullback.solved)
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
