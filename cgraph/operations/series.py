"""Taylor recurrences of the operations: coefficient k of a result from those of its arguments.

A rule is called with k, the coefficients 0 .. k - 1 of the result, and those of each argument: 0 .. k, or one where
the argument is constant. The coefficients are numbers of any kind that have arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul as product
from typing import Any

from ..core.node import Node, apply, as_node
from .operation import OPS

Coefficients = Sequence[Any]
POWERS = 2.0**53  # whole exponents up to this size become products


def add(k: int, y: Coefficients, a: Coefficients, b: Coefficients) -> Any:
    """y = a + b."""
    if k and len(b) == 1:
        return a[k]
    return b[k] if k and len(a) == 1 else a[k] + b[k]


def sub(k: int, y: Coefficients, a: Coefficients, b: Coefficients) -> Any:
    """y = a - b."""
    if k and len(b) == 1:
        return a[k]
    return -b[k] if k and len(a) == 1 else a[k] - b[k]


def neg(k: int, y: Coefficients, a: Coefficients) -> Any:
    """y = -a."""
    return -a[k]


def mul(k: int, y: Coefficients, a: Coefficients, b: Coefficients) -> Any:
    """y = a * b."""
    if len(a) == 1:
        return a[0] * b[k]
    if len(b) == 1:
        return a[k] * b[0]
    if a is not b:
        return sum(map(product, a, b[::-1]))
    half = (k + 1) // 2  # of a square, the products that come twice are taken once
    twice = 2 * sum(map(product, a[:half], a[k : k - half : -1]))
    return twice if k % 2 else twice + a[half] * a[half]


def div(k: int, y: Coefficients, a: Coefficients, b: Coefficients) -> Any:
    """y = a / b, from y b = a."""
    if len(b) == 1:
        return a[k] / b[0]
    known = sum(map(product, b[1:], y[::-1]))
    return ((a[k] if k < len(a) else 0) - known) / b[0]


def zero_safe_mul(k: int, y: Coefficients, a: Coefficients, b: Coefficients) -> Any:
    """y = a * b, in which a zero coefficient wins over an infinite one."""
    pairs = [(a[i], b[k - i]) for i in range(k + 1) if i < len(a) and k - i < len(b)]
    return sum([u * v for u, v in pairs if u != 0 and v != 0], type(a[0])(0))


def power(a: Node, b: Node) -> Node:
    """a ** b by operations that have series: products for a whole exponent, else exp(b log a)."""
    exponent = b.value
    if exponent is None or not abs(exponent) <= POWERS or exponent != int(exponent):
        return apply(OPS["sqrt"], a) if exponent == 0.5 else apply(OPS["exp"], b * apply(OPS["log"], a))
    result: Node | None = None
    square, rest = a, abs(int(exponent))
    while rest:
        if rest & 1:
            result = square if result is None else result * square
        rest >>= 1
        if rest:
            square = square * square
    if result is None:
        return as_node(1.0)
    return 1.0 / result if exponent < 0 else result
