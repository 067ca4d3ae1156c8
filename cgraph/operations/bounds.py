"""Interval rules of the operations, over numbers and over nodes alike; and in words where a slope is unbounded.

Bounds hold but for rounding. A bound that is NaN, as inf - inf, is one that is not known.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any, NamedTuple

from ..core.node import Node, apply
from .operation import OPS, Interval, columns

REAL_LINE: Interval = (-math.inf, math.inf)
Ends = tuple[Any, Any]  # numbers or nodes


class Bounded(NamedTuple):
    """Bounds of a value, numbers or nodes. known: numbers between which both lie for every box."""

    low: Any
    high: Any
    known: Interval


@dataclass(frozen=True)
class Rule:
    """The interval of an operation: of pairs of floats when called, of numbers or nodes by `ends`."""

    ends: Callable[..., Any]  # of Bounded

    def __call__(self, *arguments: Interval) -> Interval:
        """Bounds of the value, infinite where they are not known."""
        boxes = [(float(low), float(high)) for low, high in arguments]
        low, high = self.ends(*[Bounded(*box, box) for box in boxes])
        return (low + 0.0 if low == low else -math.inf), (high + 0.0 if high == high else math.inf)  # zero has no sign


def intervals(nodes: Iterable[Node], box: Mapping[str, Interval]) -> dict[Node, Interval]:
    """Bounds of nodes, arguments first, for variables in the box; one that it leaves out is any number.

    They hold but for rounding, and may be wide: an interval forgets which values belong together.
    """
    found: dict[Node, Interval] = {}
    for node in nodes:
        if node.args:
            rule, args = rule_of(node)
            found[node] = rule(*[found[arg] for arg in args])
        else:
            found[node] = box.get(str(node.name), REAL_LINE) if node.value is None else (node.value, node.value)
    return found


def rule_of(node: Node) -> tuple[Callable[..., Interval], Sequence[Node]]:
    """The interval of an operation's node, and the arguments that it takes: one if both are one node."""
    op = columns(node.op)
    if op.interval_of_same is not None and node.args[0] is node.args[1]:
        return op.interval_of_same, node.args[:1]
    return op.interval or (lambda *_: REAL_LINE), node.args


def _of(name: str, *args: Any) -> Any:
    """The value of an operation on numbers, its node on nodes."""
    op = OPS[name]
    return apply(op, *args) if any([isinstance(each, Node) for each in args]) else op.scalar(*args)


_div, _pow, _min, _max, _where, _equal = [
    partial(_of, name) for name in ("div", "pow", "minimum", "maximum", "where", "equal")
]


def _corners(value: Callable[[Any, Any], Any], a: Sequence[Any], b: Sequence[Any]) -> Ends:
    """The least and the largest value at the corners of the box."""
    values = list(dict.fromkeys([value(x, y) for x in a[:2] for y in b[:2]]))
    return reduce(_min, values), reduce(_max, values)


def _if(condition: Any, ends: Sequence[Any], otherwise: Sequence[Any] = REAL_LINE) -> Ends:
    return _where(condition, ends[0], otherwise[0]), _where(condition, ends[1], otherwise[1])


def _by_sign(end: Any, known: Interval, below: Any, above: Any) -> Any:
    """What is chosen by the sign of a bound of which this is known."""
    return above if known[0] >= 0.0 else below if known[1] <= 0.0 else _where(end < 0.0, below, above)


def _negative(a: Bounded) -> Bounded:
    return Bounded(-a.high, -a.low, (-a.known[1], -a.known[0]))


# Operations.


@Rule
def magnitude(a: Bounded) -> Ends:
    """Bounds of |a|."""
    if a.known[0] >= 0.0 or a.known[1] <= 0.0:
        return (a if a.known[0] >= 0.0 else _negative(a))[:2]
    return _max(_max(a.low, -a.high), 0.0), _max(-a.low, a.high)


