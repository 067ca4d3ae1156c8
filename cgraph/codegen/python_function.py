"""A graph as a function of generated Python, on floats, or of generated NumPy, on arrays."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..core.evaluation import Array
from ..core.graph import Graph
from ..operations.operation import LIBRARY, Op
from ..operations.table import OPS
from ..operations.values import by_element
from .python_source import source

_PLAIN = ("float", "inf", "np")


class OnFloats:
    """A graph at one point: generated Python."""

    def __init__(self, graph: Graph) -> None:
        self._graph, self.source = graph, source(graph, lambda op: op.python, {*OPS, *_PLAIN})
        self._function = _executable(self.source, {name: op.raising for name, op in OPS.items()})

    def __call__(self, x: Sequence[float]) -> tuple[float, ...]:
        """The outputs; IEEE values where a function of `math` raises."""
        try:
            return self._function(x)
        except (ValueError, OverflowError, ZeroDivisionError):  # out of a function's domain: IEEE values node by node
            named = dict(zip(self._graph.input_names, x, strict=True))
            return tuple([float(value) for value in self._graph.evaluate(named).values()])


class OnArrays:
    """A graph at many points: generated NumPy.

    exact: take from floats what NumPy's own functions round otherwise than the C library.
    """

    def __init__(self, graph: Graph, *, exact: bool) -> None:
        apart = {name for name, op in OPS.items() if exact and op.rounding >= LIBRARY}

        def text(op: Op) -> str:
            if op.name in apart:
                return f"{op.name}({', '.join([f'{{{slot}}}' for slot in range(op.arity)])})"
            return str(op.numpy)

        self.source = source(graph, text, {*OPS, *_PLAIN})
        values = {name: by_element(op.scalar) if name in apart else op.array for name, op in OPS.items()}
        self._function = _executable(self.source, values)

    def __call__(self, points: Array, result: Array) -> None:
        """The outputs, (n_out, k), at points, (n_in, k)."""
        with np.errstate(all="ignore"):  # here, as every thread has its own
            for row, value in zip(result, self._function(points), strict=True):
                row[:] = value


def _executable(text: str, operations: dict[str, Any]) -> Callable[[Any], tuple[Any, ...]]:
    """The text's function, in which an operation's name stands for its value."""
    namespace: dict[str, Any] = {"inf": math.inf, "np": np, **operations}
    exec(builtins.compile(text, "<cgraph>", "exec"), namespace)  # noqa: S102 (the text is our own)
    function: Callable[[Any], tuple[Any, ...]] = namespace["function"]
    return function
