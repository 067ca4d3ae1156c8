"""The entries of a sparse Jacobian written out, a sweep for each row or for each column over what it reaches alone."""

from collections.abc import Sequence

from ..core.builder import Builder
from ..core.forward import tangents
from ..core.graph import Graph
from ..core.node import Node, as_node
from ..core.reverse import cotangents
from .sparsity import Pattern, dependence, slopes


def written_sizes(graph: Graph, wrt: Sequence[Node]) -> tuple[int, int, int]:
    """Operations to differentiate: once, in all sweeps over columns, and in all sweeps over rows."""
    once = columns = rows = 0
    active: set[Node] = set()
    for node, bits in dependence(graph, wrt):
        if bits and node.args:
            active.add(node)
            once, columns = once + 1, columns + bits.bit_count()
    reached: dict[Node, int] = {}
    for i, node in enumerate(graph.outputs.values()):
        reached[node] = reached.get(node, 0) | 1 << i
    for node in reversed(graph.nodes):
        bits = reached.pop(node, 0)
        if bits and node in active:
            rows += bits.bit_count()
            for arg in slopes(node):
                reached[arg] = reached.get(arg, 0) | bits
    return once, columns, rows


def entry_graph(graph: Graph, wrt: Sequence[Node], entries: Pattern, by_row: bool) -> Graph:
    """x -> the entries of the Jacobian by `wrt`, in their order."""
    zero, one, build = as_node(0.0), as_node(1.0), Builder()
    outputs = list(graph.outputs.values())
    values: dict[tuple[int, int], Node] = {}
    if by_row:
        for i, row in enumerate(entries.by_row()):
            bars = cotangents({outputs[i]: one}, [wrt[j] for j in row], build) if row else []
            values |= {(i, j): bar for j, bar in zip(row, bars, strict=True)}
    else:
        for j, column in enumerate(entries.by_column()):
            dots = tangents({wrt[j]: one}, [outputs[i] for i in column], build)
            values |= {(i, j): dots.get(outputs[i], zero) for i in column}
    order = zip(entries.rows.tolist(), entries.columns.tolist(), strict=True)
    return Graph(graph.inputs, {f"e{k}": values[place] for k, place in enumerate(order)})
