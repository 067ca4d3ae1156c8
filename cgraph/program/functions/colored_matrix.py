"""A matrix of derivatives as a program: products along few directions, colors, and where they hold the entries."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...autodiff.coloring import NONE, Coloring, star_coloring
from ...autodiff.direction_split import DirectionSplit
from ...autodiff.sparsity import Indices, Indices32, Pattern, full
from ...core.evaluation import Array
from ...core.graph import Graph
from ...core.node import as_node, variable
from ...util.threads import write_batch
from ..program import Program
from ..runners.runner import Runner
from ..statement import Names, Statement
from ..statements.call import Call, Map
from ..statements.memory import Scatter
from .bound_function import BoundFunction

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
        seeds = np.zeros((len(self.colors), self.directions(lanes)))
        for k, color in enumerate(self.colors):
            if color != NONE:
                seeds[k, color] = 1.0
        return seeds.ravel()


class ColoredMatrix:
    """A matrix that depends on a point x, as a program.

    entries: those that can be other than zero, in the order in which `values` gives them.
    source: the graph that gives them all, or the parts that do.  points: the numbers in a point.
    lanes: the directions in a vector.  ready: makes a program ready to run.
    """

    def __init__(
        self,
        entries: Pattern,
        source: Graph | Sequence[MatrixPart],
        points: int,
        lanes: int,
        ready: Callable[[Program], Runner],
    ) -> None:
        self.entries, self._source, self._points = entries, source, points
        self._parts = () if isinstance(source, Graph) else source
        self._lanes, self._ready = lanes, ready
        self._made: dict[tuple[bool, bool, int], Runner] = {}
        self._making = threading.Lock()
        self._entries = BoundFunction(self.bind, points, (len(entries.rows),))
        self._dense = BoundFunction(self.bind, points, entries.shape)

    @cached_property
    def compressed(self) -> tuple[Indices32, Indices32]:
        """The columns and the starts of rows, see `Pattern.compressed`."""
        return self.entries.compressed()

    def values(self, x: Array, dense: bool) -> Array:
        """The entries, or with `dense` the whole matrix."""
        if not dense:
            return self._entries(x)
        m, n = self.entries.shape
        return self._dense(x) if m * n <= LARGE_MATRIX else self._filled(self._entries(x))

    def many(self, points: Array, dense: bool, threads: int) -> Array:
        """`values` of each of the points (N, n)."""
        m, n = self.entries.shape
        whole = dense and m * n <= LARGE_MATRIX
        values = np.empty((len(points), m, n) if whole else (len(points), len(self.entries.rows)))
        self.write(points, values, threads)
        return self._filled(values) if dense and not whole else values

    def _filled(self, entries: Array) -> Array:
        """The whole matrix, or several of them."""
        matrix = np.zeros((*entries.shape[:-1], *self.entries.shape))
        matrix[..., self.entries.rows, self.entries.columns] = entries
        return matrix

    def bind(self, x: Array, values: Array) -> Callable[[], None]:
        """A function of nothing that reads x and writes the values: entries, (count,), or into a matrix of zeros."""

        def bound(careful: bool) -> Callable[[], None]:
            runner = self._runner(values.ndim == 2, careful, self._lanes)
            run, registers = runner._bind_pass(("x", x), ("y", values))
            for name, seeds in self._seeds(self._lanes).items():
                registers[name][:] = seeds
            if "nonfinite" not in registers:
                return run
            nonfinite = registers["nonfinite"].data

            def checked() -> None:
                run()
                if nonfinite[0]:
                    bound(careful=True)()

            return checked

        return bound(careful=False)

    def write(self, points: Array, values: Array, threads: int, *, careful: bool = False) -> None:
        """The values at points (N, n), which lie side by side in vectors: entries (N, count), or matrices (N, m, n)."""
        if not len(self.entries.rows) or not len(points):
            values[...] = 0.0
            return
        rows = values.reshape(len(points), -1)
        seeds, directions, guarded = self._beside
        width, columns = self._runner(values.ndim == 3, careful, 1)._columns("x", seeds)
        write_batch(max(width // (1 + directions) // LEAST_BLOCK, 1) * LEAST_BLOCK, columns, points.T, rows.T, threads)
        if guarded and not careful:
            mend(values, lambda at, found: self.write(points[at], found, threads, careful=True))

    @cached_property
    def _beside(self) -> tuple[dict[str, Array], int, bool]:
        """Of points side by side: seeds, the number of directions, and whether any derivative has a guarded split."""
        guarded = any([part.derivative.guarded is not None for part in self._parts])
        return self._seeds(1), sum([part.directions(1) for part in self._parts]), guarded

    def _seeds(self, lanes: int) -> dict[str, Array]:
        """Numbers in the registers of directions."""
        return {f"s{k}": part.seeds(lanes) for k, part in enumerate(self._parts)}

    def _runner(self, dense: bool, careful: bool, lanes: int) -> Runner:
        """Runner of the program, made at the first use; the whole matrix is the entries, where none is left out."""
        key = dense and not full(self.entries), careful, lanes
        with self._making:
            if key not in self._made:
                self._made[key] = self._ready(self._program(*key))
            return self._made[key]

    def _program(self, dense: bool, careful: bool, lanes: int) -> Program:
        """x -> y, the entries, or with `dense` the whole matrix; the directions in vectors of so many lanes."""
        m, n = self.entries.shape
        places = self.entries.rows * n + self.entries.columns if dense else np.arange(len(self.entries.rows))
        registers = {"x": self._points, "y": m * n if dense else len(places)}
        if isinstance(self._source, Graph):
            if not dense:
                return Program(registers, [Call(self._source, ("x",), ("y",))], ["y"])
            body = [Call(self._source, ("x",), ("e",)), Scatter("e", "y", tuple(range(len(places))), _tuple(places))]
            return Program(registers | {"e": len(places)}, body, ["y"])
        statements: list[Statement] = []
        checks: dict[str, int] = {}
        for k, part in enumerate(self._parts):
            derivative = part.derivative.careful if careful else part.derivative
            (primal, linear), count = derivative.split, part.directions(lanes)
            sizes = len(primal.outputs), len(part.colors) * count, len(linear.outputs) * count
            registers |= {f"{letter}{k}": size for letter, size in zip("pst", sizes, strict=True)}
            taken = part.result * count + part.color
            checked = derivative.guarded is not None and lanes > 1  # of points side by side the entries are looked at
            statements += product_statements(derivative, k, f"t{k}", checked=checked)
            statements.append(Scatter(f"t{k}", "y", _tuple(taken), _tuple(places[part.entries])))
            if checked:
                checks[f"check{k}"] = count
        if checks:
            registers |= {**checks, "nonfinite": 1}
            statements.append(Call(_nonfinite(sum(checks.values())), (*checks,), ("nonfinite",)))
        return Program(registers, statements, ["y"])


def mend(values: Array, write: Callable[[Indices, Array], None]) -> None:
    """Write the values of points anew, by a split in which zeros win, where some are infinite or NaN."""
    wrong = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if len(wrong):
        found = values[wrong]
        write(wrong, found)
        values[wrong] = found


def product_statements(
    derivative: Derivative, k: int, results: str, asked: Names = (), *, checked: bool
) -> list[Statement]:
    """A register of results: of the point x along directions s, side by side; the number k stands behind names.

    checked: a register `check` has NaN for a direction of which a result is infinite or NaN, else 0.
    """
    (primal, linear), p = derivative.split, f"p{k}"
    statements: list[Statement] = [Call(primal, ("x",), (p,))]
    statements.append(Map(linear, (f"s{k}",), (results,), (p,), asked))
    if checked:
        count = _nonfinite(len(linear.outputs))
        statements.append(Map(count, (results,), (f"check{k}",), (), asked))
    return statements


def _tuple(numbers: Indices) -> tuple[int, ...]:
    return tuple(numbers.tolist())


def _nonfinite(count: int) -> Graph:
    """0, or NaN where one of so many numbers is infinite or NaN."""
    values = [variable(f"v{k}") for k in range(count)]
    terms = [value - value for value in values] or [as_node(0.0)]
    while len(terms) > 1:  # in pairs, which do not wait for each other
        terms = [*[a + b for a, b in zip(terms[::2], terms[1::2], strict=False)], *terms[len(terms) & ~1 :]]
    return Graph(values, {"nonfinite": terms[0]})


def jacobian_parts(
    entries: Pattern, coloring: Coloring, forward: Callable[[], Derivative], reverse: Callable[[], Derivative]
) -> list[MatrixPart]:
    """The Jacobian: forward along sums of columns, reverse along sums of rows, asked for where needed."""
    parts = []
    for make, colors, mine, keys, others in (
        (forward, coloring.columns, ~coloring.by_row, entries.columns, entries.rows),
        (reverse, coloring.rows, coloring.by_row, entries.rows, entries.columns),
    ):
        numbers = np.flatnonzero(mine)
        if len(numbers):
            parts.append(MatrixPart(make(), colors, np.array(colors)[keys[numbers]], others[numbers], numbers))
    return parts


def hessian_parts(entries: Pattern, derivative: Derivative) -> list[MatrixPart]:
    """A Hessian, symmetric, by products with sums of its columns."""
    n = entries.shape[1]
    if not len(entries.rows):
        return []
    colors = np.array(star_coloring(entries), dtype=np.int64)
    count = int(colors.max(initial=NONE)) + 1
    rows, columns = np.maximum(entries.rows, entries.columns), np.minimum(entries.rows, entries.columns)
    company = np.bincount(entries.rows * count + colors[entries.columns], minlength=n * count)  # of a color in a row
    alone = company[rows * count + colors[columns]] == 1
    row, color = np.where(alone, rows, columns), np.where(alone, colors[columns], colors[rows])
    return [MatrixPart(derivative, colors.tolist(), color, row, np.arange(len(row)))]
