"""The check of a graph: every node is one of an operation in the table, and arguments come before their use."""

from __future__ import annotations

from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from ..core.row import ROWS, Row
from ..core.traversal import topological


def check(graph: Graph) -> None:
    """Raise GraphError for a graph that no public function could have made."""
    for node in graph.nodes:
        check_node(node)
    if set(topological(graph.outputs.values())) != set(graph.nodes):
        raise GraphError("the nodes are not those that the outputs reach")
    visited: set[Node] = set()
    for node in graph.nodes:
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
