"""Compiled graphs: `compile` and the function object that it gives."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GraphError
from ..evaluate import Array
from ..graph import Graph
from ..ops import OPS
from .source import source

BACKENDS = ("auto", "python", "numpy")
BLOCK = 4096  # states a NumPy sweep takes at once: its temporaries stay in the cache

_PLAIN = ("abs", "float", "inf", "np", "power")
# Names in generated Python: `math` functions, which are fast and raise outside their domain, else the table's own.
_PYTHON = {name: getattr(math, name, op.scalar) for name, op in OPS.items()} | {"inf": math.inf, "abs": builtins.abs}
_NUMPY = {"np": np, "inf": math.inf, "power": OPS["pow"].array}


class Compiled:
    """A graph compiled by `cg.compile`. Inputs and outputs are in the order of the graph's.

    graph, backend: what was compiled, and how.  source: the generated text.
    """

    def __init__(self, graph: Graph, backend: str) -> None:
        self.graph = graph
        self.backend = backend
        self.n_in, self.n_out = len(graph.inputs), len(graph.outputs)
        dialect = "numpy" if backend == "numpy" else "python"
        self.source = source(graph, dialect, {*_PYTHON, *_PLAIN})
        self._python = _executable(self.source, _PYTHON) if dialect == "python" else None
        self._numpy = _executable(self.source, _NUMPY) if dialect == "numpy" else None

    def __call__(self, x: ArrayLike) -> Array:
        """Values of the outputs, (n_out,), at one point x, (n_in,). Raises GraphError for another shape."""
        point = np.asarray(x, dtype=np.float64)
        if point.shape != (self.n_in,):
            raise GraphError(f"x must have shape ({self.n_in},), one value for each input, got {point.shape}")
        if self._python is None:
            return self.batch(point[:, None])[:, 0]
        return np.array(self.values(point.tolist()))

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats: the fastest way in, nothing is checked."""
        assert self._python is not None
        try:
            return self._python(x)
        except (ValueError, OverflowError, ZeroDivisionError):  # out of a function's domain: IEEE values node by node
            named = dict(zip(self.graph.input_names, x, strict=True))
            return tuple([float(value) for value in self.graph.evaluate(named).values()])

    def batch(self, X: ArrayLike) -> Array:
        """Values of the outputs, (n_out, N), at N points X, (n_in, N). Raises GraphError for another shape."""
        points = np.asarray(X, dtype=np.float64)
        if points.ndim != 2 or points.shape[0] != self.n_in:
            raise GraphError(f"X must have shape ({self.n_in}, N), one row for each input, got {points.shape}")
        result = np.empty((self.n_out, points.shape[1]))
        if self.backend == "python":
            for column, x in enumerate(points.T.tolist()):
                result[:, column] = self.values(x)
            return result
        if self._numpy is None:
            self._numpy = _executable(source(self.graph, "numpy", {*_PYTHON, *_PLAIN}), _NUMPY)
        with np.errstate(all="ignore"):
            for start in range(0, points.shape[1], BLOCK):
                block = slice(start, start + BLOCK)
                for row, value in zip(result, self._numpy(points[:, block]), strict=True):
                    row[block] = value
        return result

    def __reduce__(self) -> tuple[Any, ...]:
        return compile, (self.graph, self.backend)

    def __repr__(self) -> str:
        return f"<compiled {self.graph!r}, backend {self.backend!r}>"


def _executable(text: str, helpers: dict[str, Any]) -> Callable[[Any], tuple[Any, ...]]:
    namespace = dict(helpers)
    exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
    function: Callable[[Any], tuple[Any, ...]] = namespace["function"]
    return function


def compile(graph: Graph, backend: str = "auto") -> Compiled:
    """The graph as a function: `fn(x)` at one point, `fn.batch(X)` at many, `fn.source` to read.

    backend: "python", generated Python over floats, fast at one point; "numpy", generated NumPy over arrays, fast for
    many; "auto", the first for `fn(x)` and the second for `fn.batch(X)`. All agree with `graph.evaluate`, on floats
    and on arrays respectively. Raises ValueError for an unknown backend.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    return Compiled(graph, backend)
