"""Detection of plane rotations in a graph: pairs of sums c x + s y, c y - s x with cosine and sine of one angle.

These are operations, or constants with c^2 + s^2 = 1.
"""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple

from ..core.node import Node, constant

ANGLE_ROUNDING = 2.0**-50  # of constants of size 1 that are the cosine and the sine of one angle


class Rotation(NamedTuple):
    """Two sums that are a rotation of (x, y): sign_x first = c x + s y, sign_y second = c y - s x."""

    first: Node
    second: Node
    x: Node
    y: Node
    cos: Node
    sin: Node
    sign_x: float
    sign_y: float
    products: tuple[Node, ...]

    @property
    def angle(self) -> tuple[Node | float, Node | float]:
        """Cosine and sine, alike for rotations by one angle."""
        cos, sin = (each if each.value is None else each.value for each in (self.cos, self.sin))
        return cos, sin


class _Sum(NamedTuple):
    """The sum cos_sign c a + sin_sign s b."""

    node: Node
    a: Node
    b: Node
    cos: Node
    sin: Node
    cos_sign: float
    sin_sign: float


def rotations(order: Sequence[Node], depends: Collection[Node], kept: Collection[Node]) -> list[Rotation]:
    """The rotations of pairs of nodes in `depends` by angles that are not in it, or are constants.

    order: nodes, arguments first. The products c x, .. of a rotation have no other use among them, and are not `kept`.
    """
    uses = Counter([*kept, *[arg for node in order for arg in node.args]])
    unpaired: dict[tuple[Node, Node, Node], _Sum] = {}
    unpaired_constants: dict[frozenset[Node], _Sum] = {}
    pairs = []
    for node in order:
        this = _sum(node, depends, uses)
        if this is None:
            continue
        if this.cos.value is not None:
            both = frozenset((this.a, this.b))
            if both in unpaired_constants and (pair := _constant_pair(unpaired_constants[both], this)):
                pairs.append(pair)
                del unpaired_constants[both]
            else:
                unpaired_constants[both] = this
            continue
        other = unpaired.pop((this.cos, this.b, this.a), None)
        if other is None:
            unpaired[this.cos, this.a, this.b] = this
        # c a + s b and +-(c b - s a): the products of the signs have to differ.
        elif other.cos_sign * other.sin_sign == -this.cos_sign * this.sin_sign:
            p, q = (other, this) if other.cos_sign == other.sin_sign else (this, other)
            products = p.node.args + q.node.args
            pairs.append(Rotation(p.node, q.node, p.a, p.b, p.cos, p.sin, p.cos_sign, q.cos_sign, products))
    return pairs


def _constant_pair(one: _Sum, other: _Sum) -> Rotation | None:
    """one = c x + s y, other = +-(c y - s x); None where they are not."""
    c, s = one.cos, one.sin
    at_x, at_y = (other.cos, other.sin) if other.a is one.a else (other.sin, other.cos)
    sign = math.copysign(1.0, at_y.value * c.value)  # type: ignore[operator]
    if max(abs(at_y.value - sign * c.value), abs(at_x.value + sign * s.value)) > ANGLE_ROUNDING:  # type: ignore[operator]
        return None
    return Rotation(one.node, other.node, one.a, one.b, c, s, 1.0, sign, one.node.args + other.node.args)


def _sum(node: Node, depends: Collection[Node], uses: dict[Node, int]) -> _Sum | None:
    """A sum or difference read as +-c a +- s b, where neither product has another use; else None."""
    if node.op.name not in ("add", "sub"):
        return None
    parts, constants = {}, []
    for product, sign in zip(node.args, (1.0, 1.0 if node.op.name == "add" else -1.0), strict=True):
        if product.op.name != "mul" or uses[product] > 1:
            return None
        for factor, of in (product.args, product.args[::-1]):
            if factor.op.name in ("cos", "sin") and factor not in depends and of in depends:
                parts[factor.op.name] = factor, of, sign
            elif factor.value is not None and of in depends:
                constants.append((sign * factor.value, of))
    if len(constants) == 2:
        (c, a), (s, b) = constants
        unit = a is not b and abs(c * c + s * s - 1.0) <= ANGLE_ROUNDING
        return _Sum(node, a, b, constant(c), constant(s), 1.0, 1.0) if unit else None
    if len(parts) < 2:
        return None
    (cos, a, cos_sign), (sin, b, sin_sign) = parts["cos"], parts["sin"]
    if cos.args != sin.args or a is b:
        return None
    return _Sum(node, a, b, cos, sin, cos_sign, sin_sign)
