"""Equation (3): the terms of d/dt dL/dqd on the embedded graph, read off the graph itself."""

from __future__ import annotations

from dataclasses import dataclass

from cgraph import Graph
from cgraph.extend import Polynomial, expand, format_polynomial

from ...equations.formulations.formulations import inverse_dynamics, momentum_rate
from ...scenes.scenes import spring_mass

# The paper's right-hand side, I qdd - k (qdd dt^2 + 2 qd dt + q_old), as coefficients.
PAPER: Polynomial = {
    (("I", 1), ("qdd0", 1)): 1.0,
    (("dt", 2), ("k", 1), ("qdd0", 1)): -1.0,
    (("dt", 1), ("k", 1), ("qd0", 1)): -2.0,
    (("k", 1), ("q0_old", 1)): -1.0,
}


@dataclass(frozen=True)
class Equation:
    """One formulation's d/dt dL/dqd for L = I qd^2/2 - k q^2/2, term by term."""

    formulation: str
    terms: Polynomial
    unnecessary: Polynomial  # all but I qdd

    def __str__(self) -> str:
        return format_polynomial(self.terms)


def equation3(formulation: str) -> Equation:
    """The terms of the graph of that formulation; qd0 stands for the embedded velocity qdd0 dt + qd0_old."""
    terms = _terms(momentum_rate(spring_mass(), formulation))
    inertial = (("I", 1), ("qdd0", 1))
    return Equation(formulation, terms, {key: c for key, c in terms.items() if key != inertial})


def torque_terms(formulation: str) -> Polynomial:
    """The terms of the whole torque, d/dt dL/dqd - dL/dq, of that formulation."""
    return _terms(inverse_dynamics(spring_mass(), formulation))


def _terms(graph: Graph) -> Polynomial:
    velocity = {node: "qd0" for node in graph.nodes if node.args and node.name == "qd0"}
    return expand(graph.only_output(), velocity)
