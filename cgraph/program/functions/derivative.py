"""Derivatives of a compiled graph as programs: products along directions, and matrices by few of them, colored."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from operator import add
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...autodiff.coloring import NONE, jacobian_coloring, star_coloring
from ...autodiff.products import DirectionSplit, direction_split, forward_products, reverse_products
from ...autodiff.sparsity import Indices, Indices32, Pattern, entry_graph, full, pattern, symmetric, written_sizes
from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...core.graph import Graph
from ...core.node import Node, variable
from ...util.caches import made_once
from ...util.memory import aligned
from ...util.threads import write_batch
from ...util.words import listed
from ..program import Program
from ..runners.native_runner import NativeRunner
from ..runners.python_runner import PythonRunner
from ..statement import Names, Statement
from ..statements.call import Call, Map
from ..statements.matrix import Scatter

AnyRunner = NativeRunner | PythonRunner
Ready = Callable[[Program], AnyRunner]  # makes a program ready to run
Chosen = tuple[int, ...] | None  # the numbers of inputs; None for all
CHECK = 256  # operations that take as long as to look whether slopes are infinite
DIVISION = 8  # operations that take as long as a division
LANES = 8  # directions that count as one where colorings are compared, whatever the processor's vectors
LEAST_BLOCK = 64  # points in a block, a multiple of every processor's vectors
Bind = Callable[[Array, Array], Callable[[], None]]  # x, y -> a function of nothing
_Buffers = tuple[Any, Array, memoryview, Callable[[], None]]  # memory of x; y, as an array and as memory; the call


class BoundFunction:
    """A function of n_in numbers that gives an array of some shape; any number of threads may call it at once."""

    def __init__(self, bind: Bind, n_in: int, shape: tuple[int, ...], names: Sequence[str] = ()) -> None:
        """bind: its calls may leave zeros of y as they are.  names: of the inputs, for errors."""
        self._bind, self._sizes, self._names = bind, (n_in, shape), names
        self._free: list[_Buffers] = []  # pop and append are atomic: no lock, and a call inside a call is safe
        self._pack, self._unpack = Struct(f"{n_in}d").pack_into, Struct(f"{math.prod(shape)}d").unpack_from

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point, through buffers that a call at a time has for itself."""
        buffers = self._take()
        x_memory, y, _, run = buffers
        point = x if type(x) is np.ndarray else self._point(x)
        try:
            x_memory[:] = point  # compares shape and type, and copies: quicker than to look at them first
        except ValueError:
            x_memory[:] = self._point(point).copy()
        run()
        result = y.copy()
        self._free.append(buffers)
        return result

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats."""
        buffers = self._take()
        x_memory, _, y_memory, run = buffers
        self._pack(x_memory, 0, *x)
        run()
        result = self._unpack(y_memory)
        self._free.append(buffers)
        return result

    def _take(self) -> _Buffers:
        try:
            return self._free.pop()
        except IndexError:
            x, y = np.empty(self._sizes[0]), np.zeros(self._sizes[1])
            return x.data, y, y.data, self._bind(x, y)

    def _point(self, x: ArrayLike) -> Array:
        point, n_in = real_array("x", x), self._sizes[0]
        if point.shape != (n_in,):
            these = f" ({listed(self._names)})" if self._names else ""
            raise GraphError(f"x must have shape ({n_in},), one value for each input{these}, got {point.shape}")
        return point


class Derivative(NamedTuple):
    """A derivative along directions. Where an entry of a direction is zero, an infinite slope counts for nothing.

    guarded: the split that looks at entries, if that is much longer: it runs only where a result is infinite or NaN.
    """

    split: DirectionSplit
    guarded: DirectionSplit | None = None

    def products(
        self, results: str, count: int, k: int = 0, asked: Names = (), *, checked: bool
    ) -> tuple[list[Statement], dict[str, int]]:
        """Statements from x, along `count` directions s, to a register of results, and their registers, numbered k.

        checked: a register `check` is NaN for a direction of which a result is infinite or NaN, else 0.
        """
        (primal, linear), s, p, check = self.split, f"s{k}", f"p{k}", f"check{k}"
        registers = {"x": len(primal.inputs), p: len(primal.outputs)} | ({check: count} if checked else {})
        registers |= {s: self.split.directions * count, results: len(linear.outputs) * count}
        statements: list[Statement] = [Call(primal, ("x",), (p,)), Map(linear, (s,), (results,), (p,), asked)]
        if checked:
            values = [variable(f"v{k}") for k in range(len(linear.outputs))]
            terms = [value - value for value in values]
            while len(terms) > 1:  # in pairs, which do not wait for each other
                terms = [*map(add, terms[::2], terms[1::2]), *terms[len(terms) & ~1 :]]
            statements.append(Map(Graph(values, {"nonfinite": terms[0]}), (results,), (check,), (), asked))
        return statements, registers


def _mend(values: Array, write: Callable[[Indices, Array], None]) -> None:
    """Write the values of points anew, by a split in which zeros win, where some are infinite or NaN."""
    wrong = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if len(wrong):
        found = values[wrong]
        write(wrong, found)
        values[wrong] = found


class DirectionProducts:
    """Writer of products along directions, `block` of them at a time; any number of threads may call it at once."""

    def __init__(self, derivative: Derivative, ready: Ready, block: int) -> None:
        self._derivative, self._ready, self._block = derivative, ready, block
        body, registers = derivative.products("y", block, 0, ("asked",), checked=derivative.guarded is not None)
        self._runner = ready(Program({**registers, "asked": 1}, body, ["y"]))
        self._free: list[tuple[Any, ...]] = []  # buffers of a call at a time; pop and append are atomic

    def write(self, points: Array, directions: Array, results: Array, threads: int) -> None:
        """The results (k, m) along directions (k, d) at a point (n,), or of points (N, n): (N, k, m), (N, k, d)."""
        if points.ndim == 1 and len(directions) <= self._block:
            self._write_block(points, directions, results)
        elif points.ndim == 1:
            for start in range(0, len(directions), self._block):  # between blocks, Ctrl-C is heard
                here = slice(start, start + self._block)
                self._write_block(points, directions[here], results[here])
        else:
            count, n = directions.shape[1], points.shape[1]
            rows = np.empty((len(points), count, n + directions.shape[2]))
            rows[:, :, :n], rows[:, :, n:] = points[:, None], directions
            found = results.reshape(-1, results.shape[2])
            write_batch(*self._beside.columns("x"), rows.reshape(-1, rows.shape[2]).T, found.T, threads)
            if self._derivative.guarded is not None:
                _mend(results, lambda at, found: self._careful.write(points[at], directions[at], found, threads))

    @cached_property
    def _beside(self) -> AnyRunner:
        """Runner of a point and one direction, as one register, for many of these side by side."""
        primal, linear = self._derivative.split
        seeds = linear.inputs[len(primal.outputs) :]
        whole = Graph([*primal.inputs, *seeds], linear(*primal.outputs.values(), *seeds))
        registers = {"x": len(whole.inputs), "y": len(whole.outputs)}
        return self._ready(Program(registers, [Call(whole, ("x",), ("y",))], ["y"]))

    @cached_property
    def _careful(self) -> DirectionProducts:
        return DirectionProducts(
            Derivative(self._derivative.guarded or self._derivative.split), self._ready, self._block
        )

    def _write_block(self, x: Array, directions: Array, result: Array) -> None:
        try:
            buffers = self._free.pop()
        except IndexError:
            lengths = self._runner.program.registers
            point, y = np.empty(lengths["x"]), aligned(lengths["y"])
            run, registers = self._runner.bind_pass(("x", point), ("y", y))
            columns = [each.reshape(-1, self._block) for each in (registers["s0"], y)]
            check = registers["check0"].data.cast("B") if "check0" in registers else None
            buffers = point.data, *columns, registers["asked"].data, check, run
        x_memory, seeds, results, asked, check, run = buffers
        count = len(directions)
        x_memory[:] = x
        seeds[:, :count] = directions.T
        asked[0] = count
        run()
        result[...] = results[:, :count].T
        finite = check is None or check[: 8 * count].tobytes() == bytes(8 * count)  # zeros, but for NaN
        self._free.append(buffers)
        if not finite:
            self._careful.write(x, directions, result, 1)


class MatrixPart(NamedTuple):
    """Entries that one derivative along sums of unit vectors gives."""

    derivative: Derivative
    colors: Indices  # of each unit vector the sum that it is in
    color: Indices  # of each entry its sum
    result: Indices  # of each entry its number in the results of that sum
    entries: Indices  # their numbers in the pattern

    def directions(self, lanes: int) -> int:
        """Number of directions, filled up to whole vectors."""
        return -(-int(self.colors.max() + 1) // lanes) * lanes


Source = Graph | Sequence[MatrixPart]


class ColoredMatrix:
    """A matrix of these entries that a graph, or parts, give at points of `size` numbers, for any number of threads."""

    def __init__(self, entries: Pattern, source: Source, size: int, lanes: int, ready: Ready) -> None:
        self.entries, self._source, self._size = entries, source, size
        self._parts = () if isinstance(source, Graph) else source
        self._lanes, self._ready, self._full = lanes, ready, full(entries)
        self._directions = sum([part.directions(1) for part in self._parts])
        self._checks = [f"check{k}" for k, part in enumerate(self._parts) if part.derivative.guarded is not None]
        self._functions = [BoundFunction(self.bind, size, shape) for shape in (entries.rows.shape, entries.shape)]

    @cached_property
    def compressed(self) -> tuple[Indices32, Indices32]:
        """The columns and the starts of rows, see `Pattern.compressed`."""
        return self.entries.compressed()

    def at(self, x: Array, dense: bool, threads: int = 1) -> Array:
        """The entries, or with `dense` the whole matrix, at a point, or at each of points (N, n)."""
        if x.ndim == 1:
            return self._functions[dense](x)
        values = np.empty((len(x), *(self.entries.shape if dense else self.entries.rows.shape)))
        self.write(x, values, threads)
        return values

    def bind(self, x: Array, values: Array) -> Callable[[], None]:
        """A function of nothing that reads x and writes the values: entries, (count,), or into a matrix of zeros."""
        runner = self._runner(values.ndim == 2 and not self._full, self._lanes)
        run, registers = runner.bind_pass(("x", x), ("y", values))
        for name, seeds in self._seeds(self._lanes).items():
            registers[name][:] = seeds
        checks = [(registers[name].data.cast("B"), bytes(registers[name].nbytes)) for name in self._checks]

        def mended() -> None:
            run()
            for check, zeros in checks:
                if check.tobytes() != zeros:
                    self._careful.bind(x, values)()

        return mended if checks else run

    def write(self, points: Array, values: Array, threads: int) -> None:
        """The values at points (N, n), which lie side by side in vectors: entries (N, count), or matrices (N, m, n)."""
        if not len(self.entries.rows) or not len(points):
            values[...] = 0.0
            return
        width, columns = self._runner(values.ndim == 3 and not self._full, 1).columns("x", self._seeds)
        width //= 1 + self._directions
        rows = values.reshape(len(points), -1)
        write_batch(max(width // LEAST_BLOCK, 1) * LEAST_BLOCK, columns, points.T, rows.T, threads)
        if self._checks:
            _mend(values, lambda at, found: self._careful.write(points[at], found, threads))

    @cached_property
    def _careful(self) -> ColoredMatrix:
        careful = [Derivative(part.derivative.guarded or part.derivative.split) for part in self._parts]
        parts = [part._replace(derivative=each) for part, each in zip(self._parts, careful, strict=True)]
        return ColoredMatrix(self.entries, parts, self._size, self._lanes, self._ready)

    def _seeds(self, lanes: int = 1) -> dict[str, Array]:
        """The sum of unit vectors of each color, a column each, in the registers of directions."""
        parts = enumerate(self._parts)
        return {f"s{k}": 1.0 * (each.colors[:, None] == range(each.directions(lanes))).ravel() for k, each in parts}

    @made_once
    def _runner(self, dense: bool, lanes: int) -> AnyRunner:
        """Runner of x -> y, the entries, or with `dense` the whole matrix; directions in vectors of so many lanes."""
        (m, n), count = self.entries.shape, len(self.entries.rows)
        places = self.entries.rows * n + self.entries.columns if dense else np.arange(count)
        registers, statements = {"x": self._size, "y": m * n if dense else count}, list[Statement]()
        if isinstance(self._source, Graph):
            statements.append(Call(self._source, ("x",), ("e",) if dense else ("y",)))
            if dense:
                registers["e"] = count
                statements.append(Scatter("e", "y", tuple(range(count)), tuple(places.tolist())))
        for k, part in enumerate(self._parts):
            directions = part.directions(lanes)
            checked = f"check{k}" in self._checks and lanes > 1  # side by side the entries are looked at
            more, lengths = part.derivative.products(f"t{k}", directions, k, checked=checked)
            sources, targets = part.result * directions + part.color, places[part.entries]
            statements += [*more, Scatter(f"t{k}", "y", tuple(sources.tolist()), tuple(targets.tolist()))]
            registers |= lengths
        return self._ready(Program(registers, statements, ["y"]))


class Derivatives:
    """The derivatives of a graph, which the runner runs, by chosen inputs; programs are made ready in the same way."""

    def __init__(self, graph: Graph, ready: Ready, runner: AnyRunner) -> None:
        self._original, self._ready, self._size = graph, ready, len(graph.inputs)
        self._lanes, self._block, self.vector_cost = runner.lanes, runner.lanes * runner.vectors, runner.vector_cost

    @made_once
    def products(self, chosen: Chosen, reverse: bool) -> DirectionProducts:
        """J x_dot, or with `reverse` J^T y_bar."""
        return DirectionProducts(self._derivative(chosen, reverse), self._ready, self._block)

    @made_once
    def jacobian(self, chosen: Chosen) -> ColoredMatrix:
        """The Jacobian, from whichever sweeps cost less."""
        entries = pattern(self._graph, self._wrt(chosen))
        source = self._jacobian_source(entries, chosen) if len(entries.rows) else ()
        return ColoredMatrix(entries, source, self._size, self._lanes, self._ready)

    def _jacobian_source(self, entries: Pattern, chosen: Chosen) -> Source:
        wrt, coloring = self._wrt(chosen), jacobian_coloring(entries, LANES)
        once, columns, rows = written_sizes(self._graph, wrt)
        if min(columns, rows) <= once * coloring.vectors(LANES) * self.vector_cost:
            return entry_graph(self._graph, wrt, entries, rows < columns)
        parts = []
        for reverse, colors, mine, keys, others in (  # forward along sums of columns, reverse along sums of rows
            (False, coloring.columns, ~coloring.by_row, entries.columns, entries.rows),
            (True, coloring.rows, coloring.by_row, entries.rows, entries.columns),
        ):
            if len(which := np.flatnonzero(mine)):
                each = np.array(colors)
                color = each[keys[which]]
                parts.append(MatrixPart(self._derivative(chosen, reverse), each, color, others[which], which))
        return parts

    @made_once
    def hessian(self, chosen: Chosen) -> ColoredMatrix:
        """The Hessian of y_bar . y, of points (x, y_bar), symmetric, by products with sums of its columns."""
        wrt, nothing = self._wrt(chosen), np.zeros(0, dtype=np.int64)
        entries, parts = Pattern(nothing, nothing, (0, 0)), list[MatrixPart]()
        if wrt:  # without, cotangents would be the outputs of the reverse mode
            entries = symmetric(pattern(reverse_products(self._graph, wrt, zero_wins=False), wrt))
        if len(entries.rows):
            colors = np.array(star_coloring(entries), dtype=np.int64)
            count = int(colors.max(initial=NONE)) + 1
            rows, columns = np.maximum(entries.rows, entries.columns), np.minimum(entries.rows, entries.columns)
            company = np.bincount(
                entries.rows * count + colors[entries.columns], minlength=len(wrt) * count
            )  # in a row
            alone = company[rows * count + colors[columns]] == 1
            row, color = np.where(alone, rows, columns), np.where(alone, colors[columns], colors[rows])

            def second(*, zero_wins: bool) -> Graph:
                reverse = reverse_products(self._graph, wrt, zero_wins=zero_wins)
                return forward_products(reverse, wrt, zero_wins=zero_wins)

            derivative = _derivative_of(second, len(wrt))
            parts.append(MatrixPart(derivative, colors, color, row, np.arange(len(row))))
        return ColoredMatrix(entries, parts, self._size + len(self._graph.outputs), self._lanes, self._ready)

    @made_once
    def _derivative(self, chosen: Chosen, reverse: bool) -> Derivative:
        wrt, products = self._wrt(chosen), reverse_products if reverse else forward_products
        return _derivative_of(partial(products, self._graph, wrt), len(self._graph.outputs if reverse else wrt))

    @cached_property
    def _graph(self) -> Graph:
        """The graph with numbers for names: the longest name has no room for a suffix."""
        inputs = [variable(f"x{k}") for k in range(self._size)]
        return Graph(inputs, {f"y{k}": node for k, node in enumerate(self._original(*inputs).values())})

    def _wrt(self, chosen: Chosen) -> tuple[Node, ...]:
        return self._graph.inputs if chosen is None else tuple([self._graph.inputs[k] for k in chosen])


def _cost(graph: Graph) -> int:
    """The operations of a graph, a division counted as several."""
    counts = graph.counts()
    return counts.nodes + (DIVISION - 1) * counts.by_operation.get("div", 0)


def _derivative_of(derive: Callable[..., Graph], directions: int) -> Derivative:
    """The derivative in which zeros win over infinite slopes; where that takes long, only where there are such."""
    plain = direction_split(derive(zero_wins=False), directions, divide=False)
    guarded = direction_split(derive(zero_wins=True), directions)
    saved = _cost(guarded.linear) - _cost(plain.linear)
    return Derivative(plain, guarded) if saved > CHECK else Derivative(guarded)
