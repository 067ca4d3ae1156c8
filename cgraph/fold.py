"""Folding and sharing: how derived nodes are built, without `* 1`, `+ 0` or a second copy of the same thing."""

from __future__ import annotations

import math
from collections.abc import Callable

from .label import Label
from .node import CONSTANT, OPS, Node, Op, constant
from .ops import cos, sin, sqrt

# Rules see the arguments of the node to be, not all constant, and give a node that stands for it, or None. They take
# every operand for finite and a divisor for non-zero: 0 * x = 0, x - x = 0. Zeros have no sign: x + 0 = x.
Rule = Callable[..., Node | None]


def _add(a: Node, b: Node) -> Node | None:
    if b.value is not None:
        a, b = b, a
    if a.value is not None:
        return b if a.value == 0.0 else _offset(a.value, b)
    if b.op is NEG:
        return a - b.args[0]
    if a.op is NEG:
        return b - a.args[0]
    return 2.0 * a if a is b else None


def _offset(c: float, b: Node) -> Node | None:
    """c + b where b has a constant of its own to join with: c + (d + x), c + (d - x)."""
    if b.op in (ADD, SUB) and (d := b.args[0].value) is not None and math.isfinite(c + d):
        return constant(c + d) + b.args[1] if b.op is ADD else constant(c + d) - b.args[1]
    return None


def _sub(a: Node, b: Node) -> Node | None:
    if a.value == 0.0:
        return -b
    if b.value is not None:
        return constant(-b.value) + a
    if a.value is not None and b.op in (ADD, SUB) and (d := b.args[0].value) is not None and math.isfinite(a.value - d):
        return constant(a.value - d) - b.args[1] if b.op is ADD else constant(a.value - d) + b.args[1]
    if a is b:
        return constant(0.0)
    if b.op is NEG:
        return a + b.args[0]
    if a.op is NEG:
        return -(a.args[0] + b)
    return None


def _mul(a: Node, b: Node) -> Node | None:
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
        if b.op is NEG:
            return constant(-c) * b.args[0]
        if b.op is MUL and (inner := b.args[0].value) is not None and math.isfinite(c * inner) and c * inner:
            return constant(c * inner) * b.args[1]
        return None
    if a.op is NEG:
        return a.args[0] * b.args[0] if b.op is NEG else -(a.args[0] * b)
    if b.op is NEG:
        return -(a * b.args[0])
    if a.op is MUL and b.op is MUL and (c := a.args[0].value) is not None and (d := b.args[0].value) is not None:
        return constant(c * d) * (a.args[1] * b.args[1]) if math.isfinite(c * d) and c * d else None
    return None


def _div(a: Node, b: Node) -> Node | None:
    if b.value == 1.0:
        return a
    if b.value == -1.0:
        return -a
    if a.value == 0.0:
        return constant(0.0)
    if a is b:
        return constant(1.0)
    if a.op is NEG:
        return a.args[0] / b.args[0] if b.op is NEG else -(a.args[0] / b)
    return -(a / b.args[0]) if b.op is NEG else None


def _neg(a: Node) -> Node | None:
    if a.op is NEG:
        return a.args[0]
    if a.op is SUB:
        return a.args[1] - a.args[0]
    if a.op is MUL and a.args[0].value is not None:
        return constant(-a.args[0].value) * a.args[1]
    return None


_POWERS: dict[float, Callable[[Node], Node]] = {
    0.0: lambda a: constant(1.0),
    1.0: lambda a: a,
    2.0: lambda a: a * a,
    0.5: lambda a: sqrt(a),
    -1.0: lambda a: 1.0 / a,
}


def _pow(a: Node, b: Node) -> Node | None:
    rule = _POWERS.get(b.value) if b.value is not None else None
    return rule(a) if rule else None


def _strong_mul(a: Node, b: Node) -> Node | None:
    for c, other in ((a, b), (b, a)):
        if c.value == 0.0:
            return constant(0.0)
        if c.value is not None and math.isfinite(c.value):
            return c * other
    return None


def _where(c: Node, a: Node, b: Node) -> Node | None:
    if c.value is not None:
        return a if c.value != 0.0 else b
    return a if a is b else None


def _same(a: Node, b: Node) -> Node | None:
    return a if a is b else None


ADD, SUB, NEG, MUL = OPS["add"], OPS["sub"], OPS["neg"], OPS["mul"]
_RULES: dict[str, Rule] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": _neg,
    "pow": _pow,
    "strong_mul": _strong_mul,
    "where": _where,
    "minimum": _same,
    "maximum": _same,
    "sin": lambda a: -sin(a.args[0]) if a.op is NEG else None,
    "cos": lambda a: cos(a.args[0]) if a.op is NEG else None,
    "abs": lambda a: abs(a.args[0]) if a.op is NEG else None,
}


class Builder:
    """Builds nodes folded and shared: the same operation on the same arguments is made once.

    Merging unites labels, and keeps the first name. Only nodes that this builder made are merged, so nobody else's
    node changes.
    """

    def __init__(self) -> None:
        self._made: dict[tuple[object, ...], Node] = {}

    def __call__(self, op: Op, args: tuple[Node, ...], label: Label, name: str | None = None) -> Node:
        """The node of this operation on these arguments; a name is kept by a node made here for the first time."""
        if all([arg.op is CONSTANT for arg in args]):
            value = op.scalar(*[arg.value for arg in args])
            if value == value:
                return constant(value)
        else:
            rule = _RULES.get(op.name)
            if rule is not None and (node := rule(*args)) is not None:
                return node
        if op.commutative:
            a, b = args
            if (a.op is not CONSTANT and b.op is CONSTANT) or (op, id(b), id(a)) in self._made:
                args = (b, a)  # one order for both a*b and b*a: a constant first, else as first met
        key = (op, *map(id, args))
        node = self._made.get(key)
        if node is None:
            node = self._made[key] = Node(op, args, label, name=name)
            return node
        if node.label is not label:
            object.__setattr__(node, "label", node.label.union(label))
        if node.name is None and name is not None:
            object.__setattr__(node, "name", name)
        return node
