"""Adjoint: reverse mode over statements, from cotangents of what they end with to those of what they begin with."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Factor, Map, Solve, Statement, Sum, While

from ...integrators.elementwise import SAME
from .iteration import ADDED, until_settled
from .products import Products
from .single_assignment import Assignment, fresh, require_no_shared


class Adjoint:
    """The statements that pull cotangents back through assignments.

    bars: {register: the one that has its cotangent}, of what comes after; the statements extend it.
    active: registers that matter.  lengths: of all registers; grows.
    kept: registers of cotangents that must stay as they are.
    """

    def __init__(
        self,
        bars: Mapping[str, str],
        active: Collection[str],
        lengths: dict[str, int],
        products: Products,
        kept: Iterable[str],
        outside: Adjoint | None = None,
    ) -> None:
        self.bars, self.active, self.lengths, self.products = dict(bars), active, lengths, products
        self.statements: list[Statement] = []
        self._kept = set(kept)
        self._before = outside.statements if outside else self.statements  # of an iteration, what comes before it
        # {factored matrix: the matrix, the factors of its transpose, their pivots}
        self._transposed: dict[str, tuple[str, str, str]] = outside._transposed if outside else {}

    def pull(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the last first."""
        for assignment in assignments:
            if isinstance(assignment.statement, Factor):
                matrix = assignment.statement.matrix
                self._transposed[matrix] = (assignment.copies[0].inputs[0], "", "")
        for assignment in reversed(assignments):
            statement = assignment.statement
            match statement:
                case Call():
                    self._call(statement)
                case Map():
                    self._map(statement)
                case Sum():
                    self._sum(statement)
                case Solve():
                    self._solve(statement, assignment.copies[0].inputs[0])
                case While():
                    self._iteration(assignment)

    def add(self, register: str, bar: str) -> None:
        """One more term of a register's cotangent."""
        if register not in self.bars:
            self.bars[register] = bar
            return
        before = self.bars[register]
        after = fresh(self.lengths, f"{register}_bar", self.lengths[bar]) if before in self._kept else before
        self.statements.append(Map(ADDED, (before, bar), (after,)))
        self.bars[register] = after

    def _bar(self, register: str, length: int | None = None) -> str:
        return fresh(self.lengths, f"{register}_bar", self.lengths[register] if length is None else length)

    def _seeded(self, outputs: Sequence[str]) -> tuple[int, ...]:
        return tuple([k for k, name in enumerate(outputs) if name in self.bars])

    def _wanted(self, inputs: Sequence[str]) -> tuple[int, ...]:
        return tuple([k for k, name in enumerate(inputs) if name in self.active and self.lengths[name]])

    def _call(self, call: Call) -> None:
        seeded, wanted = self._seeded(call.outputs), self._wanted(call.inputs)
        if not seeded or not wanted:
            return
        inputs, outputs = (tuple([self.lengths[name] for name in names]) for names in (call.inputs, call.outputs))
        product = self.products.pulled(call.graph, inputs, wanted, outputs, seeded)
        if product.graph is None:
            return
        bars = [self._bar(call.inputs[k]) for k in product.kept]
        values = call.outputs if product.with_outputs else ()
        seeds = [self.bars[call.outputs[k]] for k in seeded]
        self.statements.append(Call(product.graph, (*call.inputs, *values, *seeds), tuple(bars)))
        for k, bar in zip(product.kept, bars, strict=True):
            self.add(call.inputs[k], bar)

    def _map(self, statement: Map) -> None:
        seeded = self._seeded(statement.outputs)
        seeds = [self.bars[statement.outputs[k]] for k in seeded]
        if seeded:
            require_no_shared(statement)
        self._elements(statement, self.lengths[statement.outputs[0]], seeded, seeds)

    def _sum(self, statement: Sum) -> None:
        """Of the sum of g(x_i): x_i_bar = g'(x_i) y_bar."""
        seeded = self._seeded([statement.output])
        count = max([self.lengths[name] for name in statement.inputs], default=1)
        self._elements(statement, count, seeded, [self.bars[statement.output]] if seeded else [])

    def _elements(self, statement: Map | Sum, count: int, seeded: tuple[int, ...], seeds: Sequence[str]) -> None:
        wanted, inputs = self._wanted(statement.inputs), statement.inputs
        if not seeded or not wanted or not count:
            return
        ones = (1,) * len(inputs)
        product = self.products.pulled(statement.graph, ones, wanted, (1,) * len(statement.graph.outputs), seeded)
        graph = product.graph
        if graph is None:
            return
        for k, term in zip(product.kept, graph.outputs.values(), strict=True):
            name = inputs[k]
            alone = Graph(graph.inputs, {"bar": term})
            bar = self._bar(name)
            shared = self.lengths[name] != count  # one number for all elements
            made = Sum(alone, (*inputs, *seeds), bar) if shared else Map(alone, (*inputs, *seeds), (bar,))
            self.statements.append(made)
            self.add(name, bar)

    def _solve(self, solve: Solve, right: str) -> None:
        """x = A^-1 b: b_bar = A^-T x_bar, A_bar = -b_bar x^T."""
        if solve.vector not in self.bars:
            return
        before, factors, pivots = self._transposed[solve.matrix]
        n = self.lengths[solve.vector]
        if not factors:
            factors, pivots = self._bar(before), self._bar(solve.pivots)
            a = cg.variables([f"a{i}_{j}" for i in range(n) for j in range(n)])
            transposed = Graph(a, {f"{i}_{j}": a[j * n + i] for i in range(n) for j in range(n)})
            self._before += [Call(transposed, (before,), (factors,)), Factor(factors, pivots)]
            self._transposed[solve.matrix] = before, factors, pivots
        bar = self._bar(right)
        self.statements += [Map(SAME, (self.bars[solve.vector],), (bar,)), Solve(factors, pivots, bar)]
        if before in self.active:
            matrix = self._bar(before)
            self.statements.append(Call(_outer(n), (bar, solve.vector), (matrix,)))
            self.add(before, matrix)
        if right in self.active:
            self.add(right, bar)

    def _iteration(self, assignment: Assignment) -> None:
        """A fixed point V = T(V, e): u = V_bar + (dT/dV)^T u, iterated as V was; then e_bar = (dT/de)^T u."""
        after = assignment.after or {}
        outer = {name: self.bars[name] for name in after if name in self.bars}
        if not outer:
            return
        turning = {name: self._bar(name) for name in outer if name in assignment.carried}
        while True:  # which of the carried ones have cotangents
            seeds = {after[name]: turning.get(name, outer.get(name, "")) for name in (*outer, *turning)}
            inner = Adjoint(seeds, self.active, self.lengths, self.products, seeds.values(), self)
            inner.pull(assignment.turn)
            more = [name for name in assignment.carried if name in inner.bars and name not in turning]
            if not more:
                break
            turning |= {name: self._bar(name) for name in more}
        rows = [(bar, outer.get(name), inner.bars.get(name)) for name, bar in turning.items()]
        self.statements += until_settled(rows, inner.statements, self.lengths)
        for name, bar in inner.bars.items():
            if name not in after and name not in seeds and name in self.active:
                self.add(name, bar)


def _outer(n: int) -> Graph:
    """-a b^T, row by row."""
    a, b = (cg.variables([f"{name}{k}" for k in range(n)]) for name in "ab")
    return Graph([*a, *b], {f"{i}_{j}": -a[i] * b[j] for i in range(n) for j in range(n)})
