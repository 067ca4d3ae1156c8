"""`compile`: a graph as a function, by machine code or by generated Python and NumPy."""

from __future__ import annotations

import ctypes
import os
import pickle
import warnings
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...codegen.bound_call import CEntry, bound, c_entry
from ...codegen.disk_cache import cache_choice, cache_folder
from ...codegen.llvm_engine import MissingFunctionError
from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...core.graph import Graph
from ...core.html_text import html_table, html_text
from ...core.node import Node
from ...util.extras import required
from ...util.memory import lies_in_rows, require_memory, require_out, require_target
from ...util.require import require_choice, require_flag, require_graph
from ...util.threads import thread_count, write_batch
from ...util.version import __version__
from ..program import Program
from ..runners.native_runner import NativeRunner
from ..runners.python_runner import PythonRunner
from ..statements.call import Call
from .derivative import BoundFunction, Chosen, ColoredMatrix, Derivatives, Ready

BACKENDS = ("auto", "python", "numpy", "llvm")
LARGE_GRAPH = 1_000_000  # nodes; beyond, making machine code takes longer than most callers gain
Inputs = str | Node | Sequence[str | Node] | None


class Compiled(BoundFunction):
    """A graph compiled by `cg.compile`. Inputs and outputs are in the order of the graph's.

    Attributes
    ----------
    graph, backend, options
        What was compiled, the back end that was asked for, and the keyword arguments of `compile`, a dict.
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

    def __init__(self, graph: Graph, backend: str, options: dict[str, Any], ready: Ready, own: Ready) -> None:
        self.graph, self.backend, self.options = graph, backend, options
        self.n_in, self.n_out = len(graph.inputs), len(graph.outputs)
        self._runner = own(Program({"x": self.n_in, "y": self.n_out}, [Call(graph, ("x",), ("y",))], ["y"]))
        self.source = self._runner.text("x")
        super().__init__(self._bound, self.n_in, (self.n_out,), graph.input_names)
        self._derivatives = Derivatives(graph, ready, self._runner)
        if isinstance(self._runner, PythonRunner) and backend != "numpy":
            self.values = self._runner.on_floats(graph)  # type: ignore[method-assign]  # without arrays on the way

    def batch(self, X: ArrayLike, threads: int | None = 1, *, out: Array | None = None) -> Array:
        """Values of the outputs, (n_out, N), at N points X, (n_in, N).

        The last axis counts the points here, so that the numbers of one input lie side by side in the lanes of vectors;
        derivatives and motions have it first. Machine code takes `rows.T` of rows (N, n_in) as it lies.
        out: where they go, an array of float64 (n_out, N) that shares no memory with X; a new one by default.
        threads: how many may share the work, which changes no value; None: one for each core. Few points take fewer.
        Raises GraphError for another shape or an `out` that is none, ValueError for less than one thread.
        """
        count = thread_count(threads)
        points = real_array("X", X)
        if points.ndim != 2 or points.shape[0] != self.n_in:
            raise GraphError(f"X must have shape ({self.n_in}, N), one row for each input, got {points.shape}")
        total = points.shape[1]
        result = np.empty((self.n_out, total), order="F" if lies_in_rows(points) else "C") if out is None else out
        if out is not None:
            require_out(out, (self.n_out, total), points)
        write_batch(*self._runner.columns("x"), points, result, count)
        return result

    def bind(self, x: Array, y: Array) -> Callable[[], None]:
        """A function of nothing that reads x, (n_in,), and writes y, (n_out,): the fastest call there is.

        The arrays are checked here and never again; the function keeps them alive. One thread at a time may call it,
        and Python's other threads wait meanwhile.
        Raises GraphError unless both are contiguous float64 in these shapes, y can be written and they share no memory.
        """
        require_memory("x", x, (self.n_in,))
        require_memory("y", y, (self.n_out,))
        require_target("y", y, "x", x)
        return bound(self._bound(x, y))

    @property
    def address(self) -> int:
        """Address of the machine code as a function of C, `void (const double *x, double *y)`, for cffi, Numba, ctypes.

        x has the n_in inputs, y the n_out outputs, and they do not overlap; any number of threads may call it, as long
        as `fn` is alive. Raises RuntimeError for generated Python, which has none.

        >>> import ctypes
        >>> x, y = cg.variable("x"), ctypes.c_double()
        >>> fn, numbers = cg.compile(cg.Graph([x], {"y": x + 1.0})), ctypes.POINTER(ctypes.c_double)
        >>> ctypes.CFUNCTYPE(None, numbers, numbers)(fn.address)(ctypes.c_double(2.0), y)
        >>> y.value
        3.0
        """
        return ctypes.cast(self._c_entry.function, ctypes.c_void_p).value or 0

    @cached_property
    def _c_entry(self) -> CEntry:
        """The machine code as functions of C."""
        if not isinstance(self._runner, NativeRunner):
            problem = f"an address needs machine code, and this is generated Python, backend {self.backend!r}"
            raise RuntimeError(f"{problem}: cg.compile(graph, 'llvm') says what is missing")
        return c_entry(self._runner.point("x", "y")[1], self.n_in, self.n_out)

    def jvp(self, x: ArrayLike, X_dot: ArrayLike, *, wrt: Inputs = None, threads: int | None = 1) -> Array:
        """Products y_dot = J x_dot of the Jacobian at x with directions, side by side in vectors: forward mode.

        An entry of x_dot that is zero counts for nothing, also where an operation has no slope in it; times a factor
        that is infinite or NaN it is NaN.

        Parameters
        ----------
        x : array_like, (n_in,) or (N, n_in)
            The point, or points, a row each.
        X_dot : array_like, (k, n_in) or (n_in,)
            Directions, or one. At N points (N, n_in), one for each, (N, k, n_in), or (n_in,), the same for all.
        wrt : optional
            The inputs to differentiate by, n_in of them, in this order; by default all.
        threads : int, optional
            How many may share the points, as of `batch`.

        Returns
        -------
        ndarray, (k, n_out) or (n_out,)
            At N points (N, k, n_out), or (N, n_out) of a direction each.

        Raises
        ------
        GraphError
            For another shape, or an input that is not there.

        Examples
        --------
        >>> x, y = cg.variables("x y")
        >>> f = cg.compile(cg.Graph([x, y], {"area": x * y}))
        >>> f.jvp([[1.0, 2.0], [3.0, 4.0]], [1.0, 10.0]).tolist()
        [[12.0], [34.0]]
        """
        return self._products(x, "X_dot", X_dot, wrt, threads, reverse=False)

    def vjp(self, x: ArrayLike, Y_bar: ArrayLike, *, wrt: Inputs = None, threads: int | None = 1) -> Array:
        """Products x_bar = J^T y_bar of the transposed Jacobian at x with cotangents, side by side: reverse mode.

        Parameters
        ----------
        Y_bar : array_like, (k, n_out) or (n_out,)
            Cotangents, or one. At N points (N, n_out), one for each, (N, k, n_out), or (n_out,), the same for all.
        x, wrt, threads
            As of `jvp`, and so are errors.

        Returns
        -------
        ndarray, (k, n_in) or (n_in,)
            At N points (N, k, n_in), or (N, n_in) of a cotangent each; n_in counts the chosen inputs.

        Examples
        --------
        >>> x, y = cg.variables("x y")
        >>> f = cg.compile(cg.Graph([x, y], {"area": x * y}))
        >>> f.vjp([[1.0, 2.0], [3.0, 4.0]], [[1.0], [10.0]]).tolist()
        [[2.0, 1.0], [40.0, 30.0]]
        """
        return self._products(x, "Y_bar", Y_bar, wrt, threads, reverse=True)

    def jacobian(self, x: ArrayLike, *, wrt: Inputs = None, sparse: bool = False, threads: int | None = 1) -> Any:
        """The Jacobian dy_i/dx_j at x.

        Columns that share no row are one direction of a forward sweep, rows that share no column one of a reverse
        sweep, whichever costs less, or both: `cg.sparsity` tells the entries, greedy coloring the directions.

        Parameters
        ----------
        x : array_like, (n_in,) or (N, n_in)
            The point, or points, a row each; of points in columns, as `batch` takes them, it is `jacobian(X.T)`.
        wrt : optional
            The inputs to differentiate by, n_in of them, in this order; by default all. With displacements as inputs,
            a quaternion q + G(q) xi, the columns of these at xi = 0 are those of displacements.
        sparse : bool
            Give a scipy.sparse.csr_array with the entries of `cg.sparsity`; of N points a list of them.
        threads : int, optional
            How many may share the points, as of `batch`.

        Returns
        -------
        ndarray, (n_out, n_in) or (N, n_out, n_in)

        Raises
        ------
        GraphError
            For another shape, or an input that is not there.
        ImportError
            With `sparse` without SciPy.

        Examples
        --------
        >>> x = cg.variable("x")
        >>> cg.compile(cg.Graph([x], {"y": x * x})).jacobian([[1.0], [2.0], [3.0]]).ravel().tolist()
        [2.0, 4.0, 6.0]
        """
        return self._matrix(self._derivatives.jacobian(self._chosen(wrt)), self._points(x), sparse, threads)

    def hessian(
        self,
        x: ArrayLike,
        y_bar: ArrayLike | None = None,
        *,
        wrt: Inputs = None,
        sparse: bool = False,
        threads: int | None = 1,
    ) -> Any:
        """The Hessian of y_bar . y at x: forward sweeps over the reverse one, never a tensor.

        Columns are compressed by a star coloring, which reads an entry or its mirror image.

        Parameters
        ----------
        y_bar : array_like, (n_out,) or (N, n_out), optional
            The weights of the outputs, for all points or of each; not needed for one output.
        x, wrt, sparse, threads
            As of `jacobian`, and so are errors.

        Returns
        -------
        ndarray, (n_in, n_in) or (N, n_in, n_in)
            n_in counts the chosen inputs. With `sparse` a scipy.sparse.csr_array, or a list of them.

        Examples
        --------
        >>> x = cg.variable("x")
        >>> cg.compile(cg.Graph([x], {"y": x**3})).hessian([[1.0], [2.0], [3.0]]).ravel().tolist()
        [6.0, 12.0, 18.0]
        """
        if y_bar is None and self.n_out != 1:
            raise GraphError(f"hessian needs y_bar, the weights of the {self.n_out} outputs")
        points, weights = self._points(x), real_array("y_bar", [1.0] if y_bar is None else y_bar)
        if weights.shape != (self.n_out,) and weights.shape != (*points.shape[:-1], self.n_out):
            each = f" or {(len(points), self.n_out)}" if points.ndim == 2 else ""
            raise GraphError(
                f"y_bar must have shape ({self.n_out},){each}, one weight for each output, got {weights.shape}"
            )
        if points.ndim > weights.ndim:
            weights = np.broadcast_to(weights, (len(points), self.n_out))
        matrix = self._derivatives.hessian(self._chosen(wrt))
        return self._matrix(matrix, np.concatenate([points, weights], axis=-1), sparse, threads)

    def bind_jacobian(
        self, x: Array, values: Array, *, wrt: Inputs = None, threads: int | None = 1
    ) -> Callable[[], None]:
        """A function of nothing that reads x and writes the Jacobian: the fastest way to it.

        As for `bind`, the arrays are checked here and kept alive. What is always zero is set here, and not again.

        Parameters
        ----------
        x : ndarray, (n_in,) or (N, n_in)
        values : ndarray, (n_out, n_in) or (entries,)
            The matrix, or a number for each entry of `cg.sparsity`, row by row; of N points (N, ..).
        wrt, threads
            As of `jacobian`; `values` has as many columns as inputs are chosen.

        Raises
        ------
        GraphError
            For arrays that are not contiguous float64 of these shapes, or share memory, or an unknown input.

        Examples
        --------
        >>> import numpy as np
        >>> x, slopes = cg.variable("x"), np.empty((3, 1, 1))
        >>> cg.compile(cg.Graph([x], {"y": x * x})).bind_jacobian(np.array([[1.0], [2.0], [3.0]]), slopes)()
        >>> slopes.ravel().tolist()
        [2.0, 4.0, 6.0]
        """
        matrix, count = self._derivatives.jacobian(self._chosen(wrt)), thread_count(threads)
        rows = x.shape[:1] if isinstance(x, np.ndarray) and x.ndim == 2 else ()
        require_memory("x", x, (*rows, self.n_in))
        require_memory("values", values, (*rows, *matrix.entries.shape), (*rows, len(matrix.entries.rows)))
        require_target("values", values, "x", x)
        values[...] = 0.0
        return bound(partial(matrix.write, x, values, count) if rows else matrix.bind(x, values))

    def _points(self, x: ArrayLike) -> Array:
        """The point, (n_in,), or points, (N, n_in)."""
        points = real_array("x", x)
        if points.shape != (self.n_in,) and (points.ndim != 2 or points.shape[1] != self.n_in):
            wanted = f"({self.n_in},), one value for each input, or (N, {self.n_in}), a point a row"
            raise GraphError(f"x must have shape {wanted}, got {points.shape}")
        return points

    def _chosen(self, wrt: Inputs) -> Chosen:
        """The numbers of the inputs that `wrt` names."""
        if wrt is None:
            return None
        places = {node: k for k, node in enumerate(self.graph.inputs)}
        chosen = tuple([places[node] for node in self.graph.select_inputs(wrt)])
        return None if chosen == tuple(range(self.n_in)) else chosen

    def _products(
        self, x: ArrayLike, name: str, directions: ArrayLike, wrt: Inputs, threads: int | None, *, reverse: bool
    ) -> Array:
        points, rows, chosen = self._points(x), real_array(name, directions), self._chosen(wrt)
        width, found = self.n_in if chosen is None else len(chosen), self.n_out
        if reverse:
            width, found = found, width
        count, leading = thread_count(threads), points.shape[:-1]
        if leading and rows.ndim == 1:
            rows = np.broadcast_to(rows, (*leading, *rows.shape))
        fits = rows.ndim - points.ndim in (0, 1) and rows.shape[-1] == width
        if not fits or (leading and len(rows) != len(points)):
            total = len(points)
            each = f"({total}, {width}), ({total}, k, {width}) or ({width},) for {total} points"
            wanted = each if leading else f"(k, {width}) or ({width},)"
            raise GraphError(f"{name} must have shape {wanted}, got {rows.shape}")
        result = np.empty((*rows.shape[:-1], found))
        if not self.n_in:
            result[...] = 0.0
        elif result.size:
            products = self._derivatives.products(chosen, reverse)
            if rows.ndim == points.ndim:  # a direction for each point
                products.write(points, rows[..., None, :], result[..., None, :], count)
            else:
                products.write(points, rows, result, count)
        return result

    def _matrix(self, matrix: ColoredMatrix, points: Array, sparse: bool, threads: int | None) -> Any:
        count = thread_count(threads)
        if not require_flag("sparse", sparse):
            return matrix.at(points, True, count)
        module = required("scipy.sparse", "a sparse derivative needs SciPy", "scipy")
        columns, starts = matrix.compressed
        rows = matrix.at(points, False, count)
        listed = rows if rows.ndim == 2 else [rows]
        found = [module.csr_array((row, columns.copy(), starts.copy()), shape=matrix.entries.shape) for row in listed]
        return found if rows.ndim == 2 else found[0]

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        return self._runner.bind_pass(("x", x), ("y", y))[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (__version__, pickle.dumps((self.graph, self.backend, self.options)))

    def _repr_html_(self) -> str:
        rows = [("back end", self.backend), ("inputs", str(self.n_in)), ("outputs", str(self.n_out))]
        rows += [("nodes", str(len(self.graph.nodes))), ("lines of generated text", str(self.source.count("\n")))]
        return html_text("A compiled graph") + html_table(("", ""), rows)

    def __repr__(self) -> str:
        return f"<compiled {self.graph!r}, backend {self.backend!r}>"


def compile(
    graph: Graph,
    backend: str = "auto",
    *,
    fast: bool = False,
    fma: bool = True,
    cache: bool | str | os.PathLike[str] = False,
) -> Compiled:
    """The graph as a function: `fn(x)` at one point, `fn.batch(X)` at many, `fn.source` to read.

    All back ends agree with `graph.evaluate`, on floats and on arrays respectively.

    Parameters
    ----------
    graph : Graph
        What to compile.
    backend : {"auto", "llvm", "python", "numpy"}
        "llvm": machine code (extra `native`). "python": generated Python over floats. "numpy": generated NumPy over
        arrays. "auto": machine code where llvmlite is installed, the C library has all functions of the graph and that
        has at most 1 000 000 nodes, else generated Python for `fn(x)` and generated NumPy for `fn.batch(X)`; a
        RuntimeWarning says so if it is the size. Beyond 60 000 nodes machine code is made in two thirds of the time
        for a node, and takes twice as long to run.
    fast : bool
        Machine code may also re-associate sums and products, multiply by reciprocals and mistake the sign of a zero;
        NaN and infinities keep their meaning.
    fma : bool
        May round a product and the sum it goes into once instead of twice, and take sines, cosines, exponentials and
        logarithms from polynomials (within 2 ulp), NumPy its own functions. Without, `fn(x)` and `fn.batch(X)` agree
        with `graph.evaluate` at a point to the last bit, in every back end; batches then call the C library for each
        column.
    cache : bool or path
        Keep machine code on disk for the next process, and read it from there: True, in the platform's folder for
        caches (`$XDG_CACHE_HOME/cgraph`, `~/.cache/cgraph`, ...), or the path of a folder, `~` the home, that nobody
        else can write to; if this user cannot, there is a RuntimeWarning. `clear_cache` empties it.

    Returns
    -------
    Compiled
        The function; inputs and outputs are in the order of the graph's.

    Raises
    ------
    TypeError
        For what is no Graph, `fast` or `fma` that are neither True nor False, or a cache that is no path either.
    ValueError
        For an unknown backend.
    ImportError
        For "llvm" without llvmlite.
    RuntimeError
        For "llvm" where an operation is no function of the C library and its row has no instructions.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> f = cg.compile(cg.Graph([x, y], {"area": x * y}))
    >>> f([2.0, 3.0]).tolist(), f.batch([[1.0, 2.0], [3.0, 4.0]]).tolist()
    ([6.0], [[3.0, 8.0]])
    """
    require_choice("backend", backend, BACKENDS)
    require_graph("compile", graph)
    fast, fma = require_flag("fast", fast), require_flag("fma", fma)
    kept = cache_choice(cache)
    options = {"fast": fast, "fma": fma, "cache": kept}
    large = backend == "auto" and len(graph.nodes) > LARGE_GRAPH
    if large:
        warnings.warn(
            f"a graph of {len(graph.nodes)} nodes is compiled to generated Python, as it has more than {LARGE_GRAPH}; "
            "backend='llvm' makes machine code of it",
            RuntimeWarning,
            stacklevel=2,
        )
    if backend == "llvm" or (backend == "auto" and not large):
        try:
            ready = partial(NativeRunner, fast=fast, fma=fma, cache=cache_folder(kept))
            return Compiled(graph, backend, options, ready, ready)
        except (ImportError, MissingFunctionError):
            if backend == "llvm":
                raise
    in_python = partial(PythonRunner, fma=fma)
    return Compiled(graph, backend, options, in_python, partial(in_python, backend=backend))


def _unpickled(version: str, parts: bytes) -> Compiled:
    """The function of a pickle, its machine code made again; raises ValueError unless this version wrote it."""
    if version != __version__:
        problem = f"was pickled by cgraph {version}, and this is cgraph {__version__}"
        raise ValueError(f"a compiled graph {problem}: pickle the graph alone, or compile it again")
    graph, backend, options = pickle.loads(parts)  # noqa: S301 (a part of what pickle reads already)
    return compile(graph, backend, **options)
