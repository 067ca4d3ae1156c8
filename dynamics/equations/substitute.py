"""Substitution: copies of nodes with other nodes in place of their variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cgraph import Graph, Node
from cgraph.extend import topological


def substitute(nodes: Sequence[Node], replacement: Mapping[Node, Node]) -> list[Node]:
    """Copies of nodes with `replacement` in place of variables, operations kept as written."""
    if not nodes:
        return []
    inputs = [node for node in topological(nodes) if node.op.name == "variable"]
    graph = Graph(inputs, {str(i): node for i, node in enumerate(nodes)})
    return list(graph(*[replacement.get(node, node) for node in inputs]).values())
