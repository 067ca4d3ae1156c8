"""Chosen steps: a method's step, tried until its error is within the tolerance; the registers, and step control.

A pass is a trial of one step, from t to t_new = t + h exactly. Registers: x the state, t, p the parameters,
evaluations, as with equal steps; `h` the step, negative for a run back in time; `tried` its size before t_new was
rounded, `next` the size to try next, `max_step` and `min_step` their limits; `end` where to stop; rtol, and atol for
each component of the state; accepted (1 or 0), status; rejected, a count; `error`, the estimate of the last trial, 1
at the tolerance; x_new what the trial arrived at; `fresh`, 1 before the first pass; `at_limit`, accepted steps
at the stability limit of an explicit method; and of the last accepted step t_old, x_old and, for its dense output,
dense1, ..

A run begins with `anew` at 1, and goes on to a trial once it is set out, see `simulation.steps.first_step`: registers
that a step hands on to the next are 0 then. `search` is positive while a first step is looked for: a trial then is none
of the run, and not `recorded`. `trials` counts those of the run, of whose steps `longest_made` is the longest; `due` is
1 after one by which sizes that make up atol are to be looked at, if it is `sized` by them: after 32, and then after
twice as many.

Where a force jumps, steps can only shrink. `jump` is the share of the `longest` of the last steps in which it may be
missed, 0 where the caller has given atol: what its mean rate would make in that time counts into the `scale` of a
component by `leap`, rtol times that time over h. A step far shorter than those before passes a jump so. A pole stays
one: on the way to it rates grow by a share of themselves in every step, and by that share the longest step is
forgotten. On the way to a jump rates stay as they are, however many steps lead there. A step in which nothing moved
says nothing of forces to come: the next is at most `still`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import STATEMENTS, Call, If, Map, Program, Statement, Sum, copied, effects

from .elementwise import function
from .problem import Problem
from .step import SHARED, Step, rate_calls, with_registers

RUNNING, DONE, TOO_SMALL = 0.0, 1.0, 2.0  # register `status`
SAFETY, SMALLEST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 5.0  # factors from one step to the next
MEMORY = 0.04  # weight of the estimate before in the choice of the next step (Gustafsson's PI control)
RESOLUTION = 4.0 * 2.0**-52  # steps below this share of t hardly move t
SCALE = ("x", "x_new", "rtol", "atol", "leap")
FORGOTTEN = 0.1  # of the longest step at most, in every step that is shorter
COLLAPSE = 2.0**-200  # steps below this share of a run never end it
HERMITE = 3  # degree of the dense output of a step that has none of its own
SMALLEST_ATOL = 2.0**-1022  # in place of 0: a state that is 0 and stays 0 has no error


def registers(problem: Problem) -> dict[str, int]:
    """Registers of every program."""
    names = "t h tried next max_step min_step end fresh rtol accepted status rejected error error_old"
    names += " evaluations at_limit t_old t_new jump longest leap still moved turned anew search trials due"
    names += " sized seen row largest longest_made"
    m = problem.size
    states = dict.fromkeys(("x", "x_new", "x_old", "atol"), m)
    return {**states, "p": len(problem.parameters), **dict.fromkeys(names.split(), 1)}


def recorded(dense: bool, degree: int) -> list[str]:
    """Registers that a row of the record holds."""
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
    """Scale of an error, of the registers `SCALE`."""
    return atol + rtol * cg.maximum(abs(x), abs(x_new)) + leap * abs(x_new - x)


def control(evaluations: int) -> Call:
    """Call that accepts a trial or not, by its estimate. A NaN is an error beyond measure.

    A step below the resolution of t, or of the run, is not accepted whatever its error: only one that ends the run may
    be so short.

    evaluations: of the rate in a trial.
    """
    names = "error t t_new end next max_step min_step rejected evaluations accepted search trials sized seen".split()
    names += ["h", "longest_made"]
    error, t, t_new, end, wanted, max_step, min_step, rejected, done, before, *rest = inputs = cg.variables(names)
    search, trials, sized, seen, h, made = rest
    arrives = cg.equal(t_new, end)
    able = cg.maximum(arrives, cg.minimum(wanted, max_step) > cg.maximum(min_step, RESOLUTION * abs(t)))
    accepted = able * (error <= 1.0)
    row = cg.where(search, 0.0, accepted)
    outputs = {
        "accepted": accepted,
        "status": cg.where(accepted, cg.where(arrives, DONE, RUNNING), cg.where(able, RUNNING, TOO_SMALL)),
        "rejected": rejected + (1.0 - accepted),
        "evaluations": done + float(evaluations),
        "largest": cg.where(before, LARGEST_FACTOR, 1.0),  # no growth after a rejection
        "row": row,
        "longest_made": cg.where(row, cg.maximum(made, abs(h)), made),
        "trials": trials + 1.0,
        "due": sized * (trials + 1.0 >= seen),
    }
    return Call(Graph(inputs, outputs), tuple(names), tuple(outputs))


def _grown(order: int) -> Call:
    """The step after an accepted one. order: of the step's size in the estimate."""
    names = ("error", "error_old", "tried", "next", "largest")
    error, old, tried, wanted, largest = inputs = cg.variables(names)
    growth = SAFETY * error ** -(1.0 / order - 0.75 * MEMORY) * cg.maximum(old, 1e-4) ** MEMORY
    after = tried * cg.minimum(cg.maximum(growth, SMALLEST_FACTOR), largest)
    after = cg.where(tried < wanted, cg.maximum(wanted, after), after)  # a step cut short says less
    return Call(Graph(inputs, {"next": after, "error_old": error}), names, ("next", "error_old"))


