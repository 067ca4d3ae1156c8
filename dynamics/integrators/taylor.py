"""Taylor's method: steps by the Taylor series of the solution, of an order by the tolerance.

Order and step follow Jorba and Zou, Experimental Mathematics 14 (2005) 99: order -log(rtol) / 2 + 1, and the step at
which the last two terms are as small as the tolerance. Coefficients are of the time in units of the step before, so
that they neither overflow nor depend on the unit of time. What a step missed is seen at its end, where the derivative
of the polynomial has to be the rate; coefficients 0 of the next step are computed there anyway.
"""

from __future__ import annotations

import math

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, If, Jets, Map, NoSeriesError, Statement, Sum, copied, jets

from ..systems.arguments import TIME
from .elementwise import compensated, function, stage_time
from .problem import Problem
from .step import Step
from .step_control import count

LEAST = 3  # order
CHECKED = 2.0**-46  # relative: rounding of the rates, below which a defect says nothing


def taylor_step(order: int, problem: Problem) -> Step:
    """The step, of at most that order."""
    m, graphs = problem.size, _jets(problem)
    orders = range(1, order + 1)
    numbers = Graph([], {f"order{k}": float(k) for k in orders})
    series: list[Statement] = [copied("rate", "rates0")]
    for k in orders:
        series += [If(f"takes{k}", tuple(_coefficients(k, graphs)))]
    unit, h = cg.variables("unit h")
    share = Call(function("h unit", s=h / unit), ("h", "unit"), ("s",))
    at_all = Call(function("unit h", unit=cg.where(unit, unit, h)), ("unit", "h"), ("unit",))  # where nothing is wished
    names = [f"c{k}" for k in orders]
    lengths = dict.fromkeys([*names, "rates0", "rates1", "rate", "rate_new", "rounding", "rounding_new", "slope"], m)
    lengths |= {f"{side}{k}": graphs.sums for side in ("left", "right") for k in orders}
    lengths |= {"sums": graphs.sums, "none": graphs.sums, "zeros": graphs.zeros, "zeros_new": graphs.zeros}
    lengths |= {"next": 1, "rtol": 1, "atol": m}
    controls = ["unit", "last", "before", "highest", *[f"{name}{k}" for name in ("order", "takes") for k in orders]]
    lengths |= dict.fromkeys(["s", "at_t", *controls], 1)
    return Step(
        lengths,
        [share, _arrival(order)],
        [_rates(graphs, "x", "t", ""), count(1)],
        [at_all, *series, _wish()],
        [Call(numbers, (), tuple(numbers.outputs)), _orders(order), copied("next", "unit")],
        kept=[copied("rounding_new", "rounding"), copied("h", "unit")],
        fixed=("rounding", "rounding_new", "next", "rtol", "atol", *controls),
        error=[stage_time("at_t", 1.0), _rates(graphs, "x_new", "at_t", "_new"), count(1), *_checked(m)],
        estimate=order,
        handed=[copied(f"{name}_new", name) for name in ("rate", "zeros")],
        dense=[_dense(order)],
        dense_lengths={f"dense{k}": m for k in orders},
    )


def _rates(graphs: Jets, x: str, t: str, suffix: str) -> Call:
    """The rates and coefficients 0 at a state."""
    return Call(graphs.start, (x, t, "p"), (f"rate{suffix}", f"zeros{suffix}"))


def _jets(problem: Problem) -> Jets:
    try:
        return jets(problem.rate, TIME)
    except NoSeriesError as error:
        raise NoSeriesError(
            f"method 'taylor' needs equations that are smooth, and {error}: take another method, such as 'dop853'"
        ) from None


def _orders(order: int) -> Call:
    """From rtol: the order, and which coefficients are computed; all of them where the tolerance asks for nothing."""
    rtol = cg.variable("rtol")
    wanted = 1.0 - 0.5 * cg.log(cg.maximum(rtol, 1e-300))
    highest = cg.where(rtol < 1.0, cg.minimum(cg.maximum(wanted, float(LEAST)), float(order)), float(order))
    takes = {f"takes{k}": cg.less(k - 1.0, highest) for k in range(1, order + 1)}
    rounded = sum(takes.values(), cg.constant(0.0))
    return Call(Graph([rtol], {**takes, "highest": rounded}), ("rtol",), (*takes, "highest"))


