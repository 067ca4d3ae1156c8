"""Double-double: a graph whose arithmetic keeps twice the digits, by nodes for what rounding takes off.

Every value is a pair hi + lo of numbers, lo at most about an ulp of hi: some 104 bits. Sums are Knuth's, products
Dekker's with Veltkamp's splitting, put together as by Joldes, Muller and Popescu, "Tight and rigorous error bounds for
basic building blocks of double-word arithmetic", ACM Transactions on Mathematical Software 44 (2017).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ..core.graph import Graph
from ..core.label import Label
from ..core.node import CONSTANT, Node, Op, apply, as_node, constant
from ..core.ops import abs_, equal, less, less_equal, maximum, minimum, not_equal, sign, sqrt, strong_mul, where
from ..core.scope import building
from ..core.traversal import topological

ZERO = constant(0.0)
SPLIT = 2.0**27  # halves of at most 26 bits, whose products are exact
WHOLE = 64.0  # the largest whole exponent that is taken by products


class Pair(NamedTuple):
    """The value hi + lo."""

    hi: Node
    lo: Node


def double_double(graph: Graph, *, low: bool = False) -> Graph:
    """The same function, with sums, differences, products, quotients and roots to twice the digits of float64.

    Tags and roles stay. Inputs and constants count as exact. Functions (sin, exp, ..) are those of float64 with the low
    part of their argument to first order: to an ulp, which is like a rounding of the data.

    For arithmetic that cancels, such as accelerations of chains whose masses differ by 1e12, and to see what rounding
    does to a graph: the difference from it is its error. Sums become some 20 operations, products 30, quotients 50.
    Every back end keeps them, fused multiply-add or not, but `fast=True` and `cg.simplify`, which take sums in another
    order, do not: simplify before. What overflows becomes NaN, from 1e300 on for the operands of a product.

    Parameters
    ----------
    graph : Graph
        Any graph.
    low : bool
        Add an output NAME_low for each output: what its rounding to float64 took off.

    Returns
    -------
    Graph
        With the same inputs and outputs, the outputs rounded to float64.

    Raises
    ------
    TypeError
        If it is not a graph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> graph = cg.Graph([x], {"y": (x + 1e16) - 1e16})
    >>> graph.evaluate({"x": 1.0}), cg.double_double(graph).evaluate({"x": 1.0})
    ({'y': 0.0}, {'y': 1.0})
    """
    if not isinstance(graph, Graph):
        raise TypeError(f"double_double takes a Graph, got {type(graph).__name__}: {graph!r:.60}")
    pairs: dict[Node, Pair] = {}
    with building(_made) as labelled:
        for node in topological(graph.outputs.values()):
            labelled(node.label)
            if not node.args:
                pairs[node] = Pair(node, ZERO)
            else:
                pairs[node] = _pair(node, [pairs[arg] for arg in node.args])
    outputs = {name: pairs[node].hi for name, node in graph.outputs.items()}
    if low:
        outputs |= {f"{name}_low": pairs[node].lo for name, node in graph.outputs.items()}
    return Graph(graph.inputs, outputs)


def _made(op: Op, args: tuple[Node, ...], label: Label, name: str | None = None) -> Node:
    """A node as it is written, but of constants the constant."""
    if all([arg.op is CONSTANT for arg in args]):
        value = op.scalar(*[arg.value for arg in args])
        if value == value:
            return constant(value)
    return Node(op, args, label, name=name)


def _pair(node: Node, args: list[Pair]) -> Pair:
    rule = _RULES.get(node.op.name)
    found = rule(*args) if rule is not None else None
    return found if found is not None else _to_first_order(node.op, args)


def _to_first_order(op: Op, args: list[Pair]) -> Pair:
    hi = apply(op, *[arg.hi for arg in args])
    if all([arg.lo is ZERO for arg in args]):
        return Pair(hi, ZERO)
    lo = ZERO
    for arg, partial in zip(args, op.partials(hi, *[arg.hi for arg in args]), strict=True):
        if arg.lo is not ZERO:
            change = strong_mul(arg.lo, as_node(partial))  # a low part of 0 counts for nothing at a singular point
            lo = change if lo is ZERO else lo + change
    return _normal(hi, lo)


def _normal(a: Node, b: Node) -> Pair:
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


def _add(a: Pair, b: Pair) -> Pair:
    high, low = _sum(a.hi, b.hi), _sum(a.lo, b.lo)
    first = _normal(high.hi, _plus(high.lo, low.hi))
    return _normal(first.hi, _plus(first.lo, low.lo))


def _plus(a: Node, b: Node) -> Node:
    return a if b is ZERO else b if a is ZERO else a + b


def _negated(a: Pair) -> Pair:
    return Pair(-a.hi, a.lo if a.lo is ZERO else -a.lo)


def _subtract(a: Pair, b: Pair) -> Pair:
    return _add(a, _negated(b))


def _multiply(a: Pair, b: Pair) -> Pair:
    high = _product(a.hi, b.hi)
    low = high.lo
    for x, y in ((a.hi, b.lo), (a.lo, b.hi)):
        if x is not ZERO and y is not ZERO:
            low = low + x * y
    return _normal(high.hi, low)


def _divide(a: Pair, b: Pair) -> Pair:
    quotient = a.hi / b.hi
    back = _multiply(b, Pair(quotient, ZERO))
    rest = (a.hi - back.hi) + _plus(a.lo, -back.lo)
    return _normal(quotient, rest / b.hi)


def _root(a: Pair) -> Pair:
    hi = sqrt(a.hi)
    square = _product(hi, hi)
    rest = _plus((a.hi - square.hi) - square.lo, a.lo)
    return _normal(hi, where(hi, rest / (2.0 * hi), 0.0))


def _power(a: Pair, b: Pair) -> Pair | None:
    exponent = b.hi.value
    if exponent is None or b.lo is not ZERO:
        return None
    if exponent == 0.5:
        return _root(a)
    if exponent != int(exponent) or not 0.0 < abs(exponent) <= WHOLE:
        return None
    result: Pair | None = None
    square, left = a, int(abs(exponent))
    while left:
        if left % 2:
            result = square if result is None else _multiply(result, square)
        left //= 2
        if left:
            square = _multiply(square, square)
    assert result is not None
    return result if exponent > 0.0 else _divide(Pair(constant(1.0), ZERO), result)


def _strong_multiply(a: Pair, b: Pair) -> Pair:
    product = _multiply(a, b)
    hi, lo = (where(a.hi, where(b.hi, part, 0.0), 0.0) for part in product)
    return Pair(hi, lo)


def _chosen(c: Pair, a: Pair, b: Pair) -> Pair:
    return Pair(where(c.hi, a.hi, b.hi), _low(c.hi, a.lo, b.lo))


def _low(c: Node, a: Node, b: Node) -> Node:
    return ZERO if a is ZERO and b is ZERO else where(c, a, b)


def _extreme(choose: Callable[..., Node]) -> Callable[[Pair, Pair], Pair]:
    def rule(a: Pair, b: Pair) -> Pair:
        hi = choose(a.hi, b.hi)
        if a.lo is ZERO and b.lo is ZERO:
            return Pair(hi, ZERO)
        return Pair(hi, where(equal(a.hi, b.hi), choose(a.lo, b.lo), where(equal(hi, a.hi), a.lo, b.lo)))

    return rule


def _compared(compare: Callable[..., Node]) -> Callable[[Pair, Pair], Pair]:
    def rule(a: Pair, b: Pair) -> Pair:
        if a.lo is ZERO and b.lo is ZERO:
            return Pair(compare(a.hi, b.hi), ZERO)
        return Pair(where(equal(a.hi, b.hi), compare(a.lo, b.lo), compare(a.hi, b.hi)), ZERO)

    return rule


def _size(a: Pair) -> Pair:
    return Pair(abs_(a.hi), a.lo if a.lo is ZERO else where(a.hi < 0.0, -a.lo, a.lo))


_RULES: dict[str, Callable[..., Pair | None]] = {
    "add": _add,
    "sub": _subtract,
    "mul": _multiply,
    "div": _divide,
    "neg": _negated,
    "sqrt": _root,
    "pow": _power,
    "strong_mul": _strong_multiply,
    "where": _chosen,
    "abs": _size,
    "sign": lambda a: Pair(sign(a.hi), ZERO),
    "minimum": _extreme(minimum),
    "maximum": _extreme(maximum),
    "less": _compared(less),
    "less_equal": _compared(less_equal),
    "equal": _compared(equal),
    "not_equal": _compared(not_equal),
}
