"""Compiled: the function object that `cg.compile` gives, whatever runs behind it."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ...codegen.bound_call import bound
from ...codegen.c_entry import CEntry, c_entry
from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...core.graph import Graph
from ...core.html_text import html_table, html_text
from ...util.memory import lies_in_rows, require_memory, require_out, require_target
from ...util.threads import thread_count, write_batch
from ..program import Program
from ..runners.native_runner import NativeRunner
from ..statements.call import Call
from .bound_function import BoundFunction
from .differentiable import Differentiable, Ready


class Options(TypedDict):
    """The choices of `compile`, besides the backend."""

    fast: bool
    fma: bool
    cache: bool | str


class Compiled(BoundFunction, Differentiable):
    """A graph compiled by `cg.compile`. Inputs and outputs are in the order of the graph's.

    Attributes
    ----------
    graph : Graph
        What was compiled.
    backend : str
        The back end that was asked for.
    options : dict
        The keyword arguments of `compile`.
    n_in, n_out : int
        Numbers of inputs and outputs.
    source : str
        The generated text: Python, NumPy or LLVM.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> f = cg.compile(cg.Graph([x], {"y": x + 1.0}), "python")
    >>> f.n_in, f.n_out, f([2.0]).tolist()
    (1, 1, [3.0])
    >>> f.jacobian([2.0]).tolist(), f.jvp([2.0], [[5.0], [7.0]]).tolist()
    ([[1.0]], [[5.0], [7.0]])
    """

    def __init__(self, graph: Graph, backend: str, options: Options, ready: Ready, own: Ready) -> None:
        Differentiable.__init__(self, graph, ready)
        self.backend, self.options = backend, options
        self._runner = own(Program({"x": self.n_in, "y": self.n_out}, [Call(graph, ("x",), ("y",))], ["y"]))
        self.lanes, self.vectors, self.vector_cost = self._runner.lanes, self._runner.vectors, self._runner.vector_cost
        self.source = self._runner._point_text("x", "y")
        BoundFunction.__init__(self, self._bound, self.n_in, (self.n_out,), graph.input_names)
        if (on_lists := self._runner._on_lists("x")) is not None:
            self.values = on_lists  # type: ignore[assignment, method-assign]  # without arrays on the way

    def batch(self, X: ArrayLike, threads: int | None = 1, *, out: Array | None = None) -> Array:
        """Values of the outputs, (n_out, N), at N points X, (n_in, N).

        The last axis counts the points here, so that the numbers of one input lie side by side in the lanes of vectors;
        derivatives and motions have it first. Machine code reads and writes points that lie one after another, such as
        `rows.T` of rows (N, n_in), as they lie: `.T` of the result then is rows, too.
        out: where they go, an array of float64 (n_out, N) that shares no memory with X; a new one by default.
        threads: how many may share the work; None: one for each core. A batch too small to gain by it takes fewer, and
        generated Python (backend "python") takes one. They change nothing in the values.
        Raises GraphError for another shape or an `out` that is none, ValueError for less than one thread.
        """
        count = thread_count(threads)
        points = real_array("X", X)
        if points.ndim != 2 or points.shape[0] != self.n_in:
            raise GraphError(f"X must have shape ({self.n_in}, N), one row for each input, got {points.shape}")
        total = points.shape[1]
        order = "F" if self._runner.takes_rows and lies_in_rows(points) else "C"
        result = np.empty((self.n_out, total), order=order) if out is None else out  # type: ignore[call-overload]
        if out is not None:
            require_out(out, (self.n_out, total), points)
        write_batch(*self._runner._columns("x"), points, result, count)
        return result

    def bind(self, x: Array, y: Array) -> Callable[[], None]:
        """A function of nothing that reads x, (n_in,), and writes y, (n_out,): the fastest call there is.

        The arrays are checked here and never again; the function keeps them alive. One thread at a time may call it,
        and Python's other threads wait meanwhile.
        Raises GraphError unless both are contiguous arrays of float64 in these shapes, y can be written and they
        share no memory.
        """
        require_memory("x", x, (self.n_in,))
        require_memory("y", y, (self.n_out,))
        require_target("y", y, "x", x)
        return bound(self._bound(x, y))

    @property
    def address(self) -> int:
        """Address of the machine code as a function of C, `void (const double *x, double *y)`, for cffi, Numba, ctypes.

        x has the n_in inputs, y the n_out outputs, and they do not overlap; any number of threads may call it. It is
        there as long as this compiled graph is: keep `fn` alive while the address is used.
        Raises RuntimeError for generated Python, which has none.

        >>> import ctypes
        >>> x = cg.variable("x")
        >>> fn = cg.compile(cg.Graph([x], {"y": x + 1.0}))
        >>> numbers = ctypes.POINTER(ctypes.c_double)
        >>> y = ctypes.c_double()
        >>> ctypes.CFUNCTYPE(None, numbers, numbers)(fn.address)(ctypes.c_double(2.0), y)
        >>> y.value
        3.0
        """
        return ctypes.cast(self._c_entry.function, ctypes.c_void_p).value or 0

    @cached_property
    def _c_entry(self) -> CEntry:
        """The machine code as functions of C; made at the first use."""
        if not isinstance(self._runner, NativeRunner):
            raise RuntimeError(
                f"an address needs machine code, and this is generated Python, backend {self.backend!r}: "
                "cg.compile(graph, 'llvm') says what is missing"
            )
        return c_entry(self._runner.point("x", "y").entry, self.n_in, self.n_out)

    def batch_source(self) -> str:
        """The text of the function for batches: NumPy or LLVM."""
        return self._runner._batch_text("x")

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        return self._runner._bind_pass(("x", x), ("y", y))[0]

    def _repr_html_(self) -> str:
        rows = [("back end", self.backend), ("inputs", str(self.n_in)), ("outputs", str(self.n_out))]
        rows += [("nodes", str(len(self.graph.nodes))), ("lines of generated text", str(self.source.count("\n")))]
        return html_text("A compiled graph") + html_table(("", ""), rows)

    def __repr__(self) -> str:
        return f"<compiled {self.graph!r}, backend {self.backend!r}>"
