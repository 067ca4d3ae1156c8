"""A finding: one thing in a graph that is not as declared, in words, in nodes and edges, and for JSON."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...core.graph import Edge
from ...core.node import Node
from ...util.json_type import Json


@dataclass(frozen=True, eq=False)
class Finding:
    """One result of a check.

    Attributes
    ----------
    kind : str
        "dependence", "missing dependence", "unused input", "singular", "cancellation" or "guard by equality".
    text : str
        The sentence, in the person's names.
    nodes : tuple of Node
        What to mark in a drawing.
    edges : tuple of Edge
        The edges to blame.
    data : mapping
        What `to_dict` adds to kind and text.
    """

    kind: str
    text: str
    nodes: tuple[Node, ...] = ()
    edges: tuple[Edge, ...] = ()
    data: Mapping[str, Json] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"kind": self.kind, "text": self.text, **self.data}
