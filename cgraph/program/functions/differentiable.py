"""Differentiable: the derivatives of a compiled graph, in vector lanes of directions and compressed by colors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ...autodiff.coloring import jacobian_coloring
from ...autodiff.direction_split import direction_split
from ...autodiff.jacobian_entries import entry_graph, written_sizes
from ...autodiff.products import forward_products, reverse_products
from ...autodiff.sparsity import Pattern, pattern, symmetric
from ...codegen.bound_call import bound
from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...core.graph import Graph
from ...core.node import Node, variable
from ...util.extras import scipy_module
from ...util.memory import require_memory, require_target
from ...util.require import require_flag
from ...util.threads import thread_count
from ..program import Program
from ..runners.runner import Runner
from .colored_matrix import ColoredMatrix, Derivative, MatrixPart, hessian_parts, jacobian_parts
from .direction_products import DirectionProducts

CHECK = 256  # operations that take as long as to look whether slopes are infinite
Made = TypeVar("Made")
Inputs = str | Node | Sequence[str | Node] | None
Ready = Callable[[Program], Runner]  # makes a program ready to run
Chosen = tuple[int, ...] | None  # the numbers of inputs; None for all
LANES = 8  # directions that count as one where colorings are compared, whatever the processor's vectors


def _once(make: Callable[[Any, Chosen], Made]) -> Callable[[Any, Chosen], Made]:
    """Method whose result for the chosen inputs is made once, by whichever thread asks first."""

    def made(self: Differentiable, chosen: Chosen) -> Made:
        key = make, chosen
        if key not in self._made:
            with self._making:
                if key not in self._made:
                    self._made[key] = make(self, chosen)
        found: Made = self._made[key]
        return found

    return made


class Differentiable:
    """A compiled graph y = f(x) that has derivatives at run time. All that they need is made at the first use.

    ready: makes a program ready to run in the same way.
    wrt: the inputs to differentiate by, in this order; by default all. Columns, directions and products with the
    transposed Jacobian are of these alone; x has all inputs.
    """

    lanes, vectors, vector_cost = 1, 1, 1  # as of a Runner

    def __init__(self, graph: Graph, ready: Ready) -> None:
        self.graph, self._ready = graph, ready
        self.n_in, self.n_out = len(graph.inputs), len(graph.outputs)
        self._made: dict[Hashable, Any] = {}  # derivatives and matrices
        self._making = threading.RLock()

    def _points(self, x: ArrayLike) -> Array:
        """The point, (n_in,), or points, (N, n_in), checked."""
        points = real_array("x", x)
        if points.shape != (self.n_in,) and (points.ndim != 2 or points.shape[1] != self.n_in):
            wanted = f"({self.n_in},), one value for each input, or (N, {self.n_in}), a point a row"
            raise GraphError(f"x must have shape {wanted}, got {points.shape}")
        return points

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
        chosen = self._chosen(wrt)
        return self._products(self._pushed, chosen, x, "X_dot", X_dot, (self._count(chosen), self.n_out), threads)

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
        chosen = self._chosen(wrt)
        return self._products(self._pulled, chosen, x, "Y_bar", Y_bar, (self.n_out, self._count(chosen)), threads)

    def jacobian(self, x: ArrayLike, *, wrt: Inputs = None, sparse: bool = False, threads: int | None = 1) -> Any:
        """The Jacobian dy_i/dx_j at x.

        Columns that share no row are one direction of a forward sweep, rows that share no column one of a reverse
        sweep, whichever costs less, or both: `cg.sparsity` tells the entries, greedy coloring the directions.

        Parameters
        ----------
        x : array_like, (n_in,) or (N, n_in)
            The point, or points, a row each, which lie side by side in vectors. Of points in columns, as `batch` takes
            them, it is `jacobian(X.T)`.
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
        return self._matrix(self._jacobian(self._chosen(wrt)), self._points(x), sparse, threads)

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
        matrix = self._hessian(self._chosen(wrt))
        return self._matrix(matrix, np.concatenate([points, weights], axis=-1), sparse, threads)

    def bind_jacobian(
        self, x: Array, values: Array, *, wrt: Inputs = None, threads: int | None = 1
    ) -> Callable[[], None]:
        """A function of nothing that reads x and writes the Jacobian: the fastest way to it.

        As for `bind`, the arrays are checked here and kept alive, and one thread at a time may call it. What is zero
        whatever x is set to zero here, and not touched by the function.

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
            For arrays that are not contiguous float64 of these shapes, or share memory, and for an input that is not
            there.

        Examples
        --------
        >>> import numpy as np
        >>> x, slopes = cg.variable("x"), np.empty((3, 1, 1))
        >>> cg.compile(cg.Graph([x], {"y": x * x})).bind_jacobian(np.array([[1.0], [2.0], [3.0]]), slopes)()
        >>> slopes.ravel().tolist()
        [2.0, 4.0, 6.0]
        """
        matrix, count = self._jacobian(self._chosen(wrt)), thread_count(threads)
        rows = x.shape[:1] if isinstance(x, np.ndarray) and x.ndim == 2 else ()
        require_memory("x", x, (*rows, self.n_in))
        require_memory("values", values, (*rows, *matrix.entries.shape), (*rows, len(matrix.entries.rows)))
        require_target("values", values, "x", x)
        values[...] = 0.0
        return bound(partial(matrix.write, x, values, count) if rows else matrix.bind(x, values))

    def _chosen(self, wrt: Inputs) -> Chosen:
        """The numbers of the inputs that `wrt` names."""
        if wrt is None:
            return None
        places = {node: k for k, node in enumerate(self.graph.inputs)}
        chosen = tuple([places[node] for node in self.graph.select_inputs(wrt)])
        return None if chosen == tuple(range(self.n_in)) else chosen

    def _count(self, chosen: Chosen) -> int:
        return self.n_in if chosen is None else len(chosen)

    def _products(
        self,
        along: Callable[[Chosen], DirectionProducts],
        chosen: Chosen,
        x: ArrayLike,
        name: str,
        directions: ArrayLike,
        shape: tuple[int, int],
        threads: int | None,
    ) -> Array:
        """shape: the numbers of entries of a direction and of a result."""
        points, rows = self._points(x), real_array(name, directions)
        count = threads if type(threads) is int and threads > 0 else thread_count(threads)
        if points.ndim == 2:
            return self._many_products(along, chosen, points, name, rows, shape, count)
        if rows.ndim not in (1, 2) or rows.shape[-1] != shape[0]:
            raise GraphError(f"{name} must have shape (k, {shape[0]}) or ({shape[0]},), got {rows.shape}")
        matrix = rows if rows.ndim == 2 else rows[None]
        result = np.empty((len(matrix), shape[1]))
        if not self.n_in:
            result[...] = 0.0
        elif result.size:
            along(chosen)(points, matrix, result)
        return result if rows.ndim == 2 else result[0]

    def _many_products(
        self,
        along: Callable[[Chosen], DirectionProducts],
        chosen: Chosen,
        points: Array,
        name: str,
        given: Array,
        shape: tuple[int, int],
        threads: int,
    ) -> Array:
        """Products at many points, of each along one direction or along as many as others."""
        count = len(points)
        if given.ndim == 1:
            given = np.broadcast_to(given, (count, *given.shape))
        if given.ndim not in (2, 3) or len(given) != count or given.shape[-1] != shape[0]:
            wanted = f"({count}, {shape[0]}), ({count}, k, {shape[0]}) or ({shape[0]},)"
            raise GraphError(f"{name} must have shape {wanted} for {count} points, got {given.shape}")
        result = np.zeros((*given.shape[:-1], shape[1]))
        if self.n_in and result.size:
            rows = (count, -1, given.shape[-1]), (count, -1, shape[1])
            along(chosen).many(points, given.reshape(rows[0]), result.reshape(rows[1]), threads)
        return result

    @_once
    def _pushed(self, chosen: Chosen) -> DirectionProducts:
        return DirectionProducts(self._forward(chosen), self._ready, self.lanes * self.vectors)

    @_once
    def _pulled(self, chosen: Chosen) -> DirectionProducts:
        return DirectionProducts(self._reverse(chosen), self._ready, self.lanes * self.vectors)

    def _matrix(self, matrix: ColoredMatrix, points: Array, sparse: bool, threads: int | None) -> Any:
        count = threads if type(threads) is int and threads > 0 else thread_count(threads)
        if not require_flag("sparse", sparse):
            return matrix.values(points, dense=True) if points.ndim == 1 else matrix.many(points, True, count)
        module, (columns, starts) = scipy_module("sparse", "a sparse derivative"), matrix.compressed
        rows = matrix.many(points, False, count) if points.ndim == 2 else [matrix.values(points, dense=False)]
        found = [module.csr_array((row, columns.copy(), starts.copy()), shape=matrix.entries.shape) for row in rows]
        return found if points.ndim == 2 else found[0]

    @_once
    def _jacobian(self, chosen: Chosen) -> ColoredMatrix:
        graph, wrt = self._numbered(chosen)
        entries = pattern(graph, wrt)
        if not len(entries.rows):
            return self._colored(entries, [], self.n_in)
        coloring = jacobian_coloring(entries, LANES)
        once, columns, rows = written_sizes(graph, wrt)
        if min(columns, rows) <= once * coloring.vectors(LANES) * self.vector_cost:
            return self._colored(entries, entry_graph(graph, wrt, entries, rows < columns), self.n_in)
        derivatives = partial(self._forward, chosen), partial(self._reverse, chosen)
        return self._colored(entries, jacobian_parts(entries, coloring, *derivatives), self.n_in)

    def _colored(self, entries: Pattern, source: Graph | Sequence[MatrixPart], points: int) -> ColoredMatrix:
        return ColoredMatrix(entries, source, points, self.lanes, self._ready)

    @_once
    def _hessian(self, chosen: Chosen) -> ColoredMatrix:
        if not self.n_in:  # and no cotangents, which would be the outputs of the reverse mode
            nothing = np.zeros(0, dtype=np.int64)
            return self._colored(Pattern(nothing, nothing, (0, 0)), [], self.n_out)
        graph, wrt = self._numbered(chosen)
        entries = symmetric(pattern(reverse_products(graph, wrt, zero_wins=False), wrt))
        derivative = _guarded(partial(_second_products, graph, wrt), len(wrt))
        return self._colored(entries, hessian_parts(entries, derivative), self.n_in + self.n_out)

    @_once
    def _forward(self, chosen: Chosen) -> Derivative:
        graph, wrt = self._numbered(chosen)
        return _guarded(partial(forward_products, graph, wrt), len(wrt))

    @_once
    def _reverse(self, chosen: Chosen) -> Derivative:
        graph, wrt = self._numbered(chosen)
        return _guarded(partial(reverse_products, graph, wrt), self.n_out)

    def _numbered(self, chosen: Chosen) -> tuple[Graph, tuple[Node, ...]]:
        """The graph with numbers for names, and the chosen inputs: the longest name has no room for a suffix."""
        graph = self._graph(None)
        return graph, graph.inputs if chosen is None else tuple([graph.inputs[k] for k in chosen])

    @_once
    def _graph(self, _: Chosen) -> Graph:
        inputs = [variable(f"x{k}") for k in range(self.n_in)]
        return Graph(inputs, {f"y{k}": node for k, node in enumerate(self.graph(*inputs).values())})


def _guarded(derive: Callable[..., Graph], directions: int) -> Derivative:
    """The derivative in which zeros win over infinite slopes; where that takes long, only where there are such."""
    plain = direction_split(derive(zero_wins=False), directions, divide=False)
    guarded = direction_split(derive(zero_wins=True), directions)
    saved = len(guarded.linear.nodes) - len(plain.linear.nodes)
    return Derivative(plain, guarded) if saved > CHECK else Derivative(guarded)


def _second_products(graph: Graph, wrt: Sequence[Node], *, zero_wins: bool) -> Graph:
    """x, y_bar, x_dot -> the Hessian of y_bar . y times x_dot."""
    reverse = reverse_products(graph, wrt, zero_wins=zero_wins)
    return forward_products(reverse, wrt, zero_wins=zero_wins)
