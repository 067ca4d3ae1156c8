"""Integration by Taylor series: a trajectory to any number of digits, for motions that are not stiff.

Order and step follow Jorba and Zou, "A software package for the numerical integration of ODEs by means of high-order
Taylor methods", Experimental Mathematics 14 (2005): the order grows with the digits, 1.15 a digit, and the step is
about 1/e^2 of the radius of convergence, read off the last coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from functools import partial
from operator import mul
from typing import TYPE_CHECKING

import numpy as np

from cgraph import Graph, Node
from cgraph._shared import columns
from cgraph.extend import NoSeriesError, jets

from ..systems.arguments import TIME
from .decimal_numbers import GraphValues, log10_size, mpmath_context, number, piece_of, sign, value, working

if TYPE_CHECKING:
    from mpmath.ctx_mp import MPContext


class Series:
    """The series of a state equation, and its coefficients at a point.

    graph: inputs the states, then others; outputs the rates.  constants: {input: number}, without states and t.
    mp: mpmath at the precision of the series.  switches: coefficients of what chooses a piece.
    sides: its sign.  forced: {piecewise operation: its sign in the next expansion}, just after a switch.
    """

    def __init__(self, graph: Graph, states: Sequence[str], constants: Mapping[str, object], mp: MPContext) -> None:
        self._mp, self._m = mp, len(states)
        try:
            self._jets = jets(graph, TIME, exact=True)
        except NoSeriesError as error:
            raise NotImplementedError(f"a reference solution needs Taylor series, and {error}") from None
        self._pieces = {node: k for k, node in enumerate(self._jets.pieces)}
        self.switches: list[list[Decimal]] = [[] for _ in self._pieces]
        self.sides = [0] * len(self._pieces)
        self.forced: dict[int, int] = {}
        self._start = GraphValues(self._jets.start, constants, self._value)
        self._order = GraphValues(self._jets.order, {}, self._value)
        self._timed = TIME in graph.input_names

    def _value(self, node: Node) -> Callable[..., Decimal]:
        """The value of an operation; of a piecewise one, of the piece of its side, which it chooses here."""
        if node not in self._pieces:
            return value(columns(node.op), self._mp)
        k, piece = self._pieces[node], columns(node.op).piece
        assert piece is not None

        def side(switch: Decimal) -> int:
            self.sides[k] = self.forced.get(k, sign(switch))
            return self.sides[k]

        return partial(piece_of, piece, side)

    def expand(self, x: Sequence[Decimal], t: Decimal, order: int) -> list[list[Decimal]]:
        """Coefficients 0 .. order >= 1 of each state, around the state x at time t."""
        while True:
            coefficients = self._run(x, t, order)
            wrong = {
                k: side
                for k, switch in enumerate(self.switches)
                if k not in self.forced and (side := _side(switch)) != self.sides[k]
            }
            if not wrong:
                return coefficients
            self.forced |= wrong

    def _run(self, x: Sequence[Decimal], t: Decimal, order: int) -> list[list[Decimal]]:
        m, sums = self._m, self._jets.sums
        first = self._start([*x, t] if self._timed else x)
        rates, zeros = first[:m], first[m : m + self._jets.zeros]
        coefficients = [[each] for each in x]
        self.switches = [[each] for each in first[m + self._jets.zeros :]]
        left: list[list[Decimal]] = [[] for _ in range(sums)]
        right: list[list[Decimal]] = [[] for _ in range(sums)]
        for k in range(1, order + 1):
            for row, rate in zip(coefficients, rates, strict=True):
                row.append(rate / k)
            if k == order:
                break
            known = map(self._sum, left, right, self._jets.safe)
            now = self._order([*rates, Decimal(1), Decimal(k), *zeros, *known, *map(Decimal, self.sides)])
            rates = now[m : 2 * m]
            for row, each in zip((*left, *right, *self.switches), now[2 * m :], strict=True):
                row.append(each)
        return coefficients

    def _sum(self, left: Sequence[Decimal], right: Sequence[Decimal], safe: bool) -> Decimal:
        """The sum over 0 < j < k of left_j right_k-j."""
        if safe:
            return sum([a * b for a, b in zip(left, right[::-1], strict=True) if a and b], Decimal(0))
        return sum(map(mul, left, right[::-1]), Decimal(0))


def _side(switch: Sequence[Decimal]) -> int:
    """The sign of a series just after the point: that of its first coefficient that is not zero."""
    return next((side for each in switch if (side := sign(each))), 0)


GUARD = 12  # digits of arithmetic beyond the tolerance
SAMPLES = 16  # places in a step at which a switch is looked for
STUCK = 3  # steps of no length one after another
PROBE, MANY = 50, 1e6  # steps between looks at how many there will be, and how many are too many
SMALLEST_STEP = -300.0  # log10 of a step that no motion needs


class ReferenceFailedError(ArithmeticError):
    """A reference that cannot be had: a singularity on the way, or more digits lost than allowed for."""


def taylor(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[object],
    times: Sequence[float],
    values: Mapping[str, object],
    digits: int,
) -> tuple[list[list[Decimal]], str]:
    """The states at `times` from `start` at t = 0, with a relative truncation error of 10^-digits a step.

    Where a piecewise operation switches, the step ends there. Returns rows of numbers, and a sentence on the run.
    Raises ReferenceFailedError when the solution leaves the domain of f, runs into a singularity, slides along a
    switch, or would take more than a million steps.
    """
    order = math.ceil(1.15 * digits) + 2
    with working(digits + GUARD):
        series = Series(graph, states, values, mpmath_context(digits + GUARD))
        x, t, at = [number(value) for value in start], Decimal(0), [number(time) for time in times]
        rows: list[list[Decimal]] = []
        steps = stuck = 0
        while len(rows) < len(at):
            if at[len(rows)] == t:
                rows.append(x)
                continue
            coefficients = series.expand(x, t, order)
            free = min(number(step_size(coefficients, digits, float(t))), at[-1] - t)
            h, series.forced = _until_switch(series, free, digits + GUARD)
            stuck = stuck + 1 if float(h / free) < 10.0**-digits else 0
            if stuck == STUCK:
                raise ReferenceFailedError(
                    f"the solution slides along a switch of its equations at t = {float(t):.17g}"
                )
            while len(rows) < len(at) and at[len(rows)] < t + h:
                rows.append([_at(row, at[len(rows)] - t) for row in coefficients])
            x, t = [_at(row, h) for row in coefficients], t + h
            steps += 1
            if steps % PROBE == 0 and steps * abs(times[-1]) > MANY * abs(float(t)):
                raise ReferenceFailedError(
                    f"the first {steps} steps come to t = {float(t):.3g} s, so that {times[-1]:g} s would take some "
                    f"{steps * times[-1] / float(t):.0e}: the motion is too fast for so long a time, or starts near a "
                    "singularity, as where a linkage is folded, or is stiff"
                )
        return rows, f"Taylor series of order {order}, {steps} steps"


def _at(coefficients: Sequence[Decimal], h: Decimal) -> Decimal:
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * h + coefficient
    return total


def step_size(coefficients: Sequence[Sequence[Decimal]], digits: int, t: float) -> float:
    """The step at which the last two terms of each state are 10^-digits of what the step moves it."""
    size = np.array([[log10_size(coefficient) for coefficient in row] for row in coefficients])
    if np.isnan(size).any():
        raise ReferenceFailedError(f"the solution leaves the domain of its equations at t = {t:.17g}")
    size = size[np.isfinite(size[:, 1:]).any(axis=1), 1:]  # what does not move sets no step
    if not size.size:
        return math.inf
    k = np.arange(1, size.shape[1] + 1)
    low, high = 2 * SMALLEST_STEP, -2 * SMALLEST_STEP
    while high - low > 0.003:
        middle = 0.5 * (low + high)
        terms = size + k * middle
        if (terms[:, -2:].max(axis=1) <= terms[:, :-2].max(axis=1) - digits).all():
            low = middle
        else:
            high = middle
    if low < SMALLEST_STEP:
        raise ReferenceFailedError(f"the steps shrink to nothing at t = {t:.17g}: there is a singularity")
    return math.pow(10.0, min(low, 300.0))


def _until_switch(series: Series, h: Decimal, digits: int) -> tuple[Decimal, dict[int, int]]:
    """The step to the first switch of a piecewise operation, and the sides to take after it."""
    forced: dict[int, int] = {}
    first = h
    for piece, (d, side) in enumerate(zip(series.switches, series.sides, strict=True)):
        if not side:
            continue
        low = Decimal(0)
        for j in range(1, SAMPLES + 1):
            high = first * j / SAMPLES
            if sign(_at(d, high)) == -side:
                break
            low = high
        else:
            continue
        for _ in range(math.ceil(digits * math.log2(10.0))):
            middle = (low + high) / 2
            if sign(_at(d, middle)) == -side:
                high = middle
            else:
                low = middle
        if high < first:
            forced = {}
        first = high
        forced[piece] = -side
    return first, forced
