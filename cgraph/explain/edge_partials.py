"""Numbers at a point: the value of every node, and the local partial derivative of every edge."""

from collections.abc import Mapping, Sequence

from ..core.checks import GraphError
from ..core.evaluation import is_finite
from ..core.graph import Edge, Graph
from ..core.node import Node
from ..util.require import require_mapping
from .names import Names

Point = Mapping[str, float]


def checked(names: Names, at: Point) -> dict[str, float]:
    """The point as floats, by the graph's names.

    Raises GraphError for a missing or unknown name, ValueError for what is not finite.
    """
    for name, value in require_mapping("at", at, "input: value").items():
        if isinstance(value, bool) or not is_finite(value):
            raise ValueError(f"at: input {name!r} must be a finite number, got {value!r:.60}")
    given = names.inputs_of("at", at)
    if missing := [names.shown(name) for name in names.graph.input_names if name not in given]:
        raise GraphError(f"at: no value for input {', '.join(missing)}")
    return {name: float(value) for name, value in given.items()}


def node_values(names: Names, nodes: Sequence[Node], at: Point) -> list[float]:
    """The values of nodes of the graph at a point."""
    if not nodes:
        return []
    inputs = names.graph.inputs
    values = Graph(inputs, {str(i): node for i, node in enumerate(nodes)}).evaluate(checked(names, at))
    return [float(values[str(i)]) for i in range(len(nodes))]


def edge_slopes(names: Names, edges: Sequence[Edge], at: Point) -> list[float]:
    """d target / d source of each edge alone, at a point; NaN or infinite where there is no derivative."""
    return node_values(names, [edge.partial for edge in edges], at)