def _shrunk(order: int) -> Call:
    """The step after a rejected one."""
    error, tried = inputs = cg.variables("error tried")
    shrink = cg.where(error < 1e300, cg.maximum(SAFETY * error ** (-1.0 / order), SMALLEST_FACTOR), 0.1)
    return Call(Graph(inputs, {"next": tried * shrink}), ("error", "tried"), ("next",))


def accept_step(order: int, *after: Statement, starts: bool) -> If:
    """An accepted step becomes the state; `after` is what the method does besides, with x still the old state.

    order: of the step's size in the estimate.  starts: see `chosen`.
    """
    kept = (copied("x", "x_old"), copied("t", "t_old"))
    arrived = (copied("x_new", "x"), copied("t_new", "t"))
    if starts:
        free, again = (
            Call(Graph([], {name: value}), (), (name,)) for name, value in (("next", math.inf), ("fresh", 1.0))
        )
        return If("accepted", (*kept, *after, *arrived, free), (_shrunk(order), again))
    h, longest, turned = cg.variables("h longest turned")
    lost = cg.minimum(cg.sqrt(turned), FORGOTTEN) * longest
    after_h = Graph([h, longest, turned], {"longest": cg.maximum(abs(h), longest - lost)})
    x, x_new, moved, wanted, still = cg.variables("x x_new moved next still")
    way = Sum(Graph([x, x_new], {"way": abs(x_new - x)}), ("x", "x_new"), "moved")
    short = Graph([moved, wanted, still], {"next": cg.where(moved, wanted, cg.minimum(wanted, still))})
    remembered = Call(after_h, ("h", "longest", "turned"), ("longest",))
    steps = (way, Call(short, ("moved", "next", "still"), ("next",)), remembered)
    return If("accepted", (_grown(order), _turn(), *kept, *after, *steps, *arrived), (_shrunk(order),))


def _turn() -> Sum:
    """Register `turned`: the sum over the state of squares of changes of the mean rate, each a share of the larger one.

    Both rates are compared as ways in the time of this step; before the first one there is none.
    """
    t, h, t_old, x, x_new, x_old = cg.variables("t h t_old x x_new x_old")
    before = cg.where(cg.equal(t, t_old), 0.0, h / (t - t_old)) * (x - x_old)
    way = x_new - x
    share = abs(way - before) / cg.maximum(cg.maximum(abs(way), abs(before)), SMALLEST_ATOL)
    names = ("h", "t", "t_old", "x", "x_new", "x_old")
    return Sum(Graph([h, t, t_old, x, x_new, x_old], {"square": share * share}), names, "turned")


