"""Interval arithmetic of the operations: bounds of a value, and in words where a slope has none.

Bounds are outward: they hold for real numbers, and for float64 whose library functions err by ULPS at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .operation import OPS, Interval, Op

REAL_LINE: Interval = (-math.inf, math.inf)
FLAG: Interval = (0.0, 1.0)
ULPS = 4  # C libraries in use stay within 2 (glibc manual, "Known Maximum Errors"); the vector ones of NumPy within 4
_MAX_ANGLE = 2.0**20  # beyond, sine and cosine are taken for anything in [-1, 1]: the period's rounding would matter
_MAX_FLOAT = math.nextafter(math.inf, 0.0)
_SLACK = 1e-9  # by which an extremum of sine or cosine may lie outside an interval and is counted as inside


def value_of(op: Op, arguments: Sequence[Interval], *, same: bool = False) -> Interval:
    """The interval of an operation's value; `same`: its two arguments are one node."""
    if op.interval is None:
        return REAL_LINE
    if same and op.interval_of_same is not None:
        return op.interval_of_same(arguments[0])
    return op.interval(*arguments)


# Rounding outwards. A bound that is infinite by overflow alone becomes the largest number on the inner side.


def _down(x: float, ulps: int = 1) -> float:
    return min(x - ulps * math.ulp(x), _MAX_FLOAT) if x != -math.inf and x != math.inf else min(x, _MAX_FLOAT)


def _up(x: float, ulps: int = 1) -> float:
    return -_down(-x, ulps)


def _end(name: str, x: float, outwards: Callable[[float, int], float], ulps: int) -> float:
    """The operation's value at an end of an interval, rounded outwards; one that is zero at zero is so exactly."""
    y = OPS[name].scalar(x)
    return y if x == 0.0 == y else outwards(y, ulps)


def _sum(a: float, b: float, outwards: Callable[[float], float], anything: float) -> float:
    """a + b rounded outwards, but kept where it is exact, so that zero stays zero; `anything` for inf - inf."""
    total = a + b
    if not math.isfinite(total):
        return anything if total != total else outwards(total)
    back = total - a
    error = (a - (total - back)) + (b - back)  # Knuth's two-sum; NaN where it overflows
    return total if error == 0.0 else outwards(total)


def _with_sign(value: float, positive: bool) -> Interval:
    """Bounds of a rounded product or quotient, which keep the sign that is known."""
    return (max(0.0, _down(value)), _up(value)) if positive else (_down(value), min(0.0, _up(value)))


def _product(a: float, b: float) -> Interval:
    """a * b, rounded down and up; zero times anything is zero."""
    return (0.0, 0.0) if a == 0.0 or b == 0.0 else _with_sign(a * b, (a > 0.0) == (b > 0.0))


def _quotient(a: float, b: float) -> Interval:
    """a / b for b other than zero, rounded down and up."""
    return (0.0, 0.0) if a == 0.0 or math.isinf(b) else _with_sign(a / b, (a > 0.0) == (b > 0.0))


# Operations.


def add(a: Interval, b: Interval) -> Interval:
    """Bounds of a + b."""
    return _sum(a[0], b[0], _down, -math.inf), _sum(a[1], b[1], _up, math.inf)


def neg(a: Interval) -> Interval:
    """Bounds of -a."""
    return -a[1], -a[0]


def sub(a: Interval, b: Interval) -> Interval:
    """Bounds of a - b."""
    return add(a, neg(b))


def _corners(rule: Callable[[float, float], Interval], a: Interval, b: Interval) -> Interval:
    corners = [rule(x, y) for x in a for y in b]
    return min([low for low, _ in corners]), max([high for _, high in corners])


def mul(a: Interval, b: Interval) -> Interval:
    """Bounds of a * b."""
    return _corners(_product, a, b)


def square(a: Interval) -> Interval:
    """Bounds of a * a."""
    small, large = magnitude(a)
    return _product(small, small)[0], _product(large, large)[1]


