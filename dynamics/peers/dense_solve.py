"""The dense solve of `forward_dynamics(method="dense")` over any numbers: other software's expressions, or floats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cgraph as cg
from cgraph.extend import ldl_solve, topological

from .translate import translated


def dense_solve(matrix: Sequence[Sequence[Any]], rhs: Sequence[Any]) -> list[Any]:
    """x of A x = rhs for symmetric, definite A (its lower rows are read), over numbers with + - * /."""
    n = len(rhs)
    lower = [[cg.variable(f"a{i}_{j}") for j in range(i + 1)] for i in range(n)]
    right = [cg.variable(f"b{i}") for i in range(n)]
    x = ldl_solve(lower, right)
    values = {lower[i][j]: matrix[i][j] for i in range(n) for j in range(i + 1)} | dict(zip(right, rhs, strict=True))
    solved = translated(topological(x), values, None)
    return [solved[node] for node in x]
