"""Generated Python and NumPy: what compilation gives on NumPy alone."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..evaluate import Array
from ..graph import Graph
from ..ops import OPS
from .compiled import Compiled
from .source import source

BLOCK = 4096  # states a NumPy sweep takes at once: its temporaries stay in the cache

_PLAIN = ("abs", "float", "inf", "np", "power")
# Names in generated Python: `math` functions, which are fast and raise outside their domain, else the table's own.
_PYTHON = {name: getattr(math, name, op.scalar) for name, op in OPS.items()} | {"inf": math.inf, "abs": builtins.abs}
_NUMPY = {"np": np, "inf": math.inf, "power": OPS["pow"].array}


class Generated(Compiled):
    """Generated Python for one point, generated NumPy for many; with backend "python" or "numpy", that one for both."""

    def __init__(self, graph: Graph, backend: str) -> None:
        super().__init__(graph, backend)
        dialect = "numpy" if backend == "numpy" else "python"
        self.source = source(graph, dialect, {*_PYTHON, *_PLAIN})
        self._python = _executable(self.source, _PYTHON) if dialect == "python" else None
        self._numpy = _executable(self.source, _NUMPY) if dialect == "numpy" else None

    def __call__(self, x: ArrayLike) -> Array:
        """See Compiled."""
        point = self._point(x)
        return self._columns(point[:, None])[:, 0] if self._python is None else np.array(self.values(point.tolist()))

    def values(self, x: list[float]) -> tuple[float, ...]:
        """See Compiled."""
        if self._python is None:
            return tuple(self(x).tolist())
        try:
            return self._python(x)
        except (ValueError, OverflowError, ZeroDivisionError):  # out of a function's domain: IEEE values node by node
            named = dict(zip(self.graph.input_names, x, strict=True))
            return tuple([float(value) for value in self.graph.evaluate(named).values()])

    def _columns(self, points: Array) -> Array:
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


def _executable(text: str, helpers: dict[str, Any]) -> Callable[[Any], tuple[Any, ...]]:
    namespace = dict(helpers)
    exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
    function: Callable[[Any], tuple[Any, ...]] = namespace["function"]
    return function
