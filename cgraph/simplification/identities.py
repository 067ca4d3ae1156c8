"""Identities: nodes written anew from their canonical sums, in the shorter of several forms, factors taken out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ..core.builder import Builder
from ..core.label import UNLABELLED, WRITTEN, Label
from ..core.node import CONSTANT, Node, apply, constant
from ..core.scope import building
from ..core.traversal import topological
from ..operations.operation import OPS
from ..util.explain_failure import explain_failure
from .canonical import ROUNDING, Angle, Canonical, Powers, Sum, Term, added, number
from .rounding_growth import as_accurate

LONGEST = 250  # nodes; beyond, sums of products would be too long to be of use

Factor = int | tuple[str, tuple[Angle, ...]]  # an atom, or the cosine or sine of a sum of angles
Wave = tuple[tuple[Angle, int], ...]  # angles and how often they are added: exp(i sum k angle)


class Product(NamedTuple):
    """A coefficient times powers of factors."""

    value: float
    factors: dict[Factor, int]
    label: Label


def rewritten(nodes: Sequence[Node]) -> list[Node]:
    """Nodes of the same values, written out as sums of products by identities, with common factors taken out.

    sin^2 + cos^2 = 1, cosh^2 - sinh^2 = 1, the addition theorems, squares of roots, and all that cancels in a sum of
    products are seen through; a node that is constant or zero by these comes out as a number. A node that would be too
    long stays as a function of its arguments. The result can be longer than what it came from.
    """
    canonical = Canonical(nodes)
    with building(Builder()) as set_label:
        writer = _Writer(canonical, set_label)
        return [writer.node(canonical[node]) for node in nodes]


class _Writer:
    def __init__(self, canonical: Canonical, set_label: Callable[[Label], None]) -> None:
        self.canonical, self.set_label = canonical, set_label
        self._nodes: dict[Factor, Node] = {}
        self._expanded: dict[Powers, dict[Wave, complex]] = {}

    def node(self, a: Sum) -> Node:
        """The node of a sum."""
        groups: dict[Powers, Sum] = {}
        for powers, term in a.items():
            plain = tuple([(atom, power) for atom, power in powers if atom not in self.canonical.angles])
            turning = tuple([(atom, power) for atom, power in powers if atom in self.canonical.angles])
            groups.setdefault(plain, {})[turning] = term
        return self._sum(
            [
                product._replace(factors={**dict(plain), **product.factors})
                for plain, turning in groups.items()
                for product in self._shortest(turning)
            ]
        )

    def _shortest(self, a: Sum) -> list[Product]:
        """The shortest form of a polynomial in sines and cosines."""
        best = self._flipped(a)
        forms = [[Product(term.value, dict(powers), term.label) for powers, term in best.items()]]
        if all(power > 0 for powers in a for _, power in powers):
            forms.append(self._fourier(a))
        return min(forms, key=self._cost)

    def _cost(self, form: list[Product]) -> int:
        new = {
            factor
            for product in form
            for factor in product.factors
            if isinstance(factor, tuple) and frozenset(factor[1]) not in self.canonical.written
        }
        return 3 * len(new) + sum([1 + sum(map(abs, product.factors.values())) for product in form])

    def _flipped(self, a: Sum) -> Sum:
        """With cos^2 = 1 - sin^2 at the angles where that is shorter."""
        for cosine, sine in self.canonical.pairs.values():
            square = added(number(1.0), {((sine, 2),): Term(1.0, 1.0, UNLABELLED)}, -1.0)
            other = self.canonical.product(a, number(1.0), squares={cosine: square})
            if _length(other) < _length(a):
                a = other
        return a

    def _fourier(self, a: Sum) -> list[Product]:
        """As a sum of sines and cosines of sums of angles."""
        waves: dict[Wave, tuple[complex, float, Label]] = {}
        for powers, term in a.items():
            for wave, part in self._waves(powers).items():
                value = term.value * part
                old, size, label = waves.get(wave, (0j, 0.0, term.label))
                waves[wave] = old + value, size + abs(value), label.union(term.label)
        products = []
        for wave, (value, size, label) in waves.items():
            if wave and wave[0][1] < 0:
                continue  # the conjugate of another
            weight = 2.0 if wave else 1.0
            angles = tuple([((powers, abs(k) * unit), k < 0) for (powers, unit), k in wave])
            for function, part in (("cos", value.real), ("sin", -value.imag)):
                if abs(part) > ROUNDING * size:
                    factors: dict[Factor, int] = {(function, _signed(angles)): 1} if wave else {}
                    products.append(Product(weight * part, factors, label))
        return products

    def _waves(self, powers: Powers) -> dict[Wave, complex]:
        """A product of sines and cosines as a sum of exp(i wave)."""
        if powers not in self._expanded:
            parts: dict[Wave, complex] = {(): 1.0 + 0.0j}
            for atom, power in powers:
                angle, sine = self.canonical.angles[atom]
                for _ in range(power):
                    turned: dict[Wave, complex] = {}
                    for wave, value in parts.items():
                        for sign in (1, -1):
                            shifted = dict(wave)
                            shifted[angle] = shifted.get(angle, 0) + sign
                            name = tuple(sorted([(each, k) for each, k in shifted.items() if k]))
                            turned[name] = turned.get(name, 0.0) + value * (-0.5j * sign if sine else 0.5)
                    parts = turned
            self._expanded[powers] = parts
        return self._expanded[powers]

    def _sum(self, products: list[Product]) -> Node:
        """Products added up, the factor that most of them share taken out first."""
        if not products:
            return constant(0.0)
        if len(products) == 1:
            return self._product(products[0])
        uses: Counter[tuple[Factor, int]] = Counter()
        sizes: Counter[float] = Counter()
        for product in products:
            uses.update([(factor, 1 if power > 0 else -1) for factor, power in product.factors.items()])
            sizes[abs(product.value)] += 1
        factor, shared = max(uses.items(), key=lambda item: item[1], default=((0, 1), 0))
        size, alike = max(sizes.items(), key=lambda item: (item[0] != 1.0) * item[1])
        if shared >= 2 and shared >= (alike if size != 1.0 else 0):
            name, sign = factor
            inside = [product for product in products if product.factors.get(name, 0) * sign > 0]
            outside = [product for product in products if product.factors.get(name, 0) * sign <= 0]
            rest = [product._replace(factors=_divided(product.factors, name, sign)) for product in inside]
            return self._total(self._times(self._sum(rest), name, sign), outside)
        if alike >= 2 and size != 1.0:
            inside = [product for product in products if abs(product.value) == size]
            outside = [product for product in products if abs(product.value) != size]
            rest = [product._replace(value=math.copysign(1.0, product.value)) for product in inside]
            return self._total(size * self._sum(rest), outside)
        positive = [product for product in products if product.value > 0.0]
        negative = [product._replace(value=-product.value) for product in products if product.value < 0.0]
        total = None
        for product in positive:
            node = self._product(product)
            total = node if total is None else self._untagged(total) + node
        for product in negative:
            node = self._product(product)
            total = -node if total is None else self._untagged(total) - node
        assert total is not None
        return total

    def _total(self, node: Node, others: list[Product]) -> Node:
        if not others:
            return node
        rest = self._untagged(self._sum(others))
        if rest.op.name == "neg":
            return node - rest.args[0]
        return rest - node.args[0] if node.op.name == "neg" else node + rest

    def _untagged(self, node: Node) -> Node:
        """The node as it is, those to come with the tags of their arguments."""
        self.set_label(WRITTEN)
        return node

    def _times(self, node: Node, factor: Factor, sign: int) -> Node:
        self.set_label(WRITTEN)
        if node.op.name == "neg":
            return -self._times(node.args[0], factor, sign)
        return self._factor(factor) * node if sign > 0 else node / self._factor(factor)

    def _product(self, product: Product) -> Node:
        above = {factor: power for factor, power in product.factors.items() if power > 0}
        below = [factor for factor, power in product.factors.items() for _ in range(-power)]
        self.set_label(WRITTEN.with_tags_of(product.label))
        value, node = abs(product.value), self._powers(above)
        node = constant(value) if node is None else node if value == 1.0 else value * node
        for factor in below:
            node = node / self._factor(factor)
        return -node if product.value < 0.0 else node

    def _powers(self, powers: Mapping[Factor, int]) -> Node | None:
        """The product of powers, squares as squares of a product."""
        half = (
            self._powers({factor: power // 2 for factor, power in powers.items() if power > 1})
            if any([power > 1 for power in powers.values()])
            else None
        )
        node = None if half is None else half * half
        for factor, power in powers.items():
            if power % 2:
                node = self._factor(factor) if node is None else node * self._factor(factor)
        return node

    def _factor(self, factor: Factor) -> Node:
        if factor not in self._nodes:
            self._nodes[factor] = self._made(factor)
        return self._nodes[factor]

    def _made(self, factor: Factor) -> Node:
        if isinstance(factor, tuple):
            name, angles = factor
            return apply(OPS[name], self.node(_argument(angles)))
        if factor in self.canonical.angles:
            angle, sine = self.canonical.angles[factor]
            return apply(OPS["sin" if sine else "cos"], self.node(_argument((angle,))))
        op, args = self.canonical.made[factor]
        nodes = [self._argument(arg) if arg.args else arg for arg in args]
        return nodes[0] if op is None else apply(op, *nodes)

    def _argument(self, node: Node) -> Node:
        """An argument, as it stands unless it depends on less when it is written anew: sums may lose digits."""
        new = self.node(self.canonical[node])
        return new if leaves([new]) < leaves([node]) else node


@explain_failure
def shortened(nodes: Sequence[Node]) -> list[Node]:
    """Nodes of the same values: written anew by identities where that is shorter and as accurate, else as they are.

    Together where that takes fewer nodes; else, of some, those that then depend on fewer variables.

    >>> import cgraph as cg
    >>> from cgraph.extend import shortened
    >>> x, y = cg.variables("x y")
    >>> shortened([cg.cos(x) * cg.cos(x + y) + cg.sin(x) * cg.sin(x + y), x * (1.0 - cg.cos(y))])
    [<node cos>, <node mul>]
    """
    old = list(nodes)
    if len(topological(old)) > LONGEST:
        return old
    new = rewritten(old)
    usable = [as_accurate(before, after) for before, after in zip(old, new, strict=True)]
    if all(usable) and len(topological(new)) < len(topological(old)):
        return new
    return [
        after if fine and leaves([after]) < leaves([before]) else before
        for before, after, fine in zip(old, new, usable, strict=True)
    ]


def leaves(nodes: Sequence[Node]) -> set[Node]:
    """The variables that nodes depend on."""
    return {node for node in topological(nodes) if not node.args and node.op is not CONSTANT}


def _argument(angles: Sequence[Angle]) -> Sum:
    return {powers: Term(size, abs(size), UNLABELLED) for powers, size in angles}


def _signed(angles: Sequence[tuple[Angle, bool]]) -> tuple[Angle, ...]:
    return tuple([(powers, -size if negative else size) for (powers, size), negative in angles])


def _divided(factors: dict[Factor, int], factor: Factor, sign: int) -> dict[Factor, int]:
    return {each: power for each, power in {**factors, factor: factors[factor] - sign}.items() if power}


def _length(a: Sum) -> int:
    return sum([1 + sum([abs(power) for _, power in powers]) for powers in a])
