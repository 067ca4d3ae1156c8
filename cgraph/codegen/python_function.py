"""Generated Python and NumPy: what compilation gives on NumPy alone."""

from __future__ import annotations

import builtins
import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.evaluate import Array
from ..core.graph import Graph
from ..core.ops import OPS
from .compiled import Compiled
from .python_source import source

BLOCK = 4096  # states a NumPy sweep takes at once: its temporaries stay in the cache

_Function = Callable[[Any], tuple[Any, ...]]
_PLAIN = ("float", "inf", "np")


class Generated(Compiled):
    """Generated Python for one point, generated NumPy for many; with backend "python" or "numpy", that one for both."""

    def __init__(self, graph: Graph, backend: str, options: dict[str, Any]) -> None:
        super().__init__(graph, backend, options)
        dialect = "numpy" if backend == "numpy" else "python"
        self.source = source(graph, dialect, {*OPS, *_PLAIN})
        self._python = _executable(self.source, dialect) if dialect == "python" else None
        self._numpy = _executable(self.source, dialect) if dialect == "numpy" else None

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point; by NumPy, as a batch of one."""
        point = self._point(x)
        return self.batch(point[:, None])[:, 0] if self._python is None else np.array(self.values(point.tolist()))

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats; IEEE values where a function of `math` raises."""
        if self._python is None:
            return tuple(self(x).tolist())
        try:
            return self._python(x)
        except (ValueError, OverflowError, ZeroDivisionError):  # out of a function's domain: IEEE values node by node
            named = dict(zip(self.graph.input_names, x, strict=True))
            return tuple([float(value) for value in self.graph.evaluate(named).values()])

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        if self.backend == "python":
            return sys.maxsize, self._one_by_one  # the interpreter runs one thread at a time
        if self._numpy is None:
            self._numpy = _executable(source(self.graph, "numpy", {*OPS, *_PLAIN}), "numpy")
        return BLOCK, partial(_sweep, self._numpy)

    def _one_by_one(self, points: Array, result: Array) -> None:
        for column, x in enumerate(points.T.tolist()):
            result[:, column] = self.values(x)

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        def run() -> None:
            y[:] = self(x)

        return run


def _sweep(function: _Function, points: Array, result: Array) -> None:
    with np.errstate(all="ignore"):  # here, as every thread has its own
        for row, value in zip(result, function(points), strict=True):
            row[:] = value


def _executable(text: str, dialect: str) -> _Function:
    """The text's function. An operation's name stands for its value on floats, which may raise, or on arrays."""
    namespace: dict[str, Any] = {name: op.raising if dialect == "python" else op.array for name, op in OPS.items()}
    namespace |= {"inf": math.inf, "np": np}
    exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
    function: _Function = namespace["function"]
    return function
