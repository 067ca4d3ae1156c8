"""Dense symmetric solve: x of A x = b by an LDL^T factorization, on nodes or on any other numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..core.node import Node, as_node
from ..core.ops import less, where
from ..core.scope import building
from ..errors import GraphError
from ..simplify.builder import Builder


class SingularError(GraphError):
    """A pivot is the constant zero, or a negative constant where it has to be positive.

    Attributes
    ----------
    index : int
        The row of the pivot.
    pivot : float
        Its value.
    """

    def __init__(self, index: int, pivot: float = 0.0) -> None:
        problem = "not positive definite" if pivot else "singular by structure"
        super().__init__(f"the matrix is {problem}: pivot {index} is {pivot or 'zero'}")
        self.index = index
        self.pivot = pivot


def ldl_solve(
    lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder | None = None, *, check: bool = False
) -> list[Node]:
    """Nodes x with A x = rhs for a symmetric, definite A, by an LDL^T factorization without pivoting.

    Rows are eliminated from the last up: along a chain of bodies that is from the tip to the base, the order in which
    pivots are articulated inertias. Structural zeros cost nothing.

    Parameters
    ----------
    lower : n sequences of Node
        The lower triangle of A by rows: row i has at least i + 1 entries.
    rhs : sequence of Node, n of them
        The right-hand side.
    build : Builder, optional
        What the nodes are built by; by default a new one.
    check : bool
        Append one more node: 0 where all pivots are positive, else 1 + the index of the first one eliminated that is
        not.

    Returns
    -------
    list of Node
        x, n nodes; with `check`, n + 1.

    Raises
    ------
    SingularError
        If a pivot is the constant zero, or with `check` a negative constant.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import as_node, ldl_solve
    >>> ldl_solve([[as_node(4.0)], [as_node(2.0), as_node(2.0)]], [as_node(10.0), as_node(6.0)])
    [<node 2.0>, <node 1.0>]
    """
    with building(build or Builder()):
        x, pivots = ldl_elimination(lower, rhs, _require_nonzero)
        if check:
            x.append(first_not_positive({i: pivots[i] for i in reversed(range(len(pivots)))}))
    return x


def ldl_elimination(
    lower: Sequence[Sequence[Any]], rhs: Sequence[Any], accept: Callable[[int, Any], None] | None = None
) -> tuple[list[Any], list[Any]]:
    """The solution x of A x = rhs and the pivots of A, over any numbers with + - * /.

    For i = n - 1 .. 0:  g_ij = A_ij / A_ii,  A_jk -= g_ij A_ik,  b_j -= g_ij b_i  (j, k < i);
    for i = 0 .. n - 1:  x_i = b_i / A_ii - sum_j g_ij x_j.

    Parameters
    ----------
    lower : n sequences of numbers
        The lower triangle of the symmetric A by rows: row i has at least i + 1 entries. Arrays, symbols and other
        types with arithmetic count as numbers.
    rhs : sequence of n numbers
        The right-hand side.
    accept : callable, optional
        Called with the index and the value of every pivot before it divides; may raise.

    Returns
    -------
    x : list of n numbers
        The solution.
    pivots : list of n numbers
        The diagonal of D.

    Examples
    --------
    >>> from cgraph.extend import ldl_elimination
    >>> ldl_elimination([[4.0], [2.0, 2.0]], [10.0, 6.0])
    ([2.0, 1.0], [2.0, 2.0])
    """
    n = len(rhs)
    a = [list(row) for row in lower]
    b = list(rhs)
    gains: list[list[Any]] = [[] for _ in range(n)]
    for i in reversed(range(n)):
        pivot = a[i][i]
        if accept is not None:
            accept(i, pivot)
        gains[i] = [a[i][j] / pivot for j in range(i)]
        for j in range(i):
            for k in range(j + 1):
                a[j][k] = a[j][k] - gains[i][j] * a[i][k]
            b[j] = b[j] - gains[i][j] * b[i]
    x: list[Any] = []
    for i in range(n):
        total = b[i] / a[i][i]
        for gain, known in zip(gains[i], x, strict=True):
            total = total - gain * known
        x.append(total)
    return x, [a[i][i] for i in range(n)]


def _require_nonzero(index: int, pivot: Node) -> None:
    if pivot.value == 0.0:
        raise SingularError(index)


def first_not_positive(pivots: Mapping[int, Node]) -> Node:
    """0 where all pivots are positive, else 1 + the index of the first that is not (NaN is not), as a node.

    pivots: {index: pivot}, in the order of elimination: once one has failed, those after it mean nothing.
    Two operations for each pivot. Raises SingularError for a constant that is not positive.
    """
    info = as_node(0.0)
    for index, pivot in reversed(list(pivots.items())):
        if pivot.value is not None and pivot.value <= 0.0:
            raise SingularError(index, pivot.value)
        info = where(less(0.0, pivot), info, 1.0 + index)
    return info
