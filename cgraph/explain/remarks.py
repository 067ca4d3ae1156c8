"""Remarks: what who derived a graph knows of it, for drawings and notebooks: names, and what in it is wrong."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from ..core.graph import Edge, Graph
from ..core.node import Node


class Remarks(NamedTuple):
    """Remarks on a graph.

    names: {name in the graph: what a person calls it}.  words: a paragraph.  nodes, edges, and outputs by their names:
    to be painted as wrong.
    """

    names: Mapping[str, str]
    words: str = ""
    nodes: Collection[Node] = frozenset()
    edges: Collection[Edge] = frozenset()
    outputs: Collection[str] = ()


def remarked(graph: Graph, remarks: Callable[[Graph], Remarks]) -> Graph:
    """The graph, which from now on has these remarks, made when a drawing asks for them; what is made of it has not.

    >>> import cgraph as cg
    >>> from cgraph.extend import Remarks, remarked, remarks_of
    >>> q0 = cg.variable("q0")
    >>> graph = remarked(cg.Graph([q0], {"y": cg.sin(q0)}), lambda graph: Remarks({"q0": "q.knee"}))
    >>> remarks_of(graph).names["q0"], remarks_of(cg.simplify(graph)).words
    ('q.knee', '')
    """
    graph.__dict__["_remarks"] = remarks
    return graph


def remarks_of(graph: Graph) -> Remarks:
    """The remarks on a graph, none on most."""
    made: Callable[[Graph], Remarks] | None = graph.__dict__.get("_remarks")
    return made(graph) if made is not None else Remarks({})
