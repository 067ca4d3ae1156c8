"""The Jacobian of the rate by statements of a program: written out, or a product for colors of columns; its price."""

from __future__ import annotations

from cgraph._shared import CompressedJacobian, kept_by_first
from cgraph.extend import Call, Map, Statement, compressed_jacobian

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


@kept_by_first
def _compressed(problem: Problem) -> CompressedJacobian | None:
    return compressed_jacobian(problem.rate, list(problem.states))
