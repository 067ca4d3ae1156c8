"""Derivatives of a compiled graph as programs: products along directions, and matrices by few of them, colored."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from ...autodiff.coloring import NONE, jacobian_coloring, star_coloring
from ...autodiff.direction_split import DirectionSplit, direction_split
from ...autodiff.jacobian_entries import entry_graph, written_sizes
from ...autodiff.products import forward_products, reverse_products
from ...autodiff.sparsity import Indices, Indices32, Pattern, full, pattern, symmetric
from ...core.evaluation import Array
from ...core.graph import Graph
from ...core.node import Node, as_node, variable
from ...util.caches import made_once
from ...util.memory import aligned
from ...util.threads import write_batch
from ..fuse import applied
from ..program import Program
from ..runners.runner import Runner
from ..statement import Names, Statement
from ..statements.call import Call, Map
from ..statements.matrix import Scatter
from .bound_function import BoundFunction

Ready = Callable[[Program], Runner]  # makes a program ready to run
Chosen = tuple[int, ...] | None  # the numbers of inputs; None for all
CHECK = 256  # operations that take as long as to look whether slopes are infinite
LANES = 8  # directions that count as one where colorings are compared, whatever the processor's vectors
LEAST_BLOCK = 64  # points in a block, a multiple of every processor's vectors
LARGE_MATRIX = 2**16  # numbers in a matrix, of which no copy is kept for another call


class Derivative(NamedTuple):
    """A derivative along directions. Where an entry of a direction is zero, an infinite slope counts for nothing.

    To look at the entries makes the directions' part longer, of second derivatives by a half. With `guarded`, the split
    that does, the other one need not: `guarded` runs only where a result is infinite or NaN, and elsewhere it would
    give the same.
    """

    split: DirectionSplit
    guarded: DirectionSplit | None = None

    @property
    def careful(self) -> Derivative:
        """The one whose results are right wherever slopes are infinite."""
        return Derivative(self.guarded or self.split)

    def products(
        self, results: str, count: int, k: int = 0, asked: Names = (), *, checked: bool
    ) -> tuple[list[Statement], dict[str, int]]:
        """Statements that write a register of results, of the point x along `count` directions s, and their registers.

        k: a number behind the names of their registers.  checked: a register `check` is NaN for a direction of which a
        result is infinite or NaN, else 0.
        """
        (primal, linear), s, p, check = self.split, f"s{k}", f"p{k}", f"check{k}"
        registers = {"x": len(primal.inputs), p: len(primal.outputs)} | ({check: count} if checked else {})
        registers |= {s: self.split.directions * count, results: len(linear.outputs) * count}
        statements: list[Statement] = [Call(primal, ("x",), (p,)), Map(linear, (s,), (results,), (p,), asked)]
        if checked:
            statements.append(Map(_nonfinite(len(linear.outputs)), (results,), (check,), (), asked))
        return statements, registers


def _nonfinite(count: int) -> Graph:
    """0, or NaN where one of so many numbers is infinite or NaN."""
    values = [variable(f"v{k}") for k in range(count)]
    terms = [value - value for value in values] or [as_node(0.0)]
    while len(terms) > 1:  # in pairs, which do not wait for each other
        terms = [*[a + b for a, b in zip(terms[::2], terms[1::2], strict=False)], *terms[len(terms) & ~1 :]]
    return Graph(values, {"nonfinite": terms[0]})


def _mend(values: Array, write: Callable[[Indices, Array], None]) -> None:
    """Write the values of points anew, by a split in which zeros win, where some are infinite or NaN."""
    wrong = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if len(wrong):
        found = values[wrong]
        write(wrong, found)
        values[wrong] = found


class DirectionProducts:
    """Writer of products along directions; any number of threads may call it at once.

    block: directions at a time, in whole vectors.
    """

    def __init__(self, derivative: Derivative, ready: Ready, block: int) -> None:
        self._derivative, self._ready, self._block = derivative, ready, block
        body, registers = derivative.products("y", block, 0, ("asked",), checked=derivative.guarded is not None)
        self._runner = ready(Program({**registers, "asked": 1}, body, ["y"]))
        self._free: list[tuple[Any, ...]] = []  # buffers of a call at a time; pop and append are atomic

    def at(self, x: Array, directions: Array, result: Array) -> None:
        """The results, (k, results), along directions, (k, entries), at a point."""
        if len(directions) <= self._block:
            self._write_block(x, directions, result)
            return
        for start in range(0, len(directions), self._block):  # between blocks, Ctrl-C is heard
            here = slice(start, start + self._block)
            self._write_block(x, directions[here], result[here])

    def many(self, points: Array, directions: Array, results: Array, threads: int) -> None:
        """The results, (N, k, results), of N points, each along k directions of its own, (N, k, entries)."""
        count, n = directions.shape[1], points.shape[1]
        rows = np.empty((len(points), count, n + directions.shape[2]))
        rows[:, :, :n], rows[:, :, n:] = points[:, None], directions
        found = results.reshape(-1, results.shape[2])
        write_batch(*self._beside.columns("x"), rows.reshape(-1, rows.shape[2]).T, found.T, threads)
        if self._derivative.guarded is not None:
            _mend(results, lambda at, found: self._careful.many(points[at], directions[at], found, threads))

    @cached_property
    def _beside(self) -> Runner:
        """Runner of a point and one direction, as one register, for many of these side by side."""
        primal, linear = self._derivative.split
        seeds = linear.inputs[len(primal.outputs) :]
        outputs = applied(linear, [*applied(primal, primal.inputs), *seeds])
        whole = Graph([*primal.inputs, *seeds], {f"{k}": node for k, node in enumerate(outputs)})
        registers = {"x": len(whole.inputs), "y": len(whole.outputs)}
        return self._ready(Program(registers, [Call(whole, ("x",), ("y",))], ["y"]))

    @cached_property
    def _careful(self) -> DirectionProducts:
        """Products by the split in which zeros win."""
        return DirectionProducts(self._derivative.careful, self._ready, self._block)

    def _write_block(self, x: Array, directions: Array, result: Array) -> None:
        try:
            buffers = self._free.pop()
        except IndexError:
            buffers = self._buffers()
        x_memory, seeds, asked, y, check, run = buffers
        count = len(directions)
        x_memory[:] = x
        seeds[:, :count] = directions.T
        asked[0] = count
        run()
        result[...] = y[:, :count].T
        found = b"" if check is None else check[: 8 * count].tobytes()
        self._free.append(buffers)
        if found.count(0) < len(found):  # zeros, but NaN where a result is infinite or NaN
            self._careful.at(x, directions, result)

    def _buffers(self) -> tuple[Any, ...]:
        """Memory of the point; directions in columns, and how many; results in columns, and their check; the call."""
        lengths = self._runner.program.registers
        x, y = np.empty(lengths["x"]), aligned(lengths["y"])
        run, registers = self._runner.bind_pass(("x", x), ("y", y))
        check = registers["check0"].data.cast("B") if "check0" in registers else None
        seeds, results = (each.reshape(-1, self._block) for each in (registers["s0"], y))
        return x.data, seeds, registers["asked"].data, results, check, run


class MatrixPart(NamedTuple):
    """Entries that one derivative along sums of unit vectors gives.

    colors: of each unit vector the sum that it is in.  color, result: of each entry, the sum and the number in its
    results that holds it.  entries: their numbers in the pattern.
    """

    derivative: Derivative
    colors: Sequence[int]
    color: Indices
    result: Indices
    entries: Indices

    def directions(self, lanes: int) -> int:
        """Number of directions, filled up to whole vectors."""
        return -(-(max(self.colors) + 1) // lanes) * lanes

    def seeds(self, lanes: int) -> Array:
        """Sum of the unit vectors of each color, a column each."""
        colors = np.array(self.colors)
        seeds: Array = (colors[:, None] == np.arange(self.directions(lanes))) * 1.0  # none of NONE
        return seeds.ravel()


class ColoredMatrix:
    """A matrix that depends on a point x, as a program; any number of threads may call it at once.

    entries: those that can be other than zero, in the order in which `at` gives them.
    source: the graph that gives them all, or the parts that do.  size: the numbers in a point.
    lanes: the directions in a vector.  Where no entry is left out, the whole matrix is the entries.
    """

    def __init__(
        self, entries: Pattern, source: Graph | Sequence[MatrixPart], size: int, lanes: int, ready: Ready
    ) -> None:
        self.entries, self._source, self._size = entries, source, size
        self._parts = () if isinstance(source, Graph) else source
        self._lanes, self._ready = lanes, ready
        self._directions = sum([part.directions(1) for part in self._parts])
        self._guarded = any([part.derivative.guarded is not None for part in self._parts])
        self._full, self._small = full(entries), math.prod(entries.shape) <= LARGE_MATRIX
        self._functions = [BoundFunction(self.bind, size, shape) for shape in (entries.rows.shape, entries.shape)]

    @cached_property
    def compressed(self) -> tuple[Indices32, Indices32]:
        """The columns and the starts of rows, see `Pattern.compressed`."""
        return self.entries.compressed()

    def at(self, x: Array, dense: bool, threads: int = 1) -> Array:
        """The entries, or with `dense` the whole matrix, at a point, or at each of points (N, n)."""
        whole = dense and self._small
        if x.ndim == 1:
            values = self._functions[whole](x)
        else:
            values = np.empty((len(x), *(self.entries.shape if whole else self.entries.rows.shape)))
            self.write(x, values, threads)
        if whole == dense:
            return values
        matrix = np.zeros((*values.shape[:-1], *self.entries.shape))
        matrix[..., self.entries.rows, self.entries.columns] = values
        return matrix

    def bind(self, x: Array, values: Array) -> Callable[[], None]:
        """A function of nothing that reads x and writes the values: entries, (count,), or into a matrix of zeros."""
        run, registers = self._runner(values.ndim == 2 and not self._full, self._lanes).bind_pass(
            ("x", x), ("y", values)
        )
        for name, seeds in self._seeds(self._lanes).items():
            registers[name][:] = seeds
        if "nonfinite" not in registers:
            return run
        nonfinite = registers["nonfinite"].data

        def checked() -> None:
            run()
            if nonfinite[0]:
                self._careful.bind(x, values)()

        return checked

    def write(self, points: Array, values: Array, threads: int) -> None:
        """The values at points (N, n), which lie side by side in vectors: entries (N, count), or matrices (N, m, n)."""
        if not len(self.entries.rows) or not len(points):
            values[...] = 0.0
            return
        rows = values.reshape(len(points), -1)
        width, columns = self._runner(values.ndim == 3 and not self._full, 1).columns("x", self._seeds)
        width //= 1 + self._directions
        write_batch(max(width // LEAST_BLOCK, 1) * LEAST_BLOCK, columns, points.T, rows.T, threads)
        if self._guarded:
            _mend(values, lambda at, found: self._careful.write(points[at], found, threads))

    @cached_property
    def _careful(self) -> ColoredMatrix:
        """The matrix by splits in which zeros win."""
        parts = [part._replace(derivative=part.derivative.careful) for part in self._parts]
        return ColoredMatrix(self.entries, parts, self._size, self._lanes, self._ready)

    def _seeds(self, lanes: int = 1) -> dict[str, Array]:
        """Numbers in the registers of directions."""
        return {f"s{k}": part.seeds(lanes) for k, part in enumerate(self._parts)}

    @made_once
    def _runner(self, dense: bool, lanes: int) -> Runner:
        """Runner of the program."""
        return self._ready(self._program(dense, lanes))

    def _program(self, dense: bool, lanes: int) -> Program:
        """x -> y, the entries, or with `dense` the whole matrix; the directions in vectors of so many lanes."""
        m, n = self.entries.shape
        count = len(self.entries.rows)
        places = self.entries.rows * n + self.entries.columns if dense else np.arange(count)
        registers = {"x": self._size, "y": m * n if dense else count}
        if isinstance(self._source, Graph):
            if not dense:
                return Program(registers, [Call(self._source, ("x",), ("y",))], ["y"])
            body = [Call(self._source, ("x",), ("e",)), Scatter("e", "y", tuple(range(count)), tuple(places.tolist()))]
            return Program(registers | {"e": count}, body, ["y"])
        statements: list[Statement] = []
        checks: dict[str, int] = {}
        for k, part in enumerate(self._parts):
            directions = part.directions(lanes)
            checked = part.derivative.guarded is not None and lanes > 1  # side by side the entries are looked at
            more, lengths = part.derivative.products(f"t{k}", directions, k, checked=checked)
            taken, put = part.result * directions + part.color, places[part.entries]
            statements += [*more, Scatter(f"t{k}", "y", tuple(taken.tolist()), tuple(put.tolist()))]
            registers |= lengths
            checks |= {f"check{k}": directions} if checked else {}
        if checks:
            registers["nonfinite"] = 1
            statements.append(Call(_nonfinite(sum(checks.values())), (*checks,), ("nonfinite",)))
        return Program(registers, statements, ["y"])


class Derivatives:
    """The derivatives of a graph by chosen inputs.

    runner: what runs the graph itself.  ready: makes a program ready to run in the same way.
    """

    def __init__(self, graph: Graph, ready: Ready, runner: Runner) -> None:
        self._given, self._ready, self._size = graph, ready, len(graph.inputs)
        self._lanes, self._block, self.vector_cost = runner.lanes, runner.lanes * runner.vectors, runner.vector_cost

    @made_once
    def products(self, chosen: Chosen, reverse: bool) -> DirectionProducts:
        """J x_dot, or with `reverse` J^T y_bar."""
        return DirectionProducts(self._derivative(chosen, reverse), self._ready, self._block)

    @made_once
    def jacobian(self, chosen: Chosen) -> ColoredMatrix:
        """The Jacobian, from whichever sweeps cost less."""
        wrt = self._wrt(chosen)
        entries = pattern(self._graph, wrt)
        if not len(entries.rows):
            return self._colored(entries, (), self._size)
        coloring = jacobian_coloring(entries, LANES)
        once, columns, rows = written_sizes(self._graph, wrt)
        if min(columns, rows) <= once * coloring.vectors(LANES) * self.vector_cost:
            return self._colored(entries, entry_graph(self._graph, wrt, entries, rows < columns), self._size)
        parts = []
        for reverse, colors, mine, keys, others in (  # forward along sums of columns, reverse along sums of rows
            (False, coloring.columns, ~coloring.by_row, entries.columns, entries.rows),
            (True, coloring.rows, coloring.by_row, entries.rows, entries.columns),
        ):
            if len(which := np.flatnonzero(mine)):
                color, result = np.array(colors)[keys[which]], others[which]
                parts.append(MatrixPart(self._derivative(chosen, reverse), colors, color, result, which))
        return self._colored(entries, parts, self._size)

    @made_once
    def hessian(self, chosen: Chosen) -> ColoredMatrix:
        """The Hessian of y_bar . y, of points (x, y_bar)."""
        wrt, size = self._wrt(chosen), self._size + len(self._graph.outputs)
        if not wrt:  # and no cotangents, which would be the outputs of the reverse mode
            nothing = np.zeros(0, dtype=np.int64)
            return self._colored(Pattern(nothing, nothing, (0, 0)), (), size)
        entries = symmetric(pattern(reverse_products(self._graph, wrt, zero_wins=False), wrt))
        if not len(entries.rows):
            return self._colored(entries, (), size)
        derivative = _derivative_of(partial(_second_products, self._graph, wrt), len(wrt))
        # symmetric, by products with sums of its columns
        colors = np.array(star_coloring(entries), dtype=np.int64)
        count = int(colors.max(initial=NONE)) + 1
        rows, columns = np.maximum(entries.rows, entries.columns), np.minimum(entries.rows, entries.columns)
        company = np.bincount(entries.rows * count + colors[entries.columns], minlength=len(wrt) * count)  # in a row
        alone = company[rows * count + colors[columns]] == 1
        row, color = np.where(alone, rows, columns), np.where(alone, colors[columns], colors[rows])
        parts = [MatrixPart(derivative, colors.tolist(), color, row, np.arange(len(row)))]
        return self._colored(entries, parts, size)

    def _colored(self, entries: Pattern, source: Graph | Sequence[MatrixPart], size: int) -> ColoredMatrix:
        return ColoredMatrix(entries, source, size, self._lanes, self._ready)

    @made_once
    def _derivative(self, chosen: Chosen, reverse: bool) -> Derivative:
        wrt = self._wrt(chosen)
        if reverse:
            return _derivative_of(partial(reverse_products, self._graph, wrt), len(self._graph.outputs))
        return _derivative_of(partial(forward_products, self._graph, wrt), len(wrt))

    @cached_property
    def _graph(self) -> Graph:
        """The graph with numbers for names: the longest name has no room for a suffix."""
        inputs = [variable(f"x{k}") for k in range(self._size)]
        return Graph(inputs, {f"y{k}": node for k, node in enumerate(self._given(*inputs).values())})

    def _wrt(self, chosen: Chosen) -> tuple[Node, ...]:
        return self._graph.inputs if chosen is None else tuple([self._graph.inputs[k] for k in chosen])


def _derivative_of(derive: Callable[..., Graph], directions: int) -> Derivative:
    """The derivative in which zeros win over infinite slopes; where that takes long, only where there are such."""
    plain = direction_split(derive(zero_wins=False), directions, divide=False)
    guarded = direction_split(derive(zero_wins=True), directions)
    saved = len(guarded.linear.nodes) - len(plain.linear.nodes)
    return Derivative(plain, guarded) if saved > CHECK else Derivative(guarded)


def _second_products(graph: Graph, wrt: Sequence[Node], *, zero_wins: bool) -> Graph:
    """x, y_bar, x_dot -> the Hessian of y_bar . y times x_dot."""
    reverse = reverse_products(graph, wrt, zero_wins=zero_wins)
    return forward_products(reverse, wrt, zero_wins=zero_wins)
