"""Expansion: a polynomial graph written out as a sum of monomials, to be read term by term."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce

from ..core.checks import GraphError
from ..core.node import CONSTANT, Node
from ..core.traversal import topological
from ..util.explain_failure import explain_failure
from .canonical import Sum, added, multiplied, number, scaled, single, without_zeros

Monomial = tuple[tuple[str, int], ...]  # (name, power), sorted by name
Polynomial = dict[Monomial, float]  # coefficients; terms that cancel are gone


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
        sums[inner] = single(names.index(name)) if name else _operation(inner, [sums[arg] for arg in inner.args])
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


def _operation(node: Node, args: list[Sum]) -> Sum:
    if node.op is CONSTANT:
        return number(node.value or 0.0)
    match node.op.name:
        case "add":
            return added(*args)
        case "sub":
            return added(args[0], scaled(args[1], -1.0))
        case "neg":
            return scaled(args[0], -1.0)
        case "mul":
            return multiplied(*args)
        case "pow" if (power := node.args[1].value) is not None and power >= 0 and power == int(power):
            return reduce(multiplied, [args[0]] * int(power), number(1.0))
    raise GraphError(f"only sums, products and whole powers can be expanded, got {node.op.name}")
