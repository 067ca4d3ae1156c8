"""Methods of `Graph` that are functions of `cgraph` now, for one version."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from functools import partial

from ..core.graph import Graph

MOVED = ("from_networkx", "latex", "to_networkx")


class MovedMethod:
    """A method whose place the function of that name in `cgraph` has taken."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, graph: Graph | None, kind: type[Graph]) -> Callable[..., object]:
        text = f"the method Graph.{self.name} will go: call cg.{self.name}, which takes the graph"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        function: Callable[..., object] = getattr(sys.modules[__name__.partition(".")[0]], self.name)
        return function if graph is None or self.name == "from_networkx" else partial(function, graph)


for _name in MOVED:
    setattr(Graph, _name, MovedMethod(_name))
