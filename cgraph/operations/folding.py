"""Folding rules of the operations: a simpler node that stands for an operation on some arguments.

Rules see the arguments of the node to be, not all constant, and give a node that stands for it, or None. They take
every operand for finite and a divisor for non-zero: 0 * x = 0, x - x = 0. Zeros have no sign: x + 0 = x.
"""

import math
from collections.abc import Callable

from ..core.node import Node, apply, constant
from .operation import OPS


def add(a: Node, b: Node) -> Node | None:
    """a + b: a zero goes, constants and twice the same are joined, a sign makes it a difference."""
    if b.value is not None:
        a, b = b, a
    if a.value is not None:
        return b if a.value == 0.0 else _offset("add", a.value, b)
    if b.op.name == "neg":
        return a - b.args[0]
    if a.op.name == "neg":
        return b - a.args[0]
    return 2.0 * a if a is b else _doubled("add", a, b)


def _doubled(name: str, a: Node, b: Node) -> Node | None:
    """2 * x + 2 * y or their difference with the factor taken out, as slopes of squares have it: exactly the same."""
    if a.op.name == b.op.name == "mul" and a.args[0].value == b.args[0].value == 2.0:
        return 2.0 * apply(OPS[name], a.args[1], b.args[1])
    return None


def _offset(name: str, c: float, b: Node) -> Node | None:
    """c + b or c - b where b has a constant of its own to join with: c + (d + x), c - (d - x)."""
    if b.op.name not in ("add", "sub") or (d := b.args[0].value) is None:
        return None
    total = OPS[name].scalar(c, d)
    return apply(OPS["add" if b.op.name == name else "sub"], total, b.args[1]) if math.isfinite(total) else None


def sub(a: Node, b: Node) -> Node | None:
    """a - b, likewise; of twice the same it is zero."""
    if a.value == 0.0:
        return -b
    if b.value is not None:
        return constant(-b.value) + a
    if a.value is not None and (joined := _offset("sub", a.value, b)) is not None:
        return joined
    if a is b:
        return constant(0.0)
    if b.op.name == "neg":
        return a + b.args[0]
    return -(a.args[0] + b) if a.op.name == "neg" else _doubled("sub", a, b)


def mul(a: Node, b: Node) -> Node | None:
    """a * b: 0 and 1 go, constants are joined, signs come out, as do factors of quotients; squares of sizes."""
    if b.value is not None:
        a, b = b, a
    c = a.value
    if c is not None:
        if c == 0.0:
            return constant(0.0)
        if c == 1.0:
            return b
        if c == -1.0:
            return -b
        if b.op.name == "neg":
            return constant(-c) * b.args[0]
        if b.op.name == "mul" and (inner := b.args[0].value) is not None and math.isfinite(c * inner) and c * inner:
            return constant(c * inner) * b.args[1]
        rest = _cancelled(c, b)
        return _times_quotient(a, b) if rest is None else rest
    left, right = a.op.name, b.op.name
    if a is b and left == "abs":
        return a.args[0] * a.args[0]
    if left == "neg":
        return a.args[0] * b.args[0] if right == "neg" else -(a.args[0] * b)
    if right == "neg":
        return -(a * b.args[0])
    for x, y in ((a, b), (b, a)):
        if (quotient := _times_quotient(x, y)) is not None:
            return quotient
    if left != "mul" or right != "mul":
        return None
    c, d = a.args[0].value, b.args[0].value
    if c is None or d is None or not math.isfinite(c * d) or not c * d:
        return None
    return constant(c * d) * (a.args[1] * b.args[1])


