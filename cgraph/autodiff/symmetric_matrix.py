"""A sparse symmetric matrix of nodes, its rows and columns named by nodes."""

from collections.abc import Mapping

from ..core.node import Node, as_node

ZERO = as_node(0.0)
SUM_ROUNDING = 2.0**-50


class SymmetricMatrix:
    """Entries W_ab = W_ba, kept in both rows; an absent entry is zero."""

    def __init__(self) -> None:
        self._rows: dict[Node, dict[Node, Node]] = {}

    def row(self, a: Node) -> Mapping[Node, Node]:
        """The entries {b: W_ab} of a row."""
        return self._rows.get(a, {})

    def add(self, a: Node, b: Node, value: Node) -> None:
        """W_ab += value, and W_ba with it."""
        if value.value == 0.0:
            return
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
