"""Explicit Runge-Kutta methods: a tableau's step, with the estimates and the dense output of an embedded one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Map, Statement, Sum, copied

from .elementwise import advanced, compensated, stage_time, used, weighted
from .problem import Problem
from .step import Step
from .step_control import SAFETY, SCALE, nonfinite, scale
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
    last, extra = f"slope{stages}", len(tableau.extra)
    degree, estimates = len(tableau.interpolant[0]), len(tableau.error)
    lengths |= {last: m, "rounding": m, "rounding_new": m, "nonfinite_rate": 1, "rise": 1, "reach": 1}
    lengths |= {f"sum{k}": 1 for k in range(estimates)}
    error: list[Statement] = [stage_time("at_t", 1.0), Call(problem.rate, ("x_new", "at_t", "p"), (last,))]
    error += [_squared(weights, f"sum{k}") for k, weights in enumerate(tableau.error)]
    return Step(
        lengths,
        [*body, _arrival(tableau.b)],
        rates,
        kept=[copied("rounding_new", "rounding")],
        fixed=("rounding", "rounding_new"),
        error=[*error, nonfinite("nonfinite_rate", "x_new", last), _estimate(estimates, m)],
        estimate=tableau.estimate,
        handed=[*_at_limit(tableau), copied(last, "slope0")],
        dense=_dense(tableau, problem),
        dense_lengths={f"slope{stages + 1 + k}": m for k in range(extra)}
        | {f"dense{k + 1}": m for k in range(degree)}
        | {"inside": m, "inside_t": 1},
    )


def _stage(problem: Problem, k: int, c: float, weights: Sequence[float], at: tuple[str, str]) -> list[Statement]:
    """Register slope{k}, from registers x, t, h and the slopes before, at a state and a time that are kept in `at`."""
    rate = Call(problem.rate, (*at, "p"), (f"slope{k}",))
    return [advanced(at[0], weights), stage_time(at[1], c), rate]


def _arrival(weights: tuple[float, ...]) -> Map:
    """x_new = x + h * (sum of weight * slope) + what rounding took off the step before; rounding_new, what off this."""
    slopes, parts, names = used(weights, "slope")
    x, before, h = cg.variables("x rounding h")
    total, rounding = compensated(x, h * weighted(slopes, parts) + before)
    graph = Graph([x, before, h, *slopes], {"x": total, "rounding": rounding})
    return Map(graph, ("x", "rounding", "h", *names), ("x_new", "rounding_new"))


def _squared(weights: tuple[float, ...], target: str) -> Sum:
    """Sum over the state of (h * (sum of weight * slope) / scale)^2."""
    slopes, parts, names = used(weights, "slope")
    *sizes, h = inputs = cg.variables((*SCALE, "h"))
    part = h * weighted(slopes, parts) / scale(*sizes)
    return Sum(Graph([*inputs, *slopes], {"y": part * part}), (*SCALE, "h", *names), target)


def _estimate(count: int, m: int) -> Call:
    """The root mean square; of two estimates, that of DOP853 (Hairer, Norsett and Wanner I, section II.10)."""
    if count == 1:
        total, none = cg.variables("sum0 nonfinite_rate")
        return Call(Graph([total, none], {"error": cg.sqrt(total / m) + none}), ("sum0", "nonfinite_rate"), ("error",))
    fifth, third, none = inputs = cg.variables("sum0 sum1 nonfinite_rate")
    both = fifth + 0.01 * third
    error = cg.where(cg.equal(both, 0.0), 0.0, cg.where(both < math.inf, fifth / cg.sqrt(both * m), both))
    return Call(Graph(inputs, {"error": error + none}), ("sum0", "sum1", "nonfinite_rate"), ("error",))


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
