"""A matrix of derivatives, its columns or rows compressed by colors: few sweeps, and where they hold the entries."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..autodiff.coloring import NONE, Coloring, star_coloring
from ..autodiff.sparsity import Indices, Indices32, Pattern
from ..core.evaluation import Array
from .sweep import Sweep, aligned

LARGE = 2**16  # numbers in a matrix, of which no copy is kept for another call


class Part(Protocol):
    """What gives some of the entries."""

    def bind(self, x: Array, values: Array, places: Indices | None) -> Callable[[], None]:
        """A function of nothing that writes entry e of the pattern to values[e], or values[places[e]]."""


class WrittenPart(NamedTuple):
    """A compiled function of the point that gives all entries."""

    function: Any

    def bind(self, x: Array, values: Array, places: Indices | None) -> Callable[[], None]:
        """As `Part.bind` says."""
        if places is None:
            run: Callable[[], None] = self.function.bind(x, values)
            return run
        entries, flat = np.empty(len(places)), values.reshape(-1)
        write = self.function.bind(x, entries)

        def scatter() -> None:
            write()
            flat[places] = entries

        return scatter


class SweepPart(NamedTuple):
    """A sweep along the directions of all colors, and the entries that it gives.

    seeds: (groups, entries, lanes).  take: where entries lie in the results.  entries: their numbers in the pattern.
    """

    sweep: Sweep
    seeds: Array
    take: Indices
    entries: Indices

    def bind(self, x: Array, values: Array, places: Indices | None) -> Callable[[], None]:
        """As `Part.bind` says."""
        y = aligned((len(self.seeds), self.sweep.results, self.sweep.lanes))
        put = self.entries if places is None else places[self.entries]
        return self.sweep.bind(x, self.seeds, y, self.take, put, values)


class _Buffers(NamedTuple):
    """What one call at a time has for itself."""

    x: Any  # memory
    values: Array
    run: Callable[[], None]


class ColoredMatrix:
    """A matrix that depends on a point x, by sweeps.

    entries: those that can be other than zero, in the order in which `values` gives them.
    """

    def __init__(self, entries: Pattern, parts: Sequence[Part], points: int) -> None:
        self.entries, self._parts, self._points = entries, parts, points
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
        places = None
        if values.ndim == 2:
            places = self.entries.rows * self.entries.shape[1] + self.entries.columns
        runs = [part.bind(x, values, places) for part in self._parts]
        if len(runs) == 1:
            return runs[0]

        def run() -> None:
            for each in runs:
                each()

        return run


def colored_jacobian(
    entries: Pattern, coloring: Coloring, forward: Callable[[], Sweep], reverse: Callable[[], Sweep], points: int
) -> ColoredMatrix:
    """The Jacobian: forward sweeps along sums of columns, reverse ones along sums of rows, asked for where needed.

    points: the numbers in a point.
    """
    parts = []
    for make, colors, mine, keys, others in (
        (forward, coloring.columns, ~coloring.by_row, entries.columns, entries.rows),
        (reverse, coloring.rows, coloring.by_row, entries.rows, entries.columns),
    ):
        numbers = np.flatnonzero(mine)
        if len(numbers):
            sweep = make()
            take = _places(sweep, np.array(colors)[keys[numbers]], others[numbers])
            parts.append(SweepPart(sweep, _seeds(sweep, colors), take, numbers))
    return ColoredMatrix(entries, parts, points)


def colored_hessian(entries: Pattern, sweep: Sweep, points: int) -> ColoredMatrix:
    """A Hessian, symmetric, by products with sums of its columns."""
    n = entries.shape[1]
    colors = np.array(star_coloring(entries), dtype=np.int64)
    count = int(colors.max(initial=NONE)) + 1
    rows, columns = np.maximum(entries.rows, entries.columns), np.minimum(entries.rows, entries.columns)
    company = np.bincount(entries.rows * count + colors[entries.columns], minlength=n * count)  # of a color in a row
    alone = company[rows * count + colors[columns]] == 1
    row, color = np.where(alone, rows, columns), np.where(alone, colors[columns], colors[rows])
    seeds = _seeds(sweep, colors.tolist())
    parts = [SweepPart(sweep, seeds, _places(sweep, color, row), np.arange(len(row)))] if len(row) else []
    return ColoredMatrix(entries, parts, points)


def _seeds(sweep: Sweep, colors: Sequence[int]) -> Array:
    """Of each color the sum of its unit vectors, in groups."""
    groups = (max(colors, default=NONE) + sweep.lanes) // sweep.lanes
    seeds = aligned((groups, len(colors), sweep.lanes))
    seeds[...] = 0.0
    for k, color in enumerate(colors):
        if color != NONE:
            seeds[color // sweep.lanes, k, color % sweep.lanes] = 1.0
    return seeds


def _places(sweep: Sweep, colors: Indices, rows: Indices) -> Indices:
    """Where the results of directions of these colors have these rows."""
    return ((colors // sweep.lanes) * sweep.results + rows) * sweep.lanes + colors % sweep.lanes
