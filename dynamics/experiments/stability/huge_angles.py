"""Huge angles: sine and cosine of the backends at random angles of every size, beside multiprecision, in ulps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

import cgraph as cg
from cgraph.extend import Array

from ...multiprecision.chain_equations import Pair
from ...multiprecision.flint_numbers import working
from .case_result import CaseResult, Measurement
from .known_limits import reason
from .single_evaluations import SEED, available

SECTION, CASE = "Sine and cosine", "sine and cosine"
BOUND = 2.0  # ulp, what cgraph promises of its polynomials; a correctly rounded value is within half of one
COUNT, QUICK = 4000, 500  # angles of each range
DIGITS = 360  # more than the largest angle has before its point
RANGES: dict[str, tuple[float, float]] = {  # decimal exponents
    "1e-300 .. 1": (-300.0, 0.0),
    "1 .. 1e6": (0.0, 6.0),
    "1e6 .. 1e9": (6.0, 9.0),
    "1e9 .. 1e16": (9.0, 16.0),
    "1e16 .. 1e308": (16.0, 308.0),
}


def results(count: int = COUNT, backends: Sequence[str] | None = None) -> Iterator[CaseResult]:
    """A result for each backend, at single points and in a batch, with a measurement for each range of angles."""
    x = cg.variable("x")
    graph = cg.Graph([x], {"sin": cg.sin(x), "cos": cg.cos(x)})
    points = {name: angles(low, high, count) for name, (low, high) in RANGES.items()}
    known = {name: exact(each) for name, each in points.items()}
    for backend in backends or available():
        function = cg.compile(graph, backend)
        for way, evaluate in ((backend, _one_by_one), (f"{backend}, batch", _in_a_batch)):
            off = {name: ulps(evaluate(function, points[name]), known[name]) for name in RANGES}
            rows = tuple([Measurement(f"{name} rad", off[name], BOUND, "ulp", "of the exact value") for name in off])
            about = f"{count} random angles of each range, both signs"
            yield CaseResult(SECTION, CASE, about, way, rows, reason=reason(SECTION, CASE, way, rows))


def _one_by_one(function: cg.Compiled, points: Array) -> Array:
    return np.array([function([each]) for each in points.tolist()]).T


def _in_a_batch(function: cg.Compiled, points: Array) -> Array:
    return function.batch(points[None])


def angles(low: float, high: float, count: int) -> Array:
    """Random angles, their logarithms uniform, and of both signs."""
    rng = np.random.default_rng(SEED)
    sizes: Array = 10.0 ** rng.uniform(low, high, count)
    return np.where(rng.random(count) < 0.5, -sizes, sizes)


def exact(points: Array) -> Pair:
    """Sine and cosine, (2, N)."""
    with working(DIGITS) as number:
        at = [number(x) for x in points.tolist()]
        rows = [[x.sin() for x in at], [x.cos() for x in at]]
        high = [[float(each.mid()) for each in row] for row in rows]
        low = [
            [float((each - near).mid()) for each, near in zip(row, nearest, strict=True)]
            for row, nearest in zip(rows, high, strict=True)
        ]
    return Pair(np.array(high), np.array(low))


def ulps(values: Array, known: Pair) -> float:
    """The largest error."""
    return float(np.max(np.abs(known.deviation(values)) / np.spacing(np.abs(known.high))))
