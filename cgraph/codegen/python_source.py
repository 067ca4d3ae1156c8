"""Source: a graph written out as one Python function, a line a node."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from ..operations.operation import Op, columns


def source(graph: Graph, text_of: Callable[[Op], str], helpers: Iterable[str]) -> str:
    """Text of `def function(x)` from a sequence of inputs to a tuple of outputs.

    Identifiers are numbered, since names of people clash: with keywords, with functions, and with one another where
    Python takes two letters for one (it reads U+03D5 as U+03C6). Comments tell them.

    text_of: the text of an operation, with {0}, {1}, .. for its arguments.
    helpers: names that the text must not use for anything else.
    """
    names = _names(graph, helpers)
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


def _names(graph: Graph, helpers: Iterable[str]) -> dict[Node, str]:
    """An identifier for each input, x0 and so on, and operation, by its number in the listing, and constants' texts."""
    mark = ""
    while any([re.fullmatch(f"[xv]{mark}[0-9]+", name) for name in helpers]):  # a row of the table may be called x0
        mark += "_"
    names, number = {node: f"x{mark}{i}" for i, node in enumerate(graph.inputs)}, 0
    for node in graph.nodes:
        if node.op is CONSTANT:
            assert node.value is not None
            names[node] = _number(node.value)
        elif node not in names:
            names[node] = f"v{mark}{(number := number + 1)}"
    return names


def _number(value: float) -> str:
    text = {"inf": "inf", "-inf": "-inf"}.get(repr(value), repr(value))
    return f"({text})" if text.startswith("-") else text
