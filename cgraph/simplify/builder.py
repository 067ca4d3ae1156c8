"""Folding and sharing: how derived nodes are built, without `* 1`, `+ 0` or a second copy of the same thing."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

from ..core.label import Label
from ..core.node import CONSTANT, OPS, Node, Op, constant
from ..core.ops import cos, sin, sqrt
from ..core.scope import building
from ..core.traversal import rebuild

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
        return _cancelled(c, b) if b.op is MUL else None
    if a.op is NEG:
        return a.args[0] * b.args[0] if b.op is NEG else -(a.args[0] * b)
    if b.op is NEG:
        return -(a * b.args[0])
    if a.op is MUL and b.op is MUL and (c := a.args[0].value) is not None and (d := b.args[0].value) is not None:
        return constant(c * d) * (a.args[1] * b.args[1]) if math.isfinite(c * d) and c * d else None
    return None


def _cancelled(c: float, b: Node) -> Node | None:
    """c * b for a product b with a factor d * x whose d is 1 / c or -1 / c: 2 * ((0.5 * x) * y) = x * y."""
    for factor, other in (b.args, b.args[::-1]):
        if factor.op is MUL and (d := factor.args[0].value) is not None and abs(c * d) == 1.0:
            return constant(c * d) * (factor.args[1] * other)
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
_RULES: dict[Op, Rule] = {
    ADD: _add,
    SUB: _sub,
    MUL: _mul,
    NEG: _neg,
    OPS["div"]: _div,
    OPS["pow"]: _pow,
    OPS["strong_mul"]: _strong_mul,
    OPS["where"]: _where,
    OPS["minimum"]: _same,
    OPS["maximum"]: _same,
    OPS["sin"]: lambda a: -sin(a.args[0]) if a.op is NEG else None,
    OPS["cos"]: lambda a: cos(a.args[0]) if a.op is NEG else None,
    OPS["abs"]: lambda a: abs(a.args[0]) if a.op is NEG else None,
}


class Builder:
    """Builds nodes folded and shared: the same operation on the same arguments is made once.

    Merging unites labels, and keeps the first name. Only nodes that this builder made are merged, so that no other
    node changes. A node without tags, such as a sum at a variable, takes those of its arguments.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, building
    >>> x = cg.variable("x")
    >>> with building(Builder()):
    ...     print(0.0 + x is x, x * cg.sin(x) is x * cg.sin(x))
    True True
    """

    def __init__(self) -> None:
        self._made: dict[tuple[str | int, ...], Node] = {}

    def __call__(self, op: Op, args: tuple[Node, ...], label: Label, name: str | None = None) -> Node:
        """The node of this operation on these arguments; a name is kept by a node made here for the first time."""
        for arg in args:
            if arg.op is not CONSTANT:
                rule = _RULES.get(op)
                if rule is not None and (node := rule(*args)) is not None:
                    return node
                break
        else:
            value = op.scalar(*[arg.value for arg in args])
            if value == value:
                return constant(value)
        # One order for both a*b and b*a: a constant first, else as first met.
        if op.commutative and args[1].op is CONSTANT and args[0].op is not CONSTANT:
            args = args[::-1]
        key: tuple[str | int, ...] = (op.name, *map(id, args))  # no objects, which the garbage collector would follow
        node = self._made.get(key)
        if node is None and op.commutative:
            node = self._made.get((op.name, key[2], key[1]))
        if node is None:
            if not label.tags:
                for arg in args:
                    label = label.with_tags_of(arg.label)
            node = self._made[key] = Node(op, args, label, name=name)
            return node
        if node.label is not label:
            object.__setattr__(node, "label", node.label.union(label))
        if node.name is None and name is not None:
            object.__setattr__(node, "name", name)
        return node


def folded(nodes: Collection[Node], build: Builder) -> list[Node]:
    """Copies of nodes, and of all that they reach, made by a builder.

    Once is enough: a rule sees the very arguments that the copy keeps, so a copy of the copy would come out alike.

    Parameters
    ----------
    nodes : collection of Node
        What to copy.
    build : Builder
        What the copies are made by, and shared with.

    Returns
    -------
    list of Node
        The copies, in the order of `nodes`.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, folded
    >>> x = cg.variable("x")
    >>> folded([1.0 * x + 0.0], Builder())
    [<node variable x>]
    """
    with building(build) as labelled:

        def make(node: Node, args: tuple[Node, ...]) -> Node:
            labelled(node.label)
            return build(node.op, args, node.label, node.name)

        new = rebuild(nodes, {}, make)
    return [new[node] for node in nodes]
