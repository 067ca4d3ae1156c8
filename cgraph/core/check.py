"""The check of a graph: every node is one of an operation in the table, and arguments come before their use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .checks import GraphError
from .node import CONSTANT, VARIABLE, Node
from .row import ROWS, Row
from .traversal import topological


def check(nodes: Sequence[Node], outputs: Mapping[str, Node]) -> None:
    """Raise GraphError for a graph that no public function could have made."""
    for node in nodes:
        check_node(node)
    if set(topological(outputs.values())) != set(nodes):
        raise GraphError("the nodes are not those that the outputs reach")
    visited: set[Node] = set()
    for node in nodes:
        if not visited.issuperset(node.args):
            raise GraphError(f"{node!r} comes before one of its arguments")
        visited.add(node)


def check_node(node: Node) -> None:
    """Raise GraphError unless the node is well formed."""
    if not isinstance(node, Node) or not isinstance(node.op, Row):
        raise GraphError(f"a {type(node).__name__} is not a node of an operation in the table")
    if node.op is CONSTANT:
        if type(node.value) is not float or node.value != node.value:
            raise GraphError(f"constant {node.value!r} is not a number")
    elif node.op is VARIABLE:
        if not node.name:
            raise GraphError("a variable has no name")
    elif ROWS.get(node.op.name) is not node.op:
        raise GraphError(f"operation {node.op.name!r} is not in the table")
    if len(node.args) != node.op.arity:
        raise GraphError(f"{node.op.name} takes {node.op.arity} argument(s), a node has {len(node.args)}")
    for arg in node.args:
        if not isinstance(arg, Node):
            raise GraphError(f"an argument of {node!r} is not a node: {arg!r:.60}")
