"""A table of torques: its graph, its numbers at a state, and both as text, Markdown and LaTeX."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph, Node
from cgraph.extend import topological

from ..systems.system import System
from .evaluate_at import Array, at_state

NONE = "·"  # a cell that is zero by structure, at every state
LONGEST = 6  # operations up to which a cell without a state is written out


@dataclass(frozen=True, eq=False)
class TorqueTable:
    """Torques [N m or N] in named rows and columns, which add up to tau.

    graph: one output for each cell, row by row.  values: (rows, columns) at a state, or None; see `at`.
    downwards: columns add up to tau, else rows.
    """

    title: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    system: System
    graph: Graph
    downwards: bool
    values: Array | None = None

    @property
    def zeros(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """(rows, columns), True where a cell is zero by structure, at every state."""
        flat = [node.value == 0.0 for node in self.graph.outputs.values()]
        return np.array(flat).reshape(len(self.rows), len(self.columns))

    @property
    def total(self) -> Array:
        """tau, (n,), the sum of the cells. Raises ValueError for a table without a state."""
        if self.values is None:
            raise ValueError("the table has no state, and so no numbers; give it one by at(q, qd, qdd)")
        total: Array = self.values.sum(axis=0 if self.downwards else 1)
        return total

    def at(
        self,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        t: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> TorqueTable:
        """The table with its numbers at a state, (n,) each; None is rest. Raises ValueError for another shape."""
        flat = at_state(self.system, self.graph, {"q": q, "qd": qd, "qdd": qdd}, t, parameters)
        if flat.ndim != 1:
            raise ValueError(f"a table has one state, q, qd and qdd of the shape ({self.system.n},)")
        return replace(self, values=flat.reshape(len(self.rows), len(self.columns)))

    def to_text(self, digits: int = 4) -> str:
        """The table in columns of text, with the sum tau; without a state, each cell's expression or its size."""
        return _aligned(self._cells(digits), "  ")

    def __str__(self) -> str:
        return self.to_text().rstrip("\n")

    def to_markdown(self, digits: int = 4) -> str:
        """The same as a Markdown table."""
        head, *body = [[cell.replace("|", "\\|") for cell in row] for row in self._cells(digits)]
        ruled = [head, ["---", *["---:"] * (len(head) - 1)], *body]
        return "".join(f"| {' | '.join(row)} |\n" for row in ruled)

    def to_latex(self, digits: int = 4) -> str:
        """The same as a LaTeX `tabular` that needs no package."""
        head, *body = [" & ".join(map(_latex, row)) + r" \\" for row in self._cells(digits)]
        columns = "l" + "r" * len(self._cells(digits)[0][1:])
        lines = [rf"\begin{{tabular}}{{{columns}}}", r"\hline", head, r"\hline", *body, r"\hline", r"\end{tabular}"]
        return "\n".join(lines) + "\n"

    def _cells(self, digits: int) -> list[list[str]]:
        cells = self._written() if self.values is None else self._numbers(digits)
        rows = [[name, *row] for name, row in zip(self.rows, cells, strict=True)]
        head = ["", *self.columns]
        if self.values is not None:
            sums = [f"{each:.{digits}g}" for each in self.total]
            if self.downwards:
                rows.append(["tau", *sums])
            else:
                head.append("tau")
                rows = [[*row, each] for row, each in zip(rows, sums, strict=True)]
        return [head, *rows]

    def _numbers(self, digits: int) -> list[list[str]]:
        assert self.values is not None
        return [
            [NONE if zero else f"{value:.{digits}g}" for zero, value in zip(*row, strict=True)]
            for row in zip(self.zeros, self.values, strict=True)
        ]

    def _written(self) -> list[list[str]]:
        flat = [written(node) for node in self.graph.outputs.values()]
        width = len(self.columns)
        return [flat[i * width : (i + 1) * width] for i in range(len(self.rows))]


def written(node: Node) -> str:
    """The node's expression where that is short, else the number of its operations."""
    if node.value == 0.0:
        return NONE
    operations = [each for each in topological([node]) if each.args]
    if len(operations) > LONGEST:
        return f"{len(operations)} operations"
    text: dict[Node, str] = {}
    for each in topological([node]):
        if each.args:
            parts = [_part(each, slot, arg, text[arg]) for slot, arg in enumerate(each.args)]
            text[each] = each.op.python.format(*parts)
        else:
            text[each] = str(each.name) if each.value is None else f"{each.value:g}"
    return text[node]


def _part(of: Node, slot: int, arg: Node, text: str) -> str:
    """An argument's text, in brackets where the operation needs them."""
    if "(" in of.op.python:
        return text
    weak = ("neg", "sub") if of.op.name == "add" and slot else () if of.op.name in ("add", "sub") and not slot else None
    tight = of.op.name in ("div", "pow", "neg")
    operator = bool(arg.args) and "(" not in arg.op.python
    sum_ = arg.op.name in (("add", "sub", "neg") if weak is None else weak)
    return f"({text})" if (operator and (sum_ or tight)) or (slot and text.startswith("-")) else text


def _aligned(rows: Sequence[Sequence[str]], gap: str) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        gap.join(
            [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        )
        for row in rows
    ]
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _latex(cell: str) -> str:
    if number := re.fullmatch(r"(-?[\d.]+)(?:e([+-]\d+))?", cell):
        power = rf" \cdot 10^{{{int(number[2])}}}" if number[2] else ""
        return f"${number[1]}{power}$"
    if cell in (NONE, "tau"):
        return {NONE: r"$\cdot$", "tau": r"$\tau$"}[cell]
    return re.sub(r"([&%$#_{}])", r"\\\1", cell.replace("\\", r"\textbackslash ").replace("^", r"\^{}"))
