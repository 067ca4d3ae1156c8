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
from cgraph.extend import Builder, SingularError, building, cotangents, folded, tangents, topological

from ...equations.bias_terms import bias_terms
from ...equations.constraints.constraints import constraint_rows
from ...equations.mass_matrix.accelerations import DENSE_UP_TO
from ...integrators import Problem
from ...systems.arguments import new_variables
from ...systems.kinematics import numbered_graph, substitute
from ...systems.system import System

ARITHMETIC = ("add", "sub", "mul", "neg")


@dataclass(frozen=True, eq=False)
class RatePullback:
    """Inputs to differentiate by -> graph: inputs those of the rate, values, cotangents of the rate's outputs.

    values, bars: variables of the outputs.  mu: variables.  nodes: -mu . r, then what mu is, then rates of coordinates.
    shared: {node of the rate and of these: variable}, which are values besides.
    """

    inputs: Sequence[Node]
    values: Sequence[Node]
    bars: Sequence[Node]
    mu: Sequence[Node]
    nodes: Sequence[Node]
    shared: Mapping[Node, Node] = field(default_factory=dict)

    def __call__(self, wrt: Sequence[Node]) -> Graph:
        """The graph for these inputs."""
        build, n, count = Builder(), len(self.mu), len(self.nodes)
        copies = folded([*self.nodes, *self.shared], build)
        seeds: dict[Node, Node] = {copies[0]: cg.constant(1.0)}
        with building(build):
            for node, bar in zip(copies[1 + n : count], self.bars, strict=False):  # the other bars: of accelerations
                seeds[node] = seeds[node] + bar if node in seeds else bar
        known = dict(zip(copies[count:], self.shared.values(), strict=True))
        known |= dict(zip(self.mu, substitute(copies[1 : 1 + n], known), strict=True))
        pulled = substitute(cotangents(seeds, wrt, build), known)
        return cg.simplify(numbered_graph([*self.inputs, *self.values, *self.shared.values(), *self.bars], pulled))


def rate_pullback(problem: Problem) -> RatePullback | None:
    """None for first-order systems and momenta, and where constraints or a singular mass matrix need more."""
    system, m = problem.system, problem.size
    if system is None or problem.momenta or len(system.constraints):
        return None
    taken = [*problem.rate.input_names, *system.parameters]
    values, bars, mu = (new_variables(what, n, taken) for what, n in (("value", m), ("bar", m), ("mu", system.n)))
    qdd, qdd_bar = values[m - system.n :], bars[m - system.n :]
    try:
        power, ways = _power(system, mu, qdd), _solutions(system, qdd_bar)
    except SingularError:
        return None
    more = [*values, *bars, *mu]
    inputs = [*system.q, *system.qd, *more, *system.tau, *system.extra_inputs]
    names = [*problem.states, *[str(node.name) for node in more]]

    def bound(nodes: Sequence[Node]) -> list[Node]:
        return [*problem.bind(names, numbered_graph(inputs, nodes)).outputs.values()]

    power, *q_dot = bound([power, *system.q_dot])
    solved = min([bound(way) for way in ways], key=lambda nodes: _unshared_count(problem.rate, nodes))
    return RatePullback(problem.rate.inputs, values, bars, mu, [power, *solved, *q_dot])


def sharing(rate: Graph, pullback: RatePullback) -> tuple[Graph, RatePullback]:
    """The rate with values that its pullback needs as outputs besides, and the pullback that takes them over.

    These are what slopes of the power by the state, and what is solved, read; of them the cheap are made again.
    """
    power, *solved = pullback.nodes[: 1 + len(pullback.mu)]
    here = {node for node in rate.nodes if node.args}
    moving, needed = {*rate.inputs[: len(rate.outputs)]}, set(solved)
    for node in topological([power]):
        moves = [arg in moving for arg in node.args]
        moving |= {node} if any(moves) else set()
        if node.op.name == "mul":
            needed |= {arg for arg, other in zip(node.args, reversed(moves), strict=True) if other}
        elif any(moves) and node.op.name not in ARITHMETIC:
            needed |= {node, *node.args}
    order = topological([power, *solved])
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


def _solutions(system: System, rhs: Sequence[Node]) -> list[list[Node]]:
    """M^-1 rhs by elimination, as long chains are solved, and of short ones by the factors of the whole M."""
    rows, lagrangian = constraint_rows(system, []), bias_terms(system).lagrangian
    solved = [rows.solve(system, lagrangian, rhs, Builder())]
    if system.n <= DENSE_UP_TO:
        solved.append(rows.solve_densely(system, lagrangian, rhs, Builder(), composites=True))
    return solved


def _unshared_count(rate: Graph, nodes: Sequence[Node]) -> int:
    """Number of nodes of these besides those of the rate, whose solution they may share."""
    copies = folded([*rate.outputs.values(), *nodes], Builder())
    return len(topological(copies)) - len(topological(copies[: len(rate.outputs)]))


def _power(system: System, mu: Sequence[Node], qdd: Sequence[Node]) -> Node:
    """-mu . (M qdd + bias - tau - forces + D qd), each force where it works: on the velocity that mu makes of it."""
    terms, build = bias_terms(system, qdd), Builder()
    along = tangents(dict(zip(system.qd, mu, strict=True)), list(terms.inertial), build)
    power = zero = cg.constant(0.0)
    braking = system.braking(build)
    with building(build):
        for velocity, force in terms.inertial.items():
            power = power - force * along.get(velocity, zero)
        rows = zip(mu, terms.gradient, system.tau, terms.forces, braking, strict=True)
        for speed, slope, tau, applied, brake in rows:
            power = power + speed * (slope + tau + applied - brake)
    return power
