"""Explicit Runge-Kutta methods: a tableau's step, with the estimates and the dense output of an embedded one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, If, Map, Statement, Sum, copied

from .elementwise import advanced, compensated, stage_time, used, weighted
from .problem import Problem
from .step import Step
from .step_control import SAFETY, SCALE, count, nonfinite, scale
from .tableau import Tableau, real_stability


def explicit_step(tableau: Tableau, problem: Problem) -> Step:
    """The step; where the tableau has weights of an estimate, with it: the slope at its end is the next one's first."""
    m, stages = problem.size, len(tableau.b)
    lengths = {f"slope{k}": m for k in range(stages)} | {"at": m, "at_t": 1}
    rates = [Call(problem.rate, ("x", "t", "p"), ("slope0",))]
    body: list[Statement] = []
    for k in range(1, stages):
        body += _stage(problem, k, tableau.c[k], tableau.a[k], ("at", "at_t"))
    if not tableau.error:
        return Step(lengths, [*body, advanced("x_new", tableau.b)], rates)
    last, extra, degree = f"slope{stages}", len(tableau.extra), len(tableau.interpolant[0])
    lengths |= {last: m, "rounding": m, "rounding_new": m, "rise": 1, "reach": 1, "nonfinite_rate": 1, "within": 1}
    lengths |= {f"sum{k}": 1 for k in range(len(tableau.error))}
    return Step(
        lengths,
        [*body, _arrival(tableau.b)],
        rates,
        kept=[copied("rounding_new", "rounding")],
        fixed=("rounding", "rounding_new"),
        error=_error(tableau, problem, last),
        estimate=tableau.estimate,
        handed=[*_at_limit(tableau), copied(last, "slope0")],
        dense=_dense(tableau, problem),
        dense_lengths={f"slope{stages + 1 + k}": m for k in range(extra)}
        | {f"dense{k + 1}": m for k in range(degree)}
        | {"inside": m, "inside_t": 1},
    )


def _stage(problem: Problem, k: int, c: float, weights: Sequence[float], at: tuple[str, str]) -> list[Statement]:
    """Register slope{k}, from registers x, t, h and the slopes before, at a state and a time that are kept in `at`."""
    return [advanced(at[0], weights), *_slope(problem, k, c, at)]


def _slope(problem: Problem, k: int, c: float, at: tuple[str, str]) -> list[Statement]:
    """Register slope{k} at a state and at t + c h, which a rate without t does not need."""
    rate = Call(problem.rate, (at[0], at[1] if problem.timed else "t", "p"), (f"slope{k}",))
    return [stage_time(at[1], c), rate] if problem.timed else [rate]


def _arrival(weights: tuple[float, ...]) -> Map:
    """x_new = x + h * (sum of weight * slope) + what rounding took off the step before; rounding_new, what off this."""
    slopes, parts, names = used(weights, "slope")
    x, before, h = cg.variables("x rounding h")
    total, rounding = compensated(x, h * weighted(slopes, parts) + before)
    graph = Graph([x, before, h, *slopes], {"x": total, "rounding": rounding})
    return Map(graph, ("x", "rounding", "h", *names), ("x_new", "rounding_new"))


def _error(tableau: Tableau, problem: Problem, last: str) -> list[Statement]:
    """Register `error`, and the slope at the end: where no estimate needs it, of a step within the tolerance alone."""
    m, stages, sums = problem.size, len(tableau.b), tuple([f"sum{k}" for k in range(len(tableau.error))])
    slope = _slope(problem, stages, 1.0, ("x_new", "at_t"))
    estimate = [_squares(tableau.error, sums), _estimate(sums, m)]
    error, none = cg.variables("error nonfinite_rate")
    checked = Call(Graph([error, none], {"error": error + none}), ("error", "nonfinite_rate"), ("error",))
    finite = [nonfinite("nonfinite_rate", last), checked]
    if any(weights[-1] for weights in tableau.error):
        return [*slope, *estimate, *finite]
    within = Call(Graph([error], {"within": error <= 1.0}), ("error",), ("within",))
    return [*estimate, within, If("within", (*slope, count(1), *finite))]


def _squares(estimates: Sequence[Sequence[float]], targets: tuple[str, ...]) -> Sum:
    """Sum over the state, for each estimate, of (h * (sum of weight * slope) / scale)^2; NaN if x_new is infinite."""
    numbers = [k for k in range(len(estimates[0])) if any(weights[k] for weights in estimates)]
    slopes, (*sizes, h) = cg.variables([f"s{k}" for k in numbers]), cg.variables((*SCALE, "h"))
    size = scale(*sizes)
    parts = [h * weighted(slopes, [weights[k] for k in numbers]) / size for weights in estimates]
    finite = sizes[1] - sizes[1]
    graph = Graph([*sizes, h, *slopes], {f"{k}": part * part + finite for k, part in enumerate(parts)})
    return Sum(graph, (*SCALE, "h", *[f"slope{k}" for k in numbers]), targets)


def _estimate(sums: tuple[str, ...], m: int) -> Call:
    """The root mean square; of two estimates, that of DOP853 (Hairer, Norsett and Wanner I, section II.10)."""
    first, *others = inputs = cg.variables(sums)
    error = cg.sqrt(first / m)
    for third in others:
        both = first + 0.01 * third
        error = cg.where(cg.equal(both, 0.0), 0.0, cg.where(both < math.inf, first / cg.sqrt(both * m), both))
    return Call(Graph(inputs, {"error": error}), sums, ("error",))


def _at_limit(tableau: Tableau) -> list[Statement]:
    """Counts accepted steps beyond the stability limit on the negative real axis (Hairer and Wanner II, section IV.2).

    h |f(x_new) - f(y)| / |x_new - y|, with y the state of the last stage, which like x_new stands at t + h.
    """
    if tableau.c[-1] != 1.0:
        return []
    stages, limit = len(tableau.b), real_stability(tableau)
    *sizes, a, b = inputs = cg.variables((*SCALE, "a", "b"))
    part = (a - b) / scale(*sizes)
    graph = Graph(inputs, {"y": part * part})
    rise = Sum(graph, (*SCALE, f"slope{stages}", f"slope{stages - 1}"), "rise")
    reach = Sum(graph, (*SCALE, "x_new", "at"), "reach")
    h, up, along, count = inputs = cg.variables("h rise reach at_limit")
    beyond = h * h * up > (SAFETY * limit) ** 2 * along
    return [
        rise,
        reach,
        Call(Graph(inputs, {"sum": count + beyond}), ("h", "rise", "reach", "at_limit"), ("at_limit",)),
    ]


def _dense(tableau: Tableau, problem: Problem) -> list[Statement]:
    """The coefficients of the dense output of an accepted step, with the stages that only they need."""
    body: list[Statement] = []
    for k, (c, weights) in enumerate(tableau.extra, start=len(tableau.b) + 1):
        body += _stage(problem, k, c, weights, ("inside", "inside_t"))
    h = cg.variable("h")
    for power, weights in enumerate(zip(*tableau.interpolant, strict=True), start=1):
        slopes, parts, names = used(weights, "slope")
        body.append(Map(Graph([h, *slopes], {"y": h * weighted(slopes, parts)}), ("h", *names), (f"dense{power}",)))
    return body
