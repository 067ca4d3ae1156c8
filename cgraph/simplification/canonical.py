"""Canonical sums: nodes as sums of products of atoms, where identities such as sin^2 + cos^2 = 1 hold by form.

An atom is a leaf, a function of canonical sums, or the cosine or sine of a base angle. Identities are rules: a power of
an atom, and the sum that stands for it. By sin^2 = 1 - cos^2, sinh^2 = cosh^2 - 1 and sqrt(x)^2 = x, and by the
addition theorems for sums and multiples of base angles, equal functions of this kind have equal sums. In a product of
two sums those without such atoms stay together: written out they would gain nothing and lose digits. A coefficient
counts as zero where it is no more than rounding of the terms that it came from.

`expand` writes a polynomial out as a sum of monomials, to be read term by term.
"""

import cmath
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

from ..core.checks import GraphError
from ..core.label import UNLABELLED, Label
from ..core.node import CONSTANT, Node
from ..core.row import Row
from ..core.traversal import topological
from ..operations.operation import OPS, columns
from ..util.explain_failure import explain_failure

COEFFICIENT_ROUNDING = 2.0**-48  # of the size of what a coefficient is summed from
MOST_TERMS, MOST_PRODUCTS, MOST_POWER, MOST_MULTIPLE = 64, 1024, 8, 4


class TooLongError(Exception):
    """A sum has more terms than are worth writing out."""


class Term(NamedTuple):
    """A coefficient, the sum of the sizes of what it came from, and what it means."""

    value: complex
    size: float
    label: Label = UNLABELLED


Powers = tuple[tuple[int, int], ...]  # (atom, power), in order of atoms
Angle = tuple[Powers, float]  # a product, and what it is multiplied by
Sum = dict[Powers, Term]
Rules = Mapping[int, tuple[int, Sum]]  # {atom: (power, what stands for this power of it)}
Monomial = tuple[tuple[str, int], ...]  # (name, power), sorted by name
Polynomial = dict[Monomial, float]  # coefficients; terms that cancel are gone


