"""Taylor rules of the operations: coefficient k > 0 of a result, as a formula that holds for every order.

A rule is called once, with the orders of a series, the result's node y and those of the arguments. Of a node x,
`orders.zero(x)` is coefficient 0, `orders.at(x)` is coefficient k, None where x is constant, and `orders.sum(a, b)` the
sum over 0 < j < k of a_j b_k-j: in them a rule is linear in coefficients k. So it serves series of graphs, whose
coefficients are nodes, and through these graphs numbers of every kind. Sums and differences have their `signs` for a
rule, piecewise operations their `piece`; every other operation without a rule of its own has `by_partials`.
"""

import operator
from typing import Literal, Protocol

from ..core.node import Node, apply, as_node
from .operation import OPS
from .values import whole_power

POWERS = 2.0**53  # whole exponents up to this size become products
Kind = Literal["plain", "weighted", "safe"]  # of a sum over orders


class Orders(Protocol):
    """The orders of a series, as a rule sees them."""

    k: Node

    def zero(self, node: Node) -> Node:
        """Coefficient 0."""

    def at(self, node: Node) -> Node | None:
        """Coefficient k; None of what is constant."""

    def sum(self, a: Node, b: Node, kind: Kind = "plain") -> Node:
        """The sum over 0 < j < k of a_j b_k-j; "weighted" of j a_j b_k-j; "safe": zeros win over what is not finite."""


def mul(orders: Orders, y: Node, a: Node, b: Node) -> Node:
    """y = a * b."""
    if a is b:
        return orders.zero(2.0 * a) * _moving(orders.at(a)) + orders.sum(a, a)
    terms = [orders.zero(x) * each for x, each in _crossed(orders, a, b)]
    return terms[0] if len(terms) == 1 else terms[0] + (terms[1] + orders.sum(a, b))


def zero_safe_mul(orders: Orders, y: Node, a: Node, b: Node) -> Node:
    """y = a * b, in which a zero coefficient wins over an infinite one."""
    terms = [apply(OPS["zero_safe_mul"], orders.zero(x), each) for x, each in _crossed(orders, a, b)]
    return terms[0] if len(terms) == 1 else terms[0] + terms[1] + orders.sum(a, b, "safe")


def _crossed(orders: Orders, a: Node, b: Node) -> list[tuple[Node, Node]]:
    """Terms of each argument with coefficient k of the other, where that moves."""
    pairs = ((b, orders.at(a)), (a, orders.at(b)))
    return [(x, each) for x, each in pairs if each is not None]


def div(orders: Orders, y: Node, a: Node, b: Node) -> Node:
    """y = a / b, from y b = a."""
    above, below = orders.at(a), orders.at(b)
    if below is not None:
        known = -orders.zero(y) * below - orders.sum(b, y)
        above = known if above is None else above + known
    return _moving(above) * orders.zero(1.0 / b)


def sqrt(orders: Orders, y: Node, a: Node) -> Node:
    """y = sqrt(a), from y y = a."""
    return (_moving(orders.at(a)) - orders.sum(y, y)) * orders.zero(0.5 / y)


def hypot(orders: Orders, y: Node, a: Node, b: Node) -> Node:
    """y = hypot(a, b), from y y = a a + b b."""
    total = -0.5 * orders.sum(y, y)
    for x in (a, b):
        if (each := orders.at(x)) is not None:
            total = total + 0.5 * orders.sum(x, x) + orders.zero(x) * each
    return total * orders.zero(1.0 / y)


def pow(orders: Orders, y: Node, a: Node, b: Node) -> Node | None:
    """y = a ** b with a constant b: ydot a = b y adot. A whole b is products, which have series at a = 0, too."""
    if orders.at(b) is not None or (b.value is not None and b.value.is_integer()):
        return orders.at(power(a, b))
    inner = (orders.zero(b) * orders.sum(a, y, "weighted") - orders.sum(y, a, "weighted")) / orders.k
    return inner * orders.zero(1.0 / a) + orders.zero(b * a ** (b - 1.0)) * _moving(orders.at(a))


def by_partials(orders: Orders, y: Node, *args: Node) -> Node:
    """ydot = sum over arguments a of (dy/da) adot, by the table's partials g: of g_0 a_k + 1/k sum j a_j g_k-j.

    Only g_0 .. g_k-1 are asked for, so g may depend on y itself, as for exp, tan or the pair sine and cosine.
    """
    terms: list[Node] = []
    for arg, partial in zip(args, map(as_node, y.op.partials(y, *args)), strict=True):
        if (each := orders.at(arg)) is not None:
            terms.append(orders.zero(partial) * each)
            if partial.value is None:
                terms.append(orders.sum(arg, partial, "weighted") / orders.k)
    return sum(terms[1:], terms[0])


def _moving(coefficient: Node | None) -> Node:
    assert coefficient is not None  # a rule is asked only where an argument moves
    return coefficient


def power(a: Node, b: Node) -> Node:
    """a ** b by operations that have series: products for a whole exponent, else exp(b log a)."""
    exponent = b.value
    if exponent is None or not abs(exponent) <= POWERS or exponent != int(exponent):
        return apply(OPS["exp"], b * apply(OPS["log"], a))
    if exponent == 0.0:
        return as_node(1.0)
    result: Node = whole_power(a, abs(int(exponent)), operator.mul)
    return 1.0 / result if exponent < 0 else result
