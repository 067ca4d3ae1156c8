"""Taylor's method: steps by the Taylor series of the solution, of an order by the tolerance.

Order and step follow Jorba and Zou, Experimental Mathematics 14 (2005) 99: the step at which the last two terms are as
small as the tolerance, and order -log(rtol) / 2 + 3, two more than theirs. Coefficients are of the time in units of the
step before, so that they neither overflow nor depend on the unit of time. What a step missed is seen at its end, where
the derivative of the polynomial has to be the rate; coefficients 0 of the next step are computed there anyway.

All coefficients are one graph where it is short: its values stay in registers. Else a graph of one order is repeated,
with sums of products over many nodes at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Jets, convolution, kept_by_first
from cgraph.extend import Call, If, Map, NoSeriesError, Statement, Sum, copied, jets, straight

from ..systems.arguments import TIME
from .elementwise import compensated, function, stage_time
from .problem import Problem
from .step import Step
from .step_control import count

# Operations of all coefficients, before folding, that are one straight graph: more take a second to compile, and would
# run a third faster.
SHORT_CODE = 24_000
CHECKED = 2.0**-46  # relative: rounding of the rates, below which a defect says nothing
# Units in a step, inverse: a shorter one is tried again in a unit of its own, for what starts at 0 is measured by its
# first change, which is that of a whole unit.
APART = 3.0
SHORTEST = 2.0**-10  # units: the first try where terms say nothing, as of what stays at 0, or overflow


def taylor_step(problem: Problem, order: int) -> Step:
    """The step of an order."""
    m, graphs, c = problem.size, _jets(problem), _names("c", order)
    if order * (len(graphs.order.nodes) + graphs.sums * order) <= SHORT_CODE:
        series: list[Statement] = [Call(straight(graphs, order), ("rate", "unit", "zeros"), tuple(c))]
        lengths: dict[str, int] = {}
    else:
        series, lengths = _by_orders(m, graphs, order)
    unit, h = cg.variables("unit h")
    # By itself, so that the arrival follows no call that writes coefficients: it would gather them one by one.
    share = Call(function("h unit", s=h / unit), ("h", "unit"), ("s",), exact=True)
    at_all = Call(function("unit h", unit=cg.where(unit, unit, h)), ("unit", "h"), ("unit",))  # where nothing is wished
    at_most = cg.minimum(cg.variable("next"), abs(cg.variable("end") - cg.variable("t")))
    controls = ["unit", "last", "before", "next", "end", "rtol", "s", "at_t", "starting"]
    lengths |= dict.fromkeys([*c, "rate", "rounding", "rounding_new", "slope", "atol", "weight"], m)
    lengths |= {"zeros": graphs.zeros} | dict.fromkeys(controls, 1)
    return Step(
        lengths,
        [share, _arrival(order)],
        [_rates(graphs, "x", "t"), count(1)],
        [at_all, *series, *_wish(order)],
        [Call(function("next end t", unit=at_most, starting=1.0), ("next", "end", "t"), ("unit", "starting"))],
        kept=[
            copied("rounding_new", "rounding"),
            Call(function("h", unit=h, starting=0.0), ("h",), ("unit", "starting")),
        ],
        fixed=("rounding", "rounding_new", "atol", "weight", *controls),
        error=[stage_time("at_t", 1.0), _rates(graphs, "x_new", "at_t"), count(1), *_checked(m, order)],
        estimate=order,
        handed=(),
        dense=[_dense(order)],
        dense_lengths=dict.fromkeys(_names("dense", order), m),
    )


def _names(name: str, order: int) -> list[str]:
    return [f"{name}{k}" for k in range(1, order + 1)]


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


def _by_orders(m: int, graphs: Jets, order: int) -> tuple[list[Statement], dict[str, int]]:
    """Coefficients of one order after another, and the registers that it takes; `none` stays 0."""
    numbers = Graph([], {name: float(k) for k, name in enumerate(_names("order", order), 1)})
    body: list[Statement] = [copied("rate", "rates0"), Call(numbers, (), tuple(numbers.outputs))]
    lengths = dict.fromkeys([*_names("left", order), *_names("right", order), "sums", "none"], graphs.sums)
    for k in range(1, order + 1):
        if k > 1 and graphs.sums:
            sides = [*_names("left", k - 1), *_names("right", k - 1)]
            factors = cg.variables(sides)
            total = Graph(factors, {"sum": convolution(factors[: k - 1], factors[k - 1 :])})
            body.append(Map(total, tuple(sides), ("sums",)))
        inputs = (f"rates{(k - 1) % 2}", "unit", f"order{k}", "zeros", "sums" if k > 1 else "none")
        body.append(Call(graphs.order, inputs, (f"c{k}", f"rates{k % 2}", f"left{k}", f"right{k}")))
    return body, lengths | dict.fromkeys(("rates0", "rates1"), m) | dict.fromkeys(_names("order", order), 1)


def _wish(order: int) -> list[Statement]:
    """Register `next`: at most the step at which the last two terms are within the tolerance.

    That is y^(-1 / 2k) units, y the sum of squares of c_k over the tolerance, with a safety factor. Both are taken as a
    power of the higher order alone, which is the same for a step as long as the one before, and takes half the time.
    """
    names = _names("c", order)
    x, rtol, atol, *terms = inputs = cg.variables(["x", "rtol", "atol", *names])
    size = cg.maximum(abs(x), abs(terms[0]))  # what starts at 0 is as large as its first change
    weight = Graph(inputs[:4], {"weight": 1.0 / (atol + rtol * size)})
    size = cg.where(size, size, _largest(terms))  # under a force that begins at 0 that is 0, too, but not its largest
    of_start = Graph(inputs, {"weight": 1.0 / (atol + rtol * size)})
    at_start, later = (Map(each, each.input_names, ("weight",)) for each in (of_start, weight))
    c, each = inputs = cg.variables("c weight")
    square = Graph(inputs, {"y": (c * each) * (c * each)})
    last, before, unit, wanted = inputs = cg.variables("last before unit next")
    both = cg.maximum(math.exp(1.4) * before, math.exp(4.0 + 1.4 * order / (order - 1.0)) * last)
    share = both ** (-0.5 / order)
    h = abs(unit) * cg.where(share > SHORTEST, share, SHORTEST)
    graph = Graph(inputs, {"h": cg.where(h < wanted, h, wanted)})
    return [
        If("starting", (at_start,), (later,)),
        *[Sum(square, (f"c{k}", "weight"), name) for name, k in (("last", order), ("before", order - 1))],
        Call(graph, ("last", "before", "unit", "next"), ("next",)),
    ]


def _largest(c: Sequence[Node]) -> Node:
    """The largest size, by halves side by side."""
    sizes = [abs(each) for each in c]
    while len(sizes) > 1:
        pairs = zip(sizes[::2], sizes[1::2], strict=False)
        sizes = [*[cg.maximum(one, other) for one, other in pairs], *sizes[len(sizes) // 2 * 2 :]]
    return sizes[0]


def _arrival(order: int) -> Map:
    """x_new = x + sum of c_k s^k, with what rounding took off; slope = h times the polynomial's derivative there."""
    x, before, s, *c = cg.variables(["x", "rounding", "s", *_names("c", order)])
    total, rounding = compensated(x, s * _polynomial(c, s) + before)
    slope = s * _polynomial([k * each for k, each in enumerate(c, 1)], s)
    graph = Graph([x, before, s, *c], {"x": total, "rounding": rounding, "slope": slope})
    return Map(graph, ("x", "rounding", "s", *_names("c", order)), ("x_new", "rounding_new", "slope"))


