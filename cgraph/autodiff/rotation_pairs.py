"""Detection of plane rotations in a graph: pairs of sums c x + s y, c y - s x with cosine and sine of one angle."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from ..core.node import Node


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


class _Sum(NamedTuple):
    """The sum cos_sign c a + sin_sign s b."""

    node: Node
    a: Node
    b: Node
    cos: Node
    sin: Node
    cos_sign: float
    sin_sign: float
    products: tuple[Node, ...]


def rotations(order: Sequence[Node], depends: Collection[Node], kept: Collection[Node]) -> list[Rotation]:
    """The rotations of pairs of nodes in `depends` by angles that are not in it.

    order: nodes, arguments first. The products c x, .. of a rotation have no other use among them, and are not `kept`.
    """
    uses = dict.fromkeys(kept, 1)
    for node in order:
        for arg in node.args:
            uses[arg] = uses.get(arg, 0) + 1
    unpaired: dict[tuple[Node, Node, Node], _Sum] = {}
    pairs = []
    for node in order:
        this = _sum(node, depends, uses)
        if this is None:
            continue
        other = unpaired.pop((this.cos, this.b, this.a), None)
        if other is None:
            unpaired[this.cos, this.a, this.b] = this
        # c a + s b and +-(c b - s a): the products of the signs have to differ.
        elif other.cos_sign * other.sin_sign == -this.cos_sign * this.sin_sign:
            p, q = (other, this) if other.cos_sign == other.sin_sign else (this, other)
            products = p.products + q.products
            pairs.append(Rotation(p.node, q.node, p.a, p.b, p.cos, p.sin, p.cos_sign, q.cos_sign, products))
    return pairs


def _sum(node: Node, depends: Collection[Node], uses: dict[Node, int]) -> _Sum | None:
    """A sum or difference read as +-c a +- s b, where neither product has another use; else None."""
    if node.op.name not in ("add", "sub"):
        return None
    parts = {}
    for product, sign in zip(node.args, (1.0, 1.0 if node.op.name == "add" else -1.0), strict=True):
        if product.op.name != "mul" or uses[product] > 1:
            return None
        for factor, of in (product.args, product.args[::-1]):
            if factor.op.name in ("cos", "sin") and factor not in depends and of in depends:
                parts[factor.op.name] = factor, of, sign
    if len(parts) < 2:
        return None
    (cos, a, cos_sign), (sin, b, sin_sign) = parts["cos"], parts["sin"]
    if cos.args != sin.args or a is b:
        return None
    return _Sum(node, a, b, cos, sin, cos_sign, sin_sign, node.args)
