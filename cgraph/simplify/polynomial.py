"""Expansion: a polynomial graph written out as a sum of monomials, to be read term by term."""

from __future__ import annotations

from collections.abc import Mapping

from ..core.node import CONSTANT, Node
from ..core.traversal import topological
from ..errors import GraphError

Monomial = tuple[tuple[str, int], ...]  # (name, power), sorted by name
Polynomial = dict[Monomial, float]  # coefficients; terms that cancel are gone


def expand(node: Node, atoms: Mapping[Node, str] | None = None) -> Polynomial:
    """The terms of a node that is built by +, -, * and whole powers from variables, constants and `atoms`.

    atoms: {inner node: name} to be kept as a symbol of its own. Raises GraphError at any other operation.
    """
    atoms = atoms or {}
    value: dict[Node, Polynomial] = {}
    for each in topological([node]):
        if each in atoms:
            value[each] = {((atoms[each], 1),): 1.0}
        elif each.op is CONSTANT:
            assert each.value is not None
            value[each] = {(): each.value} if each.value else {}
        elif not each.args:
            value[each] = {((str(each.name), 1),): 1.0}
        else:
            value[each] = _operation(each, [value[arg] for arg in each.args])
    return value[node]


def format_polynomial(terms: Polynomial) -> str:
    """Text such as `I*qdd0 - 2*dt*k*qd0`, terms in order of degree and name."""
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
