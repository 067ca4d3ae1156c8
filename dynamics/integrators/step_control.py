"""Programs that choose their steps: the registers that all of them have, step control, and explicit embedded methods.

A pass is a trial of one step. Registers: x the state, t, p the parameters, evaluations, as with equal steps; `h` the
step tried, `next` the one to try next and `max_step` the longest allowed; `end` where to stop; rtol, and atol for each
component of the state; accepted (1 or 0), status; rejected, a count; `error`, the estimate of the last trial, 1 at the
tolerance; x_new what the trial arrived at; `fresh`, 1 before the first pass; and of the last accepted step t_old, x_old
and, for its dense output, dense1, ..
"""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, If, Map, Program, Statement, Sum

from .elementwise import SAME, compensated, function, scaled, weighted
from .explicit import stage, stage_state, stage_time
from .problem import Problem
from .tableau import Tableau

RUNNING, DONE, TOO_SMALL = 0.0, 1.0, 2.0  # register `status`
SAFETY, SMALLEST, LARGEST = 0.9, 0.2, 5.0  # factors from one step to the next
MEMORY = 0.04  # weight of the estimate before in the choice of the next step (Gustafsson's PI control)
RESOLUTION = 4.0 * 2.0**-52  # steps below this share of t hardly move t


def registers(problem: Problem) -> dict[str, int]:
    """What every program has."""
    names = "t h next max_step end fresh rtol accepted status rejected error error_old evaluations t_old t_new"
    m = problem.size
    states = dict.fromkeys(("x", "x_new", "x_old", "atol"), m)
    return {**states, "p": len(problem.parameters), **dict.fromkeys(names.split(), 1)}


def recorded(dense: bool, degree: int) -> list[str]:
    """What a row of the record holds."""
    return ["t", "h", "x", *(["t_old", "x_old", *(f"dense{k + 1}" for k in range(degree))] if dense else [])]


def trial() -> Call:
    """The step to try: `next`, or what is left; of a little more than one step, half, so that no sliver remains."""
    t, wanted, max_step, end = inputs = cg.variables("t next max_step end")
    left, most = end - t, cg.minimum(wanted, max_step)
    h = cg.where(most >= left, left, cg.where(2.0 * most > left, 0.5 * left, most))
    return Call(Graph(inputs, {"h": h}), ("t", "next", "max_step", "end"), ("h",))


def scale(x: Node, x_new: Node, rtol: Node, atol: Node) -> Node:
    """What an error is measured by."""
    return atol + rtol * cg.maximum(abs(x), abs(x_new))


def control(order: int, evaluations: int) -> Call:
    """From the estimate of a trial: whether it is accepted, and the next step. A NaN is an error beyond measure.

    order: of the step's size in the estimate.  evaluations: of the rate in a trial.
    """
    names = ("error", "error_old", "h", "t", "end", "next", "rejected", "evaluations", "accepted")
    error, old, h, t, end, wanted, rejected, done, before = inputs = cg.variables(names)
    accepted = error <= 1.0
    growth = SAFETY * error ** -(1.0 / order - 0.75 * MEMORY) * cg.maximum(old, 1e-4) ** MEMORY
    growth = cg.minimum(cg.maximum(growth, SMALLEST), cg.where(before, LARGEST, 1.0))  # no growth after a rejection
    shrink = cg.where(error < 1e300, cg.maximum(SAFETY * error ** (-1.0 / order), SMALLEST), 0.1)
    h_next = h * cg.where(accepted, growth, shrink)
    t_new = cg.where(h >= end - t, end, t + h)
    too_small = cg.maximum(h <= RESOLUTION * abs(t), h <= 2.0**-1000)
    running = cg.where(too_small, TOO_SMALL, RUNNING)
    outputs = {
        "accepted": accepted,
        "next": cg.where(accepted * (h < wanted), cg.maximum(wanted, h_next), h_next),  # a step cut short says less
        "error_old": cg.where(accepted, error, old),
        "t_new": t_new,
        "status": cg.where(accepted, cg.where(t_new >= end, DONE, RUNNING), running),
        "rejected": rejected + (1.0 - accepted),
        "evaluations": done + float(evaluations),
    }
    return Call(Graph(inputs, outputs), names, tuple(outputs))


def accept_step(*after: Statement) -> If:
    """An accepted step becomes the state; `after` is what the method does besides, with x still the old state."""
    kept = (Map(SAME, ("x",), ("x_old",)), Call(SAME, ("t",), ("t_old",)))
    moved = (Map(SAME, ("x_new",), ("x",)), Call(SAME, ("t_new",), ("t",)))
    return If("accepted", (*kept, *after, *moved))


def count(evaluations: int) -> Call:
    """That many evaluations more."""
    done = cg.variable("evaluations")
    return Call(Graph([done], {"sum": done + float(evaluations)}), ("evaluations",), ("evaluations",))


def first_pass(*statements: Statement) -> If:
    """What is done before the first trial alone."""
    return If("fresh", (*statements, Call(function("fresh", none=0.0), ("fresh",), ("fresh",))))


