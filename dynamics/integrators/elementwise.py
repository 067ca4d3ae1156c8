"""Statements and formulas that act component by component: weighted and compensated sums of states."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, Map


def weighted(nodes: Sequence[Node], weights: Sequence[float]) -> Node:
    """The sum of weight * node, without those of weight 0."""
    total: Node | None = None
    for weight, node in zip(weights, nodes, strict=True):
        if weight:
            term = node if weight == 1.0 else weight * node
            total = term if total is None else total + term
    return cg.constant(0.0) if total is None else total


def used(weights: Sequence[float], register: str) -> tuple[list[Node], list[float], tuple[str, ...]]:
    """Registers, numbered from 0, whose weight is not 0, as nodes, with their weights and names."""
    numbers = [k for k, weight in enumerate(weights) if weight]
    nodes = cg.variables([f"s{k}" for k in numbers])
    return nodes, [weights[k] for k in numbers], tuple([f"{register}{k}" for k in numbers])


def advanced(target: str, weights: Sequence[float], slope: str = "slope") -> Map:
    """target = x + h * (sum of weight * slope)."""
    x, h = cg.variables("x h")
    slopes, parts, names = used(weights, slope)
    return Map(Graph([x, h, *slopes], {"y": x + h * weighted(slopes, parts)}), ("x", "h", *names), (target,))


def combined(rows: Sequence[Sequence[float]], sources: Sequence[str], targets: Sequence[str]) -> Map:
    """Statement for each target = sum of weight * source, by its row of weights."""
    nodes = cg.variables([f"s{k}" for k in range(len(sources))])
    graph = Graph(nodes, {f"{k}": weighted(nodes, row) for k, row in enumerate(rows)})
    return Map(graph, tuple(sources), tuple(targets))


def compensated(x: Node, more: Node) -> tuple[Node, Node]:
    """x + more, and what rounding takes off it, which the next sum may add (Kahan)."""
    total = x + more
    return total, more - (total - x)


def function(inputs: str, **outputs: float | Node) -> Graph:
    """A graph over these inputs."""
    return Graph(cg.variables(inputs), outputs)


def end_to_end(count: int, sources: tuple[str, ...], targets: tuple[str, ...]) -> Call:
    """The numbers of some registers, so many in all, into others."""
    nodes = cg.variables([f"c{k}" for k in range(count)])
    return Call(Graph(nodes, {f"c{k}": node for k, node in enumerate(nodes)}), sources, targets)


def identity(m: int) -> Call:
    """Register `unit` = the identity matrix, row by row."""
    values = [1.0 if row == column else 0.0 for row in range(m) for column in range(m)]
    return Call(Graph([], {f"{k}": value for k, value in enumerate(values)}), (), ("unit",))


def stage_time(target: str, c: float) -> Call:
    """target = t + c h."""
    t, h = cg.variables("t h")
    return Call(Graph([t, h], {"y": t + c * h}), ("t", "h"), (target,))
