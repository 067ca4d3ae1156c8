"""Topological order: the nodes that some outputs reach, arguments before their use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter

from .checks import GraphError
from .node import Node


def topological(outputs: Iterable[Node]) -> list[Node]:
    """The nodes that `outputs` reach, arguments first, each once, in an order that depends on structure alone.

    Raises GraphError if the nodes form a cycle, which the public interface cannot make.

    >>> import cgraph as cg
    >>> from cgraph.extend import topological
    >>> x = cg.variable("x")
    >>> topological([cg.sin(x) + 1.0])
    [<node variable x>, <node sin>, <node 1.0>, <node add>]
    """
    order: list[Node] = []
    closed: set[Node] = set()  # what is in `order`
    for output in outputs:
        if output in closed:
            continue
        node, rest = output, iter(output.args)
        stack = []
        while True:
            for arg in rest:
                if arg in closed:
                    continue
                if arg.args:
                    stack.append((node, rest))
                    if arg.block >= node.block and (arg.block > node.block or arg.place >= node.place):
                        raise GraphError(f"the graph has a cycle through {arg!r}")
                    node, rest = arg, iter(arg.args)
                    break
                closed.add(arg)
                order.append(arg)
            else:
                closed.add(node)
                order.append(node)
                if not stack:
                    break
                node, rest = stack.pop()
    return order


def descendants(nodes: Sequence[Node], sources: Iterable[Node]) -> set[Node]:
    """The nodes, among `nodes` in topological order, that depend on `sources`; the sources included."""
    reached = set(sources)
    for node in nodes:
        if node not in reached and any([arg in reached for arg in node.args]):
            reached.add(node)
    return reached


def as_made(nodes: Iterable[Node]) -> list[Node]:
    """Nodes in the order in which they were made, so arguments first: what was derived together stays together."""
    return sorted(nodes, key=attrgetter("serial"))


def rebuild(
    outputs: Iterable[Node], replace: dict[Node, Node], make: Callable[[Node, tuple[Node, ...]], Node]
) -> dict[Node, Node]:
    """{node: copy} of all that `outputs` reach: `replace[node]` if there is one, else `make(node, new_arguments)`."""
    new = dict(replace)
    for node in as_made(topological(outputs)):
        if node not in new:
            new[node] = make(node, tuple([new[arg] for arg in node.args])) if node.args else node
    return new
