"""Forward mode: tangents pushed from the inputs to the outputs, and the graph transform `jvp`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..core.graph import Graph, require_graph
from ..core.label import TANGENT
from ..core.naming import free_suffix
from ..core.node import Node, as_node, variable
from ..core.scope import building
from ..core.traversal import topological
from ..simplify.builder import Builder
from ..util.explain_failure import explain_failure
from .reached_nodes import ReachedNodes


@explain_failure
def tangents(
    seeds: Mapping[Node, Node],
    outputs: Iterable[Node],
    build: Builder | None = None,
    *,
    zero_wins: bool = False,
) -> dict[Node, Node]:
    """Tangents of nodes by forward mode: y_dot = sum over seeds x of (dy/dx) x_dot.

    Parameters
    ----------
    seeds : mapping of Node to Node
        {x: x_dot}; leaves or inner nodes, which count as independent.
    outputs : iterable of Node
        Where to end.
    build : Builder, optional
        What the nodes are built by; by default a new one.
    zero_wins : bool
        Whether a seed that is zero counts for nothing where a slope is infinite or NaN. Default False: NaN.

    Returns
    -------
    dict of Node to Node
        {y: y_dot} for every node that `outputs` reach; absent where y_dot is zero.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import tangents
    >>> x, x_dot = cg.variables("x x_dot")
    >>> y = cg.exp(x)
    >>> tangents({x: x_dot}, [y])[y].args  # y_dot = y * x_dot
    (<node exp>, <node variable x_dot>)
    """
    dots = dict(seeds)
    reached = ReachedNodes(seeds if zero_wins else dict.fromkeys(seeds))
    with building(build or Builder()) as labelled:
        for node in topological(outputs):
            if node in dots or not any([arg in dots for arg in node.args]):
                continue
            labelled(node.label.derived(TANGENT))
            total: Node | None = None
            for arg, partial in zip(node.args, map(as_node, node.op.partials(node, *node.args)), strict=True):
                if arg in dots:
                    term = reached.product(node.op, arg, partial, dots[arg])
                    total = term if total is None else total + term
                    if term.value != 0.0:
                        reached.pass_on(node.op, arg, node, partial)
            assert total is not None
            if total.value != 0.0:
                dots[node] = total
    return dots


def jvp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes (x, x_dot) -> y_dot with y_dot = J(x) x_dot: one forward sweep.

    An entry of x_dot that is zero counts for nothing, also where y has no slope in it.

    Parameters
    ----------
    graph : Graph
        x -> y.
    wrt : str, Node or sequence of these, optional
        The inputs x to differentiate by; by default all.

    Returns
    -------
    Graph
        Its inputs are those of `graph`, then a tangent `x_dot` for each of `wrt`; its outputs are `y_dot`. Where such a
        name is taken, as in `jvp(jvp(graph))`, the suffix is `_dot2`, `_dot3`, ...

    Raises
    ------
    GraphError
        If the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> graph = cg.jvp(cg.Graph([x, y], {"f": x * y}))
    >>> graph.evaluate({"x": 2.0, "y": 3.0, "x_dot": 1.0, "y_dot": 0.0})
    {'f_dot': 3.0}
    """
    require_graph("jvp", graph)
    return forward_products(graph, graph.select_inputs(wrt), zero_wins=True)


def forward_products(graph: Graph, chosen: Sequence[Node], *, zero_wins: bool) -> Graph:
    """`jvp` by these inputs; zero_wins: as for `tangents`."""
    suffix = free_suffix("_dot", graph.input_names, [str(node.name) for node in chosen])
    seeds = {node: variable(f"{node.name}{suffix}") for node in chosen}
    dots = tangents(seeds, graph.outputs.values(), zero_wins=zero_wins and len(seeds) > 1)
    zero = as_node(0.0)
    outputs = {f"{name}{suffix}": dots.get(node, zero) for name, node in graph.outputs.items()}
    return Graph((*graph.inputs, *seeds.values()), outputs)
