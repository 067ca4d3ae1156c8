"""Programs that choose their steps: the registers that all of them have, step control, and explicit embedded methods.

A pass is a trial of one step, from t to t_new = t + h exactly. Registers: x the state, t, p the parameters,
evaluations, as with equal steps; `h` the step, negative for a run back in time; `tried` its size before t_new was
rounded, `next` the size to try next, `max_step` and `min_step` their limits; `end` where to stop; rtol, and atol for
each component of the state; accepted (1 or 0), status; rejected, a count; `error`, the estimate of the last trial, 1
at the tolerance; x_new what the trial arrived at; `fresh`, 1 before the first pass; `held`, accepted steps at the
stability limit of an explicit method; and of the last accepted step t_old, x_old and, for its dense output, dense1, ..

Where a force jumps, steps can only shrink. `jump` is the share of the `longest` of the last steps in which it may be
missed, 0 where the caller has given atol: what its mean rate would make in that time counts into the `scale` of a
component by `leap`, rtol times that time over h. A step far shorter than those before passes a jump so, and a pole, at
which the steps before get short as well, stays one. A step in which nothing moved says nothing of forces to come: the
next is at most `still`.
"""

from __future__ import annotations

import math

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, If, Map, Program, Statement, Sum

from .elementwise import SAME, compensated, function, scaled, weighted
from .explicit import stage, stage_state, stage_time
from .problem import Problem
from .tableau import Tableau, real_stability

RUNNING, DONE, TOO_SMALL = 0.0, 1.0, 2.0  # register `status`
SAFETY, SMALLEST, LARGEST = 0.9, 0.2, 5.0  # factors from one step to the next
MEMORY = 0.04  # weight of the estimate before in the choice of the next step (Gustafsson's PI control)
RESOLUTION = 4.0 * 2.0**-52  # steps below this share of t hardly move t
SCALE = ("x", "x_new", "rtol", "atol", "leap")
FORGOTTEN = 0.9  # of the longest step, in every step that is shorter
COLLAPSE = 2.0**-200  # steps below this share of a run never end it
SMALLEST_ATOL = 2.0**-1022  # in place of 0: a state that is 0 and stays 0 has no error


def registers(problem: Problem) -> dict[str, int]:
    """What every program has."""
    names = "t h tried next max_step min_step end fresh rtol accepted status rejected error error_old"
    names += " evaluations held t_old t_new jump longest leap still moved"
    m = problem.size
    states = dict.fromkeys(("x", "x_new", "x_old", "atol"), m)
    return {**states, "p": len(problem.parameters), **dict.fromkeys(names.split(), 1)}


def recorded(dense: bool, degree: int) -> list[str]:
    """What a row of the record holds."""
    return ["t", "h", "x", *(["t_old", "x_old", *(f"dense{k + 1}" for k in range(degree))] if dense else [])]


def trial() -> Call:
    """The step to try: `next`, or what is left; of a little more than one step, half, so that no sliver remains.

    h = t_new - t, so that the clock and the state make the same step.
    """
    names = ("t", "next", "max_step", "end", "rtol", "jump", "longest")
    t, wanted, max_step, end, rtol, jump, longest = inputs = cg.variables(names)
    left, most = abs(end - t), cg.minimum(wanted, max_step)
    tried = cg.where(most >= left, left, cg.where(2.0 * most > left, 0.5 * left, most))
    t_new = cg.where(most >= left, end, t + cg.where(end > t, tried, -tried))
    h = t_new - t
    outputs = {"tried": tried, "t_new": t_new, "h": h, "leap": rtol * jump * longest / abs(h)}
    return Call(Graph(inputs, outputs), names, tuple(outputs))


def scale(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node) -> Node:
    """What an error is measured by, of the registers `SCALE`."""
    return atol + rtol * cg.maximum(abs(x), abs(x_new)) + leap * abs(x_new - x)


def control(order: int, evaluations: int) -> Call:
    """From the estimate of a trial: whether it is accepted, and the next step. A NaN is an error beyond measure.

    A step below the resolution of t, or of the run, is not accepted whatever its error: only one that ends the run may
    be so short.

    order: of the step's size in the estimate.  evaluations: of the rate in a trial.
    """
    names = "error error_old tried t t_new end next max_step min_step rejected evaluations accepted".split()
    error, old, tried, t, t_new, end, wanted, max_step, min_step, rejected, done, before = inputs = cg.variables(names)
    arrives = cg.equal(t_new, end)
    able = cg.maximum(arrives, cg.minimum(wanted, max_step) > cg.maximum(min_step, RESOLUTION * abs(t)))
    accepted = able * (error <= 1.0)
    growth = SAFETY * error ** -(1.0 / order - 0.75 * MEMORY) * cg.maximum(old, 1e-4) ** MEMORY
    growth = cg.minimum(cg.maximum(growth, SMALLEST), cg.where(before, LARGEST, 1.0))  # no growth after a rejection
    shrink = cg.where(error < 1e300, cg.maximum(SAFETY * error ** (-1.0 / order), SMALLEST), 0.1)
    after = tried * cg.where(accepted, growth, shrink)
    outputs = {
        "accepted": accepted,
        "next": cg.where(accepted * (tried < wanted), cg.maximum(wanted, after), after),  # a step cut short says less
        "error_old": cg.where(accepted, error, old),
        "status": cg.where(accepted, cg.where(arrives, DONE, RUNNING), cg.where(able, RUNNING, TOO_SMALL)),
        "rejected": rejected + (1.0 - accepted),
        "evaluations": done + float(evaluations),
    }
    return Call(Graph(inputs, outputs), tuple(names), tuple(outputs))


