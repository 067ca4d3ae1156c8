"""Crossing search: where quantities of a motion first fall below zero, certain but for rounding, by bounds on cells.

On a cell, a part of a step, states lie in the hull of the Bernstein coefficients of the dense output, and interval
arithmetic bounds quantities and their slopes along the motion. A cell is clear of zeros, or a quantity goes one way in
it, or it is halved.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, kept_by_first, memo
from cgraph.extend import enclosure

from ..steps.dense_output import UNIT, Indices, StepBlock
from ..steps.row_values import values_of

MOST_CELLS = 4096  # that wait at once
SHORTEST = 2.0**-50  # of a step, a cell
LEFT = 1e-3  # of the largest that a quantity is in a step, by which it has left zero
PARTS = 32  # into which a cell is divided again and again to find a root
BITS = 56.0  # of where in a cell
DEGREES = 8  # of dense output, whose matrices are kept
MANY_NODES = 150  # of a graph that is compiled


class Crossing(NamedTuple):
    """First zero of a quantity."""

    row: int  # of the step
    s: float  # share of the step, the first number at which it is below zero
    number: int  # of the quantity


@dataclass(frozen=True, eq=False)
class Quantities:
    """Quantities as graphs over m states, t and parameters, with what the search reads of them."""

    values: Graph
    size: int

    @cached_property
    def slopes(self) -> Graph:
        """Their tangents: inputs those of `values`, then tangents of states and t."""
        return cg.simplify(cg.jvp(self.values, list(self.values.input_names[: self.size + 1])))

    @cached_property
    def bounds(self) -> Graph:
        """Lower and upper bounds of the values: inputs the parameters, then lows and highs of states and t."""
        return enclosure(self.values, exact=self._parameters)

    @cached_property
    def slope_bounds(self) -> Graph:
        """The same of the slopes."""
        return enclosure(self.slopes, exact=self._parameters)

    @property
    def _parameters(self) -> list[str]:
        return list(self.values.input_names[self.size + 1 :])


@kept_by_first
def quantities(graph: Graph, m: int) -> Quantities:
    """The quantities of a graph over m states, t and parameters."""
    return Quantities(graph, m)


@kept_by_first
def _function(graph: Graph) -> Callable[[Array], Array]:
    """The outputs (k, N) at points (inputs, N)."""
    if len(graph.nodes) > MANY_NODES:
        return cg.compile(graph).batch
    return lambda points: values_of(graph, [*points], points.shape[1])


def outputs_of(graph: Graph, *parts: Any) -> Array:
    """Outputs (k, N) of a graph at inputs that go along the last axis, or are the same at all points."""
    width = max([np.shape(part)[-1] for part in parts if np.ndim(part) == 2])
    rows = [
        np.broadcast_to(np.reshape(part, (-1, 1)) if np.ndim(part) < 2 else part, (len(part), width)) for part in parts
    ]
    with np.errstate(all="ignore"):
        return np.asarray(_function(graph)(np.concatenate(rows)))


class Cells(NamedTuple):
    """Parts of steps, from share a to share b, and the quantity that each is of, (n,) each."""

    rows: Indices
    a: Array
    b: Array
    number: Indices

    def take(self, which: Any) -> Cells:
        """Subset of the cells."""
        return Cells._make([array[which] for array in self])


def steps_near_zero(watched: Quantities, p: Array, block: StepBlock) -> list[int]:
    """Steps in which quantities may not be positive."""
    rows = np.arange(len(block.t))
    bounds = outputs_of(watched.bounds, p, *_hulls(block, rows, np.zeros(len(rows)), np.ones(len(rows))))
    return list(np.flatnonzero(~(bounds[: len(bounds) // 2] > 0.0).all(axis=0)).tolist())


def first_crossing(watched: Quantities, p: Array, block: StepBlock, fresh: Array) -> tuple[Crossing | None, bool]:
    """The first zero of quantities in these steps, that are positive before; whether cells were too many to be sure.

    fresh: (k,), of a quantity that begins at zero how far it is rounding; it counts as positive until it has left that
    in the first step; NaN of the others.
    """
    rows = np.arange(len(block.t))
    low = outputs_of(watched.bounds, p, *_hulls(block, rows, np.zeros(len(rows)), np.ones(len(rows))))[: len(fresh)]
    which, number = np.nonzero(~(low > 0.0).T)
    begins = np.where(which == 0, _left_at(watched, p, block, fresh)[number], 0.0)
    cells = Cells(which, begins, np.ones(len(which)), number).take(begins < 1.0)
    best: Crossing | None = None
    while len(cells.rows):
        own = (cells.number, np.arange(len(cells.rows)))
        k = len(fresh)
        boxes = outputs_of(watched.bounds, p, *_hulls(block, cells.rows, cells.a, cells.b))
        tangents = _tangents(block, cells)
        slopes = outputs_of(watched.slope_bounds, p, *tangents)
        rises, falls = slopes[:k][own] >= 0.0, slopes[k:][own] <= 0.0
        before, after = [_values(watched, p, block, cells.rows, s)[own] for s in (cells.a, cells.b)]
        clear = boxes[:k][own] > 0.0
        single = (rises | falls) & np.isfinite(boxes[k:][own] - boxes[:k][own])  # a pole is no zero
        last = cells.b - cells.a <= SHORTEST
        passes = ~clear & (single | last) & ((after < 0.0) | (before < 0.0))
        for each in np.flatnonzero(passes):
            at = (int(cells.rows[each]), float(cells.a[each]))
            if best is not None and at >= best[:2]:
                continue
            n = int(cells.number[each])
            s = at[1] if before[each] < 0.0 else _root(watched, p, block, *at, float(cells.b[each]), n)
            if best is None or (at[0], s) < best[:2]:
                best = Crossing(at[0], s, n)
        split = ~(clear | single | last)
        if best is not None:
            split &= (cells.rows < best.row) | ((cells.rows == best.row) & (cells.a < best.s))
        cells = cells.take(split)
        middle = 0.5 * (cells.a + cells.b)
        halves = cells._replace(b=middle), cells._replace(a=middle)
        cells = Cells._make([np.concatenate(pair) for pair in zip(*halves, strict=True)])
        if len(cells.rows) > MOST_CELLS:
            return best, False
    return best, True


def told_by_bounds(
    watched: Quantities, p: Array, block: StepBlock, rows: Indices, a: Array, b: Array
) -> tuple[Array, Array, Array]:
    """Of one quantity and cells, (n,), whether it is clear of zero, goes one way, and is bounded."""
    cells = Cells(rows, a, b, np.zeros_like(rows))
    low, high = outputs_of(watched.bounds, p, *_hulls(block, rows, a, b))
    down, up = outputs_of(watched.slope_bounds, p, *_tangents(block, cells))
    clear = (low > 0.0) | (high < 0.0)
    is_bounded = np.isfinite(high - low)
    return clear, is_bounded & ((down >= 0.0) | (up <= 0.0)), is_bounded


def _left_at(watched: Quantities, p: Array, block: StepBlock, fresh: Array) -> Array:
    """The share of the first step from which each quantity is looked at, (k,); 1 where it stays on its side."""
    begins = np.where(np.isnan(fresh), 0.0, 1.0)
    if begins.any():
        s = np.linspace(0.0, 1.0, PARTS + 1)
        values = _values(watched, p, block, np.zeros(len(s), dtype=np.intp), s)
        size = np.abs(values).max(axis=1)
        for k in np.flatnonzero((begins > 0.0) & (size > fresh)):
            left = np.flatnonzero(values[k] >= LEFT * size[k])
            begins[k] = s[left[0]] if len(left) else 1.0 - UNIT if values[k, -1] < 0.0 else 1.0
    return begins


def _values(watched: Quantities, p: Array, block: StepBlock, rows: Indices, s: Array) -> Array:
    return outputs_of(watched.values, block.states_at(rows, s).T, block.times_at(rows, s)[None], p)


def _root(watched: Quantities, p: Array, block: StepBlock, row: int, low: float, high: float, number: int) -> float:
    """The first share of a step, to the last bit, at which a quantity that falls is below zero."""
    for _ in range(math.ceil(BITS / math.log2(PARTS))):
        s = np.linspace(low, high, PARTS + 1)
        below = _values(watched, p, block, np.full(len(s), row), s)[number] < 0.0
        below[0], below[-1] = False, True
        at = int(np.argmax(below))
        low, high = float(s[at - 1]), float(s[at])
    return high


@memo(DEGREES)
def _binomials(degree: int) -> tuple[Array, Array]:
    """C(k, i), and the matrix from powers to Bernstein's polynomials."""
    choose = np.array([[math.comb(k, i) for k in range(degree + 1)] for i in range(degree + 1)], dtype=np.float64)
    return choose, choose.T / choose[:, degree]


