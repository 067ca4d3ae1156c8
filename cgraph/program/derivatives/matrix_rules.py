"""Derivatives of Factor and Solve: linear equations with the same factors."""

from __future__ import annotations

from ...core.graph import Graph
from ...core.node import constant
from ...writing.naming import variables
from ..statements.call import Call, copied
from ..statements.matrix import Factor, Solve
from .jvp import Assignment, Tangent
from .transpose import Adjoint

# The tangent, and the cotangent, of a factored matrix are those of the matrix A itself.


def push_factor(assignment: Assignment, tangent: Tangent) -> None:
    """The tangent of the factors is A_dot."""
    (before,), factor = assignment.sources, assignment.statement
    assert isinstance(factor, Factor)
    if before in tangent.dots and factor.matrix in tangent.active:
        tangent.dots[factor.matrix] = tangent.dots[before]


def pull_factor(assignment: Assignment, adjoint: Adjoint) -> None:
    """A_bar += the cotangent of the factors."""
    (before,), factor = assignment.sources, assignment.statement
    assert isinstance(factor, Factor)
    if factor.matrix in adjoint.bars and before in adjoint.active:
        adjoint.collect(before, adjoint.bars[factor.matrix])


def push_solve(assignment: Assignment, tangent: Tangent) -> None:
    """A x = b: A x_dot = b_dot - A_dot x, and with A^T for A the same."""
    (right,), solve = assignment.sources, assignment.statement
    assert isinstance(solve, Solve)
    matrix, side, n = tangent.dots.get(solve.matrix), tangent.dots.get(right), tangent.lengths[solve.vector]
    if matrix is None and side is None:
        return
    dot = tangent.dot(solve.vector)
    side = side or tangent.zero(right)
    if matrix is None:
        tangent.add(copied(side, dot))
    else:
        tangent.add(Call(_less_product(n, solve.transposed), (side, matrix, solve.vector), (dot,)))
    tangent.add(Solve(solve.matrix, solve.pivots, dot, solve.transposed))  # x_dot = A^-1 (b_dot - A_dot x)


def pull_solve(assignment: Assignment, adjoint: Adjoint) -> None:
    """x = A^-1 b: b_bar = A^-T x_bar, A_bar = -b_bar x^T; of A^T, A_bar = -x b_bar^T."""
    (right,), solve = assignment.sources, assignment.statement
    assert isinstance(solve, Solve)
    if solve.vector not in adjoint.bars:
        return
    bar, n = adjoint.bar(right), adjoint.lengths[solve.vector]
    adjoint.add(copied(adjoint.bars[solve.vector], bar))
    adjoint.add(Solve(solve.matrix, solve.pivots, bar, not solve.transposed))  # b_bar = A^-T x_bar
    if solve.matrix in adjoint.active:
        matrix = adjoint.bar(solve.matrix)
        sides = (solve.vector, bar) if solve.transposed else (bar, solve.vector)
        adjoint.add(Call(_outer(n), sides, (matrix,)))
        adjoint.collect(solve.matrix, matrix)
    if right in adjoint.active:
        adjoint.collect(right, bar)


def _less_product(n: int, transposed: bool) -> Graph:
    """b - A x, or b - A^T x."""
    b, x = (variables([f"{name}{k}" for k in range(n)]) for name in "bx")
    a = variables([f"a{k}" for k in range(n * n)])
    at = [[a[n * j + i] if transposed else a[n * i + j] for j in range(n)] for i in range(n)]
    rows = [sum([at[i][j] * x[j] for j in range(n)], constant(0.0)) for i in range(n)]
    return Graph([*b, *a, *x], {f"{i}": b[i] - row for i, row in enumerate(rows)})


def _outer(n: int) -> Graph:
    """-a b^T, row by row."""
    a, b = (variables([f"{name}{k}" for k in range(n)]) for name in "ab")
    return Graph([*a, *b], {f"{i}_{j}": -a[i] * b[j] for i in range(n) for j in range(n)})
