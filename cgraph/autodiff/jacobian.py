"""Whole derivatives: the Jacobian of a graph, and the Hessian of a graph with one output."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.graph import Graph
from ..core.node import Node, as_node
from ..simplify.builder import Builder
from .forward import tangents
from .reverse import cotangents


def jacobian(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes x -> (dy_i/dx_j), row by row, outputs named `dy_i/dx_j`.

    Forward mode, one sweep a column, when there are at most as many inputs in `wrt` as outputs; else reverse mode.
    Structural zeros are the constant 0. Raises GraphError when `wrt` names no input.
    """
    chosen = graph.select_inputs(wrt)
    zero, one, build = as_node(0.0), as_node(1.0), Builder()
    if len(chosen) <= len(graph.outputs):
        columns = [tangents({node: one}, graph.outputs.values(), build) for node in chosen]
        rows = {name: [column.get(y, zero) for column in columns] for name, y in graph.outputs.items()}
    else:
        rows = {name: cotangents({y: one}, chosen, build) for name, y in graph.outputs.items()}
    return Graph(
        graph.inputs,
        {f"d{name}/d{node.name}": entry for name, row in rows.items() for node, entry in zip(chosen, row, strict=True)},
    )


def hessian(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y, one output, becomes x -> (d2y/dx_i dx_j), row by row, outputs named `d2y/dx_idx_j`.

    Forward over reverse. Only the lower triangle is computed: entry (j, i) is the node of entry (i, j).
    Raises GraphError when there are several outputs or `wrt` names no input.
    """
    output = graph.only_output()
    (name,) = graph.outputs
    chosen = graph.select_inputs(wrt)
    lower = hessian_nodes(output, chosen)
    return Graph(
        graph.inputs,
        {
            f"d2{name}/d{a.name}d{b.name}": lower[max(i, j)][min(i, j)]
            for i, a in enumerate(chosen)
            for j, b in enumerate(chosen)
        },
    )


def hessian_nodes(output: Node, wrt: Sequence[Node], build: Builder | None = None) -> list[list[Node]]:
    """Rows of the lower triangle of d2 output / d wrt2, as nodes."""
    zero, one, build = as_node(0.0), as_node(1.0), build or Builder()
    first = cotangents({output: one}, wrt, build)
    columns = [tangents({node: one}, first[j:], build) for j, node in enumerate(wrt)]
    return [[columns[j].get(first[i], zero) for j in range(i + 1)] for i in range(len(wrt))]
