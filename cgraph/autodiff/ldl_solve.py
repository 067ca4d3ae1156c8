"""Dense symmetric solve: nodes x with A x = b by an LDL^T factorization."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.builder import Builder
from ..core.node import Node, variable
from ..core.scope import building
from ..util.explain_failure import explain_failure
from .symmetric_elimination import SymmetricElimination


@explain_failure
def ldl_solve(
    lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder | None = None, *, check: bool = False
) -> list[Node]:
    """Nodes x with A x = rhs for a symmetric, definite A, by an LDL^T factorization.

    Rows are eliminated from the last up: for bodies from the tip to the base. Structural zeros cost nothing. A row
    whose pivot is the constant zero waits, and leaves with another if it has to.
    lower: row i of the lower triangle has at least i + 1 entries.  check: append a node: 0 where all pivots are
    positive, else 1 + the index of the first that is not.
    Raises SingularError if a row has only zeros left, or with `check` a constant pivot is not positive.
    """
    _require_triangle(lower, rhs)
    unknowns = [variable(f"unknown{i}#") for i in range(len(rhs))]
    with building(build or Builder()):
        equations = SymmetricElimination(dict(zip(unknowns, rhs, strict=True)), {x: i for i, x in enumerate(unknowns)})
        for i, row in enumerate(lower):
            for j in range(i + 1):
                equations.matrix.add(unknowns[i], unknowns[j], row[j])
        for unknown in reversed(unknowns):  # A = L D L^T from the last row up, and b with it
            equations.eliminate(unknown)
        equations.eliminate_waiting()
        solution: dict[Node, Node] = {}  # L^T x = D^-1 L^-1 b, the last to leave first
        for unknown in reversed(equations.pivot_rows):
            solution[unknown] = equations.solution(unknown, solution)
        return [solution[unknown] for unknown in unknowns] + ([equations.info()] if check else [])


def _require_triangle(lower: Sequence[Sequence[object]], rhs: Sequence[object]) -> None:
    lengths = [len(row) for row in lower]
    if len(lengths) != len(rhs) or any([length <= i for i, length in enumerate(lengths)]):
        raise ValueError(f"lower needs at least 1 to {len(rhs)} entries in {len(rhs)} rows as rhs has, got {lengths}")
    for entry in (*rhs, *[entry for row in lower for entry in row]):
        if not hasattr(entry, "__truediv__"):
            raise TypeError(f"lower and rhs must be numbers, got {type(entry).__name__}: {entry!r:.60}")
