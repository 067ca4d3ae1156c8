"""Tangent: forward mode over statements, from tangents of what they begin with to those of what they end with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Factor, Map, Solve, Statement, Sum, While

from ...integrators.elementwise import SAME
from .iteration import until_settled
from .products import Products
from .single_assignment import Assignment, fresh, reads_and_writes, require_no_shared


class Tangent:
    """The statements that push tangents on through assignments.

    dots: {register: the one that has its tangent}; the statements extend it.
    active: registers that matter.  lengths: of all registers; grows.
    """

    def __init__(self, dots: Mapping[str, str], active: Set[str], lengths: dict[str, int], products: Products) -> None:
        self.dots, self.active, self.lengths, self.products = dict(dots), active, lengths, products
        self.statements: list[Statement] = []

    def push(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the first first. Values are those of `assignments`, which come before."""
        for assignment in assignments:
            statement = assignment.statement
            match statement:
                case Call():
                    self._call(statement)
                case Map():
                    self._map(statement)
                case Sum():
                    self._sum(statement)
                case Factor():
                    self._copy(assignment.copies[0].inputs[0], statement.matrix)
                case Solve():
                    self._solve(statement, assignment.copies[0].inputs[0])
                case While():
                    self._iteration(assignment)
            for name in set(reads_and_writes(statement)[1]) - set(self.active):
                self.dots.pop(name, None)

    def _dot(self, register: str) -> str:
        dot = fresh(self.lengths, f"{register}_dot", self.lengths[register])
        self.dots[register] = dot
        return dot

    def _moving(self, inputs: Sequence[str]) -> tuple[int, ...]:
        return tuple([k for k, name in enumerate(inputs) if name in self.dots and self.lengths[name]])

    def _copy(self, before: str, after: str) -> None:
        if before in self.dots and after in self.active:
            self.dots[after] = self.dots[before]

    def _call(self, call: Call) -> None:
        moving = self._moving(call.inputs)
        if not moving or self.active.isdisjoint(call.outputs):
            return
        inputs, outputs = (tuple([self.lengths[name] for name in names]) for names in (call.inputs, call.outputs))
        product = self.products.pushed(call.graph, inputs, moving, outputs)
        if product.graph is None:
            return
        dots = [self.dots[call.inputs[k]] for k in moving]
        self.statements.append(
            Call(product.graph, (*call.inputs, *dots), tuple([self._dot(call.outputs[k]) for k in product.kept]))
        )

    def _elements(self, inputs: Sequence[str], graph: Graph) -> tuple[Graph | None, tuple[str, ...], tuple[int, ...]]:
        moving = self._moving(inputs)
        product = self.products.pushed(graph, (1,) * len(inputs), moving, (1,) * len(graph.outputs))
        return product.graph, (*inputs, *[self.dots[inputs[k]] for k in moving]), product.kept

    def _map(self, statement: Map) -> None:
        inputs = (*statement.shared, *statement.inputs)
        if self._moving(inputs) and not self.active.isdisjoint(statement.outputs):
            require_no_shared(statement)
            graph, inputs, kept = self._elements(statement.inputs, statement.graph)
            if graph is not None:
                self.statements.append(Map(graph, inputs, tuple([self._dot(statement.outputs[k]) for k in kept])))

    def _sum(self, statement: Sum) -> None:
        if self._moving(statement.inputs) and statement.output in self.active:
            graph, inputs, _ = self._elements(statement.inputs, statement.graph)
            if graph is not None:
                self.statements.append(Sum(graph, inputs, self._dot(statement.output)))

    def _solve(self, solve: Solve, right: str) -> None:
        """A x = b: A x_dot = b_dot - A_dot x."""
        matrix, n = self.dots.get(solve.matrix), self.lengths[solve.vector]
        if matrix is None and right not in self.dots:
            return
        side = self.dots.get(right)
        dot = self._dot(solve.vector)
        if side is None:
            side = fresh(self.lengths, f"{right}_dot", n)
            self.statements.append(Call(Graph([], {f"{k}": 0.0 for k in range(n)}), (), (side,)))
        if matrix is None:
            self.statements.append(Map(SAME, (side,), (dot,)))
        else:
            self.statements.append(Call(_less_product(n), (side, matrix, solve.vector), (dot,)))
        self.statements.append(Solve(solve.matrix, solve.pivots, dot))

    def _iteration(self, assignment: Assignment) -> None:
        """A fixed point V = T(V, e): V_dot = (dT/dV) V_dot + (dT/de) e_dot, iterated as V was."""
        after = assignment.after or {}
        moving: dict[str, str] = {}
        while True:  # which of the carried ones have tangents
            inner = Tangent({**self.dots, **moving}, self.active, self.lengths, self.products)
            inner.push(assignment.turn)
            more = [name for name in assignment.carried if after[name] in inner.dots and name not in moving]
            more = [name for name in more if name in self.active]
            if not more:
                break
            moving |= {name: fresh(self.lengths, f"{name}_dot", self.lengths[name]) for name in more}
        rows = [(dot, None, inner.dots.get(after[name])) for name, dot in moving.items()]
        self.statements += until_settled(rows, inner.statements, self.lengths)
        for name, end in after.items():
            if name in moving:
                self.dots[name] = moving[name]
            elif end in inner.dots:
                self.dots[name] = inner.dots[end]


def _less_product(n: int) -> Graph:
    """b - A x."""
    b, x = (cg.variables([f"{name}{k}" for k in range(n)]) for name in "bx")
    a = cg.variables([f"a{i}_{j}" for i in range(n) for j in range(n)])
    rows = [sum([a[n * i + j] * x[j] for j in range(n)], cg.constant(0.0)) for i in range(n)]
    return Graph([*b, *a, *x], {f"{i}": b[i] - row for i, row in enumerate(rows)})