class Canonical:
    """Canonical sums of nodes, and the atoms that they are made of.

    made: {atom: its operation and arguments}; without an operation the node itself, and of a cosine or sine the sum
    that its angle is.  rules: those by which sums are canonical.  turns: cosines and sines by z = exp(i angle).
    angles: {z: base angle}.  written: angles whose cosine or sine stands in the graph.  expanded: whether every product
    of sums is written out.
    """

    def __init__(self, outputs: Sequence[Node], *, expanded: bool = False) -> None:
        self.expanded = expanded
        self.made: dict[int, tuple[Row | None, tuple[Node, ...] | Sum]] = {}
        self.rules: dict[int, tuple[int, Sum]] = {}
        self.turns: dict[int, tuple[int, Sum]] = {}
        self.angles: dict[int, Angle] = {}
        self.written: set[frozenset[Angle]] = set()
        self._atoms: dict[object, int] = {}
        self._leading: dict[int, complex] = {}
        self._sizes: dict[Powers, set[float]] = {}
        self._sums: dict[Node, Sum] = {}
        self._multiples = False  # whether one angle is a multiple of another, which may come later
        order = topological(outputs)
        for first in (True, False):
            for node in order if first or self._multiples else []:
                self._sums[node] = self._sum(node)

    def __getitem__(self, node: Node) -> Sum:
        return self._sums[node]

    def _sum(self, node: Node) -> Sum:
        if node.op is CONSTANT and cmath.isfinite(node.value or 0.0):
            return number(node.value or 0.0, node.label)
        try:
            result = self._operation(node, [self._sums[arg] for arg in node.args]) if node.args else None
        except TooLongError:
            result = None
        if result is None or len(result) > MOST_TERMS:
            return self._function(node)
        if not node.tags or node.op.name in ("add", "sub"):  # a sum may have the tags of all of its terms
            return result
        return {powers: x._replace(label=x.label.with_tags_of(node.label)) for powers, x in result.items()}

    def _operation(self, node: Node, args: list[Sum]) -> Sum | None:
        match node.op.name:
            case "add" | "sub" | "neg":
                return with_signs(columns(node.op).signs, args)
            case "mul":
                return self.product(*(args if min(map(len, args)) <= 1 else map(self._factor, node.args)))
            case "div":
                return self.product(self._factor(node.args[0]), self._inverse(node.args[1]))
            case "pow" if (p := node.args[1].value) is not None and abs(p) <= MOST_POWER and p == int(p):
                return self._power(node)
            case "sqrt":
                return self._ruled(self._function(node), args[0])
            case "sin" | "cos":
                return self._expanded(args[0])[node.op.name == "sin"]
            case "sinh" | "cosh":
                cosh, sinh = (self._function(node, OPS[name]) for name in ("cosh", "sinh"))
                self._ruled(sinh, added(self.product(cosh, cosh), number(-1.0)))
                return sinh if node.op.name == "sinh" else cosh
        return None

    def product(self, a: Sum, b: Sum) -> Sum:
        """a b. Raises TooLongError."""
        if len(a) * len(b) > MOST_PRODUCTS:
            raise TooLongError
        return replaced(multiplied(a, b), self.rules)

    def _ruled(self, a: Sum, square: Sum) -> Sum:
        """The atom a, its square from now on as this sum."""
        (((atom, _),),) = a
        self.rules.setdefault(atom, (2, square))
        return a

    def _factor(self, node: Node) -> Sum:
        """The sum of a node where identities are about it, or `expanded`; else one product."""
        a = self._sums[node]
        ruled = self.expanded or any([atom in self.rules or atom in self.turns for powers in a for atom, _ in powers])
        return a if ruled or len(a) <= 1 else self._one(node)

    def _one(self, node: Node) -> Sum:
        """A node as a coefficient times a product; a sum is one atom, that of every multiple of it."""
        a = self._sums[node]
        if len(a) <= 1:
            return a
        leading = a[min(a)].value
        atom = self._atom(("sum", key(scaled(a, 1.0 / leading))), None, (node,))
        factor = leading / self._leading.setdefault(atom, leading)
        return {((atom, 1),): Term(factor, abs(factor), node.label)}

    def _inverse(self, node: Node) -> Sum:
        for powers, term in self._one(node).items():
            if term.value and cmath.isfinite(inverse := 1.0 / term.value):
                return {tuple([(atom, -power) for atom, power in powers]): Term(inverse, abs(inverse), term.label)}
        raise TooLongError

    def _power(self, node: Node) -> Sum:
        base, power = node.args[0], int(node.args[1].value or 0.0)
        a = self._inverse(base) if power < 0 else self._factor(base)
        return reduce(self.product, [a] * abs(power), number(1.0))

    def _function(self, node: Node, op: Row | None = None) -> Sum:
        """An operation, or a leaf, as an atom."""
        op, leaf = op or node.op, not node.args
        known = node if leaf else (op.name, *[key(self._sums[arg]) for arg in node.args])
        atom = self._atom(known, None if leaf else op, (node,) if leaf else node.args)
        return single(atom, node.label)

    def _expanded(self, argument: Sum) -> tuple[Sum, Sum]:
        """(cos u, sin u) of a sum u of multiples of base angles, by the addition theorems."""
        self.written.add(frozenset([(powers, abs(term.value)) for powers, term in argument.items()]))
        turned = number(1.0), Sum()
        for powers, term in argument.items():
            size = abs(term.value)
            unit = self._unit(powers, size)
            cosine, sine = self._base((powers, unit), term.label)
            if term.value.real < 0.0:
                sine = scaled(sine, -1.0)
            for _ in range(round(size / unit)):
                turned = self._turned(turned, (cosine, sine))
            if max(map(len, turned)) > MOST_TERMS:
                raise TooLongError
        return turned

    def _unit(self, powers: Powers, size: float) -> float:
        """The smallest known multiple of a product that this one is a multiple of."""
        known = self._sizes.setdefault(powers, set())
        self._multiples |= bool(known) and size not in known
        known.add(size)
        for unit in sorted(known):
            ratio = size / unit
            if ratio <= MOST_MULTIPLE + 0.5 and abs(ratio - round(ratio)) <= COEFFICIENT_ROUNDING * ratio:
                return unit
        return size

    def _base(self, angle: Angle, label: Label) -> tuple[Sum, Sum]:
        """(cos a, sin a) of a base angle a, with their rules."""
        cos, sin = self.turning((angle,))
        cosine, sine = (single(atom, label) for atom in (cos, sin))
        if cos not in self.turns:
            z = self._atoms.setdefault(("turn", angle), len(self._atoms))
            self.angles[z] = angle
            self._ruled(sine, added(number(1.0), scaled(multiplied(cosine, cosine), -1.0)))
            self.turns[cos] = 1, {((z, 1),): Term(0.5, 0.5), ((z, -1),): Term(0.5, 0.5)}
            self.turns[sin] = 1, {((z, 1),): Term(-0.5j, 0.5), ((z, -1),): Term(0.5j, 0.5)}
        return cosine, sine

    def turning(self, angles: tuple[Angle, ...]) -> tuple[int, int]:
        """Atoms (cos u, sin u) of the sum u of angles."""
        u = {powers: Term(size, abs(size)) for powers, size in angles}
        return self._atom(("cos", angles), OPS["cos"], u), self._atom(("sin", angles), OPS["sin"], u)

    def _turned(self, a: tuple[Sum, Sum], b: tuple[Sum, Sum]) -> tuple[Sum, Sum]:
        """(cos, sin) of the sum of two angles, of theirs."""
        (cos_a, sin_a), (cos_b, sin_b) = a, b
        cosine = added(self.product(cos_a, cos_b), scaled(self.product(sin_a, sin_b), -1.0))
        return cosine, added(self.product(sin_a, cos_b), self.product(cos_a, sin_b))

    def _atom(self, known: object, op: Row | None, args: tuple[Node, ...] | Sum) -> int:
        atom = self._atoms.setdefault(known, len(self._atoms))
        self.made.setdefault(atom, (op, args))
        return atom