@Rule
def mul(a: Bounded, b: Bounded) -> Ends:
    """Bounds of a * b."""
    if b.known[0] >= 0.0 or b.known[1] <= 0.0:
        a, b = b, a
    if a.known[0] < 0.0 >= a.known[1]:
        low, high = mul.ends(_negative(a), b)
        return -high, -low
    times = operator.mul if all(map(math.isfinite, (*a.known, *b.known))) else partial(_of, "zero_safe_mul")
    if a.known[0] < 0.0:
        return _corners(times, a, b)
    least, most = _by_sign(b.low, b.known, a.high, a.low), _by_sign(b.high, b.known, a.low, a.high)
    return times(b.low, least), times(b.high, most)


@Rule
def div(a: Bounded, b: Bounded) -> Ends:
    """Bounds of a / b."""
    if b.known[1] <= 0.0:
        a, b = _negative(a), _negative(b)
    elif b.known[0] < 0.0:  # where the divisor is negative, both have their signs turned
        turn = b.high < 0.0
        a, b = [Bounded(*_if(turn, _negative(each), each), REAL_LINE) for each in (a, b)]
    ends = _div(a.low, _by_sign(a.low, a.known, b.low, b.high)), _div(a.high, _by_sign(a.high, a.known, b.high, b.low))
    return ends if b.known[0] > 0.0 else _if(b.low > 0.0, ends)


@Rule
def fmod(a: Bounded, b: Bounded) -> Ends:
    """Bounds of the remainder: at corners where the whole part of a / b is the same, else by sign and size."""
    low, high = div.ends(a, b)
    whole = [_of("floor", end) for end in magnitude.ends(Bounded(low, high, REAL_LINE))]
    _, most = magnitude.ends(b)
    loose = _min(_max(a.low, -most), 0.0), _max(_min(a.high, most), 0.0)
    return _if(_equal(*whole), _corners(partial(_of, "fmod"), a, b), loose)


@Rule
def pow(a: Bounded, b: Bounded) -> Ends:
    """Bounds of a ** b."""
    exponent, single = b.known[0], b.known[0] == b.known[1]
    if not (single and exponent.is_integer()):
        ends = _corners(_pow, (_max(0.0, a.low), a.high), b)  # of zeros the positive one
        return ends if single or a.known[0] >= 0.0 else _if(a.low >= 0.0, ends)
    low, high = magnitude.ends(a) if exponent % 2.0 == 0.0 else a[:2]
    if exponent >= 0.0:
        return _pow(low, exponent), _pow(high, exponent)
    return _if(_max(a.low > 0.0, a.high < 0.0), (_pow(high, exponent), _pow(low, exponent)))


def rising(name: str, domain: Interval = REAL_LINE, *, falling: bool = False) -> Rule:
    """The rule of a monotonic function on its domain."""

    def ends(a: Bounded) -> Ends:
        low = a.low if a.known[0] >= domain[0] else _max(a.low, domain[0])
        high = a.high if a.known[1] <= domain[1] else _min(a.high, domain[1])
        return (_of(name, high), _of(name, low)) if falling else (_of(name, low), _of(name, high))

    return Rule(ends)


def wave(name: str, slope: str, sign: float) -> Rule:
    """The rule of a sine or cosine: it turns between ends whose slopes differ in sign, or half a period apart."""

    def ends(a: Bounded) -> Ends:
        values, (rise, last) = [[_of(each, end) for end in a[:2]] for each in (name, slope)]
        turns = rise * last < 0.0
        top = turns * (sign * rise > 0.0)
        long = 1.0 - (a.high - a.low < _where(turns, math.tau, math.pi))
        return _where(long + (turns - top), -1.0, _min(*values)), _where(long + top, 1.0, _max(*values))

    return Rule(ends)


