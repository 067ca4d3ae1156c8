"""Integration by Taylor series: a trajectory to any number of digits, for motions that are not stiff.

Order and step follow Jorba and Zou, "A software package for the numerical integration of ODEs by means of high-order
Taylor methods", Experimental Mathematics 14 (2005): the order grows with the digits, 1.15 a digit, and the step is
about 1/e^2 of the radius of convergence, read off the last coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from cgraph import Graph

from .flint_numbers import Number, log2_size, sign, working
from .taylor_series import Series

GUARD = 12  # digits of arithmetic beyond the tolerance
SAMPLES = 16  # places in a step at which a switch is looked for
STUCK = 3  # steps of no length one after another
PROBE, MANY = 50, 1e6  # steps between looks at how many there will be, and how many are too many
SMALLEST = -1000.0  # log2 of a step that no motion needs


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
    low, high = 2 * SMALLEST, -2 * SMALLEST
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        terms = size + k * middle
        if (terms[:, -2:].max(axis=1) <= tolerance + terms[:, :-2].max(axis=1)).all():
            low = middle
        else:
            high = middle
    if low < SMALLEST:
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
