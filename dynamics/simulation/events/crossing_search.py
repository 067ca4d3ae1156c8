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

MOST_CELLS = 4096  # that wait at once
SHORTEST = 2.0**-50  # of a step, a cell
LEFT = 1e-3  # of the largest that a quantity is in a step, by which it has left zero
PARTS = 32  # of the first step, at whose ends a quantity that begins at zero is looked at
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
def _function(graph: Graph, *, numbers: bool) -> Callable[[Any], Any]:
    """The outputs (k, N) at points (inputs, N), or the k numbers at one point: of small graphs without code."""
    if len(graph.nodes) > MANY_NODES:
        return cg.compile(graph) if numbers else cg.compile(graph).batch
    place = {node: k for k, node in enumerate(graph.inputs)}
    constants, steps = list[float](), list[tuple[Callable[..., Any], list[int]]]()
    for node in [node for node in graph.nodes if node.value is not None]:
        place[node] = len(graph.inputs) + len(constants)
        constants.append(node.value)  # type: ignore[arg-type]
    for node in [node for node in graph.nodes if node.args]:
        place[node] = len(place)
        steps.append((node.op.scalar if numbers else node.op.array, [place[arg] for arg in node.args]))
    wanted = [place[node] for node in graph.outputs.values()]

    def values(points: Any) -> Any:
        known = [*points, *constants]
        for function, slots in steps:
            known.append(function(*[known[slot] for slot in slots]))
        if numbers:
            return [known[slot] for slot in wanted]
        result = np.empty((len(wanted), points.shape[1]))
        for row, slot in zip(result, wanted, strict=True):
            row[:] = known[slot]
        return result

    return values


def outputs_of(graph: Graph, *parts: Any) -> Array:
    """Outputs (k, N) of a graph at inputs that go along the last axis, or are the same at all points."""
    points = np.empty((len(graph.inputs), max([part.shape[-1] for part in parts if np.ndim(part) == 2])))
    first = 0
    for part in parts:
        points[first : first + len(part)] = part if np.ndim(part) == 2 else np.reshape(part, (-1, 1))
        first += len(part)
    with np.errstate(all="ignore"):
        return np.asarray(_function(graph, numbers=False)(points))


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
    rows, best = np.arange(len(block.t)), None
    low = outputs_of(watched.bounds, p, *_hulls(block, rows, np.zeros(len(rows)), np.ones(len(rows))))[: len(fresh)]
    which, number = np.nonzero(~(low > 0.0).T)
    begins = np.where(which == 0, _left_at(watched, p, block, fresh)[number], 0.0)
    cells = Cells(which, begins, np.ones(len(which)), number).take(begins < 1.0)
    while len(cells.rows):
        tangents = _tangents(block, cells)
        boxes, slopes = [
            [np.take_along_axis(half, cells.number[None], axis=0)[0] for half in np.split(found, 2)]
            for found in (
                outputs_of(watched.bounds, p, *[ends[: watched.size + 1] for ends in tangents]),
                outputs_of(watched.slope_bounds, p, *tangents),
            )
        ]
        ends = _values(watched, p, block, np.tile(cells.rows, 2), np.concatenate([cells.a, cells.b]))
        before, after = np.split(np.take_along_axis(ends, np.tile(cells.number, 2)[None], axis=0)[0], 2)
        clear = boxes[0] > 0.0
        single = ((slopes[0] >= 0.0) | (slopes[1] <= 0.0)) & np.isfinite(boxes[1] - boxes[0])  # a pole is no zero
        last = cells.b - cells.a <= SHORTEST
        passes = np.flatnonzero(~clear & (single | last) & ((after < 0.0) | (before < 0.0)))
        for each in passes[np.lexsort((cells.a[passes], cells.rows[passes]))].tolist():
            row, at, n = int(cells.rows[each]), float(cells.a[each]), int(cells.number[each])
            if best is not None and (row, at) >= best[:2]:
                break
            s = at if before[each] < 0.0 else _root(watched, p, block, row, at, float(cells.b[each]), n)
            best = Crossing(row, s, n) if best is None or (row, s) < best[:2] else best
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
    return outputs_of(watched.values, block.polynomials_at(rows, s).T, block.times_at(rows, s)[None], p)


def _root(watched: Quantities, p: Array, block: StepBlock, row: int, low: float, high: float, number: int) -> float:
    """The first share of a step, but for rounding, at which a quantity that falls is below zero (Chandrupatla 1997)."""
    assert block.dense is not None
    powers, start = block.dense[row][::-1], block.x_old[row]
    t, h, fixed, function = (
        float(block.t_old[row]),
        float(block.h[row]),
        p.tolist(),
        _function(watched.values, numbers=True),
    )

    def value(s: float) -> float:
        x = np.zeros_like(start)
        for coefficients in powers:
            x = (x + coefficients) * s
        return float(function([*(start + x).tolist(), t + s * h, *fixed])[number])

    a, b, f_a, f_b = low, high, value(low), value(high)
    if not f_b < 0.0:
        return high
    c, f_c, share = a, f_a, 0.5
    while abs(b - a) > 2.0 * UNIT * max(abs(a), abs(b)):
        s = a + share * (b - a)
        f = value(s)
        if (f < 0.0) == (f_a < 0.0):
            c, f_c = a, f_a
        else:
            c, f_c, b, f_b = b, f_b, a, f_a
        a, f_a = s, f
        # inverse quadratic interpolation where that is safe, and no step below rounding
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b) if f_c != f_b else 0.5
        share = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi and f_c != f_a and f_b != f_a:
            share = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        least = min(0.5, UNIT * max(abs(a), abs(b)) / abs(b - a)) if b != a else 0.5
        share = min(max(share, least), 1.0 - least)
    return a if f_a < 0.0 else b


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
