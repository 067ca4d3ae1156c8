"""Derivatives of Factor, Solve, Take, Scatter, Push, Pop: linear equations, and numbers that are moved about."""

from __future__ import annotations

from collections.abc import Iterable

from ...core.graph import Graph
from ...core.node import Node, constant
from ...writing.naming import variables
from ..statement import names_in, row_of, with_names
from ..statements.call import Call, copied, copied_or_zero
from ..statements.matrix import Factor, Solve
from ..statements.memory import Pop, Push, Scatter, Take
from .jvp import Assignment, Tangent
from .transpose import Adjoint

# The tangent, and the cotangent, of a factored matrix are those of the matrix A itself.


def push_factor(assignment: Assignment, tangent: Tangent) -> None:
    """The tangent of the factors is A_dot."""
    (before,), factor = assignment.sources, assignment.statement
    assert isinstance(factor, Factor)
    if before in tangent.dots and factor.matrix in tangent.active:
        tangent.dots[factor.matrix] = tangent.dots[before]


def pull_factor(assignment: Assignment, adjoint: Adjoint) -> None:
    """A_bar += the cotangent of the factors."""
    (before,), factor = assignment.sources, assignment.statement
    assert isinstance(factor, Factor)
    if factor.matrix in adjoint.bars and before in adjoint.active:
        adjoint.collect(before, adjoint.bars[factor.matrix])


def push_solve(assignment: Assignment, tangent: Tangent) -> None:
    """A x = b: A x_dot = b_dot - A_dot x, and with A^T for A the same."""
    (right,), solve = assignment.sources, assignment.statement
    assert isinstance(solve, Solve)
    matrix, side, n = tangent.dots.get(solve.matrix), tangent.dots.get(right), tangent.lengths[solve.vector]
    if matrix is None and side is None:
        return
    dot = tangent.dot(solve.vector)
    side = side or tangent.zero(right)
    if matrix is None:
        tangent.add(copied(side, dot))
    else:
        tangent.add(Call(_less_product(n, solve.transposed), (side, matrix, solve.vector), (dot,)))
    tangent.add(Solve(solve.matrix, solve.pivots, dot, solve.transposed))  # x_dot = A^-1 (b_dot - A_dot x)


def pull_solve(assignment: Assignment, adjoint: Adjoint) -> None:
    """x = A^-1 b: b_bar = A^-T x_bar, A_bar = -b_bar x^T; of A^T, A_bar = -x b_bar^T."""
    (right,), solve = assignment.sources, assignment.statement
    assert isinstance(solve, Solve)
    if solve.vector not in adjoint.bars:
        return
    bar, n = adjoint.bar(right), adjoint.lengths[solve.vector]
    adjoint.add(copied(adjoint.bars[solve.vector], bar))
    adjoint.add(Solve(solve.matrix, solve.pivots, bar, not solve.transposed))  # b_bar = A^-T x_bar
    if solve.matrix in adjoint.active:
        matrix = adjoint.bar(solve.matrix)
        sides = (solve.vector, bar) if solve.transposed else (bar, solve.vector)
        adjoint.add(Call(_outer(n), sides, (matrix,)))
        adjoint.collect(solve.matrix, matrix)
    if right in adjoint.active:
        adjoint.collect(right, bar)


def _less_product(n: int, transposed: bool) -> Graph:
    """b - A x, or b - A^T x."""
    b, x = (variables([f"{name}{k}" for k in range(n)]) for name in "bx")
    a = variables([f"a{k}" for k in range(n * n)])
    at = [[a[n * j + i] if transposed else a[n * i + j] for j in range(n)] for i in range(n)]
    rows = [sum([at[i][j] * x[j] for j in range(n)], constant(0.0)) for i in range(n)]
    return Graph([*b, *a, *x], {f"{i}": b[i] - row for i, row in enumerate(rows)})


def _outer(n: int) -> Graph:
    """-a b^T, row by row."""
    a, b = (variables([f"{name}{k}" for k in range(n)]) for name in "ab")
    return Graph([*a, *b], {f"{i}_{j}": -a[i] * b[j] for i in range(n) for j in range(n)})


# The tangent of a stack is a stack of tangents with a count of its own, and what is put on one comes off the other.
# What a Scatter does not write stays as it was, and so does its tangent; its cotangent goes on to before.

_MOVED = {Take: ("source", "target"), Scatter: ("source", "target"), Push: ("stack", "rows"), Pop: ("stack", "rows")}