def _coefficients(k: int, graphs: Jets) -> list[Statement]:
    """Coefficients k, and the size of the term k of the state in tolerances."""
    body: list[Statement] = []
    if k > 1 and graphs.sums:
        pairs = [(f"left{j}", f"right{k - j}") for j in range(1, k)]
        nodes = cg.variables([f"v{j}" for j in range(2 * len(pairs))])
        products = [a * b for a, b in zip(nodes[::2], nodes[1::2], strict=True)]
        halves = [sum(part[1:], part[0]) for part in (products[::2], products[1::2]) if part]
        graph = Graph(nodes, {"sum": sum(halves[1:], halves[0])})
        body.append(Map(graph, tuple([name for pair in pairs for name in pair]), ("sums",)))
    inputs = (f"rates{(k - 1) % 2}", "unit", f"order{k}", "zeros", "sums" if k > 1 else "none")
    body.append(Call(graphs.order, inputs, (f"c{k}", f"rates{k % 2}", f"left{k}", f"right{k}")))
    return [*body, copied("last", "before"), Sum(_SQUARE, (f"c{k}", "x", "c1", "rtol", "atol"), "last")]


def _square() -> Graph:
    c, x, first, rtol, atol = inputs = cg.variables("c x first rtol atol")
    part = c / (atol + rtol * cg.maximum(abs(x), abs(first)))  # what starts at 0 is as large as its first change
    return Graph(inputs, {"y": part * part})


_SQUARE = _square()


def _wish() -> Call:
    """Register `next`: at most the step at which the last two terms are within the tolerance."""
    last, before, unit, order, wanted = inputs = cg.variables("last before unit highest next")
    share = cg.minimum(before ** (-0.5 / (order - 1.0)), (math.exp(4.0) * last) ** (-0.5 / order))
    h = abs(unit) * share * cg.exp(-0.7 / (order - 1.0))
    names = ("last", "before", "unit", "highest", "next")
    return Call(Graph(inputs, {"h": cg.where(cg.equal(h, h), cg.minimum(wanted, h), 0.0)}), names, ("next",))


def _arrival(order: int) -> Map:
    """x_new = x + sum of c_k s^k, with what rounding took off; slope = h times the polynomial's derivative there."""
    x, before, s, *c = cg.variables(["x", "rounding", "s", *(f"c{k}" for k in range(1, order + 1))])
    change, slope = c[-1], order * c[-1]
    for k in range(order - 1, 0, -1):
        change, slope = c[k - 1] + s * change, k * c[k - 1] + s * slope
    total, rounding = compensated(x, s * change + before)
    graph = Graph([x, before, s, *c], {"x": total, "rounding": rounding, "slope": s * slope})
    registers = ("x", "rounding", "s", *[f"c{k}" for k in range(1, order + 1)])
    return Map(graph, registers, ("x_new", "rounding_new", "slope"))


def _checked(m: int) -> list[Statement]:
    """Register `error`: what the step misses by its defect, the difference of rate and derivative at its end."""
    slope, rate, x, x_new, rtol, atol, h, order = inputs = cg.variables("slope rate x x_new rtol atol h order")
    scale = atol + cg.maximum(rtol, CHECKED) * cg.maximum(abs(x), abs(x_new)) + CHECKED * abs(slope)
    part = (slope - h * rate) / ((order + 1.0) * scale)
    names = ("slope", "rate_new", "x", "x_new", "rtol", "atol", "h", "highest")
    total, h, t = cg.variables("error h t")
    error = cg.where(cg.not_equal(t, t + h), cg.sqrt(total / m), math.inf)
    return [
        Sum(Graph(inputs, {"y": part * part}), names, "error"),
        Call(Graph([total, h, t], {"error": error}), ("error", "h", "t"), ("error",)),
    ]


def _dense(order: int) -> Map:
    """dense_k = c_k s^k."""
    s, *c = cg.variables(["s", *(f"c{k}" for k in range(1, order + 1))])
    outputs, power = {}, s
    for k, each in enumerate(c, start=1):
        outputs[f"dense{k}"] = each * power
        power = power * s
    return Map(Graph([s, *c], outputs), ("s", *[f"c{k}" for k in range(1, order + 1)]), tuple(outputs))
