"""Records: a graph as flat rows of plain data, which pickle reads and writes without recursion."""

import copyreg
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.label import label
from ..core.node import CONSTANT, VARIABLE, Node, as_node, variable
from ..core.traversal import as_made
from ..util.doors import moved_methods
from .operation import OPS

Record = tuple[str, tuple[int, ...], Any, Any, tuple[Any, ...]]  # operation, arguments, value, name, label


def reduced(graph: Graph) -> tuple[Callable[..., Graph], tuple[object, ...]]:
    """How a graph pickles: the function that makes it again, and its arguments."""
    nodes = as_made(graph.nodes)  # made again in this order
    number = {node: i for i, node in enumerate(nodes)}
    outputs = {name: number[node] for name, node in graph.outputs.items()}
    return restored, (graph.input_names, tuple(records(nodes)), outputs)


def records(nodes: Sequence[Node]) -> Iterator[Record]:
    """One flat record a node, so that pickling a deep graph needs no recursion."""
    number = {node: i for i, node in enumerate(nodes)}
    for node in nodes:
        sets = tuple([tuple(sorted(members)) for members in (node.tags, node.roles, node.lines)])
        yield node.op.name, tuple([number[arg] for arg in node.args]), node.value, node.name, sets


def restored(inputs: tuple[str, ...], records: tuple[Record, ...], outputs: dict[str, int]) -> Graph:
    """The graph of records; its operations have to be in the table."""
    from_record: list[Node] = []
    for op, args, value, name, sets in records:
        if op == CONSTANT.name:
            node = as_node(value)
        elif op == VARIABLE.name:
            node = variable(name)
        else:
            if op not in OPS:
                raise GraphError(f"operation {op!r} is not in the table: register its row before its graph is read")
            kept = label(*map(frozenset, sets))
            node = Node(OPS[op], tuple([from_record[i] for i in args]), kept, name=name)
        from_record.append(node)
    return Graph([variable(name) for name in inputs], {name: from_record[i] for name, i in outputs.items()})


copyreg.pickle(Graph, reduced)
moved_methods(Graph, "cgraph", ("from_networkx", "latex", "to_networkx"), alone=("from_networkx",))
