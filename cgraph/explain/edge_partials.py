"""Numbers at a point: the local partial derivative of every edge."""

from collections.abc import Mapping, Sequence

from ..core.evaluation import is_finite
from ..core.graph import Edge, Graph
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
    return {name: float(value) for name, value in names.inputs_of("at", at, all_of_them=True).items()}


def edge_slopes(names: Names, edges: Sequence[Edge], at: Point) -> list[float]:
    """d target / d source of each edge alone, at a point; NaN or infinite where there is no derivative."""
    if not edges:
        return []
    partials = {str(i): edge.partial for i, edge in enumerate(edges)}
    return [float(each) for each in Graph(names.graph.inputs, partials).evaluate(checked(names, at)).values()]
