"""Enclosure: bounds of the outputs over boxes of the inputs, as a graph: interval arithmetic on nodes.

A bound that is NaN on the way stands for one that is not known; rules hand it on, and outputs have an infinite one
instead. What is known of bounds over all boxes, such as signs, spares nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..core.builder import Builder
from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.node import CONSTANT, Node, apply, as_node, variable
from ..core.scope import building
from ..util.require import require_graph, require_sequence
from .bounds import REAL_LINE, Bounded, Rule, rule_of
from .operation import Interval
from .table import where


def enclosure(graph: Graph, exact: Sequence[str | Node] = ()) -> Graph:
    """x -> y becomes (the lowest x, the highest x) -> (y.low, y.high), bounds of y over that box.

    Wherever in the box y, and what it is computed from, has a value, it lies between them, but for rounding: they are
    not rounded outwards. They may be wide, since an interval forgets which values belong together, but shrink to the
    value as the box does. Where nothing is known they are infinite, as of a quotient whose divisor may be 0, or an
    operation without `interval`; they are never NaN. Inputs may be infinite.

    exact: inputs that have one value. They come first, as they are, and what depends on them alone is computed once.
    Inputs of the result then are x.low of all others, and x.high; outputs are y.low of all, and y.high. Raises
    GraphError for an unknown input.

    >>> import cgraph as cg
    >>> from cgraph.extend import enclosure
    >>> x, a = cg.variables("x a")
    >>> bounds = enclosure(cg.Graph([x, a], {"y": a - x * x}), exact=["a"])
    >>> bounds.evaluate({"a": 5.0, "x.low": -1.0, "x.high": 2.0})
    {'y.low': 1.0, 'y.high': 5.0}
    """
    require_graph("enclosure", graph)
    for each in (exact := require_sequence("exact", exact, "inputs of the graph", (str, Node))):
        if (each.name if isinstance(each, Node) else each) not in graph.input_names:
            raise GraphError(f"exact: the graph has no input {each!r:.60} (it has {', '.join(graph.input_names)})")
    chosen = graph.select_inputs(exact) if exact else ()
    single, wide = [[node for node in graph.inputs if (node in chosen) is each] for each in (True, False)]
    lows, highs = [[variable(f"{node.name}.{end}") for node in wide] for end in ("low", "high")]
    found = {node: _exact(node) for node in single}
    found |= {node: Bounded(low, high, REAL_LINE) for node, low, high in zip(wide, lows, highs, strict=True)}
    build = Builder()
    with building(build) as labelled:
        for node in graph.nodes:
            labelled(node.label)
            if node.op is CONSTANT:
                found[node] = _exact(node)
            elif node not in found:
                found[node] = _bounded(node, found)
        ends = [found[node] for node in graph.outputs.values()]
        low = [where(-math.inf < each.low, each.low, -math.inf) for each in ends]  # NaN is not known
        high = [where(each.high < math.inf, each.high, math.inf) for each in ends]
    names = [f"{name}.{end}" for end in ("low", "high") for name in graph.outputs]
    return Graph([*single, *lows, *highs], dict(zip(names, [*low, *high], strict=True)))


def _exact(node: Node, known: Interval = REAL_LINE) -> Bounded:
    """Bounds of what has one value."""
    return Bounded(node, node, known if node.value is None else (node.value, node.value))


def _bounded(node: Node, found: Mapping[Node, Bounded]) -> Bounded:
    """Bounds of an operation."""
    rule, nodes = rule_of(node)
    args = [found[each] for each in nodes]
    known = rule(*[each.known for each in args])
    if all(each.low is each.high for each in args):
        return _exact(apply(node.op, *[found[each].low for each in node.args]), known)
    if known[0] == known[1]:
        return _exact(as_node(known[0]))
    low, high = rule.ends(*args) if isinstance(rule, Rule) else known
    return Bounded(as_node(low), as_node(high), known)
