"""Reading form: nodes of the same values as a person writes them, to be typeset and not to be computed.

A sum has its products in order and no doubled signs, a product its number first and powers as powers. Where it is
shorter, what stands is written out as a sum of products by the identities of `canonical`, collected by the rates in it,
common factors taken out: (m + M) l^2 theta_dot^2 / 2 - m g l cos(theta).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial, reduce

from ..core.node import CONSTANT, Node, constant
from ..core.traversal import topological
from ..operations.operation import OPS, columns
from ..util.explain_failure import explain_failure
from ..writing.naming import with_name
from .canonical import COEFFICIENT_ROUNDING, Canonical, Powers, Sum
from .identities import shortest

FUNCTION, RATE = 2, 3  # ranks of factors: a function stands behind coordinates, before their rates
ARITHMETIC = ("add", "sub", "neg", "mul", "div", "pow")
Rank = tuple[int, int]  # of a factor, and its place among those of that rank
Signed = tuple[bool, Node]  # whether it is subtracted, and what
TERMS, LONGEST = 48, 200.0  # terms and symbols of what is written out, at most
LARGEST = 120  # nodes of one that is written out
WORTH = 1.6  # so much longer may be what is written out
ENOUGH = 2  # nodes that stay as they are, after which no larger one is written out
PLAINER = 1.2  # and so much longer that in which every product of sums is written out, beside where sums are kept
SHORT = 8  # symbols of what is written again where it is needed again
RATIOS = (1.0, 2.0, 0.5)  # of two sums of which one is written, with the rates of both


@explain_failure
def reading_form(nodes: Sequence[Node], ranks: Mapping[str, int] | None = None, largest: int = LARGEST) -> list[Node]:
    """Nodes of the same values, as a person writes them: `x**2` a power, sums that begin with a positive term.

    ranks: {variable: rank}, default 0. In a product numbers stand first, then parameters (0), coordinates (1),
    functions (2) and rates (3 and more), by which terms are collected.
    largest: nodes of one that is written out, and of all four times as many.
    """
    reader = _Reader(ranks or {}, largest)
    plain = reader.tidied(nodes)
    orders = [topological([node]) for node in nodes]
    written: dict[int, Node] = {}
    missed = 0
    for i in sorted(range(len(nodes)), key=lambda i: len(orders[i])):  # where two stay as they are, so will larger ones
        written[i] = plain[i] if missed == ENOUGH else reader.shorter(orders[i], plain[i])
        missed += written[i] is plain[i] and len(orders[i]) > SHORT
    return [written[i] for i in range(len(nodes))]


class _Reader:
    """The maker of the nodes of a reading form, each of them once.

    ranks, largest: see `reading_form`.
    """

    def __init__(self, ranks: Mapping[str, int], largest: int) -> None:
        self.ranks = {name: (rank, place) for place, (name, rank) in enumerate(ranks.items())}
        self.largest = largest
        self.left = 4 * largest  # nodes that may still be written out
        self._made: dict[tuple[object, ...], Node] = {}
        self._numbers: dict[Node, tuple[float, Node]] = {}  # products with a number before them
        self._rank: dict[Node, Rank] = {}

    def shorter(self, order: Sequence[Node], tidy: Node) -> Node:
        """The last node of an order written out where that is short, else as it stands."""
        node = order[-1]
        if len(order) > self.largest or any(each.name and each.args for each in order[:-1]) or self.left < len(order):
            return tidy
        self.left -= len(order)
        both = [Canonical([node], expanded=expanded) for expanded in (True, False)]
        sums = [each for each in both if len(each[node]) <= TERMS]
        forms = [_Writer(self, canonical, node).node for canonical in sums]
        out = min(forms, key=lambda form: ink(form) / (PLAINER if form is forms[0] else 1.0), default=tidy)
        return out if ink(out) <= min(WORTH * ink(tidy), LONGEST) else tidy

    # As it stands.

    def tidied(self, nodes: Sequence[Node]) -> list[Node]:
        """The nodes, sums and products in order, else as they stand; what is shared stays shared."""
        order = topological(nodes)
        ends = set(nodes)
        uses = Counter([*ends, *[arg for node in order for arg in node.args]])
        size = inks(order)
        alone = {node for node in order if (uses[node] == 1 or size[node] <= SHORT) and not node.name}
        sums: dict[Node, list[Signed]] = {}  # the terms of each node
        products: dict[Node, tuple[float, dict[Node, int]]] = {}  # the factors of each node
        done: dict[Node, Node] = {}
        for node in order:
            sums[node], products[node] = self._terms(node, sums, alone), self._factors(node, products, done, alone)
            made = self._written(node, sums[node], products[node], done)
            if node.name and node.args and made.args and uses[node] > (node in ends):
                made = with_name(Node(made.op, made.args), node.name)
            done[node] = made
            if node.value is None and (node not in alone or node.op.name not in ARITHMETIC):
                sums[node], products[node] = [(False, node)], (1.0, {done[node]: 1})
        return [done[node] for node in nodes]

    def _terms(self, node: Node, sums: Mapping[Node, list[Signed]], alone: set[Node]) -> list[Signed]:
        if node.op.name not in ("add", "sub", "neg"):
            return [(False, node)]
        return [
            ((sign < 0) != each, term)
            for arg, sign in zip(node.args, columns(node.op).signs, strict=True)
            for each, term in (sums[arg] if arg in alone else [(False, arg)])
        ]

    def _factors(
        self, node: Node, products: Mapping[Node, tuple[float, dict[Node, int]]], done: Mapping[Node, Node],
        alone: set[Node],
    ) -> tuple[float, dict[Node, int]]:  # fmt: skip
        if node.value is not None:
            return node.value, {}
        name, args = node.op.name, node.args
        power = args[1].value if name == "pow" else None
        if name == "neg":
            parts = [(args[0], 1)]
        elif name in ("mul", "div"):
            parts = [(args[0], 1), (args[1], 1 if name == "mul" else -1)]
        elif power is not None and power == int(power) and args[0].value is None:
            parts = [(args[0], int(power))]
        else:
            return 1.0, ({node: 1} if not args else {})
        coefficient, powers = -1.0 if name == "neg" else 1.0, dict[Node, int]()
        for arg, times in parts:
            number, factors = products[arg]
            kept = arg.value is None and (arg not in alone or not factors)
            if kept or (not 1e-100 < abs(number) < 1e100 and abs(times) > 1) or number == 0.0 > times:
                number, factors = 1.0, {done[arg]: 1}
            coefficient *= number**times
            for factor, count in factors.items():
                powers[factor] = powers.get(factor, 0) + count * times
        return coefficient, powers

    def _written(
        self, node: Node, terms: list[Signed], product: tuple[float, dict[Node, int]], done: Mapping[Node, Node]
    ) -> Node:
        if not node.args:
            return node
        if len(terms) > 1:
            return self.sum([self.signed(minus, done.get(term, term)) for minus, term in terms])
        if node.op.name in ("mul", "div", "neg", "pow") and (product[1] or product[0] != 1.0):
            minus, made = self.product(*product)
            return self.make("neg", made) if minus else made
        return self.make(node.op.name, *[done[arg] for arg in node.args])

    # Sums and products in order.

    def make(self, name: str, *args: Node) -> Node:
        """The one node of an operation."""
        if (known := self._made.get((name, *args))) is None:
            known = self._made[name, *args] = Node(OPS[name], args)
        return known

    def signed(self, minus: bool, node: Node) -> Signed:
        """A term of a sum, its sign apart."""
        if node.op.name == "neg":
            return not minus, node.args[0]
        if node.value is not None and node.value < 0.0:
            return not minus, constant(-node.value)
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
            return constant(0.0)
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
        factors = sorted([each for each in held.items() if each[1]], key=lambda each: self.rank(each[0]))
        top = [self._power(node, power) for node, power in factors if power > 0]
        below = [self._power(node, -power) for node, power in factors if power < 0]
        size, minus = abs(coefficient), math.copysign(1.0, coefficient) < 0.0
        node = self._times(top) if top else constant(size)
        if top and size != 1.0:
            self._numbers[whole := self.make("mul", constant(size), node)] = size, node
            node = whole
        return minus, self.make("div", node, self._times(below)) if below else node

    def _apart(self, node: Node) -> tuple[float, Node]:
        """The number before a product, and the rest."""
        sign, node = (-1.0, node.args[0]) if node.op.name == "neg" else (1.0, node)
        number, rest = self._numbers.get(node, (1.0, node))
        return sign * number, rest

    def _times(self, factors: Sequence[Node]) -> Node:
        return reduce(partial(self.make, "mul"), factors)

    def _power(self, node: Node, power: int) -> Node:
        return node if power == 1 else self.make("pow", node, constant(float(power)))

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


class _Writer:
    """A node written out as a sum of products, `node`."""

    def __init__(self, reader: _Reader, canonical: Canonical, node: Node) -> None:
        self.reader, self.canonical = reader, canonical
        self._atoms: dict[int, Node] = {}
        for atom in sorted(self._needed(canonical[node])):  # as they are made: deep graphs recur nowhere
            self._atom(atom)
        self.node = self._sum(canonical[node])

    def _needed(self, a: Sum) -> set[int]:
        """The atoms that a sum is made of, and those within them."""
        found: set[int] = set()
        rest = [a]
        while rest:
            new = {atom for powers in rest.pop() for atom, _ in powers} - found
            found |= new
            for atom in new:
                args = self.canonical.made[atom][1]
                rest += [args] if isinstance(args, dict) else [self.canonical[arg] for arg in args if arg.args]
        return found

    def _atom(self, atom: int) -> Node:
        if atom not in self._atoms:
            op, args = self.canonical.made[atom]
            if isinstance(args, dict):
                inside = [self._sum(args)]
            else:
                inside = [self._sum(self.canonical[arg]) if arg.args or arg.op is CONSTANT else arg for arg in args]
            self._atoms[atom] = inside[0] if op is None else self.reader.operation(op.name, inside)
        return self._atoms[atom]

    def _sum(self, a: Sum) -> Node:
        """Products by the rates in them: (sum of the rest) * rates; one sum for rates that share it."""
        parts: dict[Powers, dict[Powers, float]] = {}
        for powers, term in shortest(self.canonical, a, new_angle=0).items():
            rates = tuple([each for each in powers if self._rank(each[0]) >= RATE])
            others = tuple([each for each in powers if each not in rates])
            parts.setdefault(rates, {})[others] = term.value.real
        alike: list[tuple[dict[Powers, float], list[tuple[float, Powers]]]] = []
        for rates, rest in parts.items():
            for first, known in alike:
                if ratio := _ratio(rest, first):
                    known.append((ratio, rates))
                    break
            else:
                alike.append((rest, [(1.0, rates)]))
        return self.reader.sum([term for rest, rates in alike for term in self._group(rest, rates)])

    def _group(self, rest: dict[Powers, float], rates: list[tuple[float, Powers]]) -> list[Signed]:
        """(sum of the rest) * (sum of the rates), factors of all terms taken out; without rates, terms by function."""
        shared = _shared(rest)
        functions: dict[Powers, dict[Powers, float]] = {}
        for powers, value in rest.items():
            kind = tuple([each for each in powers if self._rank(each[0]) == FUNCTION])
            functions.setdefault(kind, {})[powers] = value
        if len(functions) > 1:
            if rates == [(1.0, ())] and not any(self._rank(atom) == FUNCTION for atom in shared):
                return [term for part in functions.values() for term in self._group(part, rates)]
            if not shared:
                terms = [term for part in functions.values() for term in self._group(part, [(1.0, ())])]
                turn = all(minus for minus, _ in terms)
                whole = {self.reader.sum([(minus != turn, node) for minus, node in terms]): 1}
                return [self._with_rates(-1.0 if turn else 1.0, whole, rates)]
        sizes = {abs(value) for value in rest.values()}
        factor = next(iter(sizes)) if len(sizes) == 1 else 0.5 if all(each % 1.0 == 0.5 for each in sizes) else 1.0
        factor *= 1.0 if any(value > 0.0 for value in rest.values()) else -1.0
        inner = [
            self._product(value / factor, [(atom, power - shared.get(atom, 0)) for atom, power in powers])
            for powers, value in rest.items()
        ]
        if len(rest) > 1 and not shared and factor in (1.0, -1.0) and rates == [(1.0, ())]:
            return [(minus != (factor < 0.0), node) for minus, node in inner]
        whole = {self._atom(atom): power for atom, power in shared.items()}
        if len(rest) > 1:
            node = self.reader.sum(inner)
            whole[node] = whole.get(node, 0) + 1
        return [self._with_rates(factor, whole, rates)]

    def _with_rates(self, factor: float, whole: dict[Node, int], rates: list[tuple[float, Powers]]) -> Signed:
        """Factors times the sum of the rates, of which factors of all are taken out."""
        shared = _shared([powers for _, powers in rates])
        for atom, power in shared.items():
            whole[self._atom(atom)] = whole.get(self._atom(atom), 0) + power
        if len(rates) > 1:
            moved = [
                self._product(ratio, [(atom, power - shared.get(atom, 0)) for atom, power in powers])
                for ratio, powers in rates
            ]
            whole[self.reader.sum(moved)] = 1
        return self.reader.product(factor, whole)

    def _rank(self, atom: int) -> int:
        return self.reader.rank(self._atom(atom))[0]

    def _product(self, value: float, powers: Sequence[tuple[int, int]]) -> Signed:
        held: dict[Node, int] = {}
        for atom, power in powers:
            held[self._atom(atom)] = held.get(self._atom(atom), 0) + power
        return self.reader.product(value, held)


def _shared(products: Iterable[Powers]) -> dict[int, int]:
    """The powers of atoms that all products have."""
    shared, *others = map(dict, products)
    for powers in others:
        shared = {
            atom: min(power, powers[atom], key=abs) for atom, power in shared.items() if powers.get(atom, 0) * power > 0
        }
    return shared


def _ratio(a: Mapping[Powers, float], b: Mapping[Powers, float]) -> float:
    """The number that b times is a, where that is a small one and there is more than a number; else 0."""
    if a.keys() != b.keys():
        return 0.0
    found = {a[powers] / b[powers] for powers in b}
    first = next(iter(found))
    same = all(abs(each - first) <= COEFFICIENT_ROUNDING * abs(first) for each in found)
    ratios = RATIOS if b.keys() != {()} else RATIOS[:1] * (abs(b[()]) != 1.0)
    near = next((each for each in ratios if abs(abs(first) - each) <= COEFFICIENT_ROUNDING * each), 0.0)
    return math.copysign(near, first) if same else 0.0


def ink(node: Node) -> float:
    """Symbols of a node that is written without lines of its own."""
    return inks(topological([node]))[node]


def inks(order: Sequence[Node]) -> dict[Node, float]:
    """Symbols of each node of an order, arguments first."""
    size: dict[Node, float] = {}
    for each in order:
        size[each] = 1.0 + sum([size[arg] for arg in each.args]) - (each.op.name in ("mul", "pow"))
    return size