def _polynomial(c: Sequence[Node], s: Node) -> Node:
    """The sum of c_k s^k, by Estrin: halves side by side, of half as many steps each time."""
    terms, power = list(c), s
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        terms = [low + power * high for low, high in pairs] + terms[len(terms) // 2 * 2 :]
        power = power * power
    return terms[0]


def _checked(m: int, order: int) -> list[Statement]:
    """Register `error`: what the step misses by its defect, the difference of rate and derivative at its end.

    One that has to be tried again misses a tolerance more.
    """
    slope, rate, x, x_new, rtol, atol, h = inputs = cg.variables("slope rate x x_new rtol atol h")
    scale = atol + cg.maximum(rtol, CHECKED) * cg.maximum(abs(x), abs(x_new)) + CHECKED * abs(slope)
    part = (slope - h * rate) / scale
    names = ("error", "h", "t", "next", "unit")
    total, h, t, wanted, unit = of_all = cg.variables(names)
    missed = cg.sqrt(total * (1.0 / (m * (order + 1.0) ** 2)))
    error = cg.where(cg.not_equal(t, t + h), cg.where(APART * wanted < abs(unit), missed + 1.0, missed), math.inf)
    return [
        Sum(Graph(inputs, {"y": part * part}), ("slope", "rate", "x", "x_new", "rtol", "atol", "h"), "error"),
        Call(Graph(of_all, {"error": error}), names, ("error",)),
    ]


def _dense(order: int) -> Map:
    """dense_k = c_k s^k."""
    s, *c = cg.variables(["s", *_names("c", order)])
    outputs, power = {}, s
    for k, each in enumerate(c, start=1):
        outputs[f"dense{k}"] = each * power
        power = power * s
    return Map(Graph([s, *c], outputs), ("s", *_names("c", order)), tuple(outputs))
