"""A graph as one of networkx and back, and queries by it: the one place that knows it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ..core.checks import GraphError, check_name
from ..core.graph import Edge, Graph
from ..core.label import SourceLine
from ..core.node import CONSTANT, VARIABLE, Node
from ..operations.records import Record, restored
from ..operations.table import OPS
from ..util.require import require_graph

if TYPE_CHECKING:
    import networkx

LABELS = ("tags", "roles", "lines")
_name = partial(check_name, "a node")


def to_networkx(graph: Graph) -> networkx.MultiDiGraph:
    """The graph as one of networkx, from arguments to uses.

    Nodes have the attribute op; name, number and input (its place) if any; tags, roles, lines and outputs as JSON.
    Edges have a slot. So all attributes are texts and numbers, as files of GraphML, GEXF, GML and JSON have them.

    Parameters
    ----------
    graph : Graph
        The graph.

    Returns
    -------
    networkx.MultiDiGraph
        Its nodes, numbered as in `graph.nodes`, and behind them the inputs that nothing uses.

    Raises
    ------
    TypeError
        For what is no graph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> print(cg.to_networkx(cg.Graph([x], {"y": x * cg.sin(x)})))
    MultiDiGraph with 3 nodes and 3 edges
    """
    import networkx

    require_graph("to_networkx", graph)
    nodes, inputs = graph.nodes, graph.inputs
    result = networkx.MultiDiGraph()
    number = {node: k for k, node in enumerate(dict.fromkeys((*nodes, *inputs)))}
    places = {node: place for place, node in enumerate(inputs)}
    named: dict[Node, dict[str, int]] = {}
    for place, (name, node) in enumerate(graph.outputs.items()):
        named.setdefault(node, {})[name] = place
    for node, k in number.items():
        there = {"name": node.name, "number": node.value, "input": places.get(node)}
        result.add_node(
            k,
            op=node.op.name,
            **{name: value for name, value in there.items() if value is not None},
            **{name: _text(sorted(getattr(node, name))) for name in LABELS},
            outputs=_text(named.get(node, {})),
        )
    for node in nodes:
        for slot, arg in enumerate(node.args):
            result.add_edge(number[arg], number[node], key=slot, slot=slot)
    return result


def from_networkx(network: networkx.DiGraph) -> Graph:
    """The graph of what `to_networkx` gave, also through a file.

    Parameters
    ----------
    network : networkx.DiGraph
        Nodes and edges with the attributes that `to_networkx` gives them.

    Returns
    -------
    Graph
        The graph.

    Raises
    ------
    GraphError
        If an attribute is missing or cannot be read, an operation is not in the table, or there is a cycle.
    TypeError
        For what is no networkx.DiGraph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> cg.from_networkx(cg.to_networkx(cg.Graph([x], {"y": x * cg.sin(x)})))
    <Graph (x) -> (y): 3 nodes, 3 edges>
    """
    import networkx

    if not isinstance(network, networkx.DiGraph):
        raise TypeError(f"from_networkx takes a networkx.DiGraph, got {type(network).__name__}: {network!r:.60}")
    try:
        order = list(networkx.topological_sort(network))
    except networkx.NetworkXUnfeasible:
        raise GraphError("from_networkx: the arguments of a node lead back to it") from None
    number = {key: k for k, key in enumerate(order)}
    kept: list[Record] = []
    inputs: dict[int, str] = {}
    outputs: dict[int, tuple[str, int]] = {}
    for key in order:
        read = partial(_read, key, network.nodes[key])
        op, name = read("op", str), read("name", _name, None)
        cytoscape = "id" in network.nodes[key]  # whose JSON names all nodes, and has a value of its own
        name = None if cytoscape and name == network.nodes[key]["id"] else name
        if op not in (CONSTANT.name, VARIABLE.name, *OPS):
            raise GraphError(f"operation {op!r} of node {key!r} is not in the table: register its row first")
        before = "value" in network.nodes[key] and not cytoscape  # as files of version 0.1 have it
        value = read("value" if before else "number", float) if op == CONSTANT.name else None
        if op == VARIABLE.name:
            inputs[read("input", int)] = read("name", _name)
        slots = {_read(key, data, "slot", int): number[source] for source, _, data in network.in_edges(key, data=True)}
        arity = OPS[op].arity if op in OPS else 0
        if sorted(slots) != list(range(arity)) or network.in_degree(key) != arity:
            raise GraphError(f"node {key!r}, {op}, takes {arity} arguments in slots from 0, got {sorted(slots)}")
        sets = [read(label, json.loads, ()) for label in LABELS]  # in which a source line is a list
        labels = tuple([tuple([SourceLine(*x) if isinstance(x, list) else x for x in each]) for each in sets])
        kept.append((op, tuple([slots[slot] for slot in range(arity)]), value, name, labels))
        outputs |= {place: (output, number[key]) for output, place in read("outputs", json.loads, {}).items()}
    given = tuple([inputs[place] for place in sorted(inputs)])
    return restored(given, tuple(kept), dict([outputs[place] for place in sorted(outputs)]))


def _read(key: object, data: Mapping[str, Any], name: str, kind: Callable[[Any], Any], default: object = ...) -> Any:
    """An attribute of a node or of an edge to it."""
    if data.get(name, []) == []:  # what networkx makes of "[]" in GML
        if default is ...:
            raise GraphError(f"node {key!r} has no attribute {name!r}, which to_networkx gives it or its edges")
        return default
    try:
        return kind(data[name])
    except (TypeError, ValueError) as error:
        raise GraphError(f"attribute {name!r} of node {key!r}, {data[name]!r:.60}, cannot be read: {error}") from None


def _text(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def minimum_cut(edges: Sequence[Edge], sources: Collection[Node], sinks: Collection[Node]) -> list[Edge]:
    """The fewest edges without which no path leads from `sources` to `sinks`, in the order of `edges`.

    Of several such sets it is the one nearest to the sinks. edges: those on such paths; no node is source and sink.
    """
    import networkx

    network = networkx.DiGraph()
    start, end = object(), object()
    network.add_edges_from([(start, node) for node in sources])  # without a capacity: these are not to be cut
    network.add_edges_from([(node, end) for node in sinks])
    for (source, target), uses in Counter([(edge.source, edge.target) for edge in edges]).items():
        network.add_edge(source, target, capacity=uses)
    residual = networkx.algorithms.flow.shortest_augmenting_path(network, start, end)
    behind: set[object] = {end}  # what could send more flow to the sinks lies behind the cut nearest to them
    stack = [end]
    while stack:
        node = stack.pop()
        for before in residual.pred[node]:
            link = residual[before][node]
            if before not in behind and link["flow"] < link["capacity"]:
                behind.add(before)
                stack.append(before)
    return [edge for edge in edges if edge.source not in behind and edge.target in behind]