def div(a: Interval, b: Interval) -> Interval:
    """Bounds of a / b."""
    return REAL_LINE if b[0] <= 0.0 <= b[1] else _corners(_quotient, a, b)


def magnitude(a: Interval) -> Interval:
    """Bounds of |a|."""
    return (0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))), max(abs(a[0]), abs(a[1]))


def _meet(a: Interval, low: float, high: float) -> Interval | None:
    """The part of `a` in a domain, None if there is none."""
    kept = max(a[0], low) + 0.0, min(a[1], high) + 0.0  # -0.0 becomes 0.0, of which powers have the sign of the domain
    return kept if kept[0] <= kept[1] else None


@dataclass(frozen=True)
class Rising:
    """The interval of a monotonic function on its domain; outside of it there is no number to bound."""

    name: str
    domain: Interval = REAL_LINE
    bounds: Interval = REAL_LINE
    ulps: int = ULPS
    falling: bool = False

    def __call__(self, a: Interval) -> Interval:
        """Bounds of its value."""
        inside = _meet(a, *self.domain)
        if inside is None:
            return REAL_LINE
        first, last = inside[::-1] if self.falling else inside
        low, high = _end(self.name, first, _down, self.ulps), _end(self.name, last, _up, self.ulps)
        return max(self.bounds[0], low), min(self.bounds[1], high)


@dataclass(frozen=True)
class Wave:
    """The interval of a sine or cosine, whose maxima lie at top + 2 pi k."""

    name: str
    top: float

    def __call__(self, a: Interval) -> Interval:
        """Bounds of its value."""
        if not max(abs(a[0]), abs(a[1])) < _MAX_ANGLE:
            return -1.0, 1.0
        low = (
            -1.0
            if _contains_turn(a, self.top + math.pi, math.tau)
            else min([_end(self.name, x, _down, ULPS) for x in a])
        )
        high = 1.0 if _contains_turn(a, self.top, math.tau) else max([_end(self.name, x, _up, ULPS) for x in a])
        return max(-1.0, low), min(1.0, high)


def _contains_turn(a: Interval, start: float, period: float) -> bool:
    """Whether start + period * k lies within the interval for a whole k, or so close that rounding could decide."""
    return math.floor((a[1] - start) / period + _SLACK) >= math.ceil((a[0] - start) / period - _SLACK)


def tan(a: Interval) -> Interval:
    """Bounds of tan a, none beside a pole."""
    if _tan_pole(a):
        return REAL_LINE
    return Rising("tan")(a)


def no_tangent(a: Interval) -> str | None:
    """The poles of the tangent."""
    return "value and slope are infinite at odd multiples of pi/2" if _tan_pole(a) else None


def _tan_pole(a: Interval) -> bool:
    return not max(abs(a[0]), abs(a[1])) < _MAX_ANGLE or _contains_turn(a, math.pi / 2, math.pi)


def cosh(a: Interval) -> Interval:
    """Bounds of cosh a."""
    low, high = Rising("cosh")(magnitude(a))
    return max(low, 1.0), high


def hypot(a: Interval, b: Interval) -> Interval:
    """Bounds of sqrt(a * a + b * b)."""
    (a0, a1), (b0, b1) = magnitude(a), magnitude(b)
    low = math.hypot(a0, b0)
    return max(0.0, _down(low, ULPS)), _up(math.hypot(a1, b1), ULPS)


def atan2(y: Interval, x: Interval) -> Interval:
    """Bounds of the angle of (x, y)."""
    if y[0] <= 0.0 <= y[1] and x[0] <= 0.0:  # the origin, or the half line along which the angle jumps
        return _down(-math.pi), _up(math.pi)
    corners = [math.atan2(v, u) for v in y for u in x]
    low, high = min(corners), max(corners)
    return (low if low == 0.0 else _down(low, ULPS)), (high if high == 0.0 else _up(high, ULPS))  # zero is exact


