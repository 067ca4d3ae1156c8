"""Differentiable: the derivatives of a compiled graph, in vector lanes of directions and compressed by colors."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
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
from ...core.evaluation import Array
from ...core.graph import Graph
from ...core.node import Node, variable
from ...util.memory import require_memory, require_target
from ...util.real_arrays import real_array
from ...util.require import require_flag
from ...util.scipy_modules import scipy_module
from ..program import Program
from ..runners.runner import Runner
from .colored_matrix import ColoredMatrix, Derivative, Part, hessian_parts, jacobian_parts
from .direction_products import DirectionProducts

CHECK = 256  # operations that take as long as to look whether slopes are infinite
Made = TypeVar("Made")
Inputs = str | Node | Sequence[str | Node] | None
Chosen = tuple[int, ...] | None  # the numbers of inputs; None for all
LANES = 8  # directions that count as one where colorings are compared, whatever the processor's vectors


class Differentiable(ABC):
    """A compiled graph y = f(x) that has derivatives at run time. All that they need is made at the first use.

    wrt: the inputs to differentiate by, in this order; by default all. Columns, directions and products with the
    transposed Jacobian are of these alone; x has all inputs.
    """

    graph: Graph
    n_in: int
    n_out: int
    lanes, tiles = LANES, 512  # directions in a tile, and tiles in a block of them
    vector_cost = 1  # of an operation on a vector of directions, in operations on numbers

    def __init__(self) -> None:
        self._made: dict[Hashable, Any] = {}  # derivatives and matrices
        self._making = threading.RLock()

    @abstractmethod
    def _ready(self, program: Program) -> Runner:
        """A program made ready to run in the same way."""

    @abstractmethod
    def _point(self, x: ArrayLike) -> Array:
        """The point, checked."""

    def jvp(self, x: ArrayLike, X_dot: ArrayLike, *, wrt: Inputs = None) -> Array:
        """Products y_dot = J x_dot of the Jacobian at x with directions, side by side in vectors: forward mode.

        X_dot: (k, n_in), a direction a row; the result is (k, n_out). Of one direction, (n_in,), it is (n_out,). An
        entry of x_dot that is zero counts for nothing, also where an operation has no slope in it; times a factor that
        is infinite or NaN it is NaN.
        wrt: the inputs to differentiate by, n_in of them; by default all.
        Raises GraphError for another shape, or an input that is not there.
        """
        chosen = self._chosen(wrt)
        return self._products(self._forward, chosen, x, "X_dot", X_dot, (self._count(chosen), self.n_out))

    def vjp(self, x: ArrayLike, Y_bar: ArrayLike, *, wrt: Inputs = None) -> Array:
        """Products x_bar = J^T y_bar of the transposed Jacobian at x with cotangents, side by side: reverse mode.

        Y_bar: (k, n_out), a cotangent a row; the result is (k, n_in). Of one cotangent, (n_out,), it is (n_in,).
        wrt: the inputs to differentiate by, n_in of them; by default all.
        Raises GraphError for another shape, or an input that is not there.
        """
        chosen = self._chosen(wrt)
        return self._products(self._reverse, chosen, x, "Y_bar", Y_bar, (self.n_out, self._count(chosen)))

    def jacobian(self, x: ArrayLike, *, wrt: Inputs = None, sparse: bool = False) -> Any:
        """The Jacobian dy_i/dx_j at x, (n_out, n_in).

        Columns that share no row are one direction of a forward sweep, rows that share no column one of a reverse
        sweep, whichever costs less, or both: `cg.sparsity` tells the entries, greedy coloring the directions.
        wrt: the inputs to differentiate by, n_in of them; by default all. With displacements as inputs, a quaternion
        q + G(q) xi, the columns of these at xi = 0 are those of displacements.
        sparse: give a scipy.sparse.csr_array with the entries of `cg.sparsity`.
        Raises GraphError for another shape, or an input that is not there; ImportError with `sparse` without SciPy.
        """
        return self._matrix(self._jacobian(self._chosen(wrt)), self._point(x), sparse)

    def hessian(self, x: ArrayLike, y_bar: ArrayLike | None = None, *, wrt: Inputs = None, sparse: bool = False) -> Any:
        """The Hessian of y_bar . y at x, (n_in, n_in): forward sweeps over the reverse one, never a tensor.

        Columns are compressed by a star coloring, which reads an entry or its mirror image.
        y_bar: (n_out,), the weights of the outputs; not needed for one output.
        wrt: the inputs to differentiate by, n_in of them; by default all.
        sparse: give a scipy.sparse.csr_array.
        Raises GraphError for another shape, or an input that is not there; ImportError with `sparse` without SciPy.
        """
        if y_bar is None and self.n_out != 1:
            raise GraphError(f"hessian needs y_bar, the weights of the {self.n_out} outputs")
        weights = real_array("y_bar", [1.0] if y_bar is None else y_bar)
        if weights.shape != (self.n_out,):
            raise GraphError(f"y_bar must have shape ({self.n_out},), one weight for each output, got {weights.shape}")
        matrix = self._hessian(self._chosen(wrt))
        return self._matrix(matrix, np.concatenate([self._point(x), weights]), sparse)

    def bind_jacobian(self, x: Array, values: Array, *, wrt: Inputs = None) -> Callable[[], None]:
        """A function of nothing that reads x, (n_in,), and writes the Jacobian: the fastest way to it.

        values: (n_out, n_in), or one number for each entry of `cg.sparsity`, row by row. What is zero whatever x is set
        to zero here, and not touched by the function. As for `bind`, the arrays are checked here and kept alive, and
        one thread at a time may call it.
        wrt: the inputs to differentiate by, as many as `values` has columns; by default all.
        Raises GraphError for arrays that are not contiguous float64 of these shapes, or share memory, and for an input
        that is not there.
        """
        matrix = self._jacobian(self._chosen(wrt))
        count = len(matrix.entries.rows)
        require_memory("x", x, (self.n_in,))
        require_memory("values", values, matrix.entries.shape, (count,))
        require_target("values", values, "x", x)
        values[...] = 0.0
        return bound(matrix.bind(x, values))

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
        derivative: Callable[[Chosen], Derivative],
        chosen: Chosen,
        x: ArrayLike,
        name: str,
        directions: ArrayLike,
        shape: tuple[int, int],
    ) -> Array:
        """shape: the numbers of entries of a direction and of a result."""
        point, rows = self._point(x), real_array(name, directions)
        if rows.ndim not in (1, 2) or rows.shape[-1] != shape[0]:
            raise GraphError(f"{name} must have shape (k, {shape[0]}) or ({shape[0]},), got {rows.shape}")
        matrix = rows if rows.ndim == 2 else rows[None]
        result = np.empty((len(matrix), shape[1]))
        if not self.n_in:
            result[...] = 0.0
        elif result.size:
            self._once(name, chosen, lambda _: self._along(derivative(chosen)))(point, matrix, result)
        return result if rows.ndim == 2 else result[0]

    def _along(self, derivative: Derivative) -> DirectionProducts:
        return DirectionProducts(derivative, self._ready, self.lanes, self.tiles)

    def _matrix(self, matrix: ColoredMatrix, point: Array, sparse: bool) -> Any:
        if not require_flag("sparse", sparse):
            return matrix.values(point, dense=True)
        module, (columns, starts) = scipy_module("sparse", "a sparse derivative"), matrix.compressed
        values = matrix.values(point, dense=False)
        return module.csr_array((values, columns.copy(), starts.copy()), shape=matrix.entries.shape)

    def _jacobian(self, chosen: Chosen) -> ColoredMatrix:
        return self._once("jacobian", chosen, self._make_jacobian)

    def _make_jacobian(self, chosen: Chosen) -> ColoredMatrix:
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

    def _colored(self, entries: Pattern, source: Graph | Sequence[Part], points: int) -> ColoredMatrix:
        return ColoredMatrix(entries, source, points, self.lanes, self._ready)

    def _hessian(self, chosen: Chosen) -> ColoredMatrix:
        return self._once("hessian", chosen, self._make_hessian)

    def _make_hessian(self, chosen: Chosen) -> ColoredMatrix:
        if not self.n_in:  # and no cotangents, which would be the outputs of the reverse mode
            nothing = np.zeros(0, dtype=np.int64)
            return self._colored(Pattern(nothing, nothing, (0, 0)), [], self.n_out)
        graph, wrt = self._numbered(chosen)
        entries = symmetric(pattern(reverse_products(graph, wrt, zero_wins=False), wrt))
        derivative = _guarded(partial(_second_products, graph, wrt), len(wrt))
        return self._colored(entries, hessian_parts(entries, derivative), self.n_in + self.n_out)

    def _forward(self, chosen: Chosen) -> Derivative:
        return self._once("forward", chosen, self._make_forward)

    def _make_forward(self, chosen: Chosen) -> Derivative:
        graph, wrt = self._numbered(chosen)
        return _guarded(partial(forward_products, graph, wrt), len(wrt))

    def _reverse(self, chosen: Chosen) -> Derivative:
        return self._once("reverse", chosen, self._make_reverse)

    def _make_reverse(self, chosen: Chosen) -> Derivative:
        graph, wrt = self._numbered(chosen)
        return _guarded(partial(reverse_products, graph, wrt), self.n_out)

    def _numbered(self, chosen: Chosen) -> tuple[Graph, tuple[Node, ...]]:
        """The graph with numbers for names, and the chosen inputs: the longest name has no room for a suffix."""
        graph = self._once("graph", None, self._make_numbered)
        return graph, graph.inputs if chosen is None else tuple([graph.inputs[k] for k in chosen])

    def _make_numbered(self, _: Chosen) -> Graph:
        inputs = [variable(f"x{k}") for k in range(self.n_in)]
        return Graph(inputs, {f"y{k}": node for k, node in enumerate(self.graph(*inputs).values())})

    def _once(self, name: str, chosen: Chosen, make: Callable[[Chosen], Made]) -> Made:
        """What `make` gives of the chosen inputs, made once, by whichever thread asks first."""
        key = name, chosen
        if key not in self._made:
            with self._making:
                if key not in self._made:
                    self._made[key] = make(chosen)
        made: Made = self._made[key]
        return made


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
