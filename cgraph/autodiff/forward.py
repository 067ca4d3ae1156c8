"""Forward mode: tangents pushed from the inputs to the outputs, and the graph transform `jvp`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..core.graph import Graph
from ..core.label import TANGENT, building
from ..core.node import Node, as_node, variable
from ..core.ops import zero_safe_mul
from ..core.traversal import topological
from ..simplify.builder import Builder


def tangents(seeds: Mapping[Node, Node], outputs: Iterable[Node], build: Builder | None = None) -> dict[Node, Node]:
    """Tangents of nodes, sum over seeds x of (d node / d x) x_dot, for every node under `outputs` that has one.

    seeds: {x: x_dot}, leaves or inner nodes; what does not depend on them is absent from the result (zero).
    """
    dots = dict(seeds)
    with building(build or Builder()) as labelled:
        for node in topological(outputs):
            if node in dots or not any([arg in dots for arg in node.args]):
                continue
            labelled(node.label.derived(TANGENT))
            total: Node | None = None
            for arg, partial in zip(node.args, node.op.partials(node, *node.args), strict=True):
                if arg in dots:
                    term = (zero_safe_mul if node.op.selects else _mul)(partial, dots[arg])
                    total = term if total is None else total + term
            assert total is not None
            if total.value != 0.0:
                dots[node] = total
    return dots


def _mul(a: Node | float, b: Node) -> Node:
    return as_node(a) * b


def jvp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes (x, x_dot) -> y_dot with y_dot = J(x) x_dot: one forward sweep.

    The inputs of the result are those of `graph`, then one tangent `x_dot` for each input in `wrt` (default: all);
    its outputs are `y_dot`. Where such a name is taken, as in `jvp(jvp(graph))`, the suffix is `_dot2`, `_dot3`, ...
    Raises GraphError when `wrt` names no input.
    """
    chosen = graph.select_inputs(wrt)
    suffix = free_suffix("_dot", graph.input_names, [str(node.name) for node in chosen])
    seeds = {node: variable(f"{node.name}{suffix}") for node in chosen}
    dots = tangents(seeds, graph.outputs.values())
    zero = as_node(0.0)
    outputs = {f"{name}{suffix}": dots.get(node, zero) for name, node in graph.outputs.items()}
    return Graph((*graph.inputs, *seeds.values()), outputs)


def free_suffix(suffix: str, taken: Sequence[str], names: Sequence[str]) -> str:
    """`suffix`, numbered if need be, so that no name + suffix is taken."""
    candidate, number = suffix, 1
    while any(name + candidate in taken for name in names):
        number += 1
        candidate = f"{suffix}{number}"
    return candidate
