"""Substitution: copies of nodes with other nodes in place of their variables."""

from collections.abc import Mapping, Sequence

from cgraph import Node
from cgraph.extend import topological


def substitute(nodes: Sequence[Node], replacement: Mapping[Node, Node], tag: str | None = None) -> list[Node]:
    """Copies of nodes with `replacement` in place of variables, operations kept as written.

    tag: of copies of nodes that have none.
    """
    tags = frozenset() if tag is None else frozenset({tag})
    copies = dict(replacement)
    for node in topological(nodes):
        if node.args and node not in copies:
            label = node.label if node.tags or not tags else node.label.tagged(tags)
            copies[node] = Node(node.op, tuple([copies.get(arg, arg) for arg in node.args]), label, name=node.name)
    return [copies.get(node, node) for node in nodes]
