"""Identities: nodes written anew from their canonical sums, in the shorter of several forms, factors taken out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from ..core.builder import Builder
from ..core.label import WRITTEN, Label
from ..core.node import CONSTANT, Node, apply, constant
from ..core.scope import building
from ..core.traversal import topological
from ..util.explain_failure import explain_failure
from .canonical import COEFFICIENT_ROUNDING, Canonical, Powers, Sum, Term, added, number, replaced
from .rounding_growth import as_accurate

LARGEST_REWRITTEN = 250  # nodes; beyond, sums of products would be too long to be of use
NEW_ANGLE = 3  # operations that the cosine or sine of an angle counts as, where none of it stands in the graph

Product = tuple[Powers, Term]


@explain_failure
def shortened(nodes: Sequence[Node], below: int | None = None) -> list[Node]:
    """Nodes of the same values: written anew by identities where that is shorter and as accurate, else as they are.

    Together where that takes fewer nodes; else, of some, those that then depend on fewer variables.
    below: of how many nodes a result has to be less; nodes stay where it is not.
    """
    old = list(nodes)
    if len(topological(old)) > LARGEST_REWRITTEN:
        return old
    new = rewritten(old)
    pairs = list(zip(old, new, strict=True))
    if below is not None and len(topological(new)) >= below:
        return old
    if len(topological(new)) < len(topological(old)) and all(as_accurate(before, after) for before, after in pairs):
        return new
    return [
        after if leaves([after]) < leaves([before]) and as_accurate(before, after) else before
        for before, after in pairs
    ]


def rewritten(nodes: Sequence[Node]) -> list[Node]:
    """Nodes of the same values, written out as sums of products by identities, with common factors taken out.

    A node that is constant or zero by the rules of `canonical` comes out as a number. A node that would be too long
    stays as a function of its arguments. The result can be longer than what it came from.
    """
    canonical = Canonical(nodes)
    with building(Builder()) as set_label:
        writer = _Writer(canonical, set_label)
        return [writer.node(canonical[node]) for node in nodes]


class _Writer:
    """The nodes of canonical sums."""

    def __init__(self, canonical: Canonical, set_label: Callable[[Label], None]) -> None:
        self.canonical, self.set_label = canonical, set_label
        self._nodes: dict[int, Node] = {}

    def node(self, a: Sum) -> Node:
        """The node of a sum."""
        return self._sum(list(shortest(self.canonical, a).items()))

    def _sum(self, products: list[Product]) -> Node:
        """Products added up, the factor or number that most of them share taken out first."""
        uses: Counter[tuple[float, int]] = Counter()
        for powers, _ in products:
            uses.update([(atom, 1 if power > 0 else -1) for atom, power in powers])
        uses.update([(size, 0) for _, term in products if (size := abs(term.value)) != 1.0])
        (shared, sign), count = max(uses.items(), key=lambda item: item[1], default=((1.0, 0), 0))
        if count < 2:
            total = None
            for powers, term in sorted(products, key=lambda product: product[1].value.real < 0.0):
                node, negative = self._product(powers, term), term.value.real < 0.0
                if total is None:
                    total = -node if negative else node
                else:
                    self.set_label(WRITTEN)  # those to come have the tags of their arguments
                    total = total - node if negative else total + node
            return constant(0.0) if total is None else total
        inside, outside = [], []
        for powers, term in products:
            if sign == 0 and abs(term.value) == shared:
                inside.append((powers, term._replace(value=term.value / shared)))
            elif dict(powers).get(int(shared), 0) * sign > 0:
                left = [(atom, power - sign * (atom == shared)) for atom, power in powers]
                inside.append((tuple([each for each in left if each[1]]), term))
            else:
                outside.append((powers, term))
        node = self._times(self._sum(inside), shared, sign)
        return self._added(node, self._sum(outside)) if outside else node

    def _added(self, a: Node, b: Node) -> Node:
        """a + b, of a negative one the difference."""
        self.set_label(WRITTEN)
        if b.op.name == "neg":
            return a - b.args[0]
        return b - a.args[0] if a.op.name == "neg" else a + b

    def _times(self, node: Node, factor: float, sign: int) -> Node:
        """The node times a number, where the sign is 0, else times or over an atom."""
        self.set_label(WRITTEN)
        if sign == 0:
            return factor * node
        if node.op.name == "neg":
            return -self._times(node.args[0], factor, sign)
        return self._factor(int(factor)) * node if sign > 0 else node / self._factor(int(factor))

    def _product(self, powers: Powers, term: Term) -> Node:
        """A product without its sign."""
        self.set_label(WRITTEN.with_tags_of(term.label))
        value, node = abs(term.value), self._powers([each for each in powers if each[1] > 0])
        node = constant(value) if node is None else node if value == 1.0 else value * node
        for atom, power in powers:
            for _ in range(-power):
                node = node / self._factor(atom)
        return node

    def _powers(self, powers: Powers | list[tuple[int, int]]) -> Node | None:
        """The product of powers, squares as squares of a product."""
        squares = [(atom, power // 2) for atom, power in powers if power > 1]
        half = self._powers(squares) if squares else None
        node = None if half is None else half * half
        for atom, power in powers:
            if power % 2:
                node = self._factor(atom) if node is None else node * self._factor(atom)
        return node

    def _factor(self, atom: int) -> Node:
        if atom not in self._nodes:
            op, args = self.canonical.made[atom]
            nodes = [self.node(args)] if isinstance(args, dict) else [self._argument(arg) for arg in args]
            self._nodes[atom] = nodes[0] if op is None else apply(op, *nodes)
        return self._nodes[atom]

    def _argument(self, node: Node) -> Node:
        """An argument, as it stands unless it depends on less when it is written anew: sums may lose digits."""
        new = self.node(self.canonical[node]) if node.args else node
        return new if leaves([new]) < leaves([node]) else node


def shortest(canonical: Canonical, a: Sum, new_angle: int = NEW_ANGLE) -> Sum:
    """The sum with what it has of sines and cosines in the shortest form, beside each product of other atoms.

    new_angle: operations that the cosine or sine of an angle counts as, where none of it stands in the graph.
    """
    groups: dict[Powers, Sum] = {}
    for powers, term in a.items():
        plain = tuple([each for each in powers if each[0] not in canonical.turns])
        turning = tuple([each for each in powers if each[0] in canonical.turns])
        groups.setdefault(plain, {})[turning] = term
    return {
        plain + turning: term
        for plain, part in groups.items()
        for turning, term in _shortest(canonical, part, new_angle).items()
    }


def _shortest(canonical: Canonical, a: Sum, new_angle: int) -> Sum:
    """The shortest form of a polynomial in sines and cosines: with cos^2 or sin^2, or of sums of angles."""
    best = a
    for angle in canonical.angles.values():  # cos^2 = 1 - sin^2 where that is shorter
        cosine, sine = canonical.turning((angle,))
        square = added(number(1.0), {((sine, 2),): Term(-1.0, 1.0)})
        best = min(best, replaced(best, {cosine: (2, square)}), key=_length)
    waves = _fourier(canonical, a)
    arguments = [canonical.made[atom][1] for powers in waves for atom, _ in powers]
    angles = {frozenset([(powers, x.value) for powers, x in u.items()]) for u in arguments if isinstance(u, dict)}
    return waves if _length(waves) + new_angle * len(angles - canonical.written) < _length(best) else best


def _fourier(canonical: Canonical, a: Sum) -> Sum:
    """Sum of sines and cosines of sums of angles; a polynomial with negative powers as it is."""
    if any([power < 0 for powers in a for _, power in powers]):
        return a
    result: Sum = {}
    for wave, term in replaced(a, canonical.turns).items():  # of exp(i sum k angle)
        angles = sorted([(canonical.angles[z], k) for z, k in wave])
        if not angles:
            result[()] = term._replace(value=term.value.real)
        elif angles[0][1] > 0:  # the others are their conjugates
            atoms = canonical.turning(tuple([(powers, k * unit) for (powers, unit), k in angles]))
            for atom, part in zip(atoms, (term.value.real, -term.value.imag), strict=True):
                if abs(part) > COEFFICIENT_ROUNDING * term.size:
                    result[((atom, 1),)] = Term(2.0 * part, term.size, term.label)
    return result


def leaves(nodes: Sequence[Node]) -> set[Node]:
    """The variables that nodes depend on."""
    return {node for node in topological(nodes) if not node.args and node.op is not CONSTANT}


def _length(a: Sum) -> int:
    return sum([1 + sum([abs(power) for _, power in powers]) for powers in a])
