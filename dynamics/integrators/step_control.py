"""Chosen steps: a method's step, tried until its error is within the tolerance; the registers, and step control.

A pass is a trial of one step, from t to t_new = t + h exactly, over the registers that `Method` lists. `tried` is its
size before t_new was rounded; `fresh` is 1 before the first pass.

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
from cgraph import Node
from cgraph.extend import STATEMENTS, Call, If, Map, Program, Statement, Sum, copied, effects

from .problem import Problem
from .step import Step, Values, call, count, each, rate_calls, total, with_registers

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


@call
def trial(t: Node, next_: Node, max_step: Node, end: Node, rtol: Node, jump: Node, longest: Node) -> Values:
    """The step to try: `next`, or what is left; of a little more than one step, half, so that no sliver remains.

    h = t_new - t, so that the clock and the state make the same step.
    """
    left, most = abs(end - t), cg.minimum(next_, max_step)
    tried = cg.where(most >= left, left, cg.where(2.0 * most > left, 0.5 * left, most))
    t_new = cg.where(most >= left, end, t + cg.where(end > t, tried, -tried))
    h = t_new - t
    return {"tried": tried, "t_new": t_new, "h": h, "leap": rtol * jump * longest / abs(h)}


def scale(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node) -> Node:
    """Scale of an error, of the registers `SCALE`."""
    return atol + rtol * cg.maximum(abs(x), abs(x_new)) + leap * abs(x_new - x)


def control(more: int) -> Call:
    """Call that accepts a trial or not, by its estimate. A NaN is an error beyond measure.

    A step below the resolution of t, or of the run, is not accepted whatever its error: only one that ends the run may
    be so short.

    more: evaluations of the rate in a trial.
    """
    names = "error t t_new end next max_step min_step rejected evaluations accepted search trials sized seen".split()

    def judged(*values: Node) -> Values:
        error, t, t_new, end, wanted, max_step, min_step, rejected, done, before, *rest = values
        search, trials, sized, seen, h, made = rest
        arrives = cg.equal(t_new, end)
        able = cg.maximum(arrives, cg.minimum(wanted, max_step) > cg.maximum(min_step, RESOLUTION * abs(t)))
        accepted = able * (error <= 1.0)
        row = cg.where(search, 0.0, accepted)
        return {
            "accepted": accepted,
            "status": cg.where(accepted, cg.where(arrives, DONE, RUNNING), cg.where(able, RUNNING, TOO_SMALL)),
            "rejected": rejected + (1.0 - accepted),
            "evaluations": done + float(more),
            "largest": cg.where(before, LARGEST_FACTOR, 1.0),  # no growth after a rejection
            "row": row,
            "longest_made": cg.where(row, cg.maximum(made, abs(h)), made),
            "trials": trials + 1.0,
            "due": sized * (trials + 1.0 >= seen),
        }

    return call(judged, *names, "h", "longest_made")


def accept_step(order: int, *after: Statement, starts: bool) -> If:
    """An accepted step becomes the state; `after` is what the method does besides, with x still the old state.

    order: of the step's size in the estimate.  starts: see `chosen`.
    """

    def grown(error: Node, error_old: Node, tried: Node, next_: Node, largest: Node) -> Values:
        growth = SAFETY * error ** -(1.0 / order - 0.75 * MEMORY) * cg.maximum(error_old, 1e-4) ** MEMORY
        longer = tried * cg.minimum(cg.maximum(growth, SMALLEST_FACTOR), largest)
        # a step cut short says less
        return {"next": cg.where(tried < next_, cg.maximum(next_, longer), longer), "error_old": error}

    def shrunk(error: Node, tried: Node) -> Values:
        shrink = cg.where(error < 1e300, cg.maximum(SAFETY * error ** (-1.0 / order), SMALLEST_FACTOR), 0.1)
        return {"next": tried * shrink}

    kept = (copied("x", "x_old"), copied("t", "t_old"))
    arrived = (copied("x_new", "x"), copied("t_new", "t"))
    if starts:
        free, again = call(lambda: {"next": math.inf}), call(lambda: {"fresh": 1.0})
        return If("accepted", (*kept, *after, *arrived, free), (call(shrunk), again))
    way = total(lambda x, x_new: {"moved": abs(x_new - x)})
    short = call(lambda moved, next_, still: {"next": cg.where(moved, next_, cg.minimum(next_, still))})
    steps = (call(grown), turn_of_rates, *kept, *after, way, short, longest_step, *arrived)
    return If("accepted", steps, (call(shrunk),))


@call
def longest_step(h: Node, longest: Node, turned: Node) -> Values:
    """The longest of the last steps, of which a share is lost as rates grow."""
    lost = cg.minimum(cg.sqrt(turned), FORGOTTEN) * longest
    return {"longest": cg.maximum(abs(h), longest - lost)}


@total
def turn_of_rates(h: Node, t: Node, t_old: Node, x: Node, x_new: Node, x_old: Node) -> Values:
    """Squares of changes of the mean rate, each a share of the larger one, as ways in the time of this step.

    Before the first step there is none.
    """
    before = cg.where(cg.equal(t, t_old), 0.0, h / (t - t_old)) * (x - x_old)
    way = x_new - x
    share = abs(way - before) / cg.maximum(cg.maximum(abs(way), abs(before)), SMALLEST_ATOL)
    return {"turned": share * share}


def first_pass(*statements: Statement) -> If:
    """Branch before the first trial alone."""
    return If("fresh", (*statements, call(lambda fresh: {"fresh": 0.0})))


def chosen(step: Step, problem: Problem, *, dense: bool, degree: int, starts: bool) -> Program:
    """A trial of one step a pass.

    starts: whether the next step is at most what the derivatives at its start allow, whatever the one before was. After
    a trial that was too long the rates are those of its end, so that all begins again.
    """
    polynomial = (step.dense or _hermite(problem)) if dense else ()
    lengths = with_registers(step, registers(problem), *step.error, *(step.handed or ()), *polynomial)
    lengths |= dict.fromkeys([f"dense{k + 1}" for k in range(degree if dense else 0)], problem.size)
    rates, prepare = ([*part, *_counted(problem, part)] for part in (step.rates, step.prepare))
    first, again = ([*step.start, *rates], prepare) if step.handed is not None else (step.start, [*rates, *prepare])
    body = _forgotten(step, problem)
    if first:
        body.append(first_pass(*first))
    if again:
        body += again if starts else [If("accepted", tuple(again))]
    body += [trial, *step.body, *step.error]
    body.append(control(rate_calls(problem, step.body, step.error)))
    after = [If("row", (*polynomial, *_counted(problem, polynomial)))] if dense else []
    body.append(accept_step(step.estimate, *after, *step.kept, *(step.handed or ()), starts=starts))
    return Program(lengths, body, recorded(dense, degree), record_if="row", stop="status")


def _forgotten(step: Step, problem: Problem) -> list[Statement]:
    """Registers that are 0 before the first trial: those that a step reads before it is sure to write them."""
    first: dict[str, None] = {}
    written = {*registers(problem)}
    before = (*step.start, *step.rates, *step.prepare, *step.body)
    for statement in (*before, *step.error, *step.kept, *(step.handed or ())):
        reads, writes = effects([statement])
        first |= {name: None for name in reads if name not in written}
        if not STATEMENTS[type(statement)].bodies:  # which may run no time at all
            written |= {*writes}
    return [If("anew", tuple([Map(ZERO, (name,), (name,)) for name in (*first, "anew")]), seldom=True)]


ZERO = each(lambda a: {"zero": 0.0}).graph


def _counted(problem: Problem, statements: Sequence[Statement]) -> list[Call]:
    """Register `evaluations`, with those of the statements."""
    calls = rate_calls(problem, statements)
    return [count(calls)] if calls else []


def _hermite(problem: Problem) -> list[Statement]:
    """The cubic through states and rates at both ends."""

    def powers(x: Node, x_new: Node, h: Node, rate_before: Node, rate_after: Node) -> Values:
        way, first, last = x_new - x, h * rate_before, h * rate_after
        return {"dense1": first, "dense2": 3.0 * way - 2.0 * first - last, "dense3": first + last - 2.0 * way}

    before = Call(problem.rate, ("x", "t", "p"), ("rate_before",))
    return [before, Call(problem.rate, ("x_new", "t_new", "p"), ("rate_after",)), each(powers)]


def measured(error: str, m: int) -> list[Statement]:
    """Register `error`: the root mean square over the state of the register's (error / scale).

    NaN where x_new is not finite: its scale would hide any error.
    """

    def square(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node, e: Node) -> Values:
        part = e / scale(x, x_new, rtol, atol, leap)
        return {"sum": part * part + (x_new - x_new)}

    return [total(square, *SCALE, error), call(lambda sum_: {"error": cg.sqrt(sum_ / m)})]


def moved(m: int) -> list[Statement]:
    """x = register `onto`; `farthest`, the largest of such moves so far, a root mean square of move over tolerance."""

    def square(x: Node, rtol: Node, atol: Node, onto: Node) -> Values:
        part = (onto - x) / scale(x, onto, rtol, atol, cg.constant(0.0))
        return {"way": part * part}

    longer = call(lambda way, farthest: {"farthest": cg.maximum(cg.sqrt(way / m), farthest)})
    return [total(square), longer, copied("onto", "x")]


def nonfinite(target: str, *registers: str) -> Sum:
    """target = 0 where all numbers of registers of one length are finite, else NaN.

    Divided by an infinite number, an error is 0: that of a step with infinite pivots.
    """

    def none(first: Node, *others: Node) -> Values:
        return {target: sum([other - other for other in others], first - first)}

    return total(none, *registers)
