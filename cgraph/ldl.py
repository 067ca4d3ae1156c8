"""Dense symmetric solve on the graph: the nodes x of A x = b by an LDL^T factorisation."""

from __future__ import annotations

from collections.abc import Sequence

from .errors import GraphError
from .fold import Builder
from .label import building
from .node import Node


class SingularError(GraphError):
    """A pivot that is zero by structure. `index` says which row."""

    def __init__(self, index: int) -> None:
        super().__init__(f"the matrix is singular by structure: pivot {index} is zero")
        self.index = index


def ldl_solve(lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder | None = None) -> list[Node]:
    """Nodes x with A x = rhs, for the symmetric A whose lower triangle has the rows `lower`.

    Eliminates from the last row up: along a chain of bodies that is from the tip to the base, the order in which
    pivots are articulated inertias. No pivoting: A must be definite. Structural zeros cost nothing.
    Raises SingularError when a pivot is the constant zero.
    """
    n = len(rhs)
    a = [list(row) for row in lower]
    b = list(rhs)
    gains: list[list[Node]] = [[] for _ in range(n)]
    with building(build or Builder()):
        for i in reversed(range(n)):
            pivot = a[i][i]
            if pivot.value == 0.0:
                raise SingularError(i)
            gains[i] = [a[i][j] / pivot for j in range(i)]
            for j in range(i):
                for k in range(j + 1):
                    a[j][k] = a[j][k] - gains[i][j] * a[i][k]
                b[j] = b[j] - gains[i][j] * b[i]
        x: list[Node] = []
        for i in range(n):
            total = b[i] / a[i][i]
            for gain, known in zip(gains[i], x, strict=True):
                total = total - gain * known
            x.append(total)
    return x
