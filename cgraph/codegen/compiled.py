"""Compiled: the function object that `cg.compile` gives, whatever runs behind it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import GraphError
from ..core.evaluation import Array
from ..core.graph import Graph
from ..util.html_text import html_table, html_text
from ..util.real_arrays import real_array
from ..util.threads import share, thread_count
from .bound_call import bound
from .differentiable import Differentiable, describe, require_memory


class Options(TypedDict):
    """The choices of `compile`, besides the backend."""

    fast: bool
    fma: bool
    cache: bool | str


class Compiled(Differentiable):
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

    source: str
    takes_rows = False  # whether batches of points that lie one after another are read and written as they lie

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        super().__init__()
        self.graph = graph
        self.backend, self.options = backend, options
        self.n_in, self.n_out = len(graph.inputs), len(graph.outputs)

    @abstractmethod
    def __call__(self, x: ArrayLike) -> Array:
        """Values of the outputs, (n_out,), at one point x, (n_in,). Raises GraphError for another shape."""

    @abstractmethod
    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of n_in floats: the fastest way in from lists; nothing is checked."""

    def batch(self, X: ArrayLike, threads: int | None = 1, *, out: Array | None = None) -> Array:
        """Values of the outputs, (n_out, N), at N points X, (n_in, N).

        Machine code reads and writes points that lie one after another, such as `rows.T` of rows (N, n_in), as they
        lie: `.T` of the result then is rows, too.
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
        order = "F" if self.takes_rows and lies_in_rows(points) else "C"
        result = np.empty((self.n_out, total), order=order) if out is None else out  # type: ignore[call-overload]
        if out is not None:
            require_out(out, (self.n_out, total), points)
        width, columns = self._columns()

        def block(start: int) -> None:
            stop = start + width
            columns(points[:, start:stop], result[:, start:stop])

        # Blocks begin where they begin whatever `threads` is, so that each column always has the same neighbours.
        share(block, range(0, total, width), min(count, total // width))
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
        if not y.flags.writeable:
            raise GraphError("y must be an array that can be written, got one that is read-only")
        if np.may_share_memory(x, y):
            raise GraphError("x and y must not share memory")
        return bound(self._bound(x, y))

    @abstractmethod
    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        """What writes the results, (n_out, k), of points, (n_in, k), and the k that is worth handing to a thread."""

    @abstractmethod
    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        """`bind`, after its checks."""

    def _like(self, graph: Graph) -> Compiled:
        return type(self)(graph, self.backend, self.options)

    def _point(self, x: ArrayLike) -> Array:
        point = real_array("x", x)
        if point.shape != (self.n_in,):
            raise GraphError(f"x must have shape ({self.n_in},), one value for each input, got {point.shape}")
        return point

    def _repr_html_(self) -> str:
        rows = [("back end", self.backend), ("inputs", str(self.n_in)), ("outputs", str(self.n_out))]
        rows += [("nodes", str(len(self.graph.nodes))), ("lines of generated text", str(self.source.count("\n")))]
        return html_text("A compiled graph") + html_table(("", ""), rows)

    def __repr__(self) -> str:
        return f"<compiled {self.graph!r}, backend {self.backend!r}>"


def lies_in_rows(points: Array) -> bool:
    """Whether points, (n, N), lie in memory one after another, n numbers each."""
    return points.flags.f_contiguous and not points.flags.c_contiguous


def require_out(out: Array, shape: tuple[int, int], points: Array) -> None:
    """Raise GraphError unless results of that shape can be written there while the points are read."""
    if not isinstance(out, np.ndarray) or out.dtype != np.float64 or out.shape != shape:
        raise GraphError(f"out must be an array of float64 in shape {shape}, got {describe(out)}")
    if not out.flags.writeable:
        raise GraphError("out must be an array that can be written, got one that is read-only")
    if np.may_share_memory(out, points):
        raise GraphError("out and X must not share memory")
