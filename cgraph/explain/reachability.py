"""What a node reaches and what it is made from, as sets of nodes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from ..core.node import Node


def users(nodes: Sequence[Node], sources: Iterable[Node]) -> set[Node]:
    """The nodes, among `nodes` in topological order, that depend on `sources`; with the sources themselves."""
    found = set(sources)
    for node in nodes:
        if node not in found and any([arg in found for arg in node.args]):
            found.add(node)
    return found


def makers(sinks: Iterable[Node], without: Collection[Node] = ()) -> set[Node]:
    """The nodes that `sinks` are made from; with the sinks themselves, and not through those of `without`."""
    found: set[Node] = set()
    stack = [node for node in sinks if node not in without]
    while stack:
        node = stack.pop()
        if node not in found:
            found.add(node)
            stack.extend([arg for arg in node.args if arg not in without])
    return found


def made_of_more(sink: Node, number: int) -> bool:
    """Whether a node is made from more nodes than that, itself counted; looks at no more than needed."""
    found = {sink}
    stack = [sink]
    while stack and len(found) <= number:
        new = [arg for arg in stack.pop().args if arg not in found]
        found.update(new)
        stack.extend(new)
    return len(found) > number


def between(nodes: Sequence[Node], sources: Iterable[Node], sinks: Iterable[Node]) -> list[Node]:
    """The nodes on any path from `sources` to `sinks`, in the order of `nodes`; empty when there is none."""
    both = users(nodes, sources) & makers(sinks)
    return [node for node in nodes if node in both]
