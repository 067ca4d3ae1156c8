"""Records: a graph as flat rows of plain data, which pickle reads and writes without recursion; and HoldsNodes,
what pickles with the nodes that it holds, which are parts of one graph on their way.
"""

import copyreg
import pickle
from collections.abc import Callable
from copy import deepcopy
from functools import cached_property
from io import BytesIO
from typing import Any, Self, TypeVar

from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.label import label
from ..core.node import CONSTANT, VARIABLE, Node, as_node, variable
from ..core.traversal import as_made, topological
from ..util.doors import moved_methods
from .operation import OPS

Record = tuple[str, tuple[int, ...], Any, Any, tuple[Any, ...]]  # operation, arguments, value, name, label
Held = TypeVar("Held")


def reduced(graph: Graph) -> tuple[Callable[..., Graph], tuple[object, ...]]:
    """How a graph pickles: the function that makes it again, and its arguments."""
    nodes = as_made(graph.nodes)  # made again in this order
    number = {node: i for i, node in enumerate(nodes)}
    records: list[Record] = []
    for node in nodes:
        sets = tuple([tuple(sorted(members)) for members in (node.tags, node.roles, node.lines)])
        records.append((node.op.name, tuple([number[arg] for arg in node.args]), node.value, node.name, sets))
    return restored, (graph.input_names, tuple(records), {name: number[node] for name, node in graph.outputs.items()})


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


class HoldsNodes:
    """An object whose attributes hold nodes: it pickles with them, without what was derived, and sharing is kept.

    Raises pickle.PicklingError for a function that another process cannot find, such as a lambda.
    """

    def __getstate__(self) -> dict[str, Any]:
        kind = type(self)
        derived = [name for name in vars(self) if isinstance(getattr(kind, name, None), cached_property)]
        return {name: value for name, value in vars(self).items() if name not in (*derived, "_results")}

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        written = BytesIO()
        pickler = _Pickler(written)
        try:
            pickler.dump(self.__getstate__())
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            if _TOLD in str(error):  # of what it holds
                raise
            name = type(self).__name__
            article = "an" if name[0] in "AEIOU" else "a"
            raise pickle.PicklingError(
                f"{article} {name}{_TOLD}: {error}; give it functions that are written in a module by def, "
                "which another process finds, in place of a lambda or one inside another"
            ) from None
        return _restored, (type(self), written.getvalue(), pickler.graph())

    def __copy__(self) -> Self:
        return _of(type(self), self.__getstate__())

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return _of(type(self), deepcopy(self.__getstate__(), memo))


_TOLD = " does not pickle"


class _Pickler(pickle.Pickler):
    """Writes the number of a node in its place."""

    def __init__(self, file: BytesIO) -> None:
        super().__init__(file)
        self.numbers: dict[Node, int] = {}

    def persistent_id(self, given: object) -> int | None:
        return self.numbers.setdefault(given, len(self.numbers)) if isinstance(given, Node) else None

    def graph(self) -> Graph | None:
        """The nodes that it has met, as outputs that their numbers name."""
        variables = [node for node in topological(list(self.numbers)) if node.op is VARIABLE]
        return Graph(variables, {f"{k}": node for node, k in self.numbers.items()}) if self.numbers else None


class _Unpickler(pickle.Unpickler):
    """Reads the nodes of a graph where there are numbers."""

    def __init__(self, file: BytesIO, graph: Graph | None) -> None:
        super().__init__(file)
        self._nodes = {} if graph is None else graph.outputs

    def persistent_load(self, number: int) -> Node:
        return self._nodes[f"{number}"]


def _restored(kind: type[Held], written: bytes, graph: Graph | None) -> Held:
    """The object in another process."""
    return _of(kind, _Unpickler(BytesIO(written), graph).load())


def _of(kind: type[Held], state: dict[str, Any]) -> Held:
    result = object.__new__(kind)
    vars(result).update(state)
    return result


copyreg.pickle(Graph, reduced)
moved_methods(Graph, "cgraph", ("from_networkx", "latex", "to_networkx"), alone=("from_networkx",))
