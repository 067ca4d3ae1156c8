"""Dense symmetric solve on the graph: the nodes x of A x = b by an LDL^T factorisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.node import Node, as_node
from ..core.ops import less, where
from ..core.scope import building
from ..errors import GraphError
from ..simplify.builder import Builder


class SingularError(GraphError):
    """A pivot that is the constant zero, or a negative one where it should be positive: `info`, of row `index`."""

    def __init__(self, index: int, pivot: float = 0.0) -> None:
        problem = "not positive definite" if pivot else "singular by structure"
        super().__init__(f"the matrix is {problem}: pivot {index} is {pivot or 'zero'}")
        self.index = index
        self.pivot = pivot


def ldl_solve(
    lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder | None = None, *, check: bool = False
) -> list[Node]:
    """Nodes x with A x = rhs, for the symmetric A whose lower triangle has the rows `lower`.

    Eliminates from the last row up: along a chain of bodies that is from the tip to the base, the order in which
    pivots are articulated inertias. No pivoting: A must be definite. Structural zeros cost nothing.
    check: one more node follows x, see `first_not_positive`.
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
        if check:
            x.append(first_not_positive({i: a[i][i] for i in reversed(range(n))}))
    return x


def first_not_positive(pivots: Mapping[int, Node]) -> Node:
    """0 where all pivots are positive, else 1 + the index of the first that is not (NaN is not), as a node.

    pivots: {index: pivot}, in the order of elimination: once one has failed, those after it mean nothing.
    Two operations for each pivot. Raises SingularError for a constant that is not positive.
    """
    found = as_node(0.0)
    for index, pivot in reversed(list(pivots.items())):
        if pivot.value is not None and pivot.value <= 0.0:
            raise SingularError(index, pivot.value)
        found = where(less(0.0, pivot), found, 1.0 + index)
    return found