def _bernstein(coefficients: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Least and largest Bernstein coefficients (m, n) of polynomials (n, degree + 1, m) on [a, b] (n,)."""
    degree = coefficients.shape[1] - 1
    choose, matrix = _binomials(degree)
    i, k = np.indices(choose.shape)
    parts = choose * a[:, None, None] ** np.maximum(k - i, 0) * (b - a)[:, None, None] ** i
    points = matrix @ np.where(k >= i, parts, 0.0) @ coefficients
    return points.min(axis=1).T, points.max(axis=1).T


def _hulls(block: StepBlock, rows: Indices, a: Array, b: Array) -> tuple[Array, Array]:
    """Least and largest states and times on cells, (m + 1, n)."""
    assert block.dense is not None
    low, high = _bernstein(np.concatenate([block.x_old[rows, None], block.dense[rows]], axis=1), a, b)
    ends = np.stack([block.times_at(rows, a), block.times_at(rows, b)])
    return np.vstack([low, ends.min(axis=0)]), np.vstack([high, ends.max(axis=0)])


def _tangents(block: StepBlock, cells: Cells) -> tuple[Array, Array]:
    """Least and largest states, times and their derivatives by the share of the step."""
    assert block.dense is not None
    low, high = _hulls(block, cells.rows, cells.a, cells.b)
    powers = np.arange(1, block.dense.shape[1] + 1)[:, None]
    slopes = _bernstein(powers * block.dense[cells.rows], cells.a, cells.b)
    h = block.h[cells.rows][None]
    return np.vstack([low, slopes[0], h]), np.vstack([high, slopes[1], h])
