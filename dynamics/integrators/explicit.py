"""Explicit Runge-Kutta methods: a tableau's step, with the estimates and the dense output of an embedded one."""

from __future__ import annotations

import math
from dataclasses import replace

import cgraph as cg
from cgraph import Node
from cgraph.extend import If, Statement, copied

from .problem import Problem
from .step import Step, Values, advanced, call, count, each, numbered, stage_time, summed, total, weighted
from .step_control import SAFETY, SCALE, nonfinite, scale
from .tableau import RowOfWeights, Tableau, real_stability


def explicit_step(tableau: Tableau, problem: Problem) -> Step:
    """The step; where the tableau has weights of an estimate, with it: the slope at its end is the next one's first."""
    stages = len(tableau.b)
    rates, body, dense = problem.evaluation.at("x", "t", "slope0"), list[Statement](), list[Statement]()
    for k in range(1, stages):
        body += [advanced("at", tableau.a[k]), *_slope(problem, k, tableau.c[k], "at")]
    if not tableau.error:
        return Step(problem.evaluation.lengths, [*body, advanced("x_new", tableau.b)], rates)
    for k, (c, row) in enumerate(tableau.extra, start=stages + 1):
        dense += [advanced("inside", row), *_slope(problem, k, c, "inside")]
    dense += [_power(k, row) for k, row in enumerate(zip(*tableau.dense, strict=True), start=1)]
    return Step(
        problem.evaluation.lengths,
        body=[*body, summed(("x", "rounding"), ("x_new", "rounding_new"), tableau.b)],
        rates=rates,
        kept=[copied("rounding_new", "rounding")],
        fixed=("rounding", "rounding_new"),
        error=_error(tableau, problem),
        estimate=tableau.estimate,
        handed=[*_at_limit(tableau), copied(f"slope{stages}", "slope0")],
        dense=dense,
    )


def _slope(problem: Problem, k: int, c: float, at: str) -> list[Statement]:
    """Register slope{k} at a state and at t + c h, which a rate without t does not need."""
    time = f"{at}_t" if problem.timed else "t"
    rate = problem.evaluation.at(at, time, f"slope{k}")
    return [stage_time(time, c), *rate] if problem.timed else rate


def _power(k: int, weights: RowOfWeights) -> Statement:
    """The coefficient of s^k in the dense output of an accepted step."""
    slopes = numbered("slope", len(weights))
    return each(lambda h, *slopes: {f"dense{k}": h * weighted(slopes, weights)}, "h", *slopes)


def _error(tableau: Tableau, problem: Problem) -> list[Statement]:
    """Register `error`, and the slope at the end: where no estimate needs it, of a step within the tolerance alone."""
    stages, m = len(tableau.b), problem.size
    sums = numbered("sum", len(tableau.error))

    def squares(h: Node, x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node, *slopes: Node) -> Values:
        """Of h * (sum of weight * slope) / scale, for each estimate; NaN if x_new is infinite."""
        size, finite = scale(x, x_new, rtol, atol, leap), x_new - x_new
        parts = [h * weighted(slopes, weights) / size for weights in tableau.error]
        return {name: part * part + finite for name, part in zip(sums, parts, strict=True)}

    def estimate(first: Node, *others: Node) -> Values:
        """The root mean square; of two estimates, that of DOP853 (Hairer, Norsett and Wanner I, section II.10)."""
        error = cg.sqrt(first / m)
        for third in others:
            both = first + 0.01 * third
            error = cg.where(cg.equal(both, 0.0), 0.0, cg.where(both < math.inf, first / cg.sqrt(both * m), both))
        return {"error": error}

    slope = _slope(problem, stages, 1.0, "x_new")
    known = [total(squares, "h", *SCALE, *numbered("slope", stages + 1)), call(estimate, *sums)]
    finite = [
        nonfinite("nonfinite_rate", f"slope{stages}"),
        call(lambda error, nonfinite_rate: {"error": error + nonfinite_rate}),
    ]
    if any([weights[-1] for weights in tableau.error]):
        return [*slope, *known, *finite]
    return [*known, call(lambda error: {"within": error <= 1.0}), If("within", (*slope, count(1), *finite))]


def _at_limit(tableau: Tableau) -> list[Statement]:
    """Counts accepted steps with h |f(x_new) - f(y)| / |x_new - y| at the stability limit (Hairer, Wanner II, IV.2)."""
    if tableau.c[-1] != 1.0:
        return []
    stages = len(tableau.b)

    def change(a: Node, b: Node, *sizes: Node) -> Values:
        part = (a - b) / scale(*sizes)
        return {"rise": part * part}

    most = (SAFETY * real_stability(tableau)) ** 2
    count = call(lambda h, rise, reach, at_limit: {"at_limit": at_limit + (h * h * rise > most * reach)})
    rise = total(change, f"slope{stages}", f"slope{stages - 1}", *SCALE)
    return [rise, replace(rise, inputs=("x_new", "at", *SCALE), outputs=("reach",)), count]
