"""Canonical sums: nodes as sums of products of atoms, where identities such as sin^2 + cos^2 = 1 hold by form.

An atom is a leaf, a function of canonical sums, or one of a pair (cosine, sine) of a base angle. Sines and cosines of
sums and multiples of base angles are expanded by the addition theorems, and a square sin^2, sinh^2 or sqrt^2 is
replaced by 1 - cos^2, cosh^2 - 1 or the radicand, so that equal functions of this kind have equal sums. In a product
of two sums those without such atoms stay together: written out they would gain nothing and lose digits. A coefficient
counts as zero where it is no more than rounding of the terms that it came from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..core.label import UNLABELLED, Label
from ..core.node import CONSTANT, Node
from ..core.row import Row
from ..core.traversal import topological
from ..operations.operation import OPS

Powers = tuple[tuple[int, int], ...]  # (atom, power), in order of atoms
Angle = tuple[Powers, float]  # a product, and what it is multiplied by
Key = frozenset[tuple[Powers, float]]
ROUNDING = 2.0**-48  # of the size of what a coefficient is summed from
MOST_TERMS, MOST_PRODUCTS, MOST_POWER, MOST_MULTIPLE = 64, 1024, 8, 4


class TooLongError(Exception):
    """A sum has more terms than are worth writing out."""


class Term(NamedTuple):
    """A coefficient, the sum of the sizes of what it came from, and what it means."""

    value: float
    size: float
    label: Label


Sum = dict[Powers, Term]


class Canonical:
    """Canonical sums of nodes, and the atoms that they are made of.

    made: the operation and arguments of an atom, where it is no sine or cosine of a base angle: None and one node for
    that node.  angles: {atom: (angle, whether it is the sine)}.  pairs: the atoms (cosine, sine) of each base angle.
    squares: {atom: the square of it}.  written: angles whose sine or cosine stands in the graph.
    """

    def __init__(self, outputs: Sequence[Node]) -> None:
        self.order = topological(outputs)
        self.made: dict[int, tuple[Row | None, tuple[Node, ...]]] = {}
        self.angles: dict[int, tuple[Angle, bool]] = {}
        self.pairs: dict[Angle, tuple[int, int]] = {}
        self.squares: dict[int, Sum] = {}
        self.written: set[frozenset[Angle]] = set()
        self._atoms: dict[object, int] = {}
        self._leading: dict[int, float] = {}
        self._units: dict[Powers, set[float]] = {}
        self._units_used: dict[Angle, float] = {}
        self._sums: dict[Node, Sum] = {}
        self._sum_all()
        if any([self._unit(*angle) != unit for angle, unit in self._units_used.items()]):
            self._sum_all()  # now that it is known which multiples of an angle there are

    def _sum_all(self) -> None:
        for node in self.order:
            self._sums[node] = self._sum(node)

    def __getitem__(self, node: Node) -> Sum:
        return self._sums[node]

    def _sum(self, node: Node) -> Sum:
        if node.op is CONSTANT:
            assert node.value is not None
            return number(node.value, node.label) if math.isfinite(node.value) else self._leaf(node)
        if not node.args:
            return self._leaf(node)
        args = [self._sums[arg] for arg in node.args]
        try:
            result = self._operation(node, args)
        except TooLongError:
            result = None
        if result is None or len(result) > MOST_TERMS:
            return self._function(node.op, node.args, node.label)
        return result

    def _operation(self, node: Node, args: list[Sum]) -> Sum | None:
        match node.op.name:
            case "add":
                return added(args[0], args[1], 1.0)
            case "sub":
                return added(args[0], args[1], -1.0)
            case "neg":
                return scaled(args[0], -1.0)
            case "mul":
                return self.product(*self._factors(node))
            case "div":
                above = args[0] if self._paired(args[0]) else self._factor(node.args[0])
                return self.product(above, self._inverse(node.args[1]))
            case "pow" if _small_whole(node.args[1].value):
                return self._power(node)
            case "sqrt":
                return self._root(node)
            case "sin" | "cos":
                return self._expanded(args[0])[node.op.name == "sin"]
            case "sinh" | "cosh":
                return self._hyperbolic(node)
        return None

    def product(self, a: Sum, b: Sum, *, squares: Mapping[int, Sum] | None = None) -> Sum:
        """a b, with these squares replaced, by default all. Raises TooLongError."""
        if len(a) * len(b) > MOST_PRODUCTS:
            raise TooLongError
        squares = self.squares if squares is None else squares
        result: Sum = {}
        for left, x in a.items():
            for right, y in b.items():
                powers = dict(left)
                for atom, power in right:
                    powers[atom] = powers.get(atom, 0) + power
                term = Term(x.value * y.value, x.size * y.size, x.label.with_tags_of(y.label))
                accumulate(result, self._reduced(powers, term, squares))
        return without_zeros(result)

    def _reduced(self, powers: dict[int, int], term: Term, squares: Mapping[int, Sum]) -> Sum:
        """One product with its squares replaced."""
        square = next((atom for atom, power in powers.items() if power >= 2 and atom in squares), None)
        if square is not None:
            powers = {**powers, square: powers[square] - 2}
        one = {tuple(sorted([(atom, power) for atom, power in powers.items() if power])): term}
        return one if square is None else self.product(one, squares[square], squares=squares)

    def _factors(self, node: Node) -> list[Sum]:
        """The arguments of a product, a sum as one atom where writing it out would gain nothing."""
        sums = [self._sums[arg] for arg in node.args]
        if min(map(len, sums)) <= 1:
            return sums
        return [a if self._paired(a) else self._factor(arg) for a, arg in zip(sums, node.args, strict=True)]

    def _paired(self, a: Sum) -> bool:
        """Whether a sum has an atom that identities are about."""
        return any([atom in self.squares or atom in self.angles for powers in a for atom, _ in powers])

    def _factor(self, node: Node) -> Sum:
        """A node as a coefficient times a product; a sum is one atom, that of every multiple of it."""
        a = self._sums[node]
        if len(a) <= 1:
            return a
        leading = a[min(a)].value
        atom = self._atom(("sum", key(scaled(a, 1.0 / leading))))
        self.made.setdefault(atom, (None, (node,)))
        factor = leading / self._leading.setdefault(atom, leading)
        return {((atom, 1),): Term(factor, abs(factor), node.label)}

    def _inverse(self, node: Node) -> Sum:
        a = self._factor(node)
        if not a:
            raise TooLongError
        ((powers, term),) = a.items()
        inverse = 1.0 / term.value
        if not math.isfinite(inverse):
            raise TooLongError
        return {tuple([(atom, -power) for atom, power in powers]): Term(inverse, abs(inverse), term.label)}

    def _power(self, node: Node) -> Sum:
        base, power = node.args[0], int(node.args[1].value or 0.0)
        a = self._inverse(base) if power < 0 else self._sums[base]
        if len(a) > 1 and not self._paired(a):
            a = self._factor(base)
        result = number(1.0)
        for _ in range(abs(power)):
            result = self.product(result, a)
        return result

    def _leaf(self, node: Node) -> Sum:
        atom = self._atom(node)
        self.made[atom] = (None, (node,))
        return {((atom, 1),): Term(1.0, 1.0, node.label)}

    def _function(self, op: Row, args: tuple[Node, ...], label: Label) -> Sum:
        atom = self._atom((op.name, *[key(self._sums[arg]) for arg in args]))
        self.made.setdefault(atom, (op, args))
        return {((atom, 1),): Term(1.0, 1.0, label)}

    def _root(self, node: Node) -> Sum:
        result = self._function(node.op, node.args, node.label)
        (((atom, _),),) = result
        self.squares.setdefault(atom, self._sums[node.args[0]])
        return result

    def _hyperbolic(self, node: Node) -> Sum:
        """cosh u or sinh u, with sinh^2 = cosh^2 - 1."""
        sums = [self._function(OPS[name], node.args, node.label) for name in ("cosh", "sinh")]
        (((atom, _),),) = sums[1]
        self.squares.setdefault(atom, added(self.product(sums[0], sums[0]), number(1.0), -1.0))
        return sums[node.op.name == "sinh"]

    def _expanded(self, argument: Sum) -> tuple[Sum, Sum]:
        """(cos u, sin u) of a sum u of multiples of base angles, by the addition theorems."""
        self.written.add(frozenset([(powers, abs(term.value)) for powers, term in argument.items()]))
        cosine, sine = number(1.0), Sum()
        for powers, term in argument.items():
            size = abs(term.value)
            self._units.setdefault(powers, set()).add(size)
            unit = self._units_used[powers, size] = self._unit(powers, size)
            c, s = self._multiple((powers, unit), round(size / unit), term.label)
            if term.value < 0.0:
                s = scaled(s, -1.0)
            cosine, sine = self._turned((cosine, sine), (c, s))
            if max(len(cosine), len(sine)) > MOST_TERMS:
                raise TooLongError
        return cosine, sine

    def _unit(self, powers: Powers, size: float) -> float:
        """The smallest of the sizes that this one is a multiple of."""
        for unit in sorted(self._units[powers]):
            ratio = size / unit
            if ratio <= MOST_MULTIPLE + 0.5 and abs(ratio - round(ratio)) <= ROUNDING * ratio:
                return unit
        return size

    def _multiple(self, angle: Angle, count: int, label: Label) -> tuple[Sum, Sum]:
        """(cos k a, sin k a) of a base angle a."""
        cosine, sine = self.pairs.setdefault(angle, (self._atom(("cosine", angle)), self._atom(("sine", angle))))
        self.angles |= {cosine: (angle, False), sine: (angle, True)}
        one: tuple[Sum, Sum] = {((cosine, 1),): Term(1.0, 1.0, label)}, {((sine, 1),): Term(1.0, 1.0, label)}
        self.squares.setdefault(sine, added(number(1.0), self.product(one[0], one[0]), -1.0))
        turned = one
        for _ in range(count - 1):
            turned = self._turned(turned, one)
        return turned

    def _turned(self, a: tuple[Sum, Sum], b: tuple[Sum, Sum]) -> tuple[Sum, Sum]:
        """(cos, sin) of the sum of two angles, of theirs."""
        (cos_a, sin_a), (cos_b, sin_b) = a, b
        cosine = added(self.product(cos_a, cos_b), self.product(sin_a, sin_b), -1.0)
        return cosine, added(self.product(sin_a, cos_b), self.product(cos_a, sin_b), 1.0)

    def _atom(self, what: object) -> int:
        return self._atoms.setdefault(what, len(self._atoms))


def number(value: float, label: Label = UNLABELLED) -> Sum:
    """The sum that is a number."""
    return {(): Term(value, abs(value), label)} if value else {}


def added(a: Sum, b: Sum, sign: float) -> Sum:
    """a + sign b."""
    result = dict(a)
    accumulate(result, scaled(b, sign))
    return without_zeros(result)


def scaled(a: Sum, factor: float) -> Sum:
    """factor a."""
    return {powers: Term(factor * x.value, abs(factor) * x.size, x.label) for powers, x in a.items()}


def accumulate(total: Sum, more: Mapping[Powers, Term]) -> None:
    """total += more; terms that cancel stay, with their size."""
    for powers, term in more.items():
        old = total.get(powers)
        if old is not None:
            term = Term(old.value + term.value, old.size + term.size, old.label.union(term.label))
        total[powers] = term


def without_zeros(a: Sum) -> Sum:
    """Without terms that are rounding alone."""
    return {powers: term for powers, term in a.items() if abs(term.value) > ROUNDING * term.size}


def key(a: Sum) -> Key:
    """What two equal sums share."""
    return frozenset([(powers, term.value) for powers, term in a.items()])


def _small_whole(value: float | None) -> bool:
    return value is not None and abs(value) <= MOST_POWER and value == int(value)
