"""Crossing search: where quantities of a motion first fall below zero, certain but for rounding, by bounds on cells.

On a cell, a part of a step, states lie in the hull of the Bernstein coefficients of the dense output, and interval
arithmetic bounds quantities and their slopes along the motion. A cell is clear of zeros, or a quantity goes one way in
it, or it is halved. Of quantities as smooth as the rate, which steps resolve, bounds are those of the control points of
polynomials through values.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, kept_by_first, memo
from cgraph.extend import enclosure

from ...integrators.problem import reaches
from ..steps.dense_output import UNIT, Indices, StepBlock
from ..steps.row_values import compiled
from ..steps.state_sizes import Flags

MOST_CELLS, TOGETHER = 4096, 256  # that wait at once, and steps that are searched together
MOST_NUMBERS = 2**19  # of operations on the cells that wait, or on points that are looked at together
FITTED = 8  # degree of polynomials through values
SHORTEST, FINE = 2.0**-50, 2.0**-12  # of a step, a cell; and one of what the step resolves, but for rounding
LEFT = 1e-3  # of the largest that a quantity has been in a step, by which it has left zero
PARTS = np.array([0.0, *2.0 ** np.arange(-20.0, -5.0), *np.linspace(0.0, 1.0, 33)[1:]])  # where one that begins at zero
DEGREES = 8  # of dense output, whose matrices are kept
OFTEN = 80  # calls of a graph, which take about as long as to compile it
ALIKE = 256  # points, that take about as long as a call

NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(FITTED + 1) / FITTED)  # shares of a cell, its ends with them
# from values there to Bernstein coefficients
TO_POINTS = np.linalg.inv(
    [[math.comb(FITTED, k) * s**k * (1.0 - s) ** (FITTED - k) for k in range(FITTED + 1)] for s in NODES.tolist()]
)


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
    resolved: int = 0  # of the last ones, how many are as smooth as the rate

    @cached_property
    def states(self) -> list[int]:
        """States that they depend on."""
        return [k for k in range(self.size) if reaches(self.values.outputs.values(), self.values.inputs[k : k + 1])]

    @cached_property
    def slopes(self) -> Graph:
        """Their tangents: inputs those of `values`, then tangents of states and t."""
        return cg.simplify(cg.jvp(self.values, list(self.values.input_names[: self.size + 1])))

    @cached_property
    def affine(self) -> tuple[bool, ...]:
        """Whether each is a sum of states and t times what is constant, whose bounds are those of control points."""
        moving = self.slopes.inputs[: self.size + 1]
        return tuple([not reaches([slope], moving) for slope in self.slopes.outputs.values()])

    @cached_property
    def curved(self) -> Graph:
        """Bounds of those that are not affine: inputs the parameters, then lows and highs of states and t."""
        outputs = [each for each, affine in zip(self.values.outputs.items(), self.affine, strict=True) if not affine]
        return enclosure(Graph(self.values.inputs, dict(outputs)), exact=self._parameters)

    @cached_property
    def slope_bounds(self) -> Graph:
        """The same of the slopes."""
        return enclosure(self.slopes, exact=self._parameters)

    @property
    def bounded(self) -> int:
        """How many of the first ones are not resolved."""
        return len(self.values.outputs) - self.resolved

    @kept_by_first
    def part(self, first: int, last: int) -> Quantities:
        """Those from a number to another."""
        outputs = dict(list(self.values.outputs.items())[first:last])
        return Quantities(Graph(self.values.inputs, outputs), self.size, max(0, last - max(first, self.bounded)))

    @property
    def _parameters(self) -> list[str]:
        return list(self.values.input_names[self.size + 1 :])


quantities = kept_by_first(Quantities)


class _Batch:
    """The outputs (k, N) of a graph at points (inputs, N), by Python's code; often asked, by machine code."""

    def __init__(self, graph: Graph) -> None:
        self._graph, self._calls, self._function = graph, 0, compiled(graph, "python").batch

    def __call__(self, points: Array) -> Array:
        """The outputs."""
        before, self._calls = self._calls, self._calls + 1 + points.shape[1] // ALIKE
        if before < OFTEN <= self._calls:
            self._function = cg.compile(self._graph).batch
        together = max(1, 8 * MOST_NUMBERS // len(self._graph.nodes))  # what a graph in Python holds at once
        parts = np.split(points, range(together, points.shape[1], together), axis=1)
        return np.concatenate([self._function(part) for part in parts], axis=1)


_batch = kept_by_first(_Batch)


def outputs_of(graph: Graph, *parts: Any) -> Array:
    """Outputs (k, N) of a graph at inputs that go along the last axis, or are the same at all points."""
    points = np.empty((len(graph.inputs), max([part.shape[-1] for part in parts if np.ndim(part) == 2])))
    first = 0
    for part in parts:
        points[first : first + len(part)] = part if np.ndim(part) == 2 else np.reshape(part, (-1, 1))
        first += len(part)
    with np.errstate(all="ignore"):
        return _batch(graph)(points)


def steps_near_zero(watched: Quantities, p: Array, block: StepBlock) -> list[int]:
    """Steps in which quantities may not be positive."""
    rows = np.arange(len(block.t))
    low, _ = _bounds(watched, p, block, rows, np.zeros(len(rows)), np.ones(len(rows)))
    return list(np.flatnonzero(~(low >= 0.0).all(axis=0)).tolist())


def first_crossing(watched: Quantities, p: Array, block: StepBlock, fresh: Array) -> tuple[Crossing | None, bool]:
    """The first zero of quantities in these steps, that are positive before; whether cells were too many to be sure.

    fresh: (k,), of a quantity that begins at zero how far it is rounding; it counts as positive until it has left that
    in the first step; NaN of the others.
    """
    rows, best, is_sure = np.arange(len(block.t)), None, True
    low, _ = _bounds(watched, p, block, rows, np.zeros(len(rows)), np.ones(len(rows)))
    doubtful, number = np.nonzero(~(low >= 0.0).T)
    for n in dict.fromkeys(number.tolist()):
        one, where = watched.part(n, n + 1), doubtful[number == n]
        left = 0.0 if where[0] else _left_at(one, p, block, fresh[n])
        for steps in np.split(where, range(TOGETHER, len(where), TOGETHER)):
            a = np.where(steps == 0, left, 0.0)
            found, sure = _first_zero(one, p, block, steps[a < 1.0], a[a < 1.0], best)
            is_sure = is_sure and sure
            if found is not None:
                best = Crossing(*found, n)
                break
    return best, is_sure


def _first_zero(
    one: Quantities, p: Array, block: StepBlock, rows: Indices, a: Array, before: Crossing | None
) -> tuple[tuple[int, float] | None, bool]:
    """Step and share of it where one quantity first falls below zero, from share a (n,) of each of some steps on.

    before: another crossing, after which nothing counts.
    """
    best, b = None if before is None else before[:2], np.ones(len(rows))
    most = max(64, min(MOST_CELLS, MOST_NUMBERS // len(one.values.nodes)))
    found: tuple[int, float] | None = None
    while len(rows):
        begins, ends = np.split(_values(one.values, p, block, np.tile(rows, 2), np.concatenate([a, b]))[0], 2)
        clear, goes_one_way, _ = told_by_slopes(one, p, block, (rows, a, b), begins, ends)
        told = clear | goes_one_way | (b - a <= (FINE if one.resolved else SHORTEST))
        passes = np.flatnonzero(told & ((begins < 0.0) | (ends < 0.0)))
        for k in passes[np.lexsort((a[passes], rows[passes]))].tolist():
            row, at = int(rows[k]), float(a[k])
            if best is not None and (row, at) >= best:
                break
            place = row, at if begins[k] < 0.0 else _root(one, p, block, row, at, float(b[k]))
            if best is None or place < best:
                best = found = place
        split = ~told
        if best is not None:
            split &= (rows < best[0]) | ((rows == best[0]) & (a < best[1]))
        rows, a, b = rows[split], a[split], b[split]
        middle = 0.5 * (a + b)
        rows, a, b = np.tile(rows, 2), np.concatenate([a, middle]), np.concatenate([middle, b])
        if len(rows) > most:
            return found, False
    return found, True


def told_by_slopes(
    one: Quantities,
    p: Array,
    block: StepBlock,
    cells: tuple[Indices, Array, Array],
    begins: Array,
    ends: Array,
    noise: Array | float = 0.0,
) -> tuple[Flags, Flags, Flags]:
    """Of a quantity, with values at both ends of cells: whether it keeps its sign, goes one way, and is bounded.

    cells: steps, and shares a and b between which parts of them lie, (n,) each.
    """
    down, up = _slope_bounds(one, p, block, *cells)
    turned, width = begins < 0.0, cells[2] - cells[1]
    one_way, bounded = (down >= 0.0) | (up <= 0.0), np.isfinite(up - down)
    least, most = np.where(turned, -up, down), np.where(turned, -down, up)
    begins, ends = np.abs(begins), np.where(turned, -ends, ends)
    with np.errstate(all="ignore"):
        # its size lies above the lines of the least slope from the left and the largest from the right, which meet here
        meet = (begins * most - ends * least + most * least * width) / (most - least)
    clear = bounded & (np.where(one_way, np.minimum(begins, ends), meet) > noise)
    return clear, one_way & bounded, bounded


def _left_at(one: Quantities, p: Array, block: StepBlock, rounding: float) -> float:
    """The share of the first step from which a quantity that begins at zero is looked at; 1 if it stays on its side."""
    if math.isnan(rounding):
        return 0.0
    begin, *values = _values(one.values, p, block, np.zeros(len(PARTS), dtype=np.intp), PARTS)[0]
    if begin > rounding:
        return 0.0
    sizes = np.abs(values)
    left = np.flatnonzero((values >= LEFT * np.fmax.accumulate(sizes)) & (sizes > rounding))
    return float(PARTS[1 + left[0]]) if len(left) else 1.0 - UNIT if values[-1] < -rounding else 1.0


def _values(graph: Graph, p: Array, block: StepBlock, rows: Indices, s: Array) -> Array:
    return outputs_of(graph, block.polynomials_at(rows, s).T, block.times_at(rows, s)[None], p)


def _root(one: Quantities, p: Array, block: StepBlock, row: int, low: float, high: float) -> float:
    """The first share of a step, but for rounding, at which a quantity that falls is below zero (Chandrupatla 1997)."""
    assert block.dense is not None
    t, h, m, function = float(block.t_old[row]), float(block.h[row]), one.size, compiled(one.values, "python").values
    known, powers = [*block.x_old[row].tolist(), t, *p.tolist()], block.dense[row][::-1].T.tolist()
    moving = [(k, known[k], powers[k]) for k in one.states]

    def value(s: float) -> float:
        for k, start, coefficients in moving:
            x = 0.0
            for coefficient in coefficients:
                x = (x + coefficient) * s
            known[k] = start + x
        known[m] = t + s * h
        return float(function(known)[0])

    a, b, f_a, f_b = low, high, value(low), value(high)
    if not f_b < 0.0:
        return high
    c, f_c, share = a, f_a, 0.5
    while abs(b - a) > 2.0 * UNIT * max(abs(a), abs(b), SHORTEST):
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
def _binomials(degree: int) -> tuple[Array, Array, Indices, Indices]:
    """C(k, i), 0 for k < i; the matrix from powers to Bernstein's polynomials; k - i, and i."""
    i, k = np.indices((degree + 1, degree + 1))
    choose = np.array([[math.comb(k, i) for k in range(degree + 1)] for i in range(degree + 1)], dtype=np.float64)
    return choose, choose.T / choose[:, degree], np.maximum(k - i, 0), i


def _control_points(coefficients: Array, a: Array, b: Array) -> Array:
    """Bernstein coefficients (n, degree + 1, m) of polynomials (n, degree + 1, m) on [a, b] (n,)."""
    choose, matrix, before, inside = _binomials(coefficients.shape[1] - 1)
    if not a.any() and (b == 1.0).all():
        return np.asarray(matrix @ coefficients)
    parts = choose * a[:, None, None] ** before * (b - a)[:, None, None] ** inside
    return np.asarray(matrix @ parts @ coefficients)


def _state_points(block: StepBlock, rows: Indices, a: Array, b: Array) -> Array:
    """Control points of states and times on cells, (n, degree + 1, m + 1)."""
    assert block.dense is not None
    x = _control_points(np.concatenate([block.x_old[rows, None], block.dense[rows]], axis=1), a, b)
    t = np.linspace(block.times_at(rows, a), block.times_at(rows, b), x.shape[1], axis=1)
    return np.concatenate([x, t[:, :, None]], axis=2)


def _slope_points(block: StepBlock, rows: Indices, a: Array, b: Array) -> Array:
    """The same of their derivatives by the share of the step, (n, degree, m + 1)."""
    assert block.dense is not None
    powers = np.arange(1, block.dense.shape[1] + 1)[:, None]
    slopes = _control_points(powers * block.dense[rows], a, b)
    h = np.broadcast_to(block.h[rows, None, None], (*slopes.shape[:2], 1))
    return np.concatenate([slopes, h], axis=2)


def _ends(points: Array) -> tuple[Array, Array]:
    """Least and largest of control points, (m, n)."""
    return points.min(axis=1).T, points.max(axis=1).T


def _fitted_points(graph: Graph, p: Array, block: StepBlock, rows: Indices, a: Array, b: Array) -> Array:
    """Control points (k, n, degree + 1) of polynomials through the values of quantities on cells."""
    s, each = (a[:, None] + (b - a)[:, None] * NODES).reshape(-1), np.repeat(rows, len(NODES))
    return np.asarray(_values(graph, p, block, each, s).reshape(-1, len(rows), len(NODES)) @ TO_POINTS.T)


def _bounds(watched: Quantities, p: Array, block: StepBlock, rows: Indices, a: Array, b: Array) -> tuple[Array, Array]:
    """Lower and upper bounds of quantities on cells, (k, n)."""
    if watched.resolved:
        bounded = _bounds(watched.part(0, watched.bounded), p, block, rows, a, b)
        smooth = watched.part(watched.bounded, len(watched.values.outputs))
        fitted = _fitted_points(smooth.values, p, block, rows, a, b)
        return np.vstack([bounded[0], fitted.min(axis=2)]), np.vstack([bounded[1], fitted.max(axis=2)])
    points, affine = _state_points(block, rows, a, b), np.array(watched.affine)
    low, high = np.empty((2, len(affine), len(rows)))
    if affine.any():
        at = outputs_of(watched.values, points.reshape(-1, points.shape[2]).T, p)[affine]
        parts = at.reshape(len(at), *points.shape[:2])
        low[affine], high[affine] = parts.min(axis=2), parts.max(axis=2)
    if not affine.all():
        low[~affine], high[~affine] = np.split(outputs_of(watched.curved, p, *_ends(points)), 2)
    return low, high


def _slope_bounds(
    one: Quantities, p: Array, block: StepBlock, rows: Indices, a: Array, b: Array
) -> tuple[Array, Array]:
    """Lower and upper bounds of the slope of one quantity by the share of the step on cells, (n,)."""
    if one.resolved:
        ways = FITTED * np.diff(_fitted_points(one.values, p, block, rows, a, b)[0], axis=1) / (b - a)[:, None]
        return ways.min(axis=1), ways.max(axis=1)
    points, slopes = _state_points(block, rows, a, b), _slope_points(block, rows, a, b)
    if one.affine[0]:
        at = np.repeat(points[:, :1], slopes.shape[1], axis=1).reshape(-1, points.shape[2]).T
        found = outputs_of(one.slopes, at, p, slopes.reshape(-1, slopes.shape[2]).T)[0].reshape(slopes.shape[:2])
        return found.min(axis=1), found.max(axis=1)
    (low, high), (down, up) = _ends(points), _ends(slopes)
    least, largest = outputs_of(one.slope_bounds, p, np.vstack([low, down]), np.vstack([high, up]))
    return least, largest
