"""Graphs as scripts of pages take them: arrays of operations and arguments, by the numbers of nodes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cgraph import Graph

if TYPE_CHECKING:
    from cgraph.extend import Json


def graph_data(graph: Graph) -> dict[str, Json]:
    """{nodes, inputs, outputs} of a graph.

    nodes, arguments before uses: a constant as its value, an input as null, else [operation, *numbers of its
    arguments]; [[name of an input, its number, -1 where nothing uses it]]; [[name of an output, number of a node]].
    """
    number = {node: i for i, node in enumerate(graph.nodes)}
    return {
        "nodes": [
            _number(node.value) if node.value is not None
            else [node.op.name, *[number[arg] for arg in node.args]] if node.args else None
            for node in graph.nodes
        ],
        "inputs": [[name, number.get(node, -1)] for name, node in zip(graph.input_names, graph.inputs, strict=True)],
        "outputs": [[name, number[node]] for name, node in graph.outputs.items()],
    }  # fmt: skip


def _number(value: float) -> float | str:
    """JSON has no infinity."""
    return value if math.isfinite(value) else str(value).replace("inf", "Infinity")