def embedded(tableau: Tableau, problem: Problem, dense: bool) -> Program:
    """A trial of one step by an explicit embedded method; the slope at its end is the first slope of the next."""
    m, stages = problem.size, len(tableau.b)
    last = f"slope{stages}"
    slopes = tuple([f"slope{k}" for k in range(stages + 1)])
    body: list[Statement] = [first_pass(Call(problem.rate, ("x", "t", "p"), ("slope0",)), count(1)), trial()]
    for k in range(1, stages):
        body += stage(problem, tableau, k)
    body += [_arrival(tableau.b), stage_time("at_t", 1.0), Call(problem.rate, ("x_new", "at_t", "p"), (last,))]
    body += [_squared(weights, slopes, f"sum{k}") for k, weights in enumerate(tableau.error)]
    body += [_estimate(len(tableau.error), m), control(tableau.estimate, stages)]
    kept = (Map(SAME, (last,), ("slope0",)), Map(SAME, ("rounding_new",), ("rounding",)))
    body.append(accept_step(*(_dense(tableau, problem) if dense else ()), *kept))
    degree = len(tableau.interpolant[0])
    lengths = {f"slope{k}": m for k in range(stages + 1 + (len(tableau.extra) if dense else 0))}
    lengths |= {f"sum{k}": 1 for k in range(len(tableau.error))} | {
        "at": m,
        "at_t": 1,
        "rounding": m,
        "rounding_new": m,
    }
    if dense:
        lengths |= {f"dense{k + 1}": m for k in range(degree)}
    record = recorded(dense, degree)
    return Program({**registers(problem), **lengths}, body, record, record_if="accepted", stop="status")


def _arrival(weights: tuple[float, ...]) -> Map:
    """x_new = x + h * (sum of weight * slope) + what rounding took off the step before; rounding_new, what off this."""
    used = [k for k, weight in enumerate(weights) if weight]
    x, before, h, *slopes = cg.variables(["x", "rounding", "h", *(f"s{k}" for k in used)])
    total, rounding = compensated(x, h * weighted(slopes, [weights[k] for k in used]) + before)
    graph = Graph([x, before, h, *slopes], {"x": total, "rounding": rounding})
    return Map(graph, ("x", "rounding", "h", *[f"slope{k}" for k in used]), ("x_new", "rounding_new"))


def measured(error: str, m: int) -> list[Statement]:
    """Register `error`: the root mean square over the state of the register's (error / scale)."""
    x, x_new, rtol, atol, e = inputs = cg.variables("x x_new rtol atol e")
    part = e / scale(x, x_new, rtol, atol)
    total = Sum(Graph(inputs, {"y": part * part}), ("x", "x_new", "rtol", "atol", error), "sum")
    return [total, Call(function("sum", y=cg.sqrt(cg.variable("sum") / m)), ("sum",), ("error",))]


def _squared(weights: tuple[float, ...], slopes: tuple[str, ...], target: str) -> Sum:
    """Sum over the state of (h * (sum of weight * slope) / scale)^2."""
    used = [k for k, weight in enumerate(weights) if weight]
    x, x_new, rtol, atol, h = cg.variables("x x_new rtol atol h")
    nodes = cg.variables([f"s{k}" for k in used])
    part = h * weighted(nodes, [weights[k] for k in used]) / scale(x, x_new, rtol, atol)
    graph = Graph([x, x_new, rtol, atol, h, *nodes], {"y": part * part})
    return Sum(graph, ("x", "x_new", "rtol", "atol", "h", *[slopes[k] for k in used]), target)


def _estimate(count: int, m: int) -> Call:
    """The root mean square; of two estimates, that of DOP853 (Hairer, Norsett and Wanner I, section II.10)."""
    if count == 1:
        total = cg.variable("sum0")
        return Call(Graph([total], {"error": cg.sqrt(total / m)}), ("sum0",), ("error",))
    fifth, third = cg.variables("sum0 sum1")
    both = fifth + 0.01 * third
    error = cg.where(cg.equal(both, 0.0), 0.0, fifth / cg.sqrt(both * m))
    return Call(Graph([fifth, third], {"error": error}), ("sum0", "sum1"), ("error",))


def _dense(tableau: Tableau, problem: Problem) -> tuple[Statement, ...]:
    """The coefficients of the dense output of an accepted step, with the stages that only they need."""
    body: list[Statement] = []
    for k, (c, weights) in enumerate(tableau.extra, start=len(tableau.b) + 1):
        body += [
            stage_state("at", weights),
            stage_time("at_t", c),
            Call(problem.rate, ("at", "at_t", "p"), (f"slope{k}",)),
        ]
    if tableau.extra:
        body.append(count(len(tableau.extra)))
    for power in range(len(tableau.interpolant[0])):
        weights = tuple([row[power] for row in tableau.interpolant])
        used = [k for k, weight in enumerate(weights) if weight]
        slopes = tuple([f"slope{k}" for k in used])
        body.append(Map(scaled([weights[k] for k in used]), ("h", *slopes), (f"dense{power + 1}",)))
    return tuple(body)