def push_moved(assignment: Assignment, tangent: Tangent) -> None:
    """Tangents go where the numbers go: the same statement of them, with a count of its own."""
    statement = assignment.statement
    row, moved = row_of(statement), _MOVED[type(statement)]
    read = [field for field in moved if field not in row.writes]
    written = names_in(statement, [field for field in moved if field in row.writes])
    changed = names_in(statement, [field for field in row.writes if field in row.reads])
    before = dict(zip(changed, assignment.sources, strict=True))
    givers = {*names_in(statement, read), *[before[name] for name in written if name in before]}
    if givers.isdisjoint(tangent.dots) or tangent.active.isdisjoint(written):
        return
    moved_dots = with_names(statement, read, lambda name: tangent.dots.get(name) or tangent.zero(name))
    dots = {name: tangent.dot(name) for name in written}
    works = {name: dots.get(name) or tangent.fresh(name, tangent.lengths[name]) for name in changed}
    for name, work in works.items():
        old = before[name]
        tangent.add(copied_or_zero(tangent.dots.get(old), work) if name in dots else copied(old, work))
    tangent.add(with_names(moved_dots, row.writes, {**works, **dots}.__getitem__))


def pull_take(assignment: Assignment, adjoint: Adjoint) -> None:
    """source_bar[j] = the sum of target_bar[i] over all i with table[i] = j."""
    take = assignment.statement
    assert isinstance(take, Take)
    if take.target in adjoint.bars and take.source in adjoint.active:
        collect_taken(adjoint, take.source, take.target, enumerate(take.table))


def collect_taken(adjoint: Adjoint, source: str, target: str, moves: Iterable[tuple[int, int]]) -> None:
    """source_bar[j] += target_bar[i] for all (i, j) of the moves."""
    bars = variables([f"b{k}" for k in range(adjoint.lengths[target])])
    totals: dict[int, Node] = {}
    for i, j in moves:
        totals[j] = totals[j] + bars[i] if j in totals else bars[i]
    bar = adjoint.bar(source)
    graph = Graph(bars, {f"{j}": totals.get(j, constant(0.0)) for j in range(adjoint.lengths[source])})
    adjoint.add(Call(graph, (adjoint.bars[target],), (bar,)))
    adjoint.collect(source, bar)


def pull_scatter(assignment: Assignment, adjoint: Adjoint) -> None:
    """source_bar[table[i]] += target_bar[places[i]], the last of those with one place; there target_bar before is 0."""
    scatter: Scatter = assignment.statement  # type: ignore[assignment]
    (before,) = assignment.sources
    if scatter.target not in adjoint.bars:
        return
    if before in adjoint.active:
        bar, none = adjoint.bar(before), adjoint.zero(scatter.source)
        adjoint.add(copied(adjoint.bars[scatter.target], bar))
        adjoint.add(Scatter(none, bar, (0,) * len(scatter.places), scatter.places))
        adjoint.collect(before, bar)
    if scatter.source in adjoint.active:
        last = dict(zip(scatter.places, scatter.table, strict=True))
        collect_taken(adjoint, scatter.source, scatter.target, last.items())


def pull_push(assignment: Assignment, adjoint: Adjoint) -> None:
    """Cotangents of the row come off the stack of cotangents, whose row then is 0."""
    push = assignment.statement
    assert isinstance(push, Push)
    if push.stack not in adjoint.bars:
        return
    stack = assignment.sources[0]
    work, left = adjoint.bar(push.stack), adjoint.fresh("count", 1)
    bars, none = tuple([adjoint.bar(name) for name in push.rows]), tuple([adjoint.zero(name) for name in push.rows])
    adjoint.add(copied(adjoint.bars[push.stack], work), copied(push.count, left))
    adjoint.add(Pop(work, left, bars), Push(work, left, none))
    adjoint.collect(stack, work)
    for name, bar in zip(push.rows, bars, strict=True):
        if name in adjoint.active:
            adjoint.collect(name, bar)


def pull_pop(assignment: Assignment, adjoint: Adjoint) -> None:
    """The cotangents of the row go onto a stack that is 0 elsewhere."""
    pop = assignment.statement
    assert isinstance(pop, Pop)
    if not adjoint.bars.keys().isdisjoint(pop.rows) and pop.stack in adjoint.active:
        bar, left = adjoint.zero(pop.stack), adjoint.fresh("count", 1)
        rows = tuple([adjoint.bars.get(name) or adjoint.zero(name) for name in pop.rows])
        adjoint.add(copied(pop.count, left), Push(bar, left, rows))
        adjoint.collect(pop.stack, bar)
