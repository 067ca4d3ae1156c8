"""Short formulas of nodes, to be drawn beside their symbols: what an inner node is, as k θ or I α."""

from __future__ import annotations

from collections.abc import Mapping

from cgraph import Graph, Node
from cgraph.extend import Names

LENGTH = 10  # characters that fit a node


def short_formulas(graph: Graph, names: Mapping[str, str], length: int = LENGTH) -> dict[Node, str]:
    """The formulas of those operations without a name that have one of at most `length` characters.

    names: {name in the graph: text shown}.
    """
    texts = Names(graph, names)
    formulas = {
        node: texts.text(node, 2 * length).replace(" * ", " ")
        for node in graph.nodes
        if node.args and node.name is None
    }
    return {node: text for node, text in formulas.items() if len(text) <= length and "%" not in text}
