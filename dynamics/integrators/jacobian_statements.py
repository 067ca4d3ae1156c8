"""The Jacobian of the rate by statements of a program: written out, or a product in vectors for colors of columns."""

from __future__ import annotations

from cgraph import Graph
from cgraph.extend import Call, CompressedJacobian, Map, Statement, compressed_jacobian, kept_by_first

from .problem import Problem, state_jacobian


def jacobian_statements(problem: Problem) -> tuple[list[Statement], dict[str, int]]:
    """df/dx of the registers x, t and p to the register "jacobian", row by row; and the registers used on the way."""
    parts, m = _compressed(problem), problem.size
    if parts is None:
        return [Call(state_jacobian(problem), ("x", "t", "p"), ("jacobian",))], {}
    colors = Graph([], {f"{k}": float(k) for k in range(parts.colors)})
    rows = tuple([f"jacobian{k}" for k in range(m)])
    statements: list[Statement] = [
        Call(parts.primal, ("x", "t", "p"), ("known",)),
        Call(colors, (), ("color",)),
        Map(parts.product, ("color",), rows, shared=("known",)),
        Call(parts.entries, rows, ("jacobian",)),
    ]
    return statements, {"known": len(parts.primal.outputs)} | dict.fromkeys(("color", *rows), parts.colors)


@kept_by_first
def _compressed(problem: Problem) -> CompressedJacobian | None:
    return compressed_jacobian(problem.rate, list(problem.states))
