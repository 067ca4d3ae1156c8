"""Taylor's method: steps by the Taylor series of the solution, of an order by the tolerance.

Order and step follow Jorba and Zou, Experimental Mathematics 14 (2005) 99: the step at which the last two terms are as
small as the tolerance. Coefficients are of the time in units of the step before, so that they neither overflow nor
depend on the unit of time. What a step missed is seen at its end, where the derivative has to be the rate.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import cgraph as cg
from cgraph import Node
from cgraph._shared import Jets, kept_by_first
from cgraph.extend import Call, If, NoSeriesError, Statement, copied, jets, straight

from ..systems.arguments import TIME
from .problem import Problem
from .step import Step, Values, call, compensated, count, each, numbered, stage_time, total

MOST_OPERATIONS = 300_000  # of a series, before folding: as many take 20 s to compile
CHECKED = 2.0**-46  # relative: rounding of the rates, below which a defect says nothing
APART = 3.0  # units in a step, inverse: a shorter one is tried again in a unit of its own, by its own first change
SHORTEST = 2.0**-10  # units: the first try where terms say nothing, as of what stays at 0, or overflow


def taylor_step(problem: Problem, order: int) -> Step:
    """The step of an order. Raises NoSeriesError for equations without a series, or with too long a one."""
    m, graphs, c = problem.size, _jets(problem), numbered("c", order, 1)
    operations = order * (len(graphs.order.nodes) + graphs.sums * order)
    if operations > MOST_OPERATIONS:
        raise NoSeriesError(
            f"method 'taylor' of order {order} needs {operations} operations for the series of these equations, and "
            f"takes at most {MOST_OPERATIONS}: take another method, such as 'dop853'"
        )
    begin = call(lambda next_, end, t: {"unit": cg.minimum(next_, abs(end - t)), "starting": 1.0})
    # By itself, so that the arrival follows no call that writes coefficients: it would gather them one by one.
    share = replace(call(lambda h, unit: {"s": h / unit}), exact=True)
    at_all = call(lambda unit, h: {"unit": cg.where(unit, unit, h)})  # where nothing is wished
    controls = ["unit", "last", "before", "next", "end", "rtol", "at_t", "starting"]
    return Step(
        dict.fromkeys([*c, "rate"], m) | {"zeros": graphs.zeros},
        [share, _arrival(order)],
        [_rates(graphs, "x", "t"), count(1)],
        [at_all, Call(straight(graphs, order), ("rate", "unit", "zeros"), tuple(c)), *_wish(order)],
        [begin],
        kept=[copied("rounding_new", "rounding"), call(lambda h: {"unit": h, "starting": 0.0})],
        fixed=("rounding", "rounding_new", "atol", "weight", *controls),
        error=[stage_time("at_t", 1.0), _rates(graphs, "x_new", "at_t"), count(1), *_checked(m, order)],
        estimate=order,
        handed=(),
        dense=[_dense(order)],
    )


def _rates(graphs: Jets, x: str, t: str) -> Call:
    """The rates and coefficients 0 at a state."""
    return Call(graphs.start, (x, t, "p"), ("rate", "zeros"))


@kept_by_first
def _jets(problem: Problem) -> Jets:
    try:
        return jets(problem.rate, TIME)
    except NoSeriesError as error:
        raise NoSeriesError(
            f"method 'taylor' needs equations that are smooth, and {error}: take another method, such as 'dop853'"
        ) from None


def _wish(order: int) -> list[Statement]:
    """Register `next`: at most y^(-1 / 2k) units, y the squares of the last terms over the tolerance, k the order."""

    def later(x: Node, rtol: Node, atol: Node, first: Node) -> Values:
        """What starts at 0 is as large as its first change."""
        return {"weight": 1.0 / (atol + rtol * cg.maximum(abs(x), abs(first)))}

    def at_start(x: Node, rtol: Node, atol: Node, *terms: Node) -> Values:
        """Under a force that begins at 0 that is 0, too, but not its largest."""
        size = cg.maximum(abs(x), abs(terms[0]))
        return {"weight": 1.0 / (atol + rtol * cg.where(size, size, reduce(cg.maximum, map(abs, terms))))}

    def wish(last: Node, before: Node, unit: Node, next_: Node) -> Values:
        both = cg.maximum(math.exp(1.4) * before, math.exp(4.0 + 1.4 * order / (order - 1.0)) * last)
        share = both ** (-0.5 / order)
        h = abs(unit) * cg.where(share > SHORTEST, share, SHORTEST)
        return {"next": cg.where(h < next_, h, next_)}

    c, tolerance = numbered("c", order, 1), ("x", "rtol", "atol")
    last = total(lambda c, weight: {"last": (c * weight) * (c * weight)}, f"c{order}", "weight")
    return [
        If("starting", (each(at_start, *tolerance, *c),), (each(later, *tolerance, "c1"),)),
        last,
        replace(last, inputs=(f"c{order - 1}", "weight"), outputs=("before",)),
        call(wish),
    ]


def _arrival(order: int) -> Statement:
    """x_new = x + sum of c_k s^k, with what rounding took off; slope = h times the polynomial's derivative there."""

    def arrival(x: Node, rounding: Node, s: Node, *c: Node) -> Values:
        x_new, rounding_new = compensated(x, s * _polynomial(c, s) + rounding)
        slope = s * _polynomial([k * each_one for k, each_one in enumerate(c, 1)], s)
        return {"x_new": x_new, "rounding_new": rounding_new, "slope": slope}

    return each(arrival, "x", "rounding", "s", *numbered("c", order, 1))


def _polynomial(c: Sequence[Node], s: Node) -> Node:
    """The sum of c_k s^k, by Estrin: halves side by side, of half as many steps each time."""
    terms, power = list(c), s
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        terms = [low + power * high for low, high in pairs] + terms[len(terms) // 2 * 2 :]
        power = power * power
    return terms[0]


def _checked(m: int, order: int) -> list[Statement]:
    """Register `error`: the defect, the difference of rate and derivative at the end; more for what is tried again."""

    def square(slope: Node, rate: Node, x: Node, x_new: Node, rtol: Node, atol: Node, h: Node) -> Values:
        scale = atol + cg.maximum(rtol, CHECKED) * cg.maximum(abs(x), abs(x_new)) + CHECKED * abs(slope)
        part = (slope - h * rate) / scale
        return {"error": part * part}

    def judged(error: Node, h: Node, t: Node, next_: Node, unit: Node) -> Values:
        missed = cg.sqrt(error * (1.0 / (m * (order + 1.0) ** 2)))
        again = cg.where(APART * next_ < abs(unit), missed + 1.0, missed)
        return {"error": cg.where(cg.not_equal(t, t + h), again, math.inf)}

    return [total(square), call(judged)]


def _dense(order: int) -> Statement:
    """dense_k = c_k s^k."""

    def terms(s: Node, *c: Node) -> Values:
        powers = itertools.accumulate([s] * order, operator.mul)
        return {f"dense{k}": term * power for k, (term, power) in enumerate(zip(c, powers, strict=True), 1)}

    return each(terms, "s", *numbered("c", order, 1))
