"""Double-double rules of the operations: a value to twice the digits of float64, as a pair of nodes.

Sums are Knuth's, products Dekker's with Veltkamp's splitting, put together as by Joldes, Muller and Popescu, "Tight
and rigorous error bounds for basic building blocks of double-word arithmetic", ACM Transactions on Mathematical
Software 44 (2017).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ..core.node import Node, Scalar, apply, constant
from .operation import OPS
from .values import whole_power

ZERO = constant(0.0)
SPLIT = 2.0**27  # halves of at most 26 bits, whose products are exact
WHOLE = 64.0  # the largest whole exponent that is taken by products


class Pair(NamedTuple):
    """The value hi + lo."""

    hi: Node
    lo: Node


def _make(name: str, *args: Scalar) -> Node:
    return apply(OPS[name], *args)


_sqrt, _where, _equal = (partial(_make, name) for name in ("sqrt", "where", "equal"))


def normal(a: Node, b: Node) -> Pair:
    """a + b exactly, where |a| >= |b|."""
    if b is ZERO:
        return Pair(a, ZERO)
    hi = a + b
    return Pair(hi, b - (hi - a))


def _sum(a: Node, b: Node) -> Pair:
    """a + b exactly (Knuth)."""
    if a is ZERO or b is ZERO:
        return Pair(b if a is ZERO else a, ZERO)
    hi = a + b
    near = hi - a
    return Pair(hi, (a - (hi - near)) + (b - near))


def _halves(a: Node) -> tuple[Node, Node]:
    """a in two parts of 26 bits (Veltkamp)."""
    shifted = SPLIT * a + a  # a sum, not (SPLIT + 1) * a: fusing this product, which is exact, changes nothing
    upper = shifted - (shifted - a)
    return upper, a - upper


def _product(a: Node, b: Node) -> Pair:
    """a * b exactly (Dekker)."""
    # Of hi, + 0.0 makes what no compiler may fuse with a sum that follows: lo is what hi lacks, not what a * b lacks.
    hi = a * b + ZERO
    (a1, a2), (b1, b2) = _halves(a), _halves(b)
    return Pair(hi, ((a1 * b1 - hi) + a1 * b2 + a2 * b1) + a2 * b2)


def add(a: Pair, b: Pair) -> Pair:
    """a + b."""
    high, low = _sum(a.hi, b.hi), _sum(a.lo, b.lo)
    first = normal(high.hi, _plus(high.lo, low.hi))
    return normal(first.hi, _plus(first.lo, low.lo))


def _plus(a: Node, b: Node) -> Node:
    return a if b is ZERO else b if a is ZERO else a + b


def neg(a: Pair) -> Pair:
    """-a, exactly."""
    return Pair(-a.hi, a.lo if a.lo is ZERO else -a.lo)


def sub(a: Pair, b: Pair) -> Pair:
    """a - b."""
    return add(a, neg(b))


def mul(a: Pair, b: Pair) -> Pair:
    """a * b."""
    high = _product(a.hi, b.hi)
    low = high.lo
    for x, y in ((a.hi, b.lo), (a.lo, b.hi)):
        if x is not ZERO and y is not ZERO:
            low = low + x * y
    return normal(high.hi, low)


def div(a: Pair, b: Pair) -> Pair:
    """a / b: the quotient of the high parts, and that of what it leaves."""
    quotient = a.hi / b.hi
    back = mul(b, Pair(quotient, ZERO))
    rest = (a.hi - back.hi) + _plus(a.lo, -back.lo)
    return normal(quotient, rest / b.hi)


def sqrt(a: Pair) -> Pair:
    """The root of the high part, and a Newton step from it."""
    hi = _sqrt(a.hi)
    square = _product(hi, hi)
    rest = _plus((a.hi - square.hi) - square.lo, a.lo)
    return normal(hi, _where(hi, rest / (2.0 * hi), 0.0))


def pow(a: Pair, b: Pair) -> Pair | None:
    """a ** b by products for a constant whole b, by a root for 0.5; None for others."""
    exponent = b.hi.value
    if exponent is None or b.lo is not ZERO:
        return None
    if exponent == 0.5:
        return sqrt(a)
    if not (0.0 < abs(exponent) <= WHOLE and exponent == int(exponent)):
        return None
    result = whole_power(a, int(abs(exponent)), mul)
    return result if exponent > 0.0 else div(Pair(constant(1.0), ZERO), result)


def zero_safe_mul(a: Pair, b: Pair) -> Pair:
    """a * b, and 0 where a or b is 0."""
    product = mul(a, b)
    hi, lo = (_where(a.hi, _where(b.hi, part, 0.0), 0.0) for part in product)
    return Pair(hi, lo)


def choose(c: Pair, a: Pair, b: Pair) -> Pair:
    """a where c is not 0, else b."""
    return Pair(_where(c.hi, a.hi, b.hi), _low(c.hi, a.lo, b.lo))


def _low(c: Node, a: Node, b: Node) -> Node:
    return ZERO if a is ZERO and b is ZERO else _where(c, a, b)


def extreme(name: str) -> Callable[[Pair, Pair], Pair]:
    """The rule of minimum or maximum: of equal high parts the low ones decide."""
    choose = partial(_make, name)

    def rule(a: Pair, b: Pair) -> Pair:
        hi = choose(a.hi, b.hi)
        if a.lo is ZERO and b.lo is ZERO:
            return Pair(hi, ZERO)
        return Pair(hi, _where(_equal(a.hi, b.hi), choose(a.lo, b.lo), _where(_equal(hi, a.hi), a.lo, b.lo)))

    return rule


def compared(name: str) -> Callable[[Pair, Pair], Pair]:
    """The rule of a comparison: of equal high parts the low ones decide."""
    compare = partial(_make, name)

    def rule(a: Pair, b: Pair) -> Pair:
        if a.lo is ZERO and b.lo is ZERO:
            return Pair(compare(a.hi, b.hi), ZERO)
        return Pair(_where(_equal(a.hi, b.hi), compare(a.lo, b.lo), compare(a.hi, b.hi)), ZERO)

    return rule


def size(a: Pair) -> Pair:
    """|a|."""
    return Pair(abs(a.hi), a.lo if a.lo is ZERO else _where(a.hi < 0.0, -a.lo, a.lo))


def sign(a: Pair) -> Pair:
    """The sign of hi, which is never 0 while lo is not."""
    return Pair(_make("sign", a.hi), ZERO)


def floor(a: Pair) -> Pair:
    """The floor of the high part; where that is whole, of the low part too."""
    hi = _make("floor", a.hi)
    return Pair(hi, ZERO) if a.lo is ZERO else normal(hi, _where(_equal(hi, a.hi), _make("floor", a.lo), 0.0))


def ceil(a: Pair) -> Pair:
    """-floor(-a)."""
    return neg(floor(neg(a)))


def round(a: Pair) -> Pair:
    """floor(a + 1/2), and 1 less where that is odd and a is halfway."""
    if a.lo is ZERO:
        return Pair(_make("round", a.hi), ZERO)
    half = Pair(constant(0.5), ZERO)
    up = floor(add(a, half))
    halfway = compared("equal")(sub(up, a), half)
    odd = compared("not_equal")(floor(mul(up, half)), mul(up, half))
    return sub(up, Pair(halfway.hi * odd.hi, ZERO))


def fmod(a: Pair, b: Pair) -> Pair | None:
    """a - b trunc(a / b), which the rounding of a / b may miss by one b."""
    if a.lo is ZERO and b.lo is ZERO:
        return None  # float64's is exact
    length, width = size(a), size(b)
    zero, less = Pair(ZERO, ZERO), compared("less")
    rest = sub(length, mul(width, floor(div(length, width))))
    rest = choose(less(rest, zero), add(rest, width), rest)
    rest = choose(less(rest, width), rest, sub(rest, width))
    return choose(less(a, zero), neg(rest), rest)
