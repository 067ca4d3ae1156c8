"""Factoring: sums of products rewritten with their common factors taken out."""

from __future__ import annotations

from collections import Counter

from .graph import Graph
from .fold import Builder
from .label import building
from .node import OPS, Node
from .order import rebuild


def factored(graph: Graph) -> Graph:
    return graph
