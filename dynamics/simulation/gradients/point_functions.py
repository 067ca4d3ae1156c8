"""Point functions: graphs compiled for a point or many side by side, and their pullbacks, made once."""

from __future__ import annotations

from typing import Any

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array, kept_by_first


@kept_by_first
def compiled(graph: Graph, backend: str) -> Any:
    """The graph as a function."""
    return cg.compile(graph, backend)


@kept_by_first
def pulled_back(graph: Graph, backend: str) -> Any:
    """J^T y_bar as a function of the inputs, then y_bar."""
    return cg.compile(cg.simplify(cg.vjp(graph)), backend)


def at(function: Any, x: Array) -> Array:
    """The outputs, (k,) at a point (n,), or (k, N) at points (n, N)."""
    values: Array = function(x) if x.ndim == 1 else function.batch(x)
    return values