def number(value: float, label: Label = UNLABELLED) -> Sum:
    """The sum that is a number."""
    return {(): Term(value, abs(value), label)} if value else {}


def single(atom: int, label: Label = UNLABELLED) -> Sum:
    """The sum that is an atom."""
    return {((atom, 1),): Term(1.0, 1.0, label)}


def added(a: Sum, b: Sum) -> Sum:
    """a + b."""
    return without_zeros(collected([*a.items(), *b.items()]))


def with_signs(signs: Sequence[int], args: Sequence[Sum]) -> Sum:
    """The sum of arguments, each with its sign."""
    return reduce(added, [a if sign > 0 else scaled(a, -1.0) for sign, a in zip(signs, args, strict=True)])


def scaled(a: Sum, factor: complex) -> Sum:
    """factor a."""
    return {powers: Term(factor * x.value, abs(factor) * x.size, x.label) for powers, x in a.items()}


def multiplied(a: Sum, b: Sum) -> Sum:
    """a b, without any rule."""
    return collected(
        [
            (joined(left, right), Term(x.value * y.value, x.size * y.size, x.label.with_tags_of(y.label)))
            for left, x in a.items()
            for right, y in b.items()
        ]
    )


def replaced(a: Sum, rules: Rules) -> Sum:
    """The sum with powers of atoms replaced by these rules, as long as one is left."""
    while True:
        left, terms = False, list[tuple[Powers, Term]]()
        for powers, term in a.items():
            atom = next((atom for atom, power in powers if atom in rules and power >= rules[atom][0]), None)
            if atom is None:
                terms.append((powers, term))
            else:
                left, (power, form) = True, rules[atom]
                terms += multiplied({joined(powers, ((atom, -power),)): term}, form).items()
        if not left:
            return without_zeros(a)
        a = collected(terms)


def joined(left: Powers, right: Powers) -> Powers:
    """The product of two products."""
    powers = dict(left)
    for atom, power in right:
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted([(atom, power) for atom, power in powers.items() if power]))


def collected(terms: Iterable[tuple[Powers, Term]]) -> Sum:
    """The sum of terms; those that cancel stay, with their size."""
    result: Sum = {}
    for powers, term in terms:
        old = result.get(powers)
        if old is not None:
            term = Term(old.value + term.value, old.size + term.size, old.label.union(term.label))
        result[powers] = term
    return result


def without_zeros(a: Sum) -> Sum:
    """Sum without terms that are rounding alone."""
    return {powers: term for powers, term in a.items() if abs(term.value) > COEFFICIENT_ROUNDING * term.size}


def key(a: Sum) -> frozenset[tuple[Powers, complex]]:
    """Key that equal sums share."""
    return frozenset([(powers, term.value) for powers, term in a.items()])


@explain_failure
def expand(node: Node, atoms: Mapping[Node, str] | None = None) -> Polynomial:
    """The terms of a node that is built by +, -, * and whole powers from variables and constants.

    As {monomial: coefficient}, a monomial being ((name, power), ...) in order of names; terms that cancel are absent.
    atoms: {inner node: name}, nodes that are written as one symbol. Raises GraphError for any other operation.
    """
    order, atoms = topological([node]), atoms or {}
    symbols = {inner: atoms.get(inner, inner.name) for inner in order if inner in atoms or not inner.args}
    names = sorted({name for name in symbols.values() if name})
    sums: dict[Node, Sum] = {}
    for inner in order:
        name = symbols.get(inner)
        sums[inner] = single(names.index(name)) if name else _expanded(inner, [sums[arg] for arg in inner.args])
    return {
        tuple([(names[atom], power) for atom, power in powers]): term.value.real
        for powers, term in without_zeros(sums[node]).items()
    }


@explain_failure
def format_polynomial(terms: Polynomial) -> str:
    """A polynomial, see `expand`, as text, terms in order of degree and name; "0" without terms."""
    text = ""
    for monomial, coefficient in sorted(terms.items(), key=lambda item: (sum(p for _, p in item[0]), item[0])):
        factors = [name if power == 1 else f"{name}^{power}" for name, power in monomial]
        size = abs(coefficient)
        if size != 1.0 or not factors:
            factors.insert(0, f"{size:g}")
        sign = "-" if coefficient < 0 else "+"
        text += f" {sign} {'*'.join(factors)}" if text else ("-" if sign == "-" else "") + "*".join(factors)
    return text or "0"


def _expanded(node: Node, args: list[Sum]) -> Sum:
    if node.op is CONSTANT:
        return number(node.value or 0.0)
    match node.op.name:
        case "add" | "sub" | "neg":
            return with_signs(columns(node.op).signs, args)
        case "mul":
            return multiplied(*args)
        case "pow" if (power := node.args[1].value) is not None and power >= 0 and power == int(power):
            return reduce(multiplied, [args[0]] * int(power), number(1.0))
    raise GraphError(f"only sums, products and whole powers can be expanded, got {node.op.name}")
