"""A Jacobian in three graphs: what the point decides, a product with one color's columns, and where entries belong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node, as_node, variable
from ..operations.table import equal
from ..simplification.simplify import simplify
from ..util.require import require_graph
from .coloring import column_coloring
from .products import direction_split, jvp
from .sparsity import pattern, written_sizes

LANES = 8  # colors that cost one sweep


class CompressedJacobian(NamedTuple):
    """The Jacobian of x (n) -> y (m) as a loop over colors; columns that share no row have one color.

    primal: x -> p, once for all colors.  product: p and a color -> the sum of its columns, (m,).
    entries: the sums, (m, colors) row by row -> the Jacobian, row by row.

    >>> import cgraph as cg
    >>> from cgraph.extend import compressed_jacobian
    >>> x = cg.variables([f"x{k}" for k in range(9)])
    >>> energy = sum(x)
    >>> for _ in range(9):
    ...     energy = cg.sin(energy)
    >>> compressed_jacobian(cg.Graph(x, {f"y{k}": energy * x[k] for k in range(9)})).colors
    9
    """

    colors: int
    primal: Graph
    product: Graph
    entries: Graph


def compressed_jacobian(
    graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None
) -> CompressedJacobian | None:
    """The Jacobian as a product repeated for colors of columns; None where `cg.jacobian`, a node an entry, is smaller.

    Counted are operations, of which eight colors share one.  wrt: the n inputs to differentiate by; by default all.

    >>> import cgraph as cg
    >>> from cgraph.extend import compressed_jacobian
    >>> x = cg.variable("x")
    >>> compressed_jacobian(cg.Graph([x], {"y": cg.sin(x)})) is None
    True
    """
    require_graph("compressed_jacobian", graph)
    chosen = graph.select_inputs(wrt)
    entries = pattern(graph, chosen)
    coloring = column_coloring(entries)
    once, columns, rows = written_sizes(graph, chosen)
    if min(columns, rows) <= once * coloring.vectors(LANES):
        return None
    (colors, _), n = coloring.counts, len(chosen)
    split = direction_split(simplify(jvp(graph, chosen)), n)
    color = variable("color")
    known = split.linear.inputs[: len(split.primal.outputs)]
    seeds = [equal(color, float(each)) for each in coloring.columns]
    product = Graph([*known, color], split.linear(*known, *seeds))
    sums = [[variable(f"sum{i}_{c}") for c in range(colors)] for i in range(len(graph.outputs))]
    placed = {f"{i}_{j}": as_node(0.0) for i in range(len(sums)) for j in range(n)}
    placed |= {f"{i}_{j}": sums[i][coloring.columns[j]] for i, row in enumerate(entries.by_row()) for j in row}
    return CompressedJacobian(colors, split.primal, product, Graph([each for row in sums for each in row], placed))
