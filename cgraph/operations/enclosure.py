"""Enclosure: bounds of the outputs over boxes of the inputs, as a graph: interval arithmetic on nodes.

A bound that is NaN on the way, as inf - inf, stands for one that is not known; rules hand it on, and outputs have an
infinite one instead. The rules on floats, `bounds`, tell what is known over all boxes, such as signs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, NamedTuple

from ..core.builder import Builder
from ..core.graph import Graph
from ..core.node import CONSTANT, Node, apply, as_node, variable
from ..core.scope import building
from ..util.require import require_graph
from . import bounds
from .bounds import REAL_LINE, Rising, Wave
from .operation import Interval, Op, columns
from .table import atan2, cos, cosh, equal, floor, fmod, hypot, maximum, minimum, tan, where, zero_safe_mul

Ends = tuple[Any, Any]  # nodes or numbers


class Bounded(NamedTuple):
    """Bounds of a node. known: numbers between which both lie for every box."""

    low: Node
    high: Node
    known: Interval


def enclosure(graph: Graph, exact: Sequence[str | Node] = ()) -> Graph:
    """x -> y becomes (the lowest x, the highest x) -> (y.low, y.high), bounds of y over that box.

    Wherever in the box y, and what it is computed from, has a value, it lies between them, but for rounding: they are
    not rounded outwards. They may be wide, since an interval forgets which values belong together, but shrink to the
    value as the box does. Where nothing is known they are infinite, as of a quotient whose divisor may be 0, or an
    operation without `interval`; they are never NaN. Inputs may be infinite.

    exact: inputs that have one value. They come first, as they are, and what depends on them alone is computed once.
    Inputs of the result then are x.low of all others, and x.high; outputs are y.low of all, and y.high. Raises
    GraphError for an unknown input.

    >>> import cgraph as cg
    >>> from cgraph.extend import enclosure
    >>> x, a = cg.variables("x a")
    >>> bounds = enclosure(cg.Graph([x, a], {"y": a - x * x}), exact=["a"])
    >>> bounds.evaluate({"a": 5.0, "x.low": -1.0, "x.high": 2.0})
    {'y.low': 1.0, 'y.high': 5.0}
    """
    require_graph("enclosure", graph)
    chosen = graph.select_inputs(exact) if exact else ()
    single, wide = [[node for node in graph.inputs if (node in chosen) is each] for each in (True, False)]
    lows, highs = [[variable(f"{node.name}.{end}") for node in wide] for end in ("low", "high")]
    found = {node: _exact(node) for node in single}
    found |= {node: Bounded(low, high, REAL_LINE) for node, low, high in zip(wide, lows, highs, strict=True)}
    build = Builder()
    with building(build) as labelled:
        for node in graph.nodes:
            labelled(node.label)
            if node.op is CONSTANT:
                found[node] = _exact(node)
            elif node not in found:
                found[node] = _bounded(node, [found[arg] for arg in node.args])
        ends = [found[node] for node in graph.outputs.values()]
        low = [where(-math.inf < each.low, each.low, -math.inf) for each in ends]  # NaN is not known
        high = [where(each.high < math.inf, each.high, math.inf) for each in ends]
    names = [f"{name}.{end}" for end in ("low", "high") for name in graph.outputs]
    return Graph([*single, *lows, *highs], dict(zip(names, [*low, *high], strict=True)))


def _exact(node: Node, known: Interval = REAL_LINE) -> Bounded:
    """Bounds of what has one value."""
    return Bounded(node, node, known if node.value is None else (node.value, node.value))


def _bounded(node: Node, args: Sequence[Bounded]) -> Bounded:
    """Bounds of an operation."""
    op, same = columns(node.op), len(args) == 2 and node.args[0] is node.args[1]
    known = bounds.value_of(op, [each.known for each in args], same=same)
    if all(each.low is each.high for each in args):
        return _exact(apply(op, *[each.low for each in args]), known)
    if known[0] == known[1]:
        return _exact(as_node(known[0]))
    rule = op.interval_of_same if same and op.interval_of_same in _RULES else op.interval
    if isinstance(rule, Rising):
        low, high = _rising(op, rule, *args)
    elif isinstance(rule, Wave):
        low, high = _wave(op, *args)
    else:
        low, high = _RULES[rule](*args) if rule in _RULES else known
    return Bounded(as_node(low), as_node(high), known)


def _corners(rule: Callable[[Node, Node], Node], a: Sequence[Any], b: Sequence[Any]) -> Ends:
    """The least and the largest value at the corners of the box."""
    values = list(dict.fromkeys([rule(x, y) for x in a[:2] for y in b[:2]]))
    return reduce(minimum, values), reduce(maximum, values)


def _if(condition: Node, ends: Ends, otherwise: Ends = REAL_LINE) -> Ends:
    return where(condition, ends[0], otherwise[0]), where(condition, ends[1], otherwise[1])


def _by_sign(node: Node, known: Interval, below: Node, above: Node) -> Node:
    """What is chosen by the sign of a bound, of a node of which this is known."""
    return above if known[0] >= 0.0 else below if known[1] <= 0.0 else where(node < 0.0, below, above)


def _neg(a: Bounded) -> Bounded:
    return Bounded(-a.high, -a.low, bounds.neg(a.known))


def _size(a: Bounded) -> tuple[Node, Node]:
    """Bounds of |a|."""
    if a.known[0] >= 0.0 or a.known[1] <= 0.0:
        return (a if a.known[0] >= 0.0 else _neg(a))[:2]
    return maximum(maximum(a.low, -a.high), 0.0), maximum(-a.low, a.high)


def _mul(a: Bounded, b: Bounded) -> Ends:
    if b.known[0] >= 0.0 or b.known[1] <= 0.0:
        a, b = b, a
    if a.known[1] <= 0.0:
        low, high = _mul(_neg(a), b)
        return -high, -low
    bounded = all(map(math.isfinite, (*a.known, *b.known)))
    times: Callable[[Node, Node], Node] = Node.__mul__ if bounded else zero_safe_mul
    if a.known[0] < 0.0:
        return _corners(times, a, b)
    least, most = _by_sign(b.low, b.known, a.high, a.low), _by_sign(b.high, b.known, a.low, a.high)
    return times(b.low, least), times(b.high, most)


def _div(a: Bounded, b: Bounded) -> Ends:
    if b.known[1] <= 0.0:
        a, b = _neg(a), _neg(b)
    elif b.known[0] < 0.0:  # where the divisor is negative, both have their signs turned
        turn = b.high < 0.0
        a, b = [Bounded(*_if(turn, _neg(each)[:2], each[:2]), REAL_LINE) for each in (a, b)]
    ends = a.low / _by_sign(a.low, a.known, b.low, b.high), a.high / _by_sign(a.high, a.known, b.high, b.low)
    return ends if b.known[0] > 0.0 else _if(b.low > 0.0, ends)


def _fmod(a: Bounded, b: Bounded) -> Ends:
    """At the corners where the whole part of the quotient is the same; else by sign and size."""
    low, high = map(as_node, _div(a, b))
    (least, largest), most = _size(Bounded(low, high, REAL_LINE)), _size(b)[1]
    loose = minimum(maximum(a.low, -most), 0.0), maximum(minimum(a.high, most), 0.0)
    return _if(equal(floor(least), floor(largest)), _corners(fmod, a, b), loose)


def _pow(a: Bounded, b: Bounded) -> Ends:
    exponent = b.low.value if b.low is b.high else None
    if exponent is None or not exponent.is_integer():
        ends = _corners(pow, (maximum(a.low, 0.0), a.high), b)
        return ends if exponent is not None or a.known[0] >= 0.0 else _if(a.low >= 0.0, ends)
    low, high = _size(a) if exponent % 2.0 == 0.0 else a[:2]
    if exponent >= 0.0:
        return low**exponent, high**exponent
    return _if(maximum(a.low > 0.0, a.high < 0.0), (high**exponent, low**exponent))


def _rising(op: Op, rule: Rising, a: Bounded) -> Ends:
    low = a.low if a.known[0] >= rule.domain[0] else maximum(a.low, rule.domain[0])
    high = a.high if a.known[1] <= rule.domain[1] else minimum(a.high, rule.domain[1])
    return (apply(op, high), apply(op, low)) if rule.falling else (apply(op, low), apply(op, high))


def _wave(op: Op, a: Bounded) -> Ends:
    """By the slopes at both ends: it turns between them if their signs differ, or if they are half a period apart."""
    ends = apply(op, a.low), apply(op, a.high)
    (rise,), (last,) = op.partials(ends[0], a.low), op.partials(ends[1], a.high)
    turns = rise * last < 0.0
    long = 1.0 - (a.high - a.low < where(turns, math.tau, math.pi))
    top = turns * (rise > 0.0)
    return where(long + (turns - top), -1.0, minimum(*ends)), where(long + top, 1.0, maximum(*ends))


def _tan(a: Bounded) -> Ends:
    return _if((a.high - a.low < math.pi) * (cos(a.low) * cos(a.high) > 0.0), (tan(a.low), tan(a.high)))


def _atan2(y: Bounded, x: Bounded) -> Ends:
    """The angle jumps along a half line, where both of its ends count."""
    beside = maximum(maximum(y.low > 0.0, y.high < 0.0), x.low > 0.0)
    return _if(beside, _corners(atan2, y, x), (-math.pi, math.pi))


def _where(c: Bounded, a: Bounded, b: Bounded) -> Ends:
    least, most = _size(c)
    other = _if(most, (minimum(a.low, b.low), maximum(a.high, b.high)), b[:2])
    return _if(least > 0.0, a[:2], other)


def _equal(a: Bounded, b: Bounded) -> Ends:
    return equal(a.low, b.high) * equal(a.high, b.low), 1.0 - maximum(a.high < b.low, b.high < a.low)


_RULES: dict[Any, Callable[..., Any]] = {  # {rule on floats: the one on nodes}
    bounds.add: lambda a, b: (a.low + b.low, a.high + b.high),
    bounds.sub: lambda a, b: (a.low - b.high, a.high - b.low),
    bounds.neg: lambda a: _neg(a)[:2],
    bounds.mul: _mul,
    bounds.square: lambda a, _: [x * x for x in _size(a)],
    bounds.div: _div,
    bounds.fmod: _fmod,
    bounds.pow: _pow,
    bounds.magnitude: _size,
    bounds.cosh: lambda a: map(cosh, _size(a)),
    bounds.hypot: lambda a, b: map(hypot, _size(a), _size(b)),
    bounds.tan: _tan,
    bounds.atan2: _atan2,
    bounds.minimum: lambda a, b: (minimum(a.low, b.low), minimum(a.high, b.high)),
    bounds.maximum: lambda a, b: (maximum(a.low, b.low), maximum(a.high, b.high)),
    bounds.where: _where,
    bounds.less: lambda a, b: (a.high < b.low, 1.0 - (b.high <= a.low)),
    bounds.less_equal: lambda a, b: (a.high <= b.low, 1.0 - (b.high < a.low)),
    bounds.equal: _equal,
    bounds.not_equal: lambda a, b: [1.0 - flag for flag in reversed(_equal(a, b))],
}
