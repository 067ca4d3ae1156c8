"""Folding rules of the operations: a simpler node that stands for an operation on some arguments.

Rules see the arguments of the node to be, not all constant, and give a node that stands for it, or None. They take
every operand for finite and a divisor for non-zero: 0 * x = 0, x - x = 0. Zeros have no sign: x + 0 = x.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ..core.node import Node, apply, constant
from .operation import OPS

_SUMS = ("add", "sub")


def add(a: Node, b: Node) -> Node | None:
    """a + b: a zero goes, constants and twice the same are joined, a sign makes it a difference."""
    if b.value is not None:
        a, b = b, a
    if a.value is not None:
        return b if a.value == 0.0 else _offset(a.value, b)
    if b.op.name == "neg":
        return a - b.args[0]
    if a.op.name == "neg":
        return b - a.args[0]
    return 2.0 * a if a is b else None


def _offset(c: float, b: Node) -> Node | None:
    """c + b where b has a constant of its own to join with: c + (d + x), c + (d - x)."""
    if b.op.name in _SUMS and (d := b.args[0].value) is not None and math.isfinite(c + d):
        return constant(c + d) + b.args[1] if b.op.name == "add" else constant(c + d) - b.args[1]
    return None


def sub(a: Node, b: Node) -> Node | None:
    """a - b, likewise; of twice the same it is zero."""
    if a.value == 0.0:
        return -b
    if b.value is not None:
        return constant(-b.value) + a
    if a.value is not None and b.op.name in _SUMS and (d := b.args[0].value) is not None and math.isfinite(a.value - d):
        return constant(a.value - d) - b.args[1] if b.op.name == "add" else constant(a.value - d) + b.args[1]
    if a is b:
        return constant(0.0)
    if b.op.name == "neg":
        return a + b.args[0]
    if a.op.name == "neg":
        return -(a.args[0] + b)
    return None


def mul(a: Node, b: Node) -> Node | None:
    """a * b: 0 and 1 go, constants are joined, signs come out, and what a quotient takes on either side."""
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
        if b.op.name == "mul":
            return _cancelled(c, b)
        return _times_quotient(a, *b.args) if b.op.name == "div" else None
    left, right = a.op.name, b.op.name
    if left == "neg":
        return a.args[0] * b.args[0] if right == "neg" else -(a.args[0] * b)
    if right == "neg":
        return -(a * b.args[0])
    if right == "div" and (quotient := _times_quotient(a, *b.args)) is not None:
        return quotient
    if left == "div" and (quotient := _times_quotient(b, *a.args)) is not None:
        return quotient
    if left != "mul" or right != "mul":
        return None
    c, d = a.args[0].value, b.args[0].value
    if c is None or d is None or not math.isfinite(c * d) or not c * d:
        return None
    return constant(c * d) * (a.args[1] * b.args[1])


def _times_quotient(a: Node, b: Node, c: Node) -> Node | None:
    """a * (b / c) where it is a quotient: a * (1 / c) = a / c, and x * (b / (x * y)) = b / y."""
    if b.value == 1.0:
        return a / c
    if c.op.name == "mul" and a in c.args:
        return b / c.args[c.args[0] is a]
    return None


def _cancelled(c: float, b: Node) -> Node | None:
    """c * b for a product b with a factor d * x whose d is 1 / c or -1 / c: 2 * ((0.5 * x) * y) = x * y."""
    for factor, other in (b.args, b.args[::-1]):
        if factor.op.name == "mul" and (d := factor.args[0].value) is not None and abs(c * d) == 1.0:
            return constant(c * d) * (factor.args[1] * other)
    return None


def div(a: Node, b: Node) -> Node | None:
    """a / b: 1 and signs go; of twice the same it is one."""
    if b.value == 1.0:
        return a
    if b.value == -1.0:
        return -a
    if a.value == 0.0:
        return constant(0.0)
    if a is b:
        return constant(1.0)
    if a.op.name == "neg":
        return a.args[0] / b.args[0] if b.op.name == "neg" else -(a.args[0] / b)
    return -(a / b.args[0]) if b.op.name == "neg" else None


def neg(a: Node) -> Node | None:
    """-a: signs cancel, turn a difference round or go into a constant factor."""
    if a.op.name == "neg":
        return a.args[0]
    if a.op.name == "sub":
        return a.args[1] - a.args[0]
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
    """The one that a constant condition chooses; what both are."""
    if c.value is not None:
        return a if c.value != 0.0 else b
    return a if a is b else None


def same(a: Node, b: Node) -> Node | None:
    """What both arguments are."""
    return a if a is b else None
