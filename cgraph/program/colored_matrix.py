"""A matrix of derivatives as a program: products along few directions, colors, and where they hold the entries."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..autodiff.coloring import NONE, Coloring, star_coloring
from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices, Indices32, Pattern
from ..core.evaluation import Array
from ..core.graph import Graph
from ..core.node import as_node, variable
from .program import Program
from .runner import Runner
from .statement import Statement
from .statements.call import Call
from .statements.tiles import Scatter, TiledMap

LARGE = 2**16  # numbers in a matrix, of which no copy is kept for another call


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


class Part(NamedTuple):
    """Some of the entries, by a derivative along sums of unit vectors.

    colors: of each unit vector the sum that it is in.  color, result: of each entry, the sum and the number in its
    results that holds it.  entries: their numbers in the pattern.
    """

    derivative: Derivative
    colors: Sequence[int]
    color: Indices
    result: Indices
    entries: Indices


class _Buffers(NamedTuple):
    """What one call at a time has for itself."""

    x: Any  # memory
    values: Array
    run: Callable[[], None]


class ColoredMatrix:
    """A matrix that depends on a point x, as a program.

    entries: those that can be other than zero, in the order in which `values` gives them.
    source: the graph that gives them all, or the parts that do.  points: the numbers in a point.
    lanes: the directions in a tile, 0 for all in one.  ready: makes a program ready to run.
    """

    def __init__(
        self,
        entries: Pattern,
        source: Graph | Sequence[Part],
        points: int,
        lanes: int,
        ready: Callable[[Program], Runner],
    ) -> None:
        self.entries, self._source, self._points = entries, source, points
        self._lanes, self._ready = lanes, ready
        self._made: dict[tuple[bool, bool], tuple[Runner, dict[str, Array]]] = {}
        self._making = threading.Lock()
        self._free: dict[bool, list[_Buffers]] = {True: [], False: []}  # pop and append are atomic

    @cached_property
    def compressed(self) -> tuple[Indices32, Indices32]:
        """The columns and the starts of rows, see `Pattern.compressed`."""
        return self.entries.compressed()

    def values(self, x: Array, dense: bool) -> Array:
        """The entries, or with `dense` the whole matrix."""
        m, n = self.entries.shape
        if dense and m * n > LARGE:
            matrix = np.zeros((m, n))
            matrix[self.entries.rows, self.entries.columns] = self.values(x, dense=False)
            return matrix
        free = self._free[dense]
        try:
            buffers = free.pop()
        except IndexError:
            point = np.empty(self._points)
            values = np.zeros(self.entries.shape) if dense else np.empty(len(self.entries.rows))
            buffers = _Buffers(point.data, values, self.bind(point, values))
        buffers.x[:] = x
        buffers.run()
        result = buffers.values.copy()
        free.append(buffers)
        return result

    def bind(self, x: Array, values: Array) -> Callable[[], None]:
        """A function of nothing that reads x and writes the values: entries, (count,), or into a matrix of zeros."""

        def bound(careful: bool) -> Callable[[], None]:
            runner, seeds = self._runner(values.ndim == 2 and values.size > len(self.entries.rows), careful)
            return runner._bind_pass(("x", x), ("y", values), seeds, lambda: bound(careful=True)())

        return bound(careful=False)

    def _runner(self, dense: bool, careful: bool) -> tuple[Runner, dict[str, Array]]:
        """What runs the program, and values of its registers; made at the first use."""
        key = dense, careful
        with self._making:
            if key not in self._made:
                program, seeds = self._program(*key)
                self._made[key] = self._ready(program), seeds
            return self._made[key]

    def _program(self, dense: bool, careful: bool) -> tuple[Program, dict[str, Array]]:
        """x -> y, the entries, or with `dense` the whole matrix; and the directions."""
        m, n = self.entries.shape
        places = self.entries.rows * n + self.entries.columns if dense else np.arange(len(self.entries.rows))
        registers = {"x": self._points, "y": m * n if dense else len(places)}
        if isinstance(self._source, Graph):
            body: list[Statement] = [Call(self._source, ("x",), ("e",) if dense else ("y",))]
            if dense:
                registers["e"] = len(places)
                body.append(Scatter("e", "y", tuple(range(len(places))), tuple(places.tolist())))
            return Program(registers, body, ["y"]), {}
        statements, seeds, checks = [], {}, []
        for k, part in enumerate(self._source):
            derivative = part.derivative.careful if careful else part.derivative
            (primal, linear), count = derivative.split, max(part.colors) + 1
            lanes = self._lanes or count
            p, s, t = (f"{letter}{k}" for letter in "pst")
            tiles, results = -(-count // lanes), len(linear.outputs)
            seeds[s] = np.zeros((tiles, len(part.colors), lanes))
            for entry, color in enumerate(part.colors):
                if color != NONE:
                    seeds[s][color // lanes, entry, color % lanes] = 1.0
            registers |= {p: len(primal.outputs), s: seeds[s].size, t: tiles * results * lanes}
            taken = ((part.color // lanes) * results + part.result) * lanes + part.color % lanes
            statements += [
                Call(primal, ("x",), (p,)),
                TiledMap(linear, s, t, (p,), lanes),
                Scatter(t, "y", tuple(taken.tolist()), tuple(places[part.entries].tolist())),
            ]
            if derivative.guarded is not None:
                registers[f"check{k}"] = tiles * lanes
                checks.append(f"check{k}")
                statements.append(TiledMap(_nonfinite(results), t, checks[-1], (), lanes))
        if checks:
            registers["nonfinite"] = 1
            statements.append(Call(_nonfinite(sum([registers[each] for each in checks])), (*checks,), ("nonfinite",)))
        return Program(registers, statements, ["y"], stop="nonfinite" if checks else None), _flat(seeds)


def _flat(arrays: dict[str, Array]) -> dict[str, Array]:
    return {name: array.reshape(-1) for name, array in arrays.items()}


def _nonfinite(count: int) -> Graph:
    """0, or NaN where one of so many numbers is infinite or NaN."""
    values = [variable(f"v{k}") for k in range(count)]
    terms = [value - value for value in values] or [as_node(0.0)]
    while len(terms) > 1:  # in pairs, which do not wait for each other
        terms = [*[a + b for a, b in zip(terms[::2], terms[1::2], strict=False)], *terms[len(terms) & ~1 :]]
    return Graph(values, {"nonfinite": terms[0]})


def jacobian_parts(
    entries: Pattern, coloring: Coloring, forward: Callable[[], Derivative], reverse: Callable[[], Derivative]
) -> list[Part]:
    """The Jacobian: forward along sums of columns, reverse along sums of rows, asked for where needed."""
    parts = []
    for make, colors, mine, keys, others in (
        (forward, coloring.columns, ~coloring.by_row, entries.columns, entries.rows),
        (reverse, coloring.rows, coloring.by_row, entries.rows, entries.columns),
    ):
        numbers = np.flatnonzero(mine)
        if len(numbers):
            parts.append(Part(make(), colors, np.array(colors)[keys[numbers]], others[numbers], numbers))
    return parts


def hessian_parts(entries: Pattern, derivative: Derivative) -> list[Part]:
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
    return [Part(derivative, colors.tolist(), color, row, np.arange(len(row)))]
