"""Methods, and what repeats their steps: of equal lengths, or chosen ones, tried until the error is within tolerance.

A pass of chosen steps is a trial of one, from t to t_new = t + h exactly, of the size `tried`. `anew` is 1 when a run
begins, `search` positive while a first step is looked for (see `simulation.steps.first_step`): a trial then is no `row`
of the record. `due` is 1 after a trial by which sizes that make up atol are to be looked at, if it is `sized` by them.
What a force that jumps may be missed by is `leap`, for a share `jump` of the `longest` of the last steps; after a step
in which nothing moved the next is at most `still`: docs/design.md says why.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cgraph as cg
from cgraph import Node
from cgraph._shared import memo
from cgraph.extend import STATEMENTS, Call, If, Map, Program, Statement, Sum, copied, effects

from .problem import Problem
from .step import Step, Values, call, count, each, numbered, rate_calls, total, with_registers
from .switches import Switches

RUNNING, DONE, TOO_SMALL, CROSSED = 0.0, 1.0, 2.0, 3.0  # register `status`
SAFETY, SMALLEST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 5.0  # factors from one step to the next
MEMORY = 0.04  # weight of the estimate before in the choice of the next step (Gustafsson's PI control)
RESOLUTION = 4.0 * 2.0**-52  # steps below this share of t hardly move t
SCALE = ("x", "x_new", "rtol", "atol", "leap")
FORGOTTEN = 0.1  # of the longest step at most, in every step that is shorter
COLLAPSE = 2.0**-200  # steps below this share of a run never end it
KEPT_METHODS = 32  # methods of an order
SUM_ROUNDING = 16.0 * 2.0**-52  # of the sums of a step
SMALLEST_ATOL = 2.0**-1022  # in place of 0: a state that is 0 and stays 0 has no error


@dataclass(frozen=True)
class Method:
    """An integrator: what `dyn.METHODS` holds, and all that a simulation knows of a method."""

    order: int  # p, where the error of a run falls as h^p
    step: Callable[..., Step]  # of a problem; with order_at of a problem and an order
    adaptive: bool = False  # whether a run chooses its steps by the estimate of their error
    finest: float = SUM_ROUNDING  # relative tolerance below which a step's own rounding is larger
    by_rows: bool = False  # whether a step evaluates a rate by `Problem.evaluation` alone
    starts: bool = False  # whether `prepare` limits `next`: no first step is searched for, and rejection starts anew
    order_at: Callable[[float], int] | None = None  # the order for a relative tolerance, at most `order`

    def at(self, rtol: float) -> Method:
        """The method for runs of a relative tolerance, of the order that this asks for."""
        return self if self.order_at is None else _of_order(self, self.order_at(rtol))

    def program(self, problem: Problem, dense: bool) -> Program:
        """The steps of a run, one after another; dense: with dense output where they are chosen."""
        step = self.step(problem)
        if not self.adaptive:
            return equal(step, problem)
        if not step.error or step.estimate < 1:
            raise ValueError("a method that chooses its steps needs their error, `Step.error`, and `Step.estimate`")
        return chosen(step, problem, dense=dense, starts=self.starts)

    def __repr__(self) -> str:
        return f"<Method of order {self.order}, {'steps by error' if self.adaptive else 'equal steps'}>"


@memo(KEPT_METHODS)
def _of_order(method: Method, order: int) -> Method:
    """The method of one order; the same object for the same, since problems keep programs by it."""
    step = partial(method.step, order=order)
    return replace(method, order=order, step=step, order_at=None)


def equal_registers(problem: Problem) -> dict[str, int]:
    """Registers of every program of equal steps."""
    single = dict.fromkeys(("t", "h", "start", "count", "evaluations", "nonfinite"), 1)
    return {"x": problem.size, "x_new": problem.size, "p": len(problem.parameters), **single}


def equal(step: Step, problem: Problem) -> Program:
    """Equal steps: one step a pass, of a length that is given, over and over."""
    lengths = with_registers(step, equal_registers(problem))
    made = count(rate_calls(problem, step.rates, step.prepare, step.body))
    # the next time is computed from the start, without drift
    time = call(lambda start, count, h: {"t": start + (count + 1.0) * h, "count": count + 1.0})
    body = [*step.derived, time, made, nonfinite("nonfinite", "x")]
    if step.failed:
        body.append(call(lambda n, failed: {"nonfinite": n + failed, step.failed: 0.0}, "nonfinite", step.failed))
    if step.start:
        body.insert(0, first_pass(*step.start))
        lengths["fresh"] = 1
    return Program(lengths, body, record=["t", "x"], stop="nonfinite", shared=problem.evaluation.shared)


def registers(problem: Problem) -> dict[str, int]:
    """Registers of every program."""
    names = "t h tried next max_step min_step end fresh rtol accepted status rejected error error_old"
    names += " evaluations at_limit t_old t_new jump longest leap still moved turned anew search trials due"
    names += " sized seen row largest longest_made"
    states = dict.fromkeys(("x", "x_new", "x_old", "atol"), problem.size)
    return {**states, "p": len(problem.parameters), **dict.fromkeys(names.split(), 1)}


@call
def trial(t: Node, next_: Node, max_step: Node, end: Node, rtol: Node, jump: Node, longest: Node) -> Values:
    """The step to try: `next`, or what is left; of a little more than one step, half, so that no sliver remains."""
    left, most = abs(end - t), cg.minimum(next_, max_step)
    tried = cg.where(most >= left, left, cg.where(2.0 * most > left, 0.5 * left, most))
    t_new = cg.where(most >= left, end, t + cg.where(end > t, tried, -tried))
    h = t_new - t
    return {"tried": tried, "t_new": t_new, "h": h, "leap": rtol * jump * longest / abs(h)}


def scale(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node) -> Node:
    """Scale of an error, of the registers `SCALE`."""
    return atol + rtol * cg.maximum(abs(x), abs(x_new)) + leap * abs(x_new - x)


def control(more: int) -> Call:
    """Call that accepts a trial or not, by its estimate; NaN is an error.  more: evaluations of the rate in a trial."""
    names = "error t t_new end next max_step min_step rejected evaluations accepted search trials sized seen h"

    def judged(*values: Node) -> Values:
        error, t, t_new, end, wanted, max_step, min_step, rejected, done, before, *others, made = values
        search, trials, sized, seen, h = others
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

    return call(judged, *names.split(), "longest_made")


def accept_step(order: int, *after: Statement, starts: bool) -> If:
    """An accepted step becomes the state.  after: what the method does besides, with x still the old state."""

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
    """Squares of changes of the mean rate, each a share of the larger one, as ways in the time of this step."""
    before = cg.where(cg.equal(t, t_old), 0.0, h / (t - t_old)) * (x - x_old)
    way = x_new - x
    share = abs(way - before) / cg.maximum(cg.maximum(abs(way), abs(before)), SMALLEST_ATOL)
    return {"turned": share * share}


def first_pass(*statements: Statement) -> If:
    """Branch before the first trial alone."""
    return If("fresh", (*statements, call(lambda fresh: {"fresh": 0.0})))


def chosen(step: Step, problem: Problem, *, dense: bool, starts: bool) -> Program:
    """A trial of one step a pass.  starts: see `Method`."""
    polynomial = (step.dense or _hermite(problem)) if dense else ()
    written = effects(polynomial)[1]
    coefficients = [name for name in numbered("dense", len(written), 1) if name in written]
    lengths = with_registers(step, registers(problem), *step.error, *(step.handed or ()), *polynomial)
    lengths |= dict.fromkeys(coefficients, problem.size)
    rates, prepare = ([*part, *_counted(problem, part)] for part in (step.rates, step.prepare))
    first, again = ([*step.start, *rates], prepare) if step.handed is not None else (step.start, [*rates, *prepare])
    body = _forgotten(step, problem)
    if first:
        body.append(first_pass(*first))
    if again:
        body += again if starts else [If("accepted", tuple(again))]
    body += [trial, *step.body, *step.error, control(rate_calls(problem, step.body, step.error))]
    after = [If("row", (*polynomial, *_counted(problem, polynomial)))] if dense else []
    body.append(accept_step(step.estimate, *after, *step.kept, *(step.handed or ()), starts=starts))
    if problem.switches is not None:
        body.append(_crossed(problem.switches))
        lengths |= {"margins": len(problem.switches.turns), "beyond": 1}
    record = ["t", "h", "x", *(["t_old", "x_old", *coefficients] if dense else [])]
    return Program(lengths, body, record, record_if="row", stop="status", shared=problem.evaluation.shared)


def _crossed(switches: Switches) -> If:
    """After an accepted step, whether it has ended beyond a surface, where the run stops."""
    beyond = total(lambda margins: {"beyond": margins < 0.0})
    stops = call(lambda beyond, status: {"status": cg.where(beyond, CROSSED, status)})
    return If("row", (Call(switches.margins, ("x", "t", "p"), ("margins",)), beyond, stops))


def _forgotten(step: Step, problem: Problem) -> list[Statement]:
    """Registers that are 0 before the first trial: those that a step reads before it is sure to write them."""
    first: dict[str, None] = {}
    written = {*registers(problem), *problem.evaluation.lengths}
    before = (*step.start, *step.rates, *step.prepare, *step.body)
    for statement in (*before, *step.error, *step.kept, *(step.handed or ())):
        reads, writes = effects([statement])
        first |= {name: None for name in reads if name not in written}
        if not STATEMENTS[type(statement)].bodies:  # which may run no time at all
            written |= {*writes}
    zero = each(lambda a: {"a": 0.0}).graph
    return [If("anew", tuple([Map(zero, (name,), (name,)) for name in (*first, "anew")]), seldom=True)]


def _counted(problem: Problem, statements: Sequence[Statement]) -> list[Call]:
    """Register `evaluations`, with those of the statements."""
    calls = rate_calls(problem, statements)
    return [count(calls)] if calls else []


def _hermite(problem: Problem) -> list[Statement]:
    """The cubic through states and rates at both ends."""

    def powers(x: Node, x_new: Node, h: Node, rate_before: Node, rate_after: Node) -> Values:
        way, first, last = x_new - x, h * rate_before, h * rate_after
        return {"dense1": first, "dense2": 3.0 * way - 2.0 * first - last, "dense3": first + last - 2.0 * way}

    at = problem.evaluation.at
    return [*at("x", "t", "rate_before"), *at("x_new", "t_new", "rate_after"), each(powers)]


def measured(error: str, m: int) -> list[Statement]:
    """Register `error`: the root mean square of the register's (error / scale); NaN where x_new is not finite."""

    def square(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node, e: Node) -> Values:
        part = e / scale(x, x_new, rtol, atol, leap)
        return {"sum": part * part + (x_new - x_new)}

    return [total(square, *SCALE, error), call(lambda sum_: {"error": cg.sqrt(sum_ / m)})]


def projected(m: int) -> list[Statement]:
    """x = register `onto`; `farthest`, the largest of such moves so far, a root mean square of move over tolerance."""

    def square(x: Node, rtol: Node, atol: Node, onto: Node) -> Values:
        part = (onto - x) / scale(x, onto, rtol, atol, cg.constant(0.0))
        return {"way": part * part}

    longer = call(lambda way, farthest: {"farthest": cg.maximum(cg.sqrt(way / m), farthest)})
    return [total(square), longer, copied("onto", "x")]


def nonfinite(target: str, register: str) -> Sum:
    """target = 0 where all numbers of a register are finite, else NaN: divided by infinite pivots, an error is 0."""
    return total(lambda x: {target: x - x}, register)
