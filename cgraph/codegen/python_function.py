"""Generated Python and NumPy: what compilation gives on NumPy alone."""

from __future__ import annotations

import builtins
import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..autodiff.direction_split import DirectionSplit
from ..core.evaluation import Array
from ..core.graph import Graph
from ..operations.operation import LIBRARY, Op
from ..operations.table import OPS
from ..operations.values import by_element
from .compiled import Compiled, Options
from .numpy_sweep import NumpySweep
from .python_source import source

BLOCK = 4096  # states a NumPy sweep takes at once: its temporaries stay in the cache

_Function = Callable[[Any], tuple[float, ...]]
_PLAIN = ("float", "inf", "np")


class Generated(Compiled):
    """Generated Python for one point, generated NumPy for many; with backend "python" or "numpy", that one for both.

    options: fma; without it NumPy has its functions from the C library, too, one element after another.
    """

    vector_cost = 20  # NumPy's call, against one of Python's operators

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        super().__init__(graph, backend, options)
        dialect = _Dialect("numpy" if backend == "numpy" else "python", exact=not options["fma"])
        self.source = dialect.source(graph)
        self._python = dialect.executable(self.source) if dialect.column == "python" else None
        self._numpy = dialect.executable(self.source) if dialect.column == "numpy" else None

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

    def _sweep(self, split: DirectionSplit, guarded: DirectionSplit | None) -> NumpySweep:
        return NumpySweep(split, partial(Generated, options=self.options), guarded)

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        if self.backend == "python":
            return sys.maxsize, self._one_by_one  # the interpreter runs one thread at a time
        if self._numpy is None:
            numpy = _Dialect("numpy", exact=not self.options["fma"])
            self._numpy = numpy.executable(numpy.source(self.graph))
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


class _Dialect(NamedTuple):
    """How operations are written, and what their names stand for.

    column: of the operation table, "python" (floats) or "numpy" (arrays).
    exact: take from floats what NumPy's own functions round otherwise than the C library.
    """

    column: str
    exact: bool

    def source(self, graph: Graph) -> str:
        """The text of a graph's function."""
        return source(graph, self._text, {*OPS, *_PLAIN})

    def _text(self, op: Op) -> str:
        if self.column == "numpy" and self._by_element(op):
            return f"{op.name}({', '.join([f'{{{slot}}}' for slot in range(op.arity)])})"
        text: str = getattr(op, self.column)
        return text

    def _by_element(self, op: Op) -> bool:
        return self.exact and op.rounding >= LIBRARY

    def executable(self, text: str) -> _Function:
        """The text's function. An operation's name stands for its value on floats, which may raise, or on arrays."""
        namespace: dict[str, Any] = {"inf": math.inf, "np": np}
        for name, op in OPS.items():
            if self.column == "python":
                namespace[name] = op.raising
            else:
                namespace[name] = by_element(op.scalar) if self._by_element(op) else op.array
        exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
        function: _Function = namespace["function"]
        return function
