"""A graph as a function of generated Python, on floats, or of generated NumPy, on arrays."""

from __future__ import annotations

import builtins
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..core.checks import GraphError
from ..core.evaluation import Array
from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from ..operations.operation import LIBRARY, Op, columns
from ..operations.table import OPS
from ..operations.values import by_element


class OnFloats:
    """A graph at one point: generated Python."""

    def __init__(self, graph: Graph) -> None:
        self._graph, self.source = graph, source(graph, lambda op: op.python)
        self._function = _executable(self.source, {name: op.raising for name, op in _rows(graph).items()})

    def __call__(self, x: Sequence[float]) -> tuple[float, ...]:
        """The outputs; IEEE values where a function of `math` raises."""
        try:
            return self._function(x)
        except (ValueError, OverflowError, ZeroDivisionError):  # out of a function's domain: IEEE values node by node
            named = dict(zip(self._graph.input_names, x, strict=True))
            return tuple([float(value) for value in self._graph.evaluate(named).values()])


class OnArrays:
    """A graph at many points: generated NumPy.

    exact: take from floats what NumPy's own functions round otherwise than the C library.
    """

    def __init__(self, graph: Graph, *, exact: bool) -> None:
        rows = _rows(graph)
        apart = {name for name, op in rows.items() if exact and op.rounding >= LIBRARY}

        def text(op: Op) -> str:
            if op.name in apart:
                return f"{op.name}({', '.join([f'{{{slot}}}' for slot in range(op.arity)])})"
            return str(op.numpy)

        self.source = source(graph, text)
        values = {name: by_element(op.scalar) if name in apart else op.array for name, op in rows.items()}
        self._function = _executable(self.source, values)

    def __call__(self, points: Array, result: Array) -> None:
        """The outputs, (n_out, k), at points, (n_in, k)."""
        with np.errstate(all="ignore"):  # here, as every thread has its own
            for row, value in zip(result, self._function(points), strict=True):
                row[:] = value


def _rows(graph: Graph) -> dict[str, Op]:
    """The table, with the rows that the graph's nodes have, of which one may be replaced in the table.

    Raises GraphError for two of one name.
    """
    found = dict.fromkeys([columns(node.op) for node in graph.nodes if node.args])
    rows = {op.name: op for op in found}
    if twice := [op.name for op in found if rows[op.name] is not op]:
        raise GraphError(f"the graph has two operations called {twice[0]!r}: the row of one was replaced since")
    return {**OPS, **rows}


def _executable(text: str, operations: dict[str, Any]) -> Callable[[Any], tuple[Any, ...]]:
    """The text's function, in which an operation's name stands for its value."""
    namespace: dict[str, Any] = {"inf": math.inf, "np": np, **operations}
    exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
    function: Callable[[Any], tuple[Any, ...]] = namespace["function"]
    return function


def source(graph: Graph, text_of: Callable[[Op], str]) -> str:
    """Text of `def function(x)` from a sequence of inputs to a tuple of outputs.

    Identifiers are numbered, since names of people clash: with keywords, with functions, and with one another where
    Python takes two letters for one (it reads U+03D5 as U+03C6). Comments tell them.

    text_of: the text of an operation, with {0}, {1}, .. for its arguments.
    """
    names = _names(graph)
    unpacked = ", ".join(names[node] for node in graph.inputs)
    lines = ["def function(x):"]
    if graph.inputs:
        lines.append(f"    {unpacked}{',' if len(graph.inputs) == 1 else ''} = x  # {', '.join(graph.input_names)}")
    for node in graph.nodes:
        if node.op is not CONSTANT and node.op is not VARIABLE:
            text = text_of(columns(node.op)).format(*[names[arg] for arg in node.args])
            lines.append(f"    {names[node]} = {text}" + (f"  # {node.name}" if node.name else ""))
    results = ", ".join(names[node] for node in graph.outputs.values())
    lines.append(f"    return ({results},)  # {', '.join(graph.outputs)}")
    return "\n".join(lines) + "\n"


def _names(graph: Graph) -> dict[Node, str]:
    """An identifier for each input, x0 and so on, and operation, by its number in the listing, and constants' texts."""
    mark = ""
    while any([re.fullmatch(f"[xv]{mark}[0-9]+", name) for name in OPS]):  # a row of the table may be called x0
        mark += "_"
    names, number = {node: f"x{mark}{i}" for i, node in enumerate(graph.inputs)}, 0
    for node in graph.nodes:
        if node.op is CONSTANT:
            text = repr(node.value)
            names[node] = f"({text})" if text.startswith("-") else text
        elif node not in names:
            names[node] = f"v{mark}{(number := number + 1)}"
    return names
