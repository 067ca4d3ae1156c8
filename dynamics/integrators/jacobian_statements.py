"""The Jacobian of the rate by statements of a program: written out, or a product for colors of columns; its price."""

from __future__ import annotations

from cgraph import Graph
from cgraph._shared import CompressedJacobian, kept_by_first
from cgraph.extend import Call, Factor, Map, Program, Statement, compressed_jacobian

from .problem import Problem, state_jacobian
from .step import call


def jacobian_statements(problem: Problem) -> list[Statement]:
    """df/dx of the registers x, t and p to the register "jacobian", row by row."""
    parts = _compressed(problem)
    if parts is None:
        return [Call(state_jacobian(problem), ("x", "t", "p"), ("jacobian",))]
    rows = tuple([f"jacobian{k}" for k in range(problem.size)])
    return [
        Call(parts.primal, ("x", "t", "p"), ("known",)),
        call(lambda: {"color": [float(k) for k in range(parts.colors)]}),
        Map(parts.product, ("color",), rows, shared=("known",)),
        Call(parts.entries, rows, ("jacobian",)),
    ]


def identity(m: int) -> Call:
    """Register `unit` = the identity matrix, row by row."""
    return call(lambda: {"unit": [1.0 if row == column else 0.0 for row in range(m) for column in range(m)]})


def prices(steps: Program, rate: Graph) -> tuple[float, float]:
    """Operations of the Jacobian and of an LU factorization, the mean of those that steps make, in those of the rate.

    0 where they make none. A factorization of n rows has 2/3 n^3, products, sums and quotients.
    """
    jacobian, factors, one = 0, [0.0], max(1, _operations(rate))
    for each in steps.statements():
        if isinstance(each, Call | Map) and any(
            name == "known" or name.startswith("jacobian") for name in each.outputs
        ):
            turns = steps.registers[each.inputs[0]] if isinstance(each, Map) else 1
            jacobian += turns * _operations(each.graph)
        elif isinstance(each, Factor):
            factors.append(2.0 / 3.0 * steps.registers[each.pivots] ** 3)
    return jacobian / one, sum(factors) / max(1, len(factors) - 1) / one


def _operations(graph: Graph) -> int:
    return sum(bool(node.args) for node in graph.nodes)


@kept_by_first
def _compressed(problem: Problem) -> CompressedJacobian | None:
    return compressed_jacobian(problem.rate, list(problem.states))