@Rule
def tan(a: Bounded) -> Ends:
    """Bounds of tan a, none beside a pole."""
    (low, first), (high, last) = [(_of("tan", end), _of("cos", end)) for end in a[:2]]
    return _if((a.high - a.low < math.pi) * (first * last > 0.0), (low, high))


@Rule
def atan2(y: Bounded, x: Bounded) -> Ends:
    """Bounds of the angle of (x, y), which jumps along a half line, where both of its ends count."""
    beside = _max(_max(y.low > 0.0, y.high < 0.0), x.low > 0.0)
    return _if(beside, _corners(partial(_of, "atan2"), y, x), (-math.pi, math.pi))


@Rule
def where(c: Bounded, a: Bounded, b: Bounded) -> Ends:
    """Bounds of the part that the condition can choose."""
    least, most = magnitude.ends(c)
    return _if(least > 0.0, a, _if(most, (_min(a.low, b.low), _max(a.high, b.high)), b))


@Rule
def equal(a: Bounded, b: Bounded) -> Ends:
    """Bounds of a == b."""
    return _equal(a.low, b.high) * _equal(a.high, b.low), 1.0 - _max(a.high < b.low, b.high < a.low)


add = Rule(lambda a, b: (a.low + b.low, a.high + b.high))
sub = Rule(lambda a, b: (a.low - b.high, a.high - b.low))
neg = Rule(lambda a: _negative(a)[:2])
square = Rule(lambda a: [end * end for end in magnitude.ends(a)])
cosh = Rule(lambda a: [_of("cosh", end) for end in magnitude.ends(a)])
hypot = Rule(lambda a, b: [_of("hypot", *ends) for ends in zip(magnitude.ends(a), magnitude.ends(b), strict=True)])
minimum = Rule(lambda a, b: (_min(a.low, b.low), _min(a.high, b.high)))
maximum = Rule(lambda a, b: (_max(a.low, b.low), _max(a.high, b.high)))
less = Rule(lambda a, b: (a.high < b.low, 1.0 - (b.high <= a.low)))
less_equal = Rule(lambda a, b: (a.high <= b.low, 1.0 - (b.high < a.low)))
not_equal = Rule(lambda a, b: [1.0 - flag for flag in reversed(equal.ends(a, b))])


def always(value: float) -> Callable[[Interval], Interval]:
    """The rule of a value that does not depend on the argument."""
    return lambda a: (value, value)


# Where a slope is unbounded or is none, in words that follow "the slope of sqrt is".


def below(limit: float, there: str) -> Callable[[Interval], str | None]:
    """Rule of a domain that begins at `limit`."""

    def singular(a: Interval) -> str | None:
        if a[0] < limit:
            return f"there is no value below {limit:g}, and {there} at {limit:g}"
        return f"{there} at {limit:g}" if a[0] == limit else None

    return singular


def arc(a: Interval) -> str | None:
    """Rule of asin and acos."""
    if a[0] < -1.0 or a[1] > 1.0:
        return "there is no value beyond -1 and 1, and the slope is infinite at both"
    return "the slope is infinite at -1 and 1" if a[0] == -1.0 or a[1] == 1.0 else None


def divisor(a: Interval, b: Interval) -> str | None:
    """Rule of a quotient."""
    return "the divisor can be 0" if b[0] <= 0.0 <= b[1] else None


def origin(words: str) -> Callable[[Interval, Interval], str | None]:
    """Rule of functions of a point in the plane."""
    return lambda a, b: words if a[0] <= 0.0 <= a[1] and b[0] <= 0.0 <= b[1] else None


def power(a: Interval, b: Interval) -> str | None:
    """Rule of a ** b."""
    if b[0] == b[1] and b[0].is_integer():
        return "the base can be 0 under a negative power" if b[0] < 0.0 and a[0] <= 0.0 <= a[1] else None
    if a[0] < 0.0:
        return "there is no value at a negative base, unless the power is whole"
    return "the slope is infinite where the base is 0" if a[0] == 0.0 and b[0] < 1.0 else None
