"""Reverse mode: cotangents pulled from the outputs to the inputs, and the transforms `vjp` and `gradient`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ..core.graph import Graph, require_graph
from ..core.label import ADJOINT, UNLABELLED, Label
from ..core.naming import free_suffix
from ..core.node import Node, as_node, variable
from ..core.scope import building
from ..core.traversal import topological
from ..simplify.builder import Builder
from ..util.explain_failure import explain_failure
from .reached_nodes import ReachedNodes


@explain_failure
def cotangents(
    seeds: Mapping[Node, Node],
    wrt: Sequence[Node],
    build: Builder | None = None,
    *,
    fixed: Collection[Node] = (),
    through: Mapping[Node, Node] | None = None,
    zero_wins: bool = False,
) -> list[Node]:
    """Cotangents of nodes by reverse mode: x_bar = sum over seeds y of y_bar dy/dx.

    Parameters
    ----------
    seeds : mapping of Node to Node
        {y: y_bar}.
    wrt : sequence of Node
        The nodes x, leaves or inner nodes; one may depend on another. An inner node's cotangent counts every use of it,
        and goes on to its arguments.
    build : Builder, optional
        What the nodes are built by; by default a new one.
    fixed : collection of Node
        Inner nodes that count as independent: nothing goes on to their arguments.
    through : mapping of Node to Node, optional
        {inner node: factor} of its cotangent before that goes on to its arguments, which marks all that comes of it.
    zero_wins : bool
        Whether a seed that is zero counts for nothing where a slope is infinite or NaN. Default False: NaN.

    Returns
    -------
    list of Node
        x_bar for each of `wrt`; the constant 0 where no seed depends on it.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import cotangents
    >>> x, y = cg.variables("x y")
    >>> cotangents({x * y: cg.constant(1.0)}, [x, y])
    [<node variable y>, <node variable x>]
    """
    order = topological(seeds)
    active = set(wrt)
    for node in order:
        if any([arg in active for arg in node.args]):
            active.add(node)
    bars = dict(seeds)
    reached = ReachedNodes(seeds if zero_wins else dict.fromkeys(seeds))
    # A cotangent that is a constant carries no tags: what is made of it at an argument takes them from the use itself.
    bare: dict[Node, Label] = {}
    with building(build or Builder()) as labelled:
        for node in reversed(order):
            bar = bars.get(node)
            if bar is None or node not in active or not node.args or node in fixed:
                continue
            labelled(_label(node, bare))
            if through and node in through:
                bar = bar * through[node]
            terms: dict[Node, Node] = {}  # by argument first, so that x * x gives 2 * (bar * x)
            for arg, partial in zip(node.args, map(as_node, node.op.partials(node, *node.args)), strict=True):
                if arg in active:
                    term = reached.product(node.op, node, bar, partial)
                    terms[arg] = terms[arg] + term if arg in terms else term
                    if term.value != 0.0:
                        reached.pass_on(node.op, node, arg, partial)
            for arg, term in terms.items():
                if term.value == 0.0:
                    continue
                if term.value is not None:
                    bare[arg] = bare.get(arg, UNLABELLED).with_tags_of(node.label)
                if arg in bars:  # the sum over all uses of arg is about arg, not about this use
                    labelled(_label(arg, bare))
                    bars[arg] = bars[arg] + term
                else:
                    bars[arg] = term
    zero = as_node(0.0)
    return [bars.get(node, zero) for node in wrt]


def _label(node: Node, bare: Mapping[Node, Label]) -> Label:
    label = node.label.derived(ADJOINT)
    return label.with_tags_of(bare[node]) if node in bare else label


def vjp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes (x, y_bar) -> x_bar with x_bar = J(x)^T y_bar: one reverse sweep.

    An entry of y_bar that is zero counts for nothing, also where that output has no slope.

    Parameters
    ----------
    graph : Graph
        x -> y.
    wrt : str, Node or sequence of these, optional
        The inputs x to differentiate by; by default all.

    Returns
    -------
    Graph
        Its inputs are those of `graph`, then a cotangent `y_bar` for each output; its outputs are `x_bar` for each of
        `wrt`. Where such a name is taken the suffix is `_bar2`, `_bar3`, ...

    Raises
    ------
    GraphError
        If the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> graph = cg.vjp(cg.Graph([x, y], {"f": x * y}))
    >>> graph.evaluate({"x": 2.0, "y": 3.0, "f_bar": 1.0})
    {'x_bar': 3.0, 'y_bar': 2.0}
    """
    require_graph("vjp", graph)
    return reverse_products(graph, graph.select_inputs(wrt), zero_wins=True)


def reverse_products(graph: Graph, chosen: Sequence[Node], *, zero_wins: bool) -> Graph:
    """`vjp` by these inputs; zero_wins: as for `cotangents`."""
    suffix = free_suffix("_bar", graph.input_names, list(graph.outputs))
    bars = {name: variable(f"{name}{suffix}") for name in graph.outputs}
    seeds: dict[Node, Node] = {}
    for name, node in graph.outputs.items():  # two names may share a node
        seeds[node] = seeds[node] + bars[name] if node in seeds else bars[name]
    results = cotangents(seeds, chosen, zero_wins=zero_wins and len(seeds) > 1)
    outputs = {f"{node.name}{suffix}": bar for node, bar in zip(chosen, results, strict=True)}
    return Graph((*graph.inputs, *bars.values()), outputs)


def gradient(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y, one output, becomes x -> (dy/dx_i): one reverse sweep.

    Parameters
    ----------
    graph : Graph
        A function with one output y.
    wrt : str, Node or sequence of these, optional
        The inputs to differentiate by; by default all.

    Returns
    -------
    Graph
        With the inputs of `graph` and outputs named `dy/dx_i`.

    Raises
    ------
    GraphError
        If there are several outputs (then see `jacobian`), or the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.gradient(cg.Graph([x, y], {"f": x * y})).evaluate({"x": 2.0, "y": 3.0})
    {'df/dx': 3.0, 'df/dy': 2.0}
    """
    require_graph("gradient", graph)
    output = graph.only_output()
    (name,) = graph.outputs
    chosen = graph.select_inputs(wrt)
    results = cotangents({output: as_node(1.0)}, chosen)
    return Graph(graph.inputs, {f"d{name}/d{node.name}": bar for node, bar in zip(chosen, results, strict=True)})
