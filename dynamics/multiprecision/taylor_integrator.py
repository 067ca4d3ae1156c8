"""Integration by Taylor series: a trajectory to any number of digits, for motions that are not stiff.

Order and step follow Jorba and Zou, "A software package for the numerical integration of ODEs by means of high-order
Taylor methods", Experimental Mathematics 14 (2005): the order grows with the digits, 1.15 a digit, and the step is
about 1/e^2 of the radius of convergence, read off the last coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import mul

import numpy as np

from cgraph import Graph, Node
from cgraph._shared import columns
from cgraph.extend import NoSeriesError, jets, topological

from ..systems.arguments import TIME
from .flint_numbers import Number, log2_size, sign, value, working

Entry = tuple[int, Callable[..., Number], list[int]]  # where the result goes, of which function, of the numbers where


class Series:
    """The series of a state equation, and its coefficients at a point.

    graph: inputs the states, then others; outputs the rates in the order of `states`.
    constants: {name of an input: number} for all inputs but the states and t.
    number: the constructor of numbers, at the precision at which the series will be used.

    switches: of each piecewise operation, coefficients 0, 1, .. of what chooses its piece by its sign.  sides: that
    sign.  forced: {piecewise operation: the sign}, imposed in the next expansion where the value at the point does not
    tell, as just after a switch.
    """

    def __init__(
        self, graph: Graph, states: Sequence[str], constants: Mapping[str, object], number: Callable[..., Number]
    ) -> None:
        self.number, self._m = number, len(states)
        try:
            self._jets = jets(graph, TIME, exact=True)
        except NoSeriesError as error:
            raise NotImplementedError(f"a reference solution needs Taylor series, and {error}") from None
        self._pieces = {node: k for k, node in enumerate(self._jets.pieces)}
        self.switches: list[list[Number]] = [[] for _ in self._pieces]
        self.sides = [0] * len(self._pieces)
        self.forced: dict[int, int] = {}
        self._start = _Evaluation(self._jets.start, constants, number, self._value)
        self._order = _Evaluation(self._jets.order, {}, number, self._value)
        self._timed = TIME in graph.input_names

    def _value(self, node: Node) -> Callable[..., Number]:
        """The value of an operation; of a piecewise one, of the piece of its side, which it chooses here."""
        if node not in self._pieces:
            return value(columns(node.op))
        k, piece = self._pieces[node], columns(node.op).piece
        assert piece is not None

        def chosen(*args: Number) -> Number:
            side = sign(args[0] - args[1] if len(args) == 2 else args[0])
            self.sides[k] = side = self.forced.get(k, side)
            slot, factor = piece(side)
            return self.number(factor) if slot is None else args[slot] if factor == 1 else factor * args[slot]

        return chosen

    def expand(self, x: Sequence[Number], t: Number, order: int) -> list[list[Number]]:
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

    def rate(self, x: Sequence[Number], t: Number) -> list[Number]:
        """f(x, t)."""
        self.forced = {}
        return [coefficients[1] for coefficients in self.expand(x, t, 1)]

    def _run(self, x: Sequence[Number], t: Number, order: int) -> list[list[Number]]:
        m, sums = self._m, self._jets.sums
        first = self._start([*x, t] if self._timed else x)
        rates, zeros = first[:m], first[m : m + self._jets.zeros]
        coefficients = [[each] for each in x]
        self.switches = [[each] for each in first[m + self._jets.zeros :]]
        left: list[list[Number]] = [[] for _ in range(sums)]
        right: list[list[Number]] = [[] for _ in range(sums)]
        for k in range(1, order + 1):
            for row, rate in zip(coefficients, rates, strict=True):
                row.append(rate / k)
            if k == order:
                break
            known = map(self._sum, left, right, self._jets.safe)
            now = self._order([*rates, self.number(1), self.number(k), *zeros, *known, *map(self.number, self.sides)])
            rates = now[m : 2 * m]
            for row, each in zip((*left, *right, *self.switches), now[2 * m :], strict=True):
                row.append(each)
        return coefficients

    def _sum(self, left: Sequence[Number], right: Sequence[Number], safe: bool) -> Number:
        """The sum over 0 < j < k of left_j right_k-j."""
        if safe:
            return sum([a * b for a, b in zip(left, right[::-1], strict=True) if a != 0 and b != 0], self.number(0))
        return sum(map(mul, left, right[::-1]), self.number(0))


def _side(switch: Sequence[Number]) -> int:
    """The sign of a series just after the point: that of its first coefficient that is not zero."""
    return next((side for each in switch if (side := sign(each))), 0)


class _Evaluation:
    """A graph over numbers of any precision; what its constants alone decide is computed once."""

    def __init__(
        self,
        graph: Graph,
        constants: Mapping[str, object],
        number: Callable[..., Number],
        value_of: Callable[[Node], Callable[..., Number]],
    ) -> None:
        self._numbers: list[Number] = []
        self._steps: list[Entry] = []
        places: dict[Node, int] = {}
        moving: set[int] = set()
        for node in (*graph.inputs, *topological(graph.outputs.values())):
            if node in places:
                continue
            k = places[node] = len(self._numbers)
            args = [places[arg] for arg in node.args]
            known = None
            if node.value is not None:
                known = number(node.value)
            elif node.name in constants and not args:
                known = number(constants[str(node.name)])
            elif args and moving.isdisjoint(args):
                known = value_of(node)(*[self._numbers[arg] for arg in args])
            else:
                moving.add(k)
                self._steps += [(k, value_of(node), args)] if args else []
            self._numbers.append(known)
        self._inputs = [places[node] for node in graph.inputs if node.name not in constants]
        self._outputs = [places[node] for node in graph.outputs.values()]

    def __call__(self, inputs: Sequence[Number]) -> list[Number]:
        numbers = self._numbers
        for k, each in zip(self._inputs, inputs, strict=True):
            numbers[k] = each
        for k, function, args in self._steps:
            numbers[k] = function(*[numbers[arg] for arg in args])
        return [numbers[k] for k in self._outputs]


GUARD = 12  # digits of arithmetic beyond the tolerance
SAMPLES = 16  # places in a step at which a switch is looked for
STUCK = 3  # steps of no length one after another
PROBE, MANY = 50, 1e6  # steps between looks at how many there will be, and how many are too many
SMALLEST_STEP = -1000.0  # log2 of a step that no motion needs


class ReferenceFailedError(ArithmeticError):
    """A reference that cannot be had: a singularity on the way, or more digits lost than allowed for."""


def taylor(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[object],
    times: Sequence[float],
    values: Mapping[str, object],
    digits: int,
) -> tuple[list[list[Number]], str]:
    """The states at `times` from `start` at t = 0, with a relative truncation error of 10^-digits a step.

    Where a piecewise operation switches, the step ends there. Returns rows of numbers, and a sentence on the run.
    Raises ReferenceFailedError when the solution leaves the domain of f, runs into a singularity, slides along a
    switch, or would take more than a million steps.
    """
    order = math.ceil(1.15 * digits) + 2
    with working(digits + GUARD) as number:
        series = Series(graph, states, values, number)
        x, t = [number(value).mid() for value in start], number(0)
        rows: list[list[Number]] = []
        steps = stuck = 0
        while len(rows) < len(times):
            if times[len(rows)] == t:
                rows.append(x)
                continue
            coefficients = series.expand(x, t, order)
            h = number(min(step_size(coefficients, digits, float(t)), float(times[-1] - t)))
            free = h
            h, series.forced = _until_switch(series, h, digits + GUARD)
            stuck = stuck + 1 if float(h / free) < 10.0**-digits else 0
            if stuck == STUCK:
                raise ReferenceFailedError(
                    f"the solution slides along a switch of its equations at t = {float(t):.17g}"
                )
            while len(rows) < len(times) and times[len(rows)] < t + h:
                rows.append([_at(row, times[len(rows)] - t) for row in coefficients])
            if abs(float(times[-1] - t - h)) == 0.0:
                h = times[-1] - t
            x, t = [_at(row, h) for row in coefficients], (t + h).mid()
            steps += 1
            if steps % PROBE == 0 and steps * abs(times[-1]) > MANY * abs(float(t)):
                raise ReferenceFailedError(
                    f"the first {steps} steps come to t = {float(t):.3g} s, so that {times[-1]:g} s would take some "
                    f"{steps * times[-1] / float(t):.0e}: the motion is too fast for so long a time, or starts near a "
                    "singularity, as where a linkage is folded"
                )
        return rows, f"Taylor series of order {order}, {steps} steps"


def _at(coefficients: Sequence[Number], h: Number) -> Number:
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * h + coefficient
    return total.mid()


def step_size(coefficients: Sequence[Sequence[Number]], digits: int, t: float) -> float:
    """The step at which the last two terms of each state are 10^-digits of what the step moves it."""
    size = np.array([[log2_size(coefficient) for coefficient in row] for row in coefficients])
    if np.isnan(size).any():
        raise ReferenceFailedError(f"the solution leaves the domain of its equations at t = {t:.17g}")
    size = size[np.isfinite(size[:, 1:]).any(axis=1), 1:]  # what does not move sets no step
    if not size.size:
        return math.inf
    k = np.arange(1, size.shape[1] + 1)
    tolerance = -digits * math.log2(10.0)
    low, high = 2 * SMALLEST_STEP, -2 * SMALLEST_STEP
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        terms = size + k * middle
        if (terms[:, -2:].max(axis=1) <= tolerance + terms[:, :-2].max(axis=1)).all():
            low = middle
        else:
            high = middle
    if low < SMALLEST_STEP:
        raise ReferenceFailedError(f"the steps shrink to nothing at t = {t:.17g}: there is a singularity")
    return math.exp2(min(low, 1000.0))


def _until_switch(series: Series, h: Number, digits: int) -> tuple[Number, dict[int, int]]:
    """The step to the first switch of a piecewise operation, and the sides to take after it."""
    forced: dict[int, int] = {}
    first = h
    for piece, (d, side) in enumerate(zip(series.switches, series.sides, strict=True)):
        if not side:
            continue
        low = first * 0
        for j in range(1, SAMPLES + 1):
            high = first * j / SAMPLES
            if sign(_at(d, high)) == -side:
                break
            low = high
        else:
            continue
        for _ in range(math.ceil(digits * math.log2(10.0))):
            middle = ((low + high) / 2).mid()
            if sign(_at(d, middle)) == -side:
                high = middle
            else:
                low = middle
        if (first - high) > 0:
            forced = {}
        first = high
        forced[piece] = -side
    return first, forced
