"""Simplification: folding, common subexpressions and algebra; inputs bound to numbers; one division for a divisor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from ..core.builder import Builder, folded
from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.node import Node, Scalar, as_node, named_node
from ..core.traversal import rebuild
from ..operations.operation import OPS
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
        replace[node] = named_node(f"input {name!r}", value)
    if outputs is not None:
        outputs = require_sequence("outputs", outputs, "names")
        if unknown := [str(name) for name in outputs if not isinstance(name, str) or name not in graph.outputs]:
            raise GraphError(f"the graph has no output {', '.join(unknown)} (it has {', '.join(graph.outputs)})")
        graph = Graph(graph.inputs, {name: graph.outputs[name] for name in outputs})
    inputs = [node for node in graph.inputs if node not in replace]
    return simplify(Graph(inputs, graph(*[replace.get(node, node) for node in graph.inputs])))


def with_reciprocals(graph: Graph) -> Graph:
    """The function with products by 1 / d wherever several numbers are divided by the same d.

    A division takes a processor as long as ten to thirty products. A quotient is then rounded twice, within 1.5 units
    in the last place. It is the last thing to do to a graph: `simplify` and `specialize` make quotients of them again.

    >>> import cgraph as cg
    >>> from cgraph.extend import with_reciprocals
    >>> a, b, d = cg.variables("a b d")
    >>> graph = with_reciprocals(cg.Graph([a, b, d], {"x": a / d, "y": b / d}))
    >>> [node.op.name for node in graph.nodes if node.args], graph.evaluate({"a": 1.0, "b": 3.0, "d": 4.0})
    (['div', 'mul', 'mul'], {'x': 0.25, 'y': 0.75})
    """
    require_graph("with_reciprocals", graph)
    quotients = [node for node in graph.nodes if node.op is OPS["div"] and node.args[1].value is None]
    several = {divisor for divisor, count in Counter([node.args[1] for node in quotients]).items() if count > 1}
    inverses: dict[Node, Node] = {}  # of the new graph's divisors

    def copied(node: Node, args: tuple[Node, ...]) -> Node:
        if node.op is not OPS["div"] or node.args[1] not in several:
            return Node(node.op, args, node.label, name=node.name)
        inverse = inverses.setdefault(args[1], Node(node.op, (as_node(1.0), args[1]), node.label))
        return inverse if args[0].value == 1.0 else Node(OPS["mul"], (args[0], inverse), node.label, name=node.name)

    new = rebuild(graph.outputs.values(), {}, copied)
    return Graph(graph.inputs, {name: new[node] for name, node in graph.outputs.items()})