def _times_quotient(a: Node, b: Node) -> Node | None:
    """a * b where b is a quotient or has one and a factor goes: x * (1 / c) = x / c, x * (b / (x * y)) = b / y, ..,
    (2 * x) * (0.5 / c) = x / c.

    It is also exact: b / x of a subnormal x, as in the slope of x * log(x), overflows.
    """
    name = b.op.name
    if name == "where" and b.args[1].op.name in ("div", "mul") and b.args[2].value == 0.0:
        product = _times_quotient(a, b.args[1])  # derivatives have such branches at singular slopes
        return None if product is None else apply(OPS["where"], b.args[0], product, 0.0)
    if name == "mul":
        for factor, other in (b.args, b.args[::-1]):
            if factor.op.name == "div" and factor.args[1] is a and _cancels(a):
                return other * factor.args[0]
    if name != "div":
        return None
    top, c = b.args
    for x, other in ((a, constant(1.0)), *((a.args, a.args[::-1]) if a.op.name == "mul" else ())):
        for arg, slope in zip(x.args, x.op.partials(x, *x.args), strict=True) if x.op.name == "hypot" else ():
            if slope is b:  # a length times its slope is smooth
                return apply(OPS["mul"], other, arg)
    rest = a if top.value == 1.0 else None if top.value is None else _cancelled(top.value, a)
    if rest is not None and (rest is not c or _cancels(c)):
        return rest / c
    if c is a and _cancels(c):
        return top
    if c.op.name == "mul" and a in c.args:
        return top / c.args[c.args[0] is a]
    if c.op.name == "div" and c.args[0] is a and _cancels(a):
        return top * c.args[1]
    if a.op.name == "mul" and c in a.args and _cancels(c):
        return a.args[a.args[0] is c] * top
    return None


def _cancels(x: Node) -> bool:
    """Whether x / x goes from within a product: not where x has an infinite slope, which times 0 is to stay NaN."""
    return x.op.singular is None


def _cancelled(c: float, b: Node, levels: int = 3) -> Node | None:
    """c * b where a constant factor d of b goes, c d = 1 or -1: 2 * ((0.5 * x) * y) = x * y, 2 * (0.5 / y) = 1 / y.

    levels: how deep in b, of products and dividends, the factor may stand.
    """
    if b.op.name not in ("mul", "div") or not levels:
        return None
    first, second = b.args
    if (d := first.value) is not None:
        return constant(c * d) * apply(b.op, constant(1.0), second) if abs(c * d) == 1.0 else None
    if (rest := _cancelled(c, first, levels - 1)) is not None:
        return None if b.op.name == "div" and rest is second and not _cancels(rest) else apply(b.op, rest, second)
    rest = _cancelled(c, second, levels - 1) if b.op.name == "mul" else None
    return None if rest is None else rest * first


def div(a: Node, b: Node) -> Node | None:
    """a / b: 1, signs and what divides both go; of twice the same it is one."""
    if b.value == 1.0:
        return a
    if b.value == -1.0:
        return -a
    if a.value == 0.0:
        return constant(0.0)
    if a is b:
        return constant(1.0)
    if a.op.name == "mul" and b in a.args and _cancels(b):
        return a.args[a.args[0] is b]
    if a.op.name == "neg":
        return a.args[0] / b.args[0] if b.op.name == "neg" else -(a.args[0] / b)
    return -(a / b.args[0]) if b.op.name == "neg" else None


def neg(a: Node) -> Node | None:
    """-a: signs cancel or go into a constant factor; differences are turned round by the `Builder`."""
    if a.op.name == "neg":
        return a.args[0]
    if a.op.name == "mul" and a.args[0].value is not None:
        return constant(-a.args[0].value) * a.args[1]
    return None


_POWERS: dict[float, Callable[[Node], Node]] = {
    0.0: lambda a: constant(1.0),
    1.0: lambda a: a,
    2.0: lambda a: a * a,
    0.5: lambda a: apply(OPS["sqrt"], a),
    -1.0: lambda a: 1.0 / a,
}


def pow(a: Node, b: Node) -> Node | None:
    """a ** b for the exponents that have an operation of their own."""
    rule = _POWERS.get(b.value) if b.value is not None else None
    return rule(a) if rule else None


def zero_safe_mul(a: Node, b: Node) -> Node | None:
    """A zero, or with a finite constant the plain product."""
    for c, other in ((a, b), (b, a)):
        if c.value == 0.0:
            return constant(0.0)
        if c.value is not None and math.isfinite(c.value):
            return c * other
    return None


def where(c: Node, a: Node, b: Node) -> Node | None:
    """The one that a constant condition chooses; what both are; a condition that is itself, or 0 where it is 0."""
    if c.value is not None:
        return a if c.value != 0.0 else b
    return a if a is b or (a is c and b.value == 0.0) else None


def same(a: Node, b: Node) -> Node | None:
    """Argument that stands on both sides."""
    return a if a is b else None
