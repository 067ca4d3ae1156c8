"""What a check of a graph found: one thing that is not as declared, in words, in nodes and edges, and for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...core.node import Edge, Node


@dataclass(frozen=True, eq=False)
class Finding:
    """One thing that a check found.

    kind: "dependence", "missing dependence", "unused input", "singular", "cancellation".
    text: in the person's names.  nodes, edges: what to mark in a drawing, the blamed ones alone in `edges`.
    data: what `to_dict` adds to kind and text, for JSON.
    """

    kind: str
    text: str
    nodes: tuple[Node, ...] = ()
    edges: tuple[Edge, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {"kind": self.kind, "text": self.text, **self.data}
