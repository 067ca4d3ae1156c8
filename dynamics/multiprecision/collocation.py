"""Integration by implicit collocation: a trajectory to many digits for stiff motions.

On each step the rate is a polynomial through its values at the Radau points (the method Radau IIA of as many stages,
L-stable; Hairer and Wanner, "Solving Ordinary Differential Equations II", section IV.5). A step is as long as that
polynomial, written in Legendre's, has its last terms below the tolerance: it resolves the whole solution on the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array

from ..systems.arguments import TIME
from .flint_numbers import Number, flint, log2_size, working
from .taylor_integrator import ReferenceFailedError, Series, step_size

if TYPE_CHECKING:
    from flint import arb_mat

GUARD = 40  # digits of arithmetic beyond the tolerance: a stiff rate is a small difference of large terms
SETTLED = 24  # digits beyond the tolerance to which the stages are solved for: a stiff rate loses most of them
NEWTON = 40  # iterations before a step is halved
LEAST_GROWTH = 0.85  # growth of the next step below which this one is refused: its last terms are too large
SMALLEST_STEP = 1e-300  # s


@dataclass(frozen=True)
class Radau:
    """The s Radau points c in (0, 1], and matrices over the rates there: (s, s) each."""

    c: list[Number]
    integral: arb_mat  # rates at the points -> integrals from 0 to the points, for a step of 1
    legendre: arb_mat  # rates at the points -> coefficients of Legendre's polynomials


def radau(stages: int, digits: int) -> Radau:
    """The method to so many digits."""
    package = flint()
    # The matrix of Legendre's polynomials at the points is well conditioned: ten digits are more than it loses.
    with working(digits + 10) as number:
        x = [_radau_point(number, stages, guess) for guess in _guesses(stages)]
        values = [[point.legendre_p(n).mid() for n in range(stages + 1)] for point in x]
        vandermonde = package.arb_mat([row[:stages] for row in values])
        to_legendre = vandermonde.solve(package.arb_mat(stages, stages, _identity(stages)), algorithm="approx").mid()
        # the integral of P_n from -1 is (P_(n+1) - P_(n-1)) / (2n + 1); a step of 1 is half of [-1, 1]
        primitive = [
            [((row[n + 1] - row[n - 1]) / (2 * n + 1) if n else at + 1) / 2 for n in range(stages)]
            for at, row in zip(x, values, strict=True)
        ]
        integral = (package.arb_mat(primitive) * to_legendre).mid()
        return Radau([(point + 1) / 2 for point in x], integral, to_legendre)


def _identity(n: int) -> list[int]:
    return [int(i == j) for i in range(n) for j in range(n)]


def _guesses(stages: int) -> list[float]:
    """Radau points on [-1, 1] in float64: zeros of P_s - P_(s-1), the last at 1."""
    roots: Array = np.polynomial.legendre.legroots([0.0] * (stages - 1) + [-1.0, 1.0])
    return sorted(np.real(roots).tolist())[:-1] + [1.0]


def _radau_point(number: Callable[[object], Number], s: int, guess: float) -> Number:
    x = number(guess)
    if guess == 1.0:
        return x
    for _ in range(9):  # Newton: the number of right digits doubles, from some ten
        low, high, above = (x.legendre_p(n) for n in (s - 1, s, s + 1))
        # (1 - x^2) P_n' = (n + 1) (x P_n - P_(n+1))
        slope = ((s + 1) * (x * high - above) - s * (x * low - high)) / (1 - x * x)
        x = (x - (high - low) / slope).mid()
    return x


def collocation(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[object],
    times: Sequence[float],
    values: Mapping[str, object],
    digits: int,
) -> tuple[list[list[Number]], str]:
    """The states at `times` from `start` at t = 0, each step resolved to about a relative 10^-digits.

    f must be smooth along the motion: a step has no place to end at a switch.
    Returns rows of numbers, and a sentence on the run.
    Raises ReferenceFailedError when no step is small enough.
    """
    stages = digits + 4
    slopes = _jacobian(graph, states, values)
    with working(digits + GUARD) as number:
        method = radau(stages, digits + GUARD)
        series = Series(graph, states, values, number)
        weights = np.array([[float(entry) for entry in row] for row in method.integral.tolist()])
        x, t = [number(value).mid() for value in start], number(0)
        h = step_size(series.expand(x, t, stages), digits, 0.0)
        guess = [series.rate(x, t)] * stages
        rows: list[list[Number]] = []
        steps = refused = 0
        for time in times:
            while float(time - t) > 0.0:
                last = float(time - t)
                size = number(time) - t if h >= last else number(last / math.ceil(last / h) if last < 2 * h else h)
                rates = _stages(series, slopes, method, weights, x, t, size, guess, digits)
                growth = 0.5 if rates is None else _growth(method, rates, x, size, digits)
                if rates is None or growth < LEAST_GROWTH:
                    refused += 1
                    h = float(size) * max(0.1, growth * 0.9)
                    guess = [series.rate(x, t)] * stages
                    if h < SMALLEST_STEP:
                        raise ReferenceFailedError(f"the steps shrink to nothing at t = {float(t):.17g}")
                    continue
                x = _moved(method, x, rates, size)[-1]
                t = (t + size).mid()
                h = float(size) * min(4.0, growth * 0.9) if float(size) >= h or growth < 1.0 else h
                guess = [rates[-1]] * stages
                steps += 1
            rows.append(x)
        return rows, f"Radau collocation of {stages} stages, {steps} steps ({refused} more refused)"


def _stages(
    series: Series,
    slopes: Callable[[Array, Array], Array],
    method: Radau,
    weights: Array,
    x: list[Number],
    t: Number,
    h: Number,
    rates: list[list[Number]],
    digits: int,
) -> list[list[Number]] | None:
    """The rates at the points of a step, or None when Newton's method does not settle.

    The correction is solved for in float64, with the exact Jacobian: some ten digits an iteration near the solution.
    """
    m, stages = len(x), len(method.c)
    at = np.array([float(t + h * c) for c in method.c])
    place = _moved(method, x, rates, h)
    smallest = math.inf
    for _ in range(NEWTON):
        new = [series.rate(row, t + h * c) for row, c in zip(place, method.c, strict=True)]
        target = _moved(method, x, new, h)
        # a scale for each state makes float64 do for states of any size
        scale = np.array([_scale(place, x, i) for i in range(m)])
        residual = np.array(
            [
                [float((b - a) / s) for a, b, s in zip(p, q, scale.tolist(), strict=True)]
                for p, q in zip(place, target, strict=True)
            ]
        )
        size = float(np.abs(residual).max())
        if not math.isfinite(size):
            return None
        if size < 10.0 ** -(digits + SETTLED) or (size >= 0.5 * smallest and size < 10.0 ** -(digits + 3)):
            return new
        smallest = min(smallest, size)
        jacobian = slopes(np.array([[float(v) for v in row] for row in place]), at)
        jacobian = jacobian * (scale[None, None, :] / scale[None, :, None])
        system = -float(h) * np.einsum("ij,jab->iajb", weights, jacobian).reshape(stages * m, stages * m)
        system[np.diag_indices(stages * m)] += 1.0
        try:
            step = np.linalg.solve(system, residual.ravel() / size).reshape(stages, m)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        place = [
            [(a + size * float(d) * s).mid() for a, d, s in zip(row, move, scale.tolist(), strict=True)]
            for row, move in zip(place, step, strict=True)
        ]
    return None


def _scale(place: list[list[Number]], x: list[Number], i: int) -> float:
    return max([abs(float(row[i])) for row in (x, *place)]) or 1.0


def _moved(method: Radau, x: list[Number], rates: list[list[Number]], h: Number) -> list[list[Number]]:
    """The states at the points."""
    moves = (method.integral * flint().arb_mat(rates)).tolist()
    return [[(a + h * d).mid() for a, d in zip(x, row, strict=True)] for row in moves]


def _growth(method: Radau, rates: list[list[Number]], x: list[Number], h: Number, digits: int) -> float:
    """The factor on the step at which the last two Legendre coefficients would just be small enough."""
    table = (method.legendre * flint().arb_mat(rates)).tolist()
    worst = -math.inf
    for i, value in enumerate(x):
        sizes = [log2_size(row[i]) + log2_size(h) for row in table]
        # what is far below the rounding of the state itself does not count
        floor = log2_size(value) - 10 * math.log2(10.0)
        worst = max(worst, max(sizes[-2:]) - max([*sizes, floor]))
    if worst == -math.inf:
        return 4.0
    return math.exp2((-digits * math.log2(10.0) - worst) / len(table))


def _jacobian(graph: Graph, states: Sequence[str], values: Mapping[str, Number]) -> Callable[[Array, Array], Array]:
    """df/dx in float64 at points x, (s, m), and times t, (s,): (s, m, m)."""
    bound = cg.specialize(graph, {name: float(value) for name, value in values.items()})
    compiled = cg.compile(cg.jacobian(bound, list(states)), "numpy")
    timed = TIME in bound.input_names
    m = len(states)

    def slopes(x: Array, t: Array) -> Array:
        values = compiled.batch(np.vstack([x.T, t]) if timed else x.T)
        return np.moveaxis(values.reshape(m, m, len(x)), 2, 0)

    return slopes
