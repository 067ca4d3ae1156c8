"""Paths through a graph: the nodes on any, their number and the k best, by one sweep over the nodes."""

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from operator import itemgetter

from ..core.graph import Edge
from ..core.node import Node
from ..core.traversal import descendants


def ancestors(sinks: Iterable[Node], without: Collection[Node] = ()) -> set[Node]:
    """The nodes that `sinks` depend on, the sinks included, along paths that pass no node of `without`."""
    reached: set[Node] = set()
    stack = [node for node in sinks if node not in without]
    while stack:
        node = stack.pop()
        if node not in reached:
            reached.add(node)
            stack.extend([arg for arg in node.args if arg not in without])
    return reached


def between(nodes: Sequence[Node], sources: Iterable[Node], sinks: Iterable[Node]) -> list[Node]:
    """The nodes on any path from `sources` to `sinks`, in the order of `nodes`; empty when there is none."""
    on_path = descendants(nodes, sources) & ancestors(sinks)
    return [node for node in nodes if node in on_path]


def edges_among(nodes: Collection[Node]) -> list[Edge]:
    """The uses of nodes by one another, in their order."""
    inside = set(nodes)
    return [Edge(arg, node, slot) for node in nodes for slot, arg in enumerate(node.args) if arg in inside]


def path_count(nodes: Sequence[Node], edges: Sequence[Edge], source: Node, sink: Node) -> int:
    """Number of ways from source to sink, through x * x two; exact, however many.

    nodes, edges: those between the two, in topological order.
    """
    uses = dict.fromkeys(nodes, 0)
    for edge in edges:
        uses[edge.source] += 1
    counts: dict[Node, int] = {source: 1}
    incoming = by_target(edges)
    for node in nodes:
        for edge in incoming.get(node, ()):
            counts[node] = counts.get(node, 0) + counts[edge.source]
            uses[edge.source] -= 1
            if not uses[edge.source] and edge.source is not sink:  # so that huge numbers do not pile up
                del counts[edge.source]
    return counts.get(sink, 0)


def by_target(edges: Sequence[Edge]) -> dict[Node, list[Edge]]:
    """The edges into each node."""
    incoming: dict[Node, list[Edge]] = {}
    for edge in edges:
        incoming.setdefault(edge.target, []).append(edge)
    return incoming


_Way = tuple[float, Edge | None, int]  # one of the best ways to a node: cost, last edge, rank among those before it


def best_paths(
    nodes: Sequence[Node],
    edges: Sequence[Edge],
    sources: Collection[Node],
    sinks: Collection[Node],
    k: int,
    cost: Callable[[Edge], float] = lambda edge: 1.0,
) -> list[tuple[Edge, ...]]:
    """The k paths of least cost, the sum over their edges, best first: each node keeps the k best ways to it.

    nodes, edges: those between the two, in topological order. A path whose cost is infinite is left out.
    """
    incoming = by_target(edges)
    start: list[_Way] = [(0.0, None, 0)]
    best = dict.fromkeys(sources, start[:k])
    for node in nodes:
        if node not in sources:
            ways: list[_Way] = []
            for edge in incoming.get(node, ()):
                if math.isfinite(more := cost(edge)):
                    ways += [(step[0] + more, edge, rank) for rank, step in enumerate(best.get(edge.source, ()))]
            ways.sort(key=_cost)  # sorted runs, so this is a merge; stable, so that ties fall the same way in every run
            best[node] = ways[:k]
    ends = sorted([step for sink in sinks for step in best.get(sink, ())], key=_cost)
    return [_traced(best, step) for step in ends[:k]]


_cost = itemgetter(0)


def _traced(best: dict[Node, list[_Way]], step: _Way) -> tuple[Edge, ...]:
    edges: list[Edge] = []
    while (edge := step[1]) is not None:
        edges.append(edge)
        step = best[edge.source][step[2]]
    return tuple(reversed(edges))