def pow(a: Interval, b: Interval) -> Interval:
    """Bounds of a ** b."""
    if b[0] == b[1] and b[0].is_integer():
        return _whole_power(a, b[0])
    if a[0] < 0.0 and b[0] != b[1]:
        return REAL_LINE  # a whole exponent between the bounds has a value there, another has none
    inside = _meet(a, 0.0, math.inf)
    if inside is None:
        return REAL_LINE
    corners = [OPS["pow"].scalar(x, y) for x in inside for y in b]
    return max(0.0, _down(min(corners), ULPS)), _up(max(corners), ULPS)


def _whole_power(a: Interval, n: float) -> Interval:
    if n == 0.0:
        return 1.0, 1.0
    if n < 0.0 and a[0] <= 0.0 <= a[1]:
        return REAL_LINE
    ends = [OPS["pow"].scalar(x, n) for x in a]
    if n % 2.0 == 0.0:
        low = 0.0 if a[0] <= 0.0 <= a[1] else max(0.0, _down(min(ends), ULPS))
        return low, _up(max(ends), ULPS)
    return _down(min(ends), ULPS), _up(max(ends), ULPS)


def where(c: Interval, a: Interval, b: Interval) -> Interval:
    """Bounds of the part that the condition can choose."""
    if c == (0.0, 0.0):
        return b
    return a if c[0] > 0.0 or c[1] < 0.0 else (min(a[0], b[0]), max(a[1], b[1]))


def minimum(a: Interval, b: Interval) -> Interval:
    """Bounds of the smaller."""
    return min(a[0], b[0]), min(a[1], b[1])


def maximum(a: Interval, b: Interval) -> Interval:
    """Bounds of the larger."""
    return max(a[0], b[0]), max(a[1], b[1])


def fmod(a: Interval, b: Interval) -> Interval:
    """Bounds of the remainder of a / b: of the sign of a, not larger than a, and smaller than b."""
    if b[0] <= 0.0 <= b[1]:
        return REAL_LINE
    if magnitude(a)[1] < magnitude(b)[0]:
        return a
    size = min(magnitude(a)[1], magnitude(b)[1])
    return (-size if a[0] < 0.0 else 0.0), (size if a[1] > 0.0 else 0.0)


def always(value: float) -> Callable[[Interval], Interval]:
    """A value that does not depend on the argument."""
    return lambda a: (value, value)


def less(a: Interval, b: Interval) -> Interval:
    """Bounds of a < b."""
    return (1.0, 1.0) if a[1] < b[0] else (0.0, 0.0) if a[0] >= b[1] else FLAG


def less_equal(a: Interval, b: Interval) -> Interval:
    """Bounds of a <= b."""
    return (1.0, 1.0) if a[1] <= b[0] else (0.0, 0.0) if a[0] > b[1] else FLAG


def equal(a: Interval, b: Interval) -> Interval:
    """Bounds of a == b."""
    if a == b and a[0] == a[1]:
        return 1.0, 1.0
    return (0.0, 0.0) if a[1] < b[0] or b[1] < a[0] else FLAG


def not_equal(a: Interval, b: Interval) -> Interval:
    """Bounds of a != b."""
    low, high = equal(a, b)
    return 1.0 - high, 1.0 - low


# Where a slope is unbounded or is none, in words that follow "the slope of sqrt is".


def below(limit: float, there: str) -> Callable[[Interval], str | None]:
    """Rule of a domain that begins at `limit`."""

    def singular(a: Interval) -> str | None:
        if a[0] < limit:
            return f"there is no value below {limit:g}, and {there} at {limit:g}"
        return f"{there} at {limit:g}" if a[0] == limit else None

    return singular


def steep(words: str) -> Callable[[Interval], str | None]:
    """Rule of a function whose slope is infinite at 0."""
    return lambda a: words if a[0] <= 0.0 <= a[1] else None


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
