"""Numbers at a point: the value of every node, and the local partial derivative of every edge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.edge import Edge
from ..core.graph import Graph
from ..core.node import Node
from ..errors import GraphError
from ..util.real_arrays import is_finite
from ..util.require import require_mapping

Point = Mapping[str, float]


def checked(graph: Graph, at: Point) -> dict[str, float]:
    """The point as floats. Raises GraphError for a missing or unknown name, ValueError for what is not finite."""
    for name, value in require_mapping("at", at, "input: value").items():
        if isinstance(value, bool) or not is_finite(value):
            raise ValueError(f"at: input {name!r} must be a finite number, got {value!r:.60}")
    if missing := [name for name in graph.input_names if name not in at]:
        raise GraphError(f"at: no value for input {', '.join(missing)}")
    if unknown := [name for name in at if name not in graph.input_names]:
        raise GraphError(
            f"at: the graph has no input {', '.join(map(str, unknown))} (it has {', '.join(graph.input_names)})"
        )
    return {name: float(value) for name, value in at.items()}


def node_values(graph: Graph, nodes: Sequence[Node], at: Point) -> list[float]:
    """The values of nodes of the graph at a point."""
    if not nodes:
        return []
    values = Graph(graph.inputs, {str(i): node for i, node in enumerate(nodes)}).evaluate(checked(graph, at))
    return [float(values[str(i)]) for i in range(len(nodes))]


def edge_slopes(graph: Graph, edges: Sequence[Edge], at: Point) -> list[float]:
    """d target / d source of each edge alone, at a point; NaN or infinite where there is no derivative."""
    return node_values(graph, [edge.partial for edge in edges], at)
