"""Sums and products in the order in which a person writes them: terms by rates, a number first, powers as powers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..core.node import Node, constant
from ..core.traversal import topological
from ..operations.operation import OPS

FUNCTION, RATE = 2, 3  # ranks of factors: a function stands behind coordinates, before their rates
ARITHMETIC = ("add", "sub", "neg", "mul", "div", "pow")
Rank = tuple[int, int]  # of a factor, and its place among those of that rank
Signed = tuple[bool, Node]  # whether it is subtracted, and what


class OrderedTerms:
    """The maker of nodes that are typeset, each of them once: sums and products in order.

    ranks: {name of a variable: its rank}, see `reading_form`.
    """

    def __init__(self, ranks: Mapping[str, int]) -> None:
        self.ranks = {name: (rank, place) for place, (name, rank) in enumerate(ranks.items())}
        self._made: dict[tuple[object, ...], Node] = {}
        self._numbers: dict[Node, tuple[float, Node]] = {}  # products with a number before them
        self._rank: dict[Node, Rank] = {}

    def make(self, name: str, *args: Node) -> Node:
        """The one node of an operation."""
        if (known := self._made.get((name, *args))) is None:
            known = self._made[name, *args] = Node(OPS[name], args)
        return known

    def number(self, value: float) -> Node:
        """The one node of a number."""
        if (known := self._made.get((value,))) is None:
            known = self._made[value,] = constant(value)
        return known

    def signed(self, minus: bool, node: Node) -> Signed:
        """A term of a sum, its sign apart."""
        if node.op.name == "neg":
            return not minus, node.args[0]
        if node.value is not None and node.value < 0.0:
            return not minus, self.number(-node.value)
        return minus, node

    def operation(self, name: str, args: Sequence[Node]) -> Node:
        """An operation on nodes that are made, a sum or a product in order."""
        if name in ("add", "sub"):
            return self.sum([self.signed(False, args[0]), self.signed(name == "sub", args[1])])
        if name in ("mul", "div", "neg") and all(arg.value is None for arg in args):
            powers = dict.fromkeys(args[:1], 1)
            for arg in args[1:]:
                powers[arg] = powers.get(arg, 0) + (1 if name == "mul" else -1)
            minus, made = self.product(-1.0 if name == "neg" else 1.0, powers)
            return self.make("neg", made) if minus else made
        return self.make(name, *args)

    def sum(self, terms: Sequence[Signed]) -> Node:
        """Terms added up, a positive one first."""
        if not terms:
            return self.number(0.0)
        ranks = {node: self.rank(node) for _, node in terms}
        order = sorted(terms, key=lambda term: (-ranks[term[1]][0], ranks[term[1]][1]))
        first = next((i for i, (minus, _) in enumerate(order) if not minus), 0)
        order = [order[first], *order[:first], *order[first + 1 :]]
        minus, total = order[0]
        total = self.make("neg", total) if minus else total
        for minus, node in order[1:]:
            total = self.make("sub" if minus else "add", total, node)
        return total

    def product(self, coefficient: float, powers: Mapping[Node, int]) -> Signed:
        """A product, its sign apart: a number, factors by rank, over those of negative powers."""
        held: dict[Node, int] = {}
        for node, power in powers.items():
            number, rest = self._apart(node)
            coefficient *= number**power
            held[rest] = held.get(rest, 0) + power
        powers = held
        factors = sorted(
            [(node, power) for node, power in powers.items() if power], key=lambda each: self.rank(each[0])
        )
        top = [self._power(node, power) for node, power in factors if power > 0]
        below = [self._power(node, -power) for node, power in factors if power < 0]
        size, minus = abs(coefficient), math.copysign(1.0, coefficient) < 0.0
        node = self._times(top) if top else self.number(size)
        if top and size != 1.0:
            self._numbers[whole := self.make("mul", self.number(size), node)] = size, node
            node = whole
        return minus, self.make("div", node, self._times(below)) if below else node

    def _apart(self, node: Node) -> tuple[float, Node]:
        """The number before a product, and the rest."""
        sign = 1.0
        if node.op.name == "neg":
            sign, node = -1.0, node.args[0]
        if node in self._numbers:
            number, node = self._numbers[node]
            return sign * number, node
        return sign, node

    def _times(self, factors: Sequence[Node]) -> Node:
        node = factors[0]
        for factor in factors[1:]:
            node = self.make("mul", node, factor)
        return node

    def _power(self, node: Node, power: int) -> Node:
        return node if power == 1 else self.make("pow", node, self.number(float(power)))

    def rank(self, node: Node) -> Rank:
        """The place of a factor in a product: the rank of a name, of a rate in it, else that of a function."""
        if node not in self._rank:
            for each in topological([node]):
                if each not in self._rank:
                    self._rank[each] = self._ranked(each)
        return self._rank[node]

    def _ranked(self, node: Node) -> Rank:
        if not node.args:
            return (-1, 0) if node.value is not None else self.ranks.get(str(node.name), (0, len(self.ranks)))
        inner = [self._rank[arg] for arg in node.args]
        rank = max([each for each, _ in inner])
        place = min([place for each, place in inner if each == rank])
        return (rank, place) if rank >= RATE or node.op.name in ARITHMETIC else (FUNCTION, place)


def ink(node: Node) -> float:
    """Symbols of a node that is written without lines of its own."""
    return inks(topological([node]))[node]


def inks(order: Sequence[Node]) -> dict[Node, float]:
    """Symbols of each node of an order, arguments first."""
    size: dict[Node, float] = {}
    for each in order:
        size[each] = (
            1.0 + sum([size[arg] for arg in each.args]) - (each.op.name in ("mul", "pow")) if each.args else 1.0
        )
    return size
