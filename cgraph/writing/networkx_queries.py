"""Graph queries by networkx: the one place that knows it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from ..core.graph import Edge
from ..core.node import Node

if TYPE_CHECKING:
    import networkx


def to_networkx(nodes: Sequence[Node], inputs: Sequence[Node], outputs: Mapping[str, Node]) -> networkx.MultiDiGraph:
    """A MultiDiGraph from arguments to uses, of nodes in topological order and the inputs that nothing uses."""
    import networkx

    result = networkx.MultiDiGraph()
    number: dict[Node, int] = {}
    for node in dict.fromkeys((*nodes, *inputs)):
        number[node] = len(number)
        result.add_node(
            number[node],
            op=node.op.name,
            name=node.name,
            value=node.value,
            tags=sorted(node.tags),
            roles=sorted(node.roles),
            outputs=[name for name, output in outputs.items() if output is node],
        )
    for node in nodes:
        for slot, arg in enumerate(node.args):
            result.add_edge(number[arg], number[node], key=slot)
    return result


def minimum_cut(edges: Sequence[Edge], sources: Collection[Node], sinks: Collection[Node]) -> list[Edge]:
    """The fewest edges without which no path leads from `sources` to `sinks`, in the order of `edges`.

    Of several such sets it is the one nearest to the sinks. edges: those on such paths; no node is source and sink.
    """
    import networkx

    network = networkx.DiGraph()
    start, end = object(), object()
    network.add_edges_from([(start, node) for node in sources])  # without a capacity: these are not to be cut
    network.add_edges_from([(node, end) for node in sinks])
    for (source, target), uses in Counter([(edge.source, edge.target) for edge in edges]).items():
        network.add_edge(source, target, capacity=uses)
    residual = networkx.algorithms.flow.shortest_augmenting_path(network, start, end)
    behind: set[object] = {end}  # what could send more flow to the sinks lies behind the cut nearest to them
    stack = [end]
    while stack:
        node = stack.pop()
        for before in residual.pred[node]:
            link = residual[before][node]
            if before not in behind and link["flow"] < link["capacity"]:
                behind.add(before)
                stack.append(before)
    return [edge for edge in edges if edge.source not in behind and edge.target in behind]
