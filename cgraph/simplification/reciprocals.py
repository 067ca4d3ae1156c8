"""Reciprocals: one division for every divisor, and products in place of the others."""

from __future__ import annotations

from collections import Counter

from ..core.graph import Graph
from ..core.node import Node, as_node
from ..core.traversal import rebuild
from ..operations.operation import OPS
from ..util.require import require_graph


def with_reciprocals(graph: Graph) -> Graph:
    """The function with products by 1 / d wherever several numbers are divided by the same d.

    A division takes a processor as long as ten to thirty products. A quotient is then rounded twice, within 1.5 units
    in the last place. It is the last thing to do to a graph: `simplify` and `specialize` make quotients of them again.

    >>> import cgraph as cg
    >>> from cgraph.extend import with_reciprocals
    >>> a, b, d = cg.variables("a b d")
    >>> graph = with_reciprocals(cg.Graph([a, b, d], {"x": a / d, "y": b / d}))
    >>> [node.op.name for node in graph.nodes if node.args], graph.evaluate({"a": 1.0, "b": 3.0, "d": 4.0})
    (['div', 'mul', 'mul'], {'x': 0.25, 'y': 0.75})
    """
    require_graph("with_reciprocals", graph)
    quotients = [node for node in graph.nodes if node.op is OPS["div"] and node.args[1].value is None]
    several = {divisor for divisor, count in Counter([node.args[1] for node in quotients]).items() if count > 1}
    inverses: dict[Node, Node] = {}  # of the new graph's divisors

    def copied(node: Node, args: tuple[Node, ...]) -> Node:
        if node.op is not OPS["div"] or node.args[1] not in several:
            return Node(node.op, args, node.label, name=node.name)
        inverse = inverses.setdefault(args[1], Node(node.op, (as_node(1.0), args[1]), node.label))
        return inverse if args[0].value == 1.0 else Node(OPS["mul"], (args[0], inverse), node.label, name=node.name)

    new = rebuild(graph.outputs.values(), {}, copied)
    return Graph(graph.inputs, {name: new[node] for name, node in graph.outputs.items()})