def count(more: int, register: str = "evaluations") -> Call:
    """That many more in a register."""
    return Call(function("done", sum=cg.variable("done") + float(more)), (register,), (register,))


def first_pass(*statements: Statement) -> If:
    """Branch before the first trial alone."""
    return If("fresh", (*statements, Call(function("fresh", none=0.0), ("fresh",), ("fresh",))))


def chosen(step: Step, problem: Problem, *, dense: bool, degree: int, starts: bool) -> Program:
    """A trial of one step a pass.

    starts: whether the next step is at most what the derivatives at its start allow, whatever the one before was. After
    a trial that was too long the rates are those of its end, so that all begins again.
    """
    lengths = with_registers(step, registers(problem))
    rates, prepare = ([*part, *_counted(problem, part)] for part in (step.rates, step.prepare))
    first, again = ([*step.start, *rates], prepare) if step.handed is not None else (step.start, [*rates, *prepare])
    body = _forgotten(step)
    if first:
        body.append(first_pass(*first))
    if again:
        body += again if starts else [If("accepted", tuple(again))]
    body += [trial(), *step.body, *step.error]
    body.append(control(rate_calls(problem, step.body, step.error)))
    after: list[Statement] = []
    if dense:
        polynomial, more = (step.dense, step.dense_lengths) if step.dense else _hermite(problem)
        after.append(If("row", (*polynomial, *_counted(problem, polynomial))))
        lengths |= {**dict.fromkeys([f"dense{k + 1}" for k in range(degree)], problem.size), **more}
    body.append(accept_step(step.estimate, *after, *step.kept, *(step.handed or ()), starts=starts))
    return Program(lengths, body, recorded(dense, degree), record_if="row", stop="status")


def _forgotten(step: Step) -> list[Statement]:
    """Registers that are 0 before the first trial: those that a step reads before it is sure to write them."""
    first: dict[str, None] = {}
    written: set[str] = set()
    for each in (*step.start, *step.rates, *step.prepare, *step.body, *step.error, *step.kept, *(step.handed or ())):
        reads, writes = effects([each])
        first |= {name: None for name in reads if name in step.lengths and name not in SHARED and name not in written}
        if not STATEMENTS[type(each)].bodies:  # which may run no time at all
            written |= {*writes}
    return [If("anew", tuple([Map(_ZERO, (name,), (name,)) for name in (*first, "anew")]), seldom=True)]


_ZERO = function("a", zero=0.0)


def _counted(problem: Problem, statements: Sequence[Statement]) -> list[Call]:
    """Register `evaluations`, with those of the statements."""
    calls = rate_calls(problem, statements)
    return [count(calls)] if calls else []


def _hermite(problem: Problem) -> tuple[list[Statement], dict[str, int]]:
    """The cubic through states and rates at both ends."""
    x, x_new, h, a, b = inputs = cg.variables("x x_new h a b")
    way, first, last = x_new - x, h * a, h * b
    powers = {"1": first, "2": 3.0 * way - 2.0 * first - last, "3": first + last - 2.0 * way}
    statements: list[Statement] = [
        Call(problem.rate, ("x", "t", "p"), ("rate_before",)),
        Call(problem.rate, ("x_new", "t_new", "p"), ("rate_after",)),
        Map(
            Graph(inputs, powers),
            ("x", "x_new", "h", "rate_before", "rate_after"),
            tuple([f"dense{k + 1}" for k in range(HERMITE)]),
        ),
    ]
    return statements, dict.fromkeys(("rate_before", "rate_after"), problem.size)


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
    return [total, Call(longer, ("way", "farthest"), ("farthest",)), copied("onto", "x")]


def nonfinite(target: str, *registers: str) -> Sum:
    """target = 0 where all numbers of registers of one length are finite, else NaN.

    Divided by an infinite number, an error is 0: that of a step with infinite pivots.
    """
    first, *others = inputs = cg.variables([f"a{k}" for k in range(len(registers))])
    none = sum([other - other for other in others], first - first)
    return Sum(Graph(inputs, {"none": none}), registers, target)
