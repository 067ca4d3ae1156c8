"""Expansion: a polynomial graph written out as a sum of monomials, to be read term by term."""

from __future__ import annotations

from collections.abc import Mapping

from ..core.checks import GraphError
from ..core.node import CONSTANT, Node
from ..core.traversal import topological
from ..util.explain_failure import explain_failure

Monomial = tuple[tuple[str, int], ...]  # (name, power), sorted by name
Polynomial = dict[Monomial, float]  # coefficients; terms that cancel are gone


@explain_failure
def expand(node: Node, atoms: Mapping[Node, str] | None = None) -> Polynomial:
    """The terms of a node that is built by +, -, * and whole powers from variables and constants.

    As {monomial: coefficient}, a monomial being ((name, power), ...) in order of names; terms that cancel are absent.
    atoms: {inner node: name}, nodes that are written as one symbol. Raises GraphError for any other operation.

    >>> import cgraph as cg
    >>> from cgraph.extend import expand
    >>> a, b = cg.variables("a b")
    >>> expand((a - b) * (a + b))
    {(('a', 2),): 1.0, (('b', 2),): -1.0}
    """
    atoms = atoms or {}
    value: dict[Node, Polynomial] = {}
    for inner in topological([node]):
        if inner in atoms:
            value[inner] = {((atoms[inner], 1),): 1.0}
        elif inner.op is CONSTANT:
            assert inner.value is not None
            value[inner] = {(): inner.value} if inner.value else {}
        elif not inner.args:
            value[inner] = {((str(inner.name), 1),): 1.0}
        else:
            value[inner] = _operation(inner, [value[arg] for arg in inner.args])
    return value[node]


@explain_failure
def format_polynomial(terms: Polynomial) -> str:
    """A polynomial, see `expand`, as text, terms in order of degree and name; "0" without terms.

    >>> import cgraph as cg
    >>> from cgraph.extend import expand, format_polynomial
    >>> a, b = cg.variables("a b")
    >>> format_polynomial(expand((a - b) ** 2))
    '-2*a*b + a^2 + b^2'
    """
    text = ""
    for monomial, coefficient in sorted(terms.items(), key=lambda item: (sum(p for _, p in item[0]), item[0])):
        factors = [name if power == 1 else f"{name}^{power}" for name, power in monomial]
        size = abs(coefficient)
        if size != 1.0 or not factors:
            factors.insert(0, f"{size:g}")
        sign = "-" if coefficient < 0 else "+"
        text += f" {sign} {'*'.join(factors)}" if text else ("-" if sign == "-" else "") + "*".join(factors)
    return text or "0"


def _operation(node: Node, args: list[Polynomial]) -> Polynomial:
    match node.op.name:
        case "add":
            return _sum(args[0], args[1], 1.0)
        case "sub":
            return _sum(args[0], args[1], -1.0)
        case "neg":
            return {monomial: -c for monomial, c in args[0].items()}
        case "mul":
            return _product(*args)
        case "pow" if (power := node.args[1].value) is not None and power >= 0 and power == int(power):
            result: Polynomial = {(): 1.0}
            for _ in range(int(power)):
                result = _product(result, args[0])
            return result
    raise GraphError(f"only sums, products and whole powers can be expanded, got {node.op.name}")


def _sum(a: Polynomial, b: Polynomial, sign: float) -> Polynomial:
    result = dict(a)
    for monomial, coefficient in b.items():
        total = result.pop(monomial, 0.0) + sign * coefficient
        if total:
            result[monomial] = total
    return result


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    result: Polynomial = {}
    for left, x in a.items():
        for right, y in b.items():
            powers = dict(left)
            for name, power in right:
                powers[name] = powers.get(name, 0) + power
            result = _sum(result, {tuple(sorted(powers.items())): x * y}, 1.0)
    return result
