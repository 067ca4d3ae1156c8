"""The rate's pullback: J^T y_bar of xdot = f(x, tau, t, p) of a mechanical system, by its inverse dynamics.

From r(q, qd, qdd, tau, p) = M qdd + bias - tau - forces + D qd = 0 follows dqdd = -M^-1 dr, so that cotangents of the
accelerations make mu = M^-1 qdd_bar, and the others are the slopes of the power -mu . r at constant mu and qdd: one
reverse sweep over the virtual power of inverse dynamics, in place of one over its solution.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, SingularError, building, cotangents, folded, solve_nodes, tangents

from ...equations.bias_terms import bias_terms
from ...equations.substitute import substitute
from ...integrators import Problem
from ...systems.system import System

ONE, ZERO = cg.constant(1.0), cg.constant(0.0)


def rate_pullback(problem: Problem) -> Callable[[Sequence[Node]], Graph] | None:
    """Inputs to differentiate by -> graph: inputs those of the rate, its outputs' values, their cotangents.

    None for a system of first order, and where constraints or a singular mass matrix need more.
    """
    system = problem.system
    if system is None or len(system.constraints):
        return None
    try:
        return _Pullback(problem, system)
    except SingularError:
        return None


class _Pullback:
    """power: -mu . r over variables mu, qdd.  mu: M^-1 of variables, the cotangents of the accelerations."""

    def __init__(self, problem: Problem, system: System) -> None:
        self.problem, self.system, n = problem, system, system.n
        m = problem.size
        self.values = cg.variables([f"value{k}" for k in range(m)])
        self.bars = cg.variables([f"value{k}_bar" for k in range(m)])
        self.mu = cg.variables([f"mu{k}" for k in range(n)])
        build = Builder()
        (lagrangian,) = folded([system.lagrangian], build)
        self.solved = solve_nodes(lagrangian, system.qd, self.bars[m - n :], build)
        self.power = _power(system, self.mu, self.values[m - n :])

    def __call__(self, wrt: Sequence[Node]) -> Graph:
        """The graph for these inputs."""
        system, nq = self.system, self.problem.nq
        build = Builder()
        q_dot = folded(system.q_dot, build)
        seeds: dict[Node, Node] = {self.power: ONE}
        with building(build):
            for node, bar in zip(q_dot, self.bars[:nq], strict=True):
                seeds[node] = seeds[node] + bar if node in seeds else bar
        pulled = substitute(cotangents(seeds, wrt, build), dict(zip(self.mu, self.solved, strict=True)))
        outputs = {f"{k}": node for k, node in enumerate(pulled)}
        rate, names = self.problem.rate, [str(node.name) for node in (*self.values, *self.bars)]
        more = [*system.q, *system.qd, *self.values, *self.bars, *system.tau, *system.extra_inputs]
        bound = self.problem.bind([*self.problem.states, *names], Graph(more, outputs))
        return cg.simplify(Graph([*rate.inputs, *self.values, *self.bars], bound.outputs))


def _power(system: System, mu: Sequence[Node], qdd: Sequence[Node]) -> Node:
    """-mu . (M qdd + bias - tau - forces + D qd), each force where it works: on the velocity that mu makes of it."""
    terms, build = bias_terms(system), Builder()
    along = tangents(dict(zip(system.qd, mu, strict=True)), [terms.lagrangian, *terms.inertial], build)
    momentum = along.get(terms.lagrangian, ZERO)  # mu . dL/dqd
    inertia = tangents(dict(zip(system.qd, qdd, strict=True)), [momentum], build).get(momentum, ZERO)
    with building(build):
        power = -inertia
        for velocity, force in terms.inertial.items():
            power = power - force * along.get(velocity, ZERO)
        rows = zip(mu, terms.gradient, system.tau, terms.forces, system.damping, system.qd, strict=True)
        for speed, slope, tau, applied, damping, qd in rows:
            power = power + speed * (slope + tau + applied - damping * qd)
    return power
