"""Sums of products side by side: as many products in each of them, added up in the lanes of a vector.

Of a straight line of code for one point, where factors are used again and again, as the Taylor coefficients of a
solution are. Every sum is added up in the order in which it is written, so that its bits are the same.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node

WIDTHS = (8, 4)  # sums side by side: LLVM makes a vector of them two or four where a processor has shorter ones
TERMS = 3  # products in a sum, at least
AGAIN = 2.0  # how often a factor is multiplied, at least: it is put beside others, which takes as long
# Products in all, at least: in short code a vector would wait for factors that have just been put there one by one.
MANY = 300


class Sums(NamedTuple):
    """Sums that are added up at once.

    roots: one in each lane.  terms: the products in the order in which they are added, those of all lanes together.
    signs: of each product, and of what is there before it.
    """

    roots: tuple[Node, ...]
    terms: tuple[tuple[Node, ...], ...]
    signs: tuple[tuple[int, int], ...]

    @property
    def factors(self) -> Iterator[tuple[tuple[Node, ...], tuple[Node, ...]]]:
        """First and second factors of each product, of all lanes together."""
        for products in self.terms:
            yield tuple([each.args[0] for each in products]), tuple([each.args[1] for each in products])


class _Chain(NamedTuple):
    """A sum of products alone."""

    terms: tuple[Node, ...]
    signs: tuple[tuple[int, int], ...]

    @property
    def factors(self) -> list[Node]:
        return [factor for product in self.terms for factor in product.args]


def vector_sums(graph: Graph, products: Mapping[Node, Node]) -> dict[Node, Sums]:
    """{sum: the sums that it is added up with}, as far as that pays.

    products: {sum or difference: its argument, a product that nothing else needs}, see `products_of`.
    """
    chains = _chains(graph, products)
    numbers = {node: number for number, node in enumerate(graph.nodes)}
    groups: dict[tuple[tuple[int, int], ...], list[Node]] = {}
    for root, chain in chains.items():
        if all(factor.args and factor not in chains for factor in chain.factors):
            groups.setdefault(chain.signs, []).append(root)
    found = [sums for group in groups.values() for sums in _side_by_side(group, chains, numbers)]
    multiplied = sum(len(sums.roots) * len(sums.terms) for sums in found)
    vectors = {side for sums in found for pair in sums.factors for side in pair}
    if multiplied < max(MANY, AGAIN * sum(map(len, vectors))):
        return {}
    result = {root: sums for sums in found for root in sums.roots}
    return result if _in_order(graph, result) else {}


def _chains(graph: Graph, products: Mapping[Node, Node]) -> dict[Node, _Chain]:
    """{part of a longer sum: the products that it is the sum of, and that nothing else needs}."""
    users = Counter([arg for node in graph.nodes for arg in node.args] + list(graph.outputs.values()))
    added = {
        arg for node in graph.nodes if node.op.name in ("add", "sub") and node not in products for arg in node.args
    }
    chains: dict[Node, _Chain] = {}
    for node in graph.nodes:
        if node in products:
            first = node.args[0] is products[node]
            rest, minus = node.args[first], node.op.name == "sub"
            sign = (-1 if minus and not first else 1, -1 if minus and first else 1)
            if users[rest] == 1 and rest in chains:
                terms, signs = chains.pop(rest)
                chains[node] = _Chain((*terms, products[node]), (*signs, sign))
            elif users[rest] == 1 and rest.op.name == "mul":
                chains[node] = _Chain((rest, products[node]), ((1, 1), sign))
    parts = [root for root in chains if root in added and users[root] == 1]
    return {root: chains[root] for root in parts if len(chains[root].terms) >= TERMS}


def _side_by_side(group: list[Node], chains: Mapping[Node, _Chain], numbers: Mapping[Node, int]) -> Iterator[Sums]:
    """Sums in lanes, by their last factors, so that others of these factors fit."""
    group = sorted(group, key=lambda root: [numbers[factor] for factor in chains[root].factors[:-5:-1]])
    for width in WIDTHS:
        while len(group) >= width:
            roots, group = tuple(group[:width]), group[width:]
            terms = zip(*[chains[root].terms for root in roots], strict=True)
            yield Sums(roots, tuple(terms), chains[roots[0]].signs)


def _in_order(graph: Graph, found: Mapping[Node, Sums]) -> bool:
    """Whether no sum needs another of its vector, nor one vector another that needs it."""
    needs: dict[Node | Sums, Iterable[Node | Sums]] = {node: node.args for node in graph.nodes}
    for root, sums in found.items():
        needs[root] = (sums,)
        needs[sums] = [node for pair in sums.factors for side in pair for node in side]
    try:
        TopologicalSorter(needs).prepare()
    except CycleError:
        return False
    return True


class Vectors:
    """Layout of factors and sums beside each other in the memory %w.

    slots: {node: its places}.  places: how many there are.
    """

    def __init__(self, sums: Mapping[Node, Sums]) -> None:
        self.slots: dict[Node, list[int]] = {}
        self.places = 0
        self._at: dict[tuple[Node, ...], int] = {}
        for each in dict.fromkeys(sums.values()):
            for nodes in (*[side for pair in each.factors for side in pair], each.roots):
                if nodes not in self._at:
                    self._at[nodes] = self.places
                    for lane, node in enumerate(nodes):
                        self.slots.setdefault(node, []).append(self.places + lane)
                    self.places += WIDTHS[0]

    def lines(self, sums: Sums, r: str) -> list[str]:
        """The instructions that add them up."""
        lanes = len(sums.roots)
        t, align = f"<{lanes} x double>", 8 * lanes
        lines, total = [], ""
        for k, (pair, (sign, before)) in enumerate(zip(sums.factors, sums.signs, strict=True)):
            a, b, term = f"{r}.a{k}", f"{r}.b{k}", f"{r}.sum{k}"
            for name, side in zip((a, b), pair, strict=True):
                lines.append(f"  {name}.at = getelementptr double, ptr %w, i64 {self._at[side]}")
                lines.append(f"  {name} = load {t}, ptr {name}.at, align {align}")
            if sign < 0:
                lines.append(f"  {a}.minus = fneg {t} {a}")
                a += ".minus"
            if before < 0:
                lines.append(f"  {term}.minus = fneg {t} {total}")
                total = f"{term}.minus"
            if total:
                lines.append(f"  {term} = call {t} @llvm.fmuladd.v{lanes}f64({t} {a}, {t} {b}, {t} {total})")
            else:
                lines.append(f"  {term} = fmul {t} {a}, {b}")
            total = term
        lines.append(f"  {r}.at = getelementptr double, ptr %w, i64 {self._at[sums.roots]}")
        return [*lines, f"  store {t} {total}, ptr {r}.at, align {align}"]

    def store(self, node: Node, r: str) -> list[str]:
        """The instructions that put a value beside others."""
        lines = []
        for slot in self.slots.get(node, ()):
            lines.append(f"  {r}.at{slot} = getelementptr double, ptr %w, i64 {slot}")
            lines.append(f"  store double {r}, ptr {r}.at{slot}, align 8")
        return lines
