"""The listing of a program: its registers, and its statements as a person would write them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from fractions import Fraction
from textwrap import wrap

from ..core.graph import Graph
from ..core.node import Node
from ..operations.operation import FUNCTION, LEAF, PRODUCT, SUM, columns
from ..util.words import counted
from .statement import Lengths, Names, Statement, bodies_of, names_in, row_of
from .statements.call import Call, Map, Sum, elements, several
from .statements.control import FixedPoint, If
from .statements.rows import For

Text = tuple[str, int]  # a formula, and how strongly it binds, as in the table of operations
INLINE, WIDE = 20, 100  # operations of a graph that is written as formulas, and letters of one, at most
SHORT, LINE = 60, 120  # letters of a field, and of a line of registers


class Listing:
    """Statements over registers of these lengths, line by line.

    names: {name of a function: its graph}; others are f1, f2, .. in order.
    """

    def __init__(self, lengths: Lengths, names: Mapping[str, Graph]) -> None:
        self._lengths, self._called = lengths, {id(graph): name for name, graph in names.items()}
        self._first = 1 - len(self._called)

    def registers(self) -> list[str]:
        """The registers of each length."""
        rows = []
        for length in sorted({*self._lengths.values()}):
            names = [name for name in self._lengths if self._lengths[name] == length]
            rows.append(f"{counted(length, 'number')}: {', '.join(names)}")
        return [line for row in rows for line in wrap(row, LINE, subsequent_indent="    ")]

    def body(self, statements: Sequence[Statement], indent: str = "    ") -> list[str]:
        """The statements, and those inside of others further in."""
        lines: list[str] = []
        for statement in statements:
            if isinstance(statement, Call | Map | Sum):
                lines += [indent + line for line in self._graph(statement)]
                continue
            if isinstance(statement, For):
                lines += [indent + line for line in self._rows(statement)]
                continue
            bodies = [body for body in bodies_of(statement) if body]
            lines.append(indent + (self._control(statement) if bodies else self._plain(statement)))
            for k, body in enumerate(bodies):
                lines += [*[f"{indent}else:"] * (k > 0), *self.body(body, f"{indent}    ")]
        return lines

    def _control(self, statement: Statement) -> str:
        """The line above a body."""
        registers = ", ".join(names_in(statement, row_of(statement).reads))
        if isinstance(statement, If):
            return f"if {'' if statement.body else 'not '}{registers} > 0:"
        return f"while {registers} > 0:" + ("  # to a fixed point" if isinstance(statement, FixedPoint) else "")

    def _rows(self, statement: For) -> list[str]:
        """The rows of each kind: blocks of numbers, register[place], of a function."""
        lines = [f"for each of {statement.count} rows{', the last first' if statement.backwards else ''}:"]
        for number, (graph, *uses) in enumerate(statement.kinds):
            reads, writes, adds = [
                ", ".join([f"{at}[{table}]" if table else at for at, table, _ in ends]) for ends in uses
            ]
            call, size = f"{self._name(graph)}({reads})", sum([1 for node in graph.nodes if node.args])
            ways = [f"{writes} = {call}"] * bool(writes) + [f"{adds} += {'the rest' if writes else call}"] * bool(adds)
            kind = f"if {statement.kind} is {number}: " if len(statement.graphs) > 1 else ""
            lines.append(f"    {kind}{', '.join(ways)}  # {counted(size, 'operation')}")
        return lines

    def _name(self, graph: Graph) -> str:
        """The name of a function."""
        return self._called.setdefault(id(graph), f"f{len(self._called) + self._first}")

    def _plain(self, statement: Statement) -> str:
        """writes = Kind(reads, other fields): of any kind."""
        row = row_of(statement)
        others = [each.name for each in fields(statement) if each.name not in (*row.reads, *row.writes)]  # type: ignore[arg-type]
        given = [*names_in(statement, row.reads), *[f"{name}={getattr(statement, name)!r:.{SHORT}}" for name in others]]
        targets = f"{', '.join(names_in(statement, row.writes))} = " if row.writes else ""
        return f"{targets}{type(statement).__name__}({', '.join(given)})"

    def _graph(self, statement: Call | Map | Sum) -> list[str]:
        graph = statement.graph
        size = sum([1 for node in graph.nodes if node.args])
        formulas = self._formulas(statement) if size <= INLINE and id(graph) not in self._called else {}
        if formulas and max(map(len, formulas.values())) <= WIDE:
            return [f"{target} = {formula}" for target, formula in formulas.items()]
        call = f"{self._name(graph)}({', '.join(names_in(statement, row_of(statement).reads))})"
        if not isinstance(statement, Call):
            call = f"{'sum of ' if isinstance(statement, Sum) else ''}{call} for each element"
        return [f"{', '.join(statement.outputs)} = {call}  # {counted(size, 'operation')}"]

    def _formulas(self, statement: Call | Map | Sum) -> dict[str, str]:
        """{register, or one of its numbers: formula}; none where a line would read what one above it writes."""
        graph = statement.graph
        if isinstance(statement, Call):
            sources = self._numbers(statement.inputs)
        elif several(statement, self._lengths):
            return {}
        else:  # register by register, as in NumPy
            sources = [*self._numbers(statement.shared), *statement.inputs]
        targets = list(statement.outputs) if isinstance(statement, Map) else self._numbers(statement.outputs)
        texts = {node: (name, LEAF) for node, name in zip(graph.inputs, sources, strict=True)}
        reads = {node: {name} for node, name in zip(graph.inputs, sources, strict=True)}
        for node in graph.nodes:
            if node not in texts:
                args = [texts[arg] for arg in node.args]
                texts[node] = _operation(node, args) if args else _number(float(node.value or 0.0))
                reads[node] = set[str]().union(*[reads[arg] for arg in node.args])
        formulas: dict[str, str] = {}
        for target, node in zip(targets, graph.outputs.values(), strict=True):
            if reads[node] & set(formulas):
                return {}
            total = isinstance(statement, Sum) and elements(statement, self._lengths) != 1
            formulas[target] = f"sum({texts[node][0]})" if total else texts[node][0]
        return formulas

    def _numbers(self, names: Names) -> list[str]:
        """The numbers of registers, end to end."""
        sizes = [(name, self._lengths[name]) for name in names]
        return [name if length == 1 else f"{name}[{k}]" for name, length in sizes for k in range(length)]


def _number(value: float) -> Text:
    near = Fraction(value).limit_denominator(12) if math.isfinite(value) else Fraction(0)
    if near.denominator > 1 and float(near) == value:
        return str(near), PRODUCT
    return f"{value:.6g}", LEAF if value >= 0.0 else PRODUCT


def _operation(node: Node, args: Sequence[Text]) -> Text:
    """The text of an operation: between its arguments, or name(..)."""
    op = columns(node.op)

    def inside(k: int, least: int) -> str:
        text, binding = args[k]
        return text if binding >= least else f"({text})"

    if op.name == "neg":
        return f"-{inside(0, PRODUCT)}", SUM
    if op.infix is None:
        return f"{op.name}({', '.join([text for text, _ in args])})", FUNCTION
    sign, binding = op.infix
    return f"{inside(0, binding)} {sign} {inside(1, binding + 1)}", binding
