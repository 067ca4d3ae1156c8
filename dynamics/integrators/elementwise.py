"""Graphs that act component by component: weighted sums and compensated additions of states."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call


def weighted(nodes: Sequence[Node], weights: Sequence[float]) -> Node:
    """The sum of weight * node, without those of weight 0."""
    total: Node | None = None
    for weight, node in zip(weights, nodes, strict=True):
        if weight:
            term = node if weight == 1.0 else weight * node
            total = term if total is None else total + term
    return cg.constant(0.0) if total is None else total


def ahead(weights: Sequence[float]) -> Graph:
    """x + h * (sum of weight * slope); inputs x, h and the slopes."""
    x, h, *slopes = cg.variables(["x", "h", *(f"s{k}" for k in range(len(weights)))])
    return Graph([x, h, *slopes], {"y": x + h * weighted(slopes, weights)})


def scaled(weights: Sequence[float]) -> Graph:
    """h * (sum of weight * slope); inputs h and the slopes."""
    h, *slopes = cg.variables(["h", *(f"s{k}" for k in range(len(weights)))])
    return Graph([h, *slopes], {"y": h * weighted(slopes, weights)})


def compensated(x: Node, more: Node) -> tuple[Node, Node]:
    """x + more, and what rounding takes off it, which the next sum may add (Kahan)."""
    total = x + more
    return total, more - (total - x)


def function(inputs: str, **outputs: float | Node) -> Graph:
    """A graph over these inputs."""
    return Graph(cg.variables(inputs), outputs)


def identity(m: int) -> Call:
    """Register `unit` = the identity matrix, row by row."""
    values = [1.0 if row == column else 0.0 for row in range(m) for column in range(m)]
    return Call(Graph([], {f"{k}": value for k, value in enumerate(values)}), (), ("unit",))


SAME = function("a", a=cg.variable("a"))
