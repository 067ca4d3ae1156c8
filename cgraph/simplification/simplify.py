"""Simplification: folding, common subexpressions and algebra; and `specialize`, which binds inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.builder import Builder, folded
from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.node import Node, Scalar, constant
from ..util.require import require_graph, require_mapping, require_sequence


def simplify(graph: Graph) -> Graph:
    """The function in fewer nodes: constants folded and collected, equal nodes merged, `1 * x` and the like gone.

    Assumes finite operands and non-zero divisors: `0 * x = 0`, `x - x = 0`, `x / x = 1`, `x + 0 = x` also for -0.0.
    Sums and products may be taken in another order, so values can differ by rounding.

    Parameters
    ----------
    graph : Graph
        Any graph.

    Returns
    -------
    Graph
        With the same inputs and outputs and at most as many nodes; for as many nodes, no more edges.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> cg.simplify(cg.Graph([x], {"y": 1.0 * x + (x - 0.0) * cg.exp(0.0)}))
    <Graph (x) -> (y): 3 nodes, 2 edges>
    """
    require_graph("simplify", graph)
    nodes = folded(graph.outputs.values(), Builder())
    candidate = Graph(graph.inputs, dict(zip(graph.outputs, nodes, strict=True)))
    return candidate if _size(candidate) < _size(graph) else graph


def _size(graph: Graph) -> tuple[int, int]:
    return len(graph.nodes), sum([len(node.args) for node in graph.nodes])


def specialize(graph: Graph, values: Mapping[str, Scalar], outputs: Sequence[str] | None = None) -> Graph:
    """The graph with inputs bound to numbers, simplified.

    Parameters
    ----------
    graph : Graph
        Any graph.
    values : mapping of str to float or Node
        {input: number, or a node over the other inputs}.
    outputs : sequence of str, optional
        The outputs to keep; by default all.

    Returns
    -------
    Graph
        Without the bound inputs.

    Raises
    ------
    GraphError
        If the graph has no such input or output.
    ValueError
        If a number is NaN.

    Examples
    --------
    >>> import cgraph as cg
    >>> m, v = cg.variables("m v")
    >>> energy = cg.Graph([m, v], {"T": 0.5 * m * v * v})
    >>> cg.specialize(energy, {"m": 2.0}).evaluate({"v": 3.0})
    {'T': 9.0}
    """
    require_graph("specialize", graph)
    replace = {}
    require_sequence("values", require_mapping("values", values, "input: number or node"), "inputs", (str, Node))
    for name, value in values.items():
        (node,) = graph.select_inputs(name)
        try:
            replace[node] = value if isinstance(value, Node) else constant(value)
        except (TypeError, ValueError) as error:
            raise type(error)(f"input {name!r}: {error}") from None
    if outputs is not None:
        outputs = require_sequence("outputs", outputs, "names")
        if unknown := [str(name) for name in outputs if not isinstance(name, str) or name not in graph.outputs]:
            raise GraphError(f"the graph has no output {', '.join(unknown)} (it has {', '.join(graph.outputs)})")
        graph = Graph(graph.inputs, {name: graph.outputs[name] for name in outputs})
    inputs = [node for node in graph.inputs if node not in replace]
    return simplify(Graph(inputs, graph(*[replace.get(node, node) for node in graph.inputs])))
