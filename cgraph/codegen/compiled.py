"""Compiled: the function object that `cg.compile` gives, whatever runs behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GraphError
from ..evaluate import Array
from ..graph import Graph


class Compiled(ABC):
    """A graph compiled by `cg.compile`. Inputs and outputs are in the order of the graph's.

    graph, backend: what was compiled, and how it was asked for.  n_in, n_out: their numbers.
    source: the generated text: Python, NumPy or LLVM.
    """

    source: str

    def __init__(self, graph: Graph, backend: str) -> None:
        self.graph = graph
        self.backend = backend
        self.n_in, self.n_out = len(graph.inputs), len(graph.outputs)

    @abstractmethod
    def __call__(self, x: ArrayLike) -> Array:
        """Values of the outputs, (n_out,), at one point x, (n_in,). Raises GraphError for another shape."""

    @abstractmethod
    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of n_in floats: the fastest way in from lists; nothing is checked."""

    def batch(self, X: ArrayLike) -> Array:
        """Values of the outputs, (n_out, N), at N points X, (n_in, N). Raises GraphError for another shape."""
        points = np.asarray(X, dtype=np.float64)
        if points.ndim != 2 or points.shape[0] != self.n_in:
            raise GraphError(f"X must have shape ({self.n_in}, N), one row for each input, got {points.shape}")
        return self._columns(points)

    @abstractmethod
    def _columns(self, points: Array) -> Array:
        """`batch`, after its checks."""

    def _point(self, x: ArrayLike) -> Array:
        point = np.asarray(x, dtype=np.float64)
        if point.shape != (self.n_in,):
            raise GraphError(f"x must have shape ({self.n_in},), one value for each input, got {point.shape}")
        return point

    def __repr__(self) -> str:
        return f"<compiled {self.graph!r}, backend {self.backend!r}>"
