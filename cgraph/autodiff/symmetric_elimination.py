"""Gaussian elimination on a sparse symmetric matrix of nodes, with pivots of one or two unknowns, and dense solves."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from ..core.builder import Builder
from ..core.checks import GraphError
from ..core.node import Node, as_node, variable
from ..core.scope import building
from ..operations.table import equal, less, where
from ..util.explain_failure import explain_failure

ZERO = as_node(0.0)
SUM_ROUNDING = 2.0**-50


class SingularError(GraphError):
    """A pivot, of row `index`, is the constant zero beside zeros alone, or known not to be positive where it has to be.

    regular: whether the matrix is not singular for all that is known, but not positive definite.
    """

    def __init__(self, index: int, pivot: float = 0.0, *, regular: bool = False) -> None:
        regular = regular or pivot != 0.0
        problem = "not positive definite" if regular else "singular by structure"
        super().__init__(f"the matrix is {problem}: pivot {index} is {pivot or 'zero'}")
        self.index = index
        self.pivot = pivot
        self.regular = regular


class PivotRow(NamedTuple):
    """The row of an eliminated unknown i: t_i = constant - sum_j gains_j t_j."""

    pivot: Node  # what was divided by
    constant: Node
    gains: dict[Node, Node]


class SymmetricMatrix:
    """A sparse matrix with rows and columns named by nodes: entries W_ab = W_ba in both rows; an absent one is zero.

    written: the unknowns whose rows have been added to.
    """

    def __init__(self) -> None:
        self._rows: dict[Node, dict[Node, Node]] = {}
        self.written: set[Node] = set()

    def row(self, a: Node) -> Mapping[Node, Node]:
        """The entries {b: W_ab} of a row."""
        return self._rows.get(a, {})

    def add(self, a: Node, b: Node, value: Node) -> None:
        """W_ab += value, and W_ba with it."""
        if value.value == 0.0:
            return
        self.written |= {a, b}
        row = self._rows.setdefault(a, {})
        total = _sum(row[b], value) if b in row else value
        row[b] = total
        self._rows.setdefault(b, {})[a] = total

    def add_both(self, a: Node, b: Node, value: Node) -> None:
        """W_ab += value and W_ba += value, which on the diagonal are two additions to one entry."""
        self.add(a, b, 2.0 * value if a is b else value)

    def pop(self, a: Node) -> tuple[Node, dict[Node, Node]]:
        """W_aa and the entries {b: W_ab} off the diagonal; row and column a leave the matrix."""
        row = self._rows.pop(a, {})
        diagonal = row.pop(a, ZERO)
        for b in row:
            del self._rows[b][a]
        return diagonal, row


def _sum(a: Node, b: Node) -> Node:
    """a + b; of two constants that cancel to their last bits, which are rounding, zero."""
    total = a + b
    if a.value is None or b.value is None or total.value is None:
        return total
    return ZERO if abs(total.value) <= SUM_ROUNDING * abs(b.value) else total


class SymmetricElimination:
    """The equations W t = b while unknowns leave them; an unknown is called by a node.

    An unknown whose pivot W_ii is the constant zero waits: those eliminated after it may fill the pivot. What waits to
    the end leaves two at a time, by pivots [[0, c], [c, 0]].

    rhs: {unknown: entry of b}.  place: {unknown: its number in messages and in `info`}.
    """

    def __init__(self, rhs: dict[Node, Node], place: Mapping[Node, int]) -> None:
        self.matrix = SymmetricMatrix()
        self.rhs = rhs
        self.place = dict(place)
        self.pivot_rows: dict[Node, PivotRow] = {}  # in the order of elimination
        self._waiting: list[Node] = []
        self._pairs: list[tuple[Node, Node]] = []

    def eliminate(self, i: Node) -> None:
        """Take out unknown i: W_jk -= W_ij W_ik / W_ii, b_j -= W_ij b_i / W_ii; or let it wait."""
        if self.matrix.row(i).get(i, ZERO).value == 0.0:
            self._waiting.append(i)
            return
        pivot, row = self.matrix.pop(i)
        rhs = self.rhs[i]
        gains = {other: value / pivot for other, value in row.items()}  # g_j = W_ij / W_ii
        others = list(row)
        for k, a in enumerate(others):  # the Schur complement: W_jk -= g_j W_ik, b_j -= g_j b_i
            for b in others[: k + 1]:
                self.matrix.add(a, b, -(gains[a] * row[b]))
            self.rhs[a] = self.rhs.get(a, ZERO) - gains[a] * rhs
        self.pivot_rows[i] = PivotRow(pivot, rhs / pivot, gains)

    def eliminate_waiting(self) -> list[Node]:
        """Take out the unknowns that wait, when no others are left, and return them, the last one first.

        Raises SingularError if a row has nothing but zeros.
        """
        before = len(self.pivot_rows)
        while waiting := self.retry():
            if len(self._waiting) == len(waiting):
                self._eliminate_pair(waiting[0])
        return list(self.pivot_rows)[before:][::-1]

    def retry(self) -> list[Node]:
        """Take out those of the unknowns that waited whose pivots have been filled; and what waited."""
        waiting, self._waiting = self._waiting, []
        for i in waiting:
            self.eliminate(i)
        return waiting

    def _eliminate_pair(self, i: Node) -> None:
        """Take out i and the first j that it stands with, W_ii = W_jj = 0: t_i = (b_j - sum_k W_jk t_k) / W_ij."""
        j = next((k for k, value in self.matrix.row(i).items() if k is not i and value.value != 0.0), None)
        if j is None:
            raise SingularError(self.place[i])
        _, row_i = self.matrix.pop(i)
        c = row_i.pop(j)
        _, row_j = self.matrix.pop(j)
        rhs_i, rhs_j = self.rhs[i], self.rhs[j]
        gains_i, gains_j = ({k: value / c for k, value in row.items()} for row in (row_j, row_i))
        others = list(dict.fromkeys([*row_i, *row_j]))
        for n, k in enumerate(others):  # by [[0, c], [c, 0]]^-1: W_km -= (W_jk W_im + W_ik W_jm) / c
            for m in others[: n + 1]:
                for gains, row in ((gains_i, row_i), (gains_j, row_j)):
                    self.matrix.add(k, m, -(gains.get(k, ZERO) * row.get(m, ZERO)))
            self.rhs[k] = self.rhs.get(k, ZERO) - (gains_i.get(k, ZERO) * rhs_i + gains_j.get(k, ZERO) * rhs_j)
        self.pivot_rows[i] = PivotRow(c, rhs_j / c, gains_i)
        self.pivot_rows[j] = PivotRow(c, rhs_i / c, gains_j)
        self._pairs.append((i, j))
        self._waiting = [k for k in self._waiting if k not in (i, j)]

    def solution(self, i: Node, known: Mapping[Node, Node]) -> Node:
        """t_i from those eliminated after it."""
        _, total, gains = self.pivot_rows[i]  # t_i = b_i / W_ii - sum_j g_j t_j
        for other, gain in gains.items():
            total = total - gain * known[other]
        return total

    def info(self, negative: Collection[Node] = ()) -> Node:
        """0 where all pivots have their sign, else 1 + the place of the first that has not (NaN has not), as a node.

        negative: unknowns whose pivots are to be negative. Raises SingularError for a constant of the other sign, and
        for a pair, of which one eigenvalue is negative, unless it is one of each kind.
        """
        pairs = {i: pair for pair in self._pairs for i in pair}
        info = as_node(0.0)
        for i, row in reversed(self.pivot_rows.items()):
            if i in pairs:
                if sum(each in negative for each in pairs[i]) != 1:
                    raise SingularError(self.place[i], regular=True)
                info = where(equal(row.pivot, 0.0), 1.0 + self.place[i], info)
                continue
            sign = -1.0 if i in negative else 1.0
            if row.pivot.value is not None and sign * row.pivot.value <= 0.0:
                raise SingularError(self.place[i], row.pivot.value)
            right = less(row.pivot, 0.0) if i in negative else less(0.0, row.pivot)
            info = where(right, info, 1.0 + self.place[i])
        return info


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