def accept_step(*after: Statement) -> If:
    """An accepted step becomes the state; `after` is what the method does besides, with x still the old state."""
    kept = (Map(SAME, ("x",), ("x_old",)), Call(SAME, ("t",), ("t_old",)))
    h, longest = cg.variables("h longest")
    after_h = Graph([h, longest], {"longest": cg.maximum(abs(h), FORGOTTEN * longest)})
    x, x_new, moved, wanted, still = cg.variables("x x_new moved next still")
    way = Sum(Graph([x, x_new], {"way": abs(x_new - x)}), ("x", "x_new"), "moved")
    short = Graph([moved, wanted, still], {"next": cg.where(moved, wanted, cg.minimum(wanted, still))})
    steps = (way, Call(short, ("moved", "next", "still"), ("next",)), Call(after_h, ("h", "longest"), ("longest",)))
    arrived = (Map(SAME, ("x_new",), ("x",)), Call(SAME, ("t_new",), ("t",)))
    return If("accepted", (*kept, *after, *steps, *arrived))


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
    body += [_whole(last), _estimate(len(tableau.error), m), control(tableau.estimate, stages)]
    kept = (Map(SAME, (last,), ("slope0",)), Map(SAME, ("rounding_new",), ("rounding",)))
    body.append(accept_step(*_held(tableau), *(_dense(tableau, problem) if dense else ()), *kept))
    degree = len(tableau.interpolant[0])
    lengths = {f"slope{k}": m for k in range(stages + 1 + (len(tableau.extra) if dense else 0))}
    lengths |= {f"sum{k}": 1 for k in range(len(tableau.error))} | dict.fromkeys(("at_t", "lost", "rise", "reach"), 1)
    lengths |= dict.fromkeys(("at", "rounding", "rounding_new"), m)
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
    """Register `error`: the root mean square over the state of the register's (error / scale).

    NaN where x_new is not finite: its scale would hide any error.
    """
    *sizes, e = inputs = cg.variables((*SCALE, "e"))
    part, x_new = e / scale(*sizes), sizes[1]
    total = Sum(Graph(inputs, {"y": part * part + (x_new - x_new)}), (*SCALE, error), "sum")
    return [total, Call(function("sum", y=cg.sqrt(cg.variable("sum") / m)), ("sum",), ("error",))]


def moved(m: int) -> list[Statement]:
    """x = register `onto`; `farthest`, the largest of such moves so far, a root mean square of move over tolerance."""
    x, rtol, atol, onto, way, far = cg.variables("x rtol atol onto way farthest")
    part = (onto - x) / scale(x, onto, rtol, atol, cg.constant(0.0))
    total = Sum(Graph([x, rtol, atol, onto], {"y": part * part}), ("x", "rtol", "atol", "onto"), "way")
    longer = Graph([way, far], {"far": cg.maximum(cg.sqrt(way / m), far)})
    return [total, Call(longer, ("way", "farthest"), ("farthest",)), Map(SAME, ("onto",), ("x",))]


def lost(register: str, target: str) -> Sum:
    """target = 0 where all numbers of a register are finite, else NaN.

    Divided by an infinite number, an error is 0: that of a step with infinite pivots.
    """
    a = cg.variable("a")
    return Sum(Graph([a], {"none": a - a}), (register,), target)


def _whole(last: str) -> Sum:
    """Register `lost`: 0 where the trial arrived at a finite state with a finite rate, else NaN."""
    x_new, slope = cg.variables("x_new slope")
    return Sum(Graph([x_new, slope], {"none": (x_new - x_new) + (slope - slope)}), ("x_new", last), "lost")


def _held(tableau: Tableau) -> list[Statement]:
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
    h, up, along, held = inputs = cg.variables("h rise reach held")
    beyond = h * h * up > (SAFETY * limit) ** 2 * along
    return [rise, reach, Call(Graph(inputs, {"sum": held + beyond}), ("h", "rise", "reach", "held"), ("held",))]


def _squared(weights: tuple[float, ...], slopes: tuple[str, ...], target: str) -> Sum:
    """Sum over the state of (h * (sum of weight * slope) / scale)^2."""
    used = [k for k, weight in enumerate(weights) if weight]
    *sizes, h = inputs = cg.variables((*SCALE, "h"))
    nodes = cg.variables([f"s{k}" for k in used])
    part = h * weighted(nodes, [weights[k] for k in used]) / scale(*sizes)
    return Sum(Graph([*inputs, *nodes], {"y": part * part}), (*SCALE, "h", *[slopes[k] for k in used]), target)


def _estimate(count: int, m: int) -> Call:
    """The root mean square; of two estimates, that of DOP853 (Hairer, Norsett and Wanner I, section II.10)."""
    if count == 1:
        total, none = cg.variables("sum0 lost")
        return Call(Graph([total, none], {"error": cg.sqrt(total / m) + none}), ("sum0", "lost"), ("error",))
    fifth, third, none = inputs = cg.variables("sum0 sum1 lost")
    both = fifth + 0.01 * third
    error = cg.where(cg.equal(both, 0.0), 0.0, cg.where(both < math.inf, fifth / cg.sqrt(both * m), both))
    return Call(Graph(inputs, {"error": error + none}), ("sum0", "sum1", "lost"), ("error",))


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
