"""Source: a graph written out as one Python function, a line a node."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable

from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node, Op


def source(graph: Graph, text_of: Callable[[Op], str], helpers: Iterable[str]) -> str:
    """Text of `def function(x)` from a sequence of inputs to a tuple of outputs.

    text_of: the text of an operation, with {0}, {1}, .. for its arguments.
    helpers: names that the text must not use for anything else.
    """
    names = _names(graph, set(helpers))
    unpacked = ", ".join(names[node] for node in graph.inputs)
    lines = ["def function(x):"]
    if graph.inputs:
        lines.append(f"    {unpacked}{',' if len(graph.inputs) == 1 else ''} = x")
    for node in graph.nodes:
        if node.op is not CONSTANT and node.op is not VARIABLE:
            text = text_of(node.op).format(*[names[arg] for arg in node.args])
            lines.append(f"    {names[node]} = {text}")
    results = ", ".join(names[node] for node in graph.outputs.values())
    lines.append(f"    return ({results},)")
    return "\n".join(lines) + "\n"


def _names(graph: Graph, taken: set[str]) -> dict[Node, str]:
    """An identifier for each node: the person's name where it can be one, a number elsewhere."""
    names: dict[Node, str] = {}
    taken = taken | {"x", "function"}

    def free(wanted: str) -> str:
        name = wanted
        while name in taken or keyword.iskeyword(name):
            name += "_"
        taken.add(name)
        return name

    for node in graph.inputs:
        plain = re.sub(r"\W", "_", str(node.name))
        names[node] = free(plain if plain.isidentifier() else f"_{plain}")
    for node in graph.nodes:
        if node.op is CONSTANT:
            assert node.value is not None
            names[node] = _number(node.value)
        elif node not in names:
            names[node] = free(f"v{len(names)}")
    return names


def _number(value: float) -> str:
    text = {"inf": "inf", "-inf": "-inf"}.get(repr(value), repr(value))
    return f"({text})" if text.startswith("-") else text
