"""Whole derivatives: the Jacobian of a graph, and the Hessian of a graph with one output."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.builder import Builder
from ..core.forward import tangents
from ..core.graph import Graph
from ..core.node import Node, as_node
from ..core.reverse import cotangents
from ..util.explain_failure import explain_failure
from ..util.require import require_graph


def jacobian(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes x -> (dy_i/dx_j).

    Forward mode, one sweep a column, when there are at most as many inputs in `wrt` as outputs; else reverse mode, one
    sweep a row.

    Parameters
    ----------
    graph : Graph
        x (n) -> y (m).
    wrt : str, Node or sequence of these, optional
        The n inputs to differentiate by; by default all.

    Returns
    -------
    Graph
        With the inputs of `graph` and m * n outputs named `dy_i/dx_j`, row by row; structural zeros are the constant 0.
        Where two of these names would be alike, all are by place: `d0/d1`.

    Raises
    ------
    GraphError
        If the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> r, a = cg.variables("r a")
    >>> polar = cg.Graph([r, a], {"x": r * cg.cos(a), "y": r * cg.sin(a)})
    >>> cg.jacobian(polar).evaluate({"r": 2.0, "a": 0.0})
    {'dx/dr': 1.0, 'dx/da': -0.0, 'dy/dr': 0.0, 'dy/da': 2.0}
    """
    require_graph("jacobian", graph)
    chosen = graph.select_inputs(wrt)
    zero, one, build = as_node(0.0), as_node(1.0), Builder()
    if len(chosen) <= len(graph.outputs):
        columns = [tangents({node: one}, graph.outputs.values(), build) for node in chosen]
        rows = {name: [column.get(y, zero) for column in columns] for name, y in graph.outputs.items()}
    else:
        rows = {name: cotangents({y: one}, chosen, build) for name, y in graph.outputs.items()}
    by_name = [f"d{name}/d{node.name}" for name in rows for node in chosen]
    by_place = [f"d{i}/d{j}" for i in range(len(rows)) for j in range(len(chosen))]
    entries = [entry for row in rows.values() for entry in row]
    return Graph(graph.inputs, dict(zip(_distinct(by_name, by_place), entries, strict=True)))


def hessian(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y, one output, becomes x -> (d2y/dx_i dx_j): forward mode over reverse mode.

    Only the lower triangle is computed: entry (j, i) is the node of entry (i, j).

    Parameters
    ----------
    graph : Graph
        A function with one output y.
    wrt : str, Node or sequence of these, optional
        The n inputs to differentiate by; by default all.

    Returns
    -------
    Graph
        With the inputs of `graph` and n * n outputs named `d2y/dx_idx_j`, row by row. Where two of these names
        would be alike, as of inputs `x` and `xdx`, all are by place: `d2y/d0d1`.

    Raises
    ------
    GraphError
        If there are several outputs, or the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.hessian(cg.Graph([x, y], {"f": x * x * y})).evaluate({"x": 2.0, "y": 3.0})
    {'d2f/dxdx': 6.0, 'd2f/dxdy': 4.0, 'd2f/dydx': 4.0, 'd2f/dydy': 0.0}
    """
    require_graph("hessian", graph)
    output = graph.only_output()
    (name,) = graph.outputs
    chosen = graph.select_inputs(wrt)
    lower = hessian_nodes(output, chosen)
    n = range(len(chosen))
    by_name = [f"d2{name}/d{a.name}d{b.name}" for a in chosen for b in chosen]
    by_place = [f"d2{name}/d{i}d{j}" for i in n for j in n]
    entries = [lower[max(i, j)][min(i, j)] for i in n for j in n]
    return Graph(graph.inputs, dict(zip(_distinct(by_name, by_place), entries, strict=True)))


def _distinct(by_name: list[str], by_place: list[str]) -> list[str]:
    """The names of entries; where joining made two of them alike, such as those of inputs x and xdx, all by place."""
    return by_name if len(set(by_name)) == len(by_name) else by_place


@explain_failure
def hessian_nodes(output: Node, wrt: Sequence[Node], build: Builder | None = None) -> list[list[Node]]:
    """The lower triangle of the Hessian d2y/dx2, row i with i + 1 nodes: forward mode over reverse mode.

    wrt: the variables x.  build: what the nodes are built by; by default a new one.

    >>> import cgraph as cg
    >>> from cgraph.extend import hessian_nodes
    >>> x, y = cg.variables("x y")
    >>> hessian_nodes(x * y, [x, y])
    [[<node 0.0>], [<node 1.0>, <node 0.0>]]
    """
    zero, one, build = as_node(0.0), as_node(1.0), build or Builder()
    first = cotangents({output: one}, wrt, build)
    columns = [tangents({node: one}, first[j:], build) for j, node in enumerate(wrt)]
    return [[columns[j].get(first[i], zero) for j in range(i + 1)] for i in range(len(wrt))]
