"""Jets: the Taylor coefficients of a solution of xdot = f(x, t), order by order, as two graphs.

Coefficient k of a node is linear in coefficients k of its arguments, with coefficients 0 as factors, and in sums over
0 < j < k of products of earlier ones. So one graph computes all values at order 0, and one, the same for all k > 0, the
rest, from those sums, which run over many nodes at once. Of a product y = a b, y_k = a_0 b_k + b_0 a_k + sum a_j b_k-j;
of a quotient y b = a; a whole power is products; of any other operation ydot = sum over arguments of (dy/da) adot, by
the table's partials g: y_k = sum of g_0 a_k + 1/k sum j a_j g_k-j. The last only need g_0 .. g_k-1, so g may depend on
y itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, as_node, building, columns

from ..systems.arguments import TIME

ONE = cg.constant(1.0)


class Jets(NamedTuple):
    """The graphs, and how many numbers they hand on."""

    start: Graph  # (x, t, p) -> (rates m, zeros)
    order: Graph  # (rates before m, unit, k, zeros, sums) -> (x_k m, rates m, left, right)
    zeros: int
    sums: int


class NoSeriesError(ValueError):
    """An operation without a Taylor series in the equations."""


def jets(rate: Graph, m: int) -> Jets:
    """The graphs of a rate whose first m inputs are the states."""
    return _Jets(rate, m).graphs()


class _Jets:
    def __init__(self, rate: Graph, m: int) -> None:
        self.rate, self.build = rate, Builder()
        self.before = cg.variables([f"rate{i}" for i in range(m)])
        self.unit, self.k = cg.variables(["unit", "order"])
        self.of: dict[Node, Node | None] = {}  # {node: its coefficient k, None where it is constant}
        self.zeros: dict[Node, Node] = {}  # {node: the variable that holds its coefficient 0}
        self.sums: dict[tuple[Node, Node, bool], Node] = {}  # {(a, b, weighted): the sum of (j) a_j b_k-j}
        with building(self.build):
            states = [before * (self.unit / self.k) for before in self.before]
            for k, node in enumerate(rate.inputs):
                moving = states[k] if k < m else None
                if node.name == TIME:
                    moving = cg.where(cg.equal(self.k, 1.0), self.unit, 0.0)
                self.of[node] = moving
        self.states = states
        waiting = list(rate.outputs.values())
        with building(self.build):
            while waiting:
                self._reach(waiting.pop(), waiting)

    def graphs(self) -> Jets:
        """Both graphs."""
        zero = cg.constant(0.0)
        with building(self.build):
            left = [self._moving(a) * (self.k if weighted else ONE) for a, _, weighted in self.sums]
            right = [self._moving(b) for _, b, _ in self.sums]
            coefficients = [self.of[node] for node in self.rate.outputs.values()]
            rates = [zero if each is None else each for each in coefficients]
            wanted = [*self.states, *rates, *left, *right]
        inputs = [*self.before, self.unit, self.k, *self.zeros.values(), *self.sums.values()]
        order = Graph(inputs, {f"{k}": node for k, node in enumerate(wanted)})
        first = [*self.rate.outputs.values(), *self.zeros]
        start = Graph(self.rate.inputs, {f"{k}": node for k, node in enumerate(first)})
        return Jets(cg.simplify(start), order, len(self.zeros), len(self.sums))

    def _moving(self, node: Node) -> Node:
        coefficient = self.of[node]
        assert coefficient is not None
        return coefficient

    def zero(self, node: Node) -> Node:
        """Coefficient 0 of a node."""
        if node.value is not None:
            return node
        return self.zeros.setdefault(node, cg.variable(f"zero{len(self.zeros)}"))

    def sum(self, a: Node, b: Node, weighted: bool = False) -> Node:
        """The sum over 0 < j < k of a_j b_k-j, or of j a_j b_k-j."""
        if not weighted and (b, a, False) in self.sums:
            a, b = b, a
        return self.sums.setdefault((a, b, weighted), cg.variable(f"sum{len(self.sums)}"))

    def _reach(self, node: Node, waiting: list[Node]) -> Node | None:
        """Coefficient k of a node, after those of all that it is made from."""
        path = [node]
        while path:
            if missing := [arg for arg in path[-1].args if arg not in self.of]:
                path += missing
            elif (last := path.pop()) not in self.of:
                self.of[last] = self._coefficient(last, waiting)
        return self.of[node]

    def _coefficient(self, node: Node, waiting: list[Node]) -> Node | None:
        """Coefficient k of a node, those of its arguments being there; their partials are left to wait."""
        op, args = columns(node.op), node.args
        at = [self.of[arg] for arg in args]
        if all(each is None for each in at):
            return None
        if op.signs:
            terms = [each if sign > 0 else -each for sign, each in zip(op.signs, at, strict=True) if each is not None]
            return sum(terms[1:], terms[0])
        if op.name in ("mul", "zero_safe_mul"):
            return self._product(args, at)
        if op.name == "div":
            known = -self.zero(node) * at[1] - self.sum(args[1], node) if at[1] is not None else None
            above = at[0] if known is None else known if at[0] is None else at[0] + known
            assert above is not None
            return above * self.zero(1.0 / args[1])
        if op.name == "sqrt":
            assert at[0] is not None
            return (at[0] - self.sum(node, node)) * self.zero(0.5 / node)
        if op.name == "hypot":  # y y = a a + b b
            moving = [(arg, each) for arg, each in zip(args, at, strict=True) if each is not None]
            total = -0.5 * self.sum(node, node)
            for arg, each in moving:
                total = total + 0.5 * self.sum(arg, arg) + self.zero(arg) * each
            return total * self.zero(1.0 / node)
        if op.name == "pow" and op.rewrite is not None and at[1] is None:
            if args[1].value is not None and args[1].value.is_integer():
                return self._reach(op.rewrite(*args), waiting)  # products, whose coefficients a base of 0 has, too
            return self._power(node, at[0])
        self._refuse(node)
        return self._by_partials(node, at, waiting)

    def _product(self, args: Sequence[Node], at: Sequence[Node | None]) -> Node:
        terms = [self.zero(args[1 - i]) * each for i, each in enumerate(at) if each is not None]
        return terms[0] if len(terms) == 1 else terms[0] + terms[1] + self.sum(args[0], args[1])

    def _power(self, node: Node, at: Node | None) -> Node:
        """y = a^b with a constant b: ydot a = b y adot."""
        assert at is not None
        base, exponent = node.args[0], self.zero(node.args[1])
        inner = (exponent * self.sum(base, node, weighted=True) - self.sum(node, base, weighted=True)) / self.k
        return inner * self.zero(1.0 / base) + self.zero(node.args[1] * base ** (node.args[1] - 1.0)) * at

    def _refuse(self, node: Node) -> None:
        partials = [as_node(each).value for each in node.op.partials(node, *node.args)]
        if columns(node.op).piece is not None or node.op.name in JUMPS or all(value == 0.0 for value in partials):
            where = f", in what is tagged {', '.join(map(repr, sorted(node.tags)))}" if node.tags else ""
            raise NoSeriesError(
                f"method 'taylor' needs equations that are smooth, and {node.op.name} has no Taylor series"
                f"{where}: take another method, such as 'dop853'"
            )

    def _by_partials(self, node: Node, at: Sequence[Node | None], waiting: list[Node]) -> Node:
        terms: list[Node] = []
        for arg, each, partial in zip(node.args, at, map(as_node, node.op.partials(node, *node.args)), strict=True):
            if each is not None:
                terms.append(self.zero(partial) * each)
                if partial.value is None:
                    waiting.append(partial)
                    terms.append(self.sum(arg, partial, weighted=True) / self.k)
        return sum(terms[1:], terms[0])


JUMPS = ("floor", "ceil", "round", "fmod")
