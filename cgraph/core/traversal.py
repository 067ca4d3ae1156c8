"""Topological order: the nodes that some outputs reach, arguments before their use."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..errors import GraphError
from .node import Node


def topological(outputs: Iterable[Node]) -> list[Node]:
    """Every node that `outputs` reach, arguments first, in an order that depends on structure alone.

    Raises GraphError when the nodes form a cycle (impossible through the public interface).
    """
    order: list[Node] = []
    closed: dict[Node, bool] = {}  # False while the arguments of the node are being walked
    for output in outputs:
        stack = [] if output in closed else [output]
        while stack:
            node = stack[-1]
            for arg in node.args:
                if arg not in closed:
                    if arg.args:
                        closed[node] = False
                        stack.append(arg)
                        break
                    closed[arg] = True
                    order.append(arg)
                elif not closed[arg]:
                    raise GraphError(f"the graph has a cycle through {arg!r}")
            else:
                stack.pop()
                closed[node] = True
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
