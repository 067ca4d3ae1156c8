"""Reachability: the descendants and the ancestors of nodes, and what lies between two groups."""

from collections.abc import Collection, Iterable, Sequence

from ..core.node import Node


def descendants(nodes: Sequence[Node], sources: Iterable[Node]) -> set[Node]:
    """The nodes, among `nodes` in topological order, that depend on `sources`; the sources included."""
    reached = set(sources)
    for node in nodes:
        if node not in reached and any([arg in reached for arg in node.args]):
            reached.add(node)
    return reached


def ancestors(sinks: Iterable[Node], without: Collection[Node] = ()) -> set[Node]:
    """The nodes that `sinks` depend on, the sinks included, along paths that pass no node of `without`."""
    reached: set[Node] = set()
    stack = [node for node in sinks if node not in without]
    while stack:
        node = stack.pop()
        if node not in reached:
            reached.add(node)
            stack.extend([arg for arg in node.args if arg not in without])
    return reached


def between(nodes: Sequence[Node], sources: Iterable[Node], sinks: Iterable[Node]) -> list[Node]:
    """The nodes on any path from `sources` to `sinks`, in the order of `nodes`; empty when there is none."""
    on_path = descendants(nodes, sources) & ancestors(sinks)
    return [node for node in nodes if node in on_path]
