"""The order in which machine code computes a graph's nodes, and the calls of functions that it makes as one."""

from collections import Counter
from collections.abc import Mapping, Set
from types import MappingProxyType
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node
from ..core.traversal import as_made
from ..operations.operation import columns
from .vector_math import POLYNOMIAL
from .vector_sums import Sums


class Joined(NamedTuple):
    """One call in place of several: each of the functions named, at each of the arguments."""

    names: tuple[str, ...]
    arguments: tuple[Node, ...]


class Merged(NamedTuple):
    """Several nodes of a graph that machine code does in one step.

    calls: {node: the call that gives it}.  products: {sum: its argument that it multiplies itself}.
    of_libm: nodes of a vector that each lane has from libm.  sums: {sum of products: those added up with it}.
    """

    calls: Mapping[Node, Joined]
    products: Mapping[Node, Node]
    of_libm: Set[Node] = frozenset()
    sums: Mapping[Node, Sums] = MappingProxyType({})


Scheduled = Node | Joined | Sums


def schedule(graph: Graph, merged: Merged) -> dict[Scheduled, tuple[Scheduled, ...]]:
    """Every operation once and what it reads, arguments first, in the order in which the nodes were made.

    Calls of library functions come as early as they can, since a call empties the registers; right behind a joined one
    come the nodes that it gives.
    """
    results: dict[Scheduled, list[Node]] = {}
    for node, call in merged.calls.items():
        results.setdefault(call, []).append(node)
    reads: dict[Scheduled, tuple[Scheduled, ...]] = {}
    stack: list[Scheduled] = list(graph.outputs.values())
    while stack:
        step = stack.pop()
        if step not in reads and not _leaf(step):
            reads[step] = needed(step, merged)
            stack += reads[step]
    early = [merged.calls.get(node, node) for node in graph.nodes if node.args and columns(node.op).calls_library]
    made = as_made([step for step in reads if isinstance(step, Node)])
    order: dict[Scheduled, tuple[Scheduled, ...]] = {}
    stack = [*reversed(made), *reversed(early)]
    while stack:
        step = stack[-1]
        missing = [each for each in reads[step] if each not in order and not _leaf(each)]
        if missing and step not in order:
            stack += reversed(missing)
            continue
        order.setdefault(stack.pop(), reads[step])
        order |= {node: (step,) for node in results.get(step, ()) if node not in order}
    return order


def _leaf(step: Scheduled) -> bool:
    return isinstance(step, Node) and not step.args


def needed(step: Scheduled, merged: Merged) -> tuple[Scheduled, ...]:
    """Arguments of a step, or the joined call that gives the node; of a product that it takes in, the factors.

    In their place, as in a * b + c and in c - a * b.
    """
    if isinstance(step, Joined):
        return step.arguments
    if isinstance(step, Sums):
        return tuple(dict.fromkeys([node for pair in step.factors for side in pair for node in side]))
    if step in merged.calls:
        return (merged.calls[step],)
    if step in merged.sums:
        return (merged.sums[step],)
    if (product := merged.products.get(step)) is not None:
        first, second = step.args
        return (*product.args, second) if first is product else (first, *product.args)
    return step.args


def products_of(graph: Graph) -> dict[Node, Node]:
    """{sum or difference: its argument, a product that nothing else needs}, the first where both are; rounded once."""
    users = Counter([arg for node in graph.nodes for arg in node.args] + list(graph.outputs.values()))
    return {
        node: product
        for node in graph.nodes
        if node.op.name in ("add", "sub")
        for product in [next((arg for arg in node.args if arg.op.name == "mul" and users[arg] == 1), None)]
        if product is not None
    }


def joined_calls(graph: Graph, together: int) -> dict[Node, Joined]:
    """{node: the call that gives it} for sines, cosines, exponentials and logarithms that do not need each other.

    together: at most so many arguments in one call. With 1, only sine and cosine of the same angle are joined. A node
    with nothing to join stays out.
    """
    level: dict[Node, int] = {}  # how many of these functions lie one behind another on the way to a node
    groups: dict[tuple[int, str], dict[Node, list[Node]]] = {}  # (level, kind) -> argument -> its calls
    for node in graph.nodes:
        level[node] = max([level[arg] for arg in node.args], default=0)
        if columns(node.op).vector:
            level[node] += 1
            groups.setdefault((level[node], columns(node.op).vector), {}).setdefault(node.args[0], []).append(node)
    calls: dict[Node, Joined] = {}
    for group in groups.values():
        arguments = tuple(group)
        for start in range(0, len(arguments), together):
            chosen = arguments[start : start + together]
            nodes = [node for argument in chosen for node in group[argument]]
            if len(nodes) > 1:
                names = {columns(node.op).library for node in nodes}
                call = Joined(tuple([name for name in POLYNOMIAL if name in names]), chosen)
                calls.update(dict.fromkeys(nodes, call))
    return calls
