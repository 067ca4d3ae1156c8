"""Generated: a graph as generated Python and NumPy, what compilation gives on NumPy alone."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ...codegen.python_function import OnArrays, OnFloats
from ...core.evaluation import Array
from ...core.graph import Graph
from ..program import Program
from ..runners.python_runner import BLOCK, PythonRunner
from .compiled import Compiled, Options


class Generated(Compiled):
    """Generated Python for one point, generated NumPy for many; with backend "python" or "numpy", that one for both.

    options: fma; without it NumPy has its functions from the C library, too, one element after another.
    """

    vector_cost = 20  # NumPy's call, against one of Python's operators

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        super().__init__(graph, backend, options)
        self._floats = None if backend == "numpy" else OnFloats(graph)
        self._arrays = self._on_arrays(graph) if backend == "numpy" else None
        self.source = (self._floats or self._on_arrays(graph)).source

    def _on_arrays(self, graph: Graph) -> OnArrays:
        return OnArrays(graph, exact=not self.options["fma"])

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point; by NumPy, as a batch of one."""
        point = self._point(x)
        return self.batch(point[:, None])[:, 0] if self._floats is None else np.array(self._floats(point.tolist()))

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats; IEEE values where a function of `math` raises."""
        return tuple(self(x).tolist()) if self._floats is None else self._floats(x)

    def _ready(self, program: Program) -> PythonRunner:
        return PythonRunner(program, fma=self.options["fma"])

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        if self.backend == "python":
            return sys.maxsize, self._one_by_one  # the interpreter runs one thread at a time
        if self._arrays is None:
            self._arrays = self._on_arrays(self.graph)
        return BLOCK, self._arrays

    def _one_by_one(self, points: Array, result: Array) -> None:
        for column, x in enumerate(points.T.tolist()):
            result[:, column] = self.values(x)

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        def run() -> None:
            y[:] = self(x)

        return run
