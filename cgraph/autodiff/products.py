"""Products: graphs of J x_dot and J^T y_bar of a graph, one sweep each, and of the Hessian times x_dot, two.

A product comes in two, too: what the point alone decides, and what has to be done again for every direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ..core.builder import Builder
from ..core.forward import tangents
from ..core.graph import Graph
from ..core.node import Node, as_node, variable
from ..core.reverse import cotangents
from ..core.traversal import descendants, rebuild
from ..operations.operation import OPS
from ..util.require import require_graph
from ..writing.naming import free_suffix


def jvp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes (x, x_dot) -> y_dot with y_dot = J(x) x_dot: one forward sweep.

    An entry of x_dot that is zero counts for nothing, also where y has no slope in it, if values are finite.

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


def forward_products(graph: Graph, chosen: Sequence[Node], *, zero_wins: bool, build: Builder | None = None) -> Graph:
    """`jvp` by these inputs; zero_wins, build: as for `tangents`."""
    suffix = free_suffix("_dot", graph.input_names, [str(node.name) for node in chosen])
    seeds = {node: variable(f"{node.name}{suffix}") for node in chosen}
    dots = tangents(seeds, graph.outputs.values(), build, zero_wins=zero_wins and len(seeds) > 1)
    zero = as_node(0.0)
    outputs = {f"{name}{suffix}": dots.get(node, zero) for name, node in graph.outputs.items()}
    return Graph((*graph.inputs, *seeds.values()), outputs)


def vjp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y becomes (x, y_bar) -> x_bar with x_bar = J(x)^T y_bar: one reverse sweep.

    An entry of y_bar that is zero counts for nothing, also where that output has no slope, if values are finite.

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
    return _gradient(graph, graph.select_inputs(wrt), Builder())


def _gradient(graph: Graph, chosen: Sequence[Node], build: Builder) -> Graph:
    output = graph.only_output()
    (name,) = graph.outputs
    results = cotangents({output: as_node(1.0)}, chosen, build)
    return Graph(graph.inputs, {f"d{name}/d{node.name}": bar for node, bar in zip(chosen, results, strict=True)})


def hvp(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> Graph:
    """x -> y, one output, becomes (x, x_dot) -> H(x) x_dot with the Hessian H: forward mode over reverse mode.

    A gradient and its `jvp`, a few times the operations of `graph` whatever the number of inputs; the matrix is never
    formed. An entry of x_dot that is zero counts for nothing, as in `jvp`.

    Parameters
    ----------
    graph : Graph
        A function with one output y.
    wrt : str, Node or sequence of these, optional
        The inputs x to differentiate by; by default all.

    Returns
    -------
    Graph
        Its inputs are those of `graph`, then a tangent `x_dot` for each of `wrt`; its outputs, the rates of the entries
        of the gradient along x_dot, are `dy/dx_i_dot`. Where such a name is taken the suffix is `_dot2`, `_dot3`, ...

    Raises
    ------
    GraphError
        If there are several outputs, or the graph has no such input.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> graph = cg.hvp(cg.Graph([x, y], {"f": x * x * y}))
    >>> graph.evaluate({"x": 2.0, "y": 3.0, "x_dot": 1.0, "y_dot": 10.0})
    {'df/dx_dot': 46.0, 'df/dy_dot': 4.0}
    """
    require_graph("hvp", graph)
    chosen, build = graph.select_inputs(wrt), Builder()
    return forward_products(_gradient(graph, chosen, build), chosen, zero_wins=True, build=build)


class DirectionSplit(NamedTuple):
    """A derivative x, s -> y, linear in the direction s, as y = linear(primal(x), s).

    primal: x -> p, values that the other part reads.  linear: p, s -> y.
    """

    primal: Graph
    linear: Graph

    @property
    def directions(self) -> int:
        """The number of entries of a direction."""
        return len(self.linear.inputs) - len(self.primal.outputs)


def direction_split(derivative: Graph, directions: int, *, divide: bool = True) -> DirectionSplit:
    """The two parts of a derivative whose last `directions` inputs are the direction, as of `jvp` and `vjp`.

    divide: whether the linear part may divide, and hold infinite constants. If not, it reads reciprocals and such
    constants from the primal part: then what it reads is infinite or NaN wherever a slope is.
    """
    count = len(derivative.inputs) - directions
    points, seeds = derivative.inputs[:count], derivative.inputs[count:]
    directional = descendants(derivative.nodes, seeds)
    reciprocals: dict[Node, Node] = {}  # of divisors
    factors: dict[Node, Node] = {}  # of a quotient: the reciprocal of its divisor
    wanted: list[Node] = []  # what the linear part reads of the primal one
    for node in derivative.nodes:
        if not node.args or node not in directional:
            continue
        args = node.args
        if not divide and node.op is OPS["div"]:
            factors[node] = reciprocals.setdefault(args[1], Node(node.op, (as_node(1.0), args[1])))
            args = (args[0], factors[node])
        fixed = {arg for arg in args if arg.value is not None and (divide or math.isfinite(arg.value))}
        wanted += [arg for arg in args if arg not in directional and arg not in fixed]
    wanted += [node for node in derivative.outputs.values() if node not in directional and node.value is None]
    read = {node: variable(f"p{k}") for k, node in enumerate(dict.fromkeys(wanted))}
    stands = [*read.values()] or [variable("p0")]
    replace = read | {seed: variable(f"s{k}") for k, seed in enumerate(seeds)}

    def copied(node: Node, args: tuple[Node, ...]) -> Node:
        if node in factors:
            return Node(OPS["mul"], (read[factors[node]], args[0]), node.label)
        return Node(node.op, args, node.label)

    new = rebuild(derivative.outputs.values(), replace, copied)
    outputs = {name: new[node] for name, node in derivative.outputs.items()}
    linear = Graph([*stands, *[replace[seed] for seed in seeds]], outputs)
    return DirectionSplit(Graph(points, {str(each.name): node for node, each in read.items()} or {"p0": 0.0}), linear)
