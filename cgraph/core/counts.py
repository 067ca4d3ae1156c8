"""Counts: how large a graph is, in nodes, edges, depth and width, by operation, tag and role."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from .html_text import html_table
from .node import Node


@dataclass(frozen=True)
class Counts:
    """Sizes of a graph; leaves (inputs and constants) count as nodes. `str` of it is a table.

    Attributes
    ----------
    nodes, edges : int
        How many; an edge is one use of a node by another.
    depth : int
        Operations on the longest path.
    width : int
        The largest number of nodes at one distance from the leaves.
    by_operation, by_tag, by_role : dict of str to int
        Numbers of nodes, the largest first.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> counts = cg.Graph([x], {"y": x * cg.sin(x)}).counts()
    >>> counts.nodes, counts.edges, counts.depth
    (3, 3, 2)
    """

    nodes: int
    edges: int
    depth: int
    width: int
    by_operation: dict[str, int]
    by_tag: dict[str, int]
    by_role: dict[str, int]

    def __str__(self) -> str:
        def row(title: str, counts: dict[str, int]) -> str:
            listed = ", ".join(f"{name} {n}" for name, n in counts.items())
            return f"{title:13}{listed or '-'}"

        return "\n".join(
            (
                f"nodes {self.nodes}, edges {self.edges}, depth {self.depth}, width {self.width}",
                row("by operation", self.by_operation),
                row("by tag", self.by_tag),
                row("by role", self.by_role),
            )
        )

    def _repr_html_(self) -> str:
        sizes = [(name, str(getattr(self, name))) for name in ("nodes", "edges", "depth", "width")]
        groups = {"operation": self.by_operation, "tag": self.by_tag, "role": self.by_role}
        rows = [(f"{kind} {name}", str(n)) for kind, counts in groups.items() for name, n in counts.items()]
        return html_table(("", "count"), sizes + rows)


def count(nodes: Iterable[Node]) -> Counts:
    """Counts of nodes in topological order."""
    level: dict[Node, int] = {}
    operations: Counter[str] = Counter()
    tags: Counter[str] = Counter()
    roles: Counter[str] = Counter()
    edges = 0
    for node in nodes:
        level[node] = 1 + max(level[arg] for arg in node.args) if node.args else 0
        operations[node.op.name] += 1
        edges += len(node.args)
        tags.update(node.tags)
        roles.update(node.roles)
    width = max(Counter(level.values()).values(), default=0)
    return Counts(len(level), edges, max(level.values(), default=0), width, *map(_sorted, (operations, tags, roles)))


def _sorted(counter: Counter[str]) -> dict[str, int]:
    return dict(sorted(counter.items(), key=lambda item: (-item[1], item[0])))
