"""Topological order: the nodes that some outputs reach, arguments before their use."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .errors import GraphError
from .node import Node


def topological(outputs: Iterable[Node]) -> list[Node]:
    """Every node that `outputs` reach, arguments first, in an order that depends on structure alone.

    Raises GraphError when the nodes form a cycle (impossible through the public interface).
    """
    order: list[Node] = []
    done: set[Node] = set()
    for output in outputs:
        if output in done:
            continue
        stack = [(output, iter(output.args))]
        open_nodes = {output}
        while stack:
            node, arguments = stack[-1]
            for arg in arguments:
                if arg in done:
                    continue
                if arg.args:
                    if arg in open_nodes:
                        raise GraphError(f"the graph has a cycle through {arg!r}")
                    stack.append((arg, iter(arg.args)))
                    open_nodes.add(arg)
                    break
                done.add(arg)
                order.append(arg)
            else:
                stack.pop()
                open_nodes.discard(node)
                done.add(node)
                order.append(node)
    return order


def rebuild(
    outputs: Iterable[Node], replace: dict[Node, Node], make: Callable[[Node, tuple[Node, ...]], Node]
) -> dict[Node, Node]:
    """Map every node under `outputs` to its copy: `replace` where given, else `make(node, new_arguments)`."""
    new = dict(replace)
    for node in topological(outputs):
        if node not in new:
            new[node] = make(node, tuple([new[arg] for arg in node.args])) if node.args else node
    return new
