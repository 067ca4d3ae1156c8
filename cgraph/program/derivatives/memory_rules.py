"""Derivatives of Take, Scatter, Push, Pop: numbers go where their values came from."""

from __future__ import annotations

from collections.abc import Iterable

from ...core.graph import Graph
from ...core.node import Node, constant
from ...writing.naming import variables
from ..statements.call import Call, copied, copied_or_zero, zeroed
from ..statements.memory import Pop, Push, Scatter, Take
from .adjoint import Adjoint
from .single_assignment import Assignment
from .tangent import Tangent


def push_take(assignment: Assignment, tangent: Tangent) -> None:
    """target_dot[i] = source_dot[table[i]]."""
    take = assignment.statement
    assert isinstance(take, Take)
    if take.source in tangent.dots and take.target in tangent.active:
        source = tangent.dots[take.source]
        tangent.add(Take(source, tangent.dot(take.target), take.table))


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


# What a Scatter does not write stays as it was, and so does its tangent; its cotangent goes on to before.


def push_scatter(assignment: Assignment, tangent: Tangent) -> None:
    """target_dot[places[i]] = source_dot[table[i]]."""
    scatter: Scatter = assignment.statement  # type: ignore[assignment]
    (before,) = assignment.sources
    if scatter.target in tangent.active and {scatter.source, before} & tangent.dots.keys():
        dot = tangent.dot(scatter.target)
        tangent.add(copied_or_zero(tangent.dots.get(before), dot))
        tangent.add(Scatter(tangent.dot_or_zero(scatter.source), dot, scatter.table, scatter.places))


def pull_scatter(assignment: Assignment, adjoint: Adjoint) -> None:
    """source_bar[table[i]] += target_bar[places[i]], the last of those with one place; there target_bar before is 0."""
    scatter: Scatter = assignment.statement  # type: ignore[assignment]
    (before,) = assignment.sources
    if scatter.target not in adjoint.bars:
        return
    if before in adjoint.active:
        bar, none = adjoint.bar(before), adjoint.fresh("none", 1)
        adjoint.add(copied(adjoint.bars[scatter.target], bar), zeroed(none))
        adjoint.add(Scatter(none, bar, (0,) * len(scatter.places), scatter.places))
        adjoint.collect(before, bar)
    if scatter.source in adjoint.active:
        last = dict(zip(scatter.places, scatter.table, strict=True))
        collect_taken(adjoint, scatter.source, scatter.target, last.items())


# The tangent of a stack is a stack of tangents with a count of its own, and what is put on one comes off the other.


def push_push(assignment: Assignment, tangent: Tangent) -> None:
    """The tangents of the row go onto the stack of tangents."""
    push = assignment.statement
    assert isinstance(push, Push)
    if push.stack not in tangent.active:
        return
    stack, count = assignment.sources[:2]
    dot, work = tangent.dot(push.stack), tangent.fresh("count", 1)
    tangent.add(copied_or_zero(tangent.dots.get(stack), dot))
    tangent.add(copied(count, work), Push(dot, work, tuple([tangent.dot_or_zero(name) for name in push.rows])))


def push_pop(assignment: Assignment, tangent: Tangent) -> None:
    """The tangents of the row come off the stack of tangents."""
    pop = assignment.statement
    assert isinstance(pop, Pop)
    if pop.stack not in tangent.dots:
        return
    work = tangent.fresh("count", 1)
    tangent.add(copied(assignment.sources[0], work))
    tangent.add(Pop(tangent.dots[pop.stack], work, tuple([tangent.dot(name) for name in pop.rows])))


def pull_push(assignment: Assignment, adjoint: Adjoint) -> None:
    """Cotangents of the row come off the stack of cotangents, whose row then is 0."""
    push = assignment.statement
    assert isinstance(push, Push)
    if push.stack not in adjoint.bars:
        return
    stack = assignment.sources[0]
    work, left = adjoint.bar(push.stack), adjoint.fresh("count", 1)
    bars = tuple([adjoint.bar(name) for name in push.rows])
    none = tuple([adjoint.bar(name) for name in push.rows])
    adjoint.add(copied(adjoint.bars[push.stack], work), copied(push.count, left), Pop(work, left, bars))
    adjoint.add(*[zeroed(name) for name in none], Push(work, left, none))
    adjoint.collect(stack, work)
    for name, bar in zip(push.rows, bars, strict=True):
        if name in adjoint.active:
            adjoint.collect(name, bar)


def pull_pop(assignment: Assignment, adjoint: Adjoint) -> None:
    """The cotangents of the row go onto a stack that is 0 elsewhere."""
    pop = assignment.statement
    assert isinstance(pop, Pop)
    if adjoint.seeded(pop.rows) and pop.stack in adjoint.active:
        bar, left = adjoint.bar(pop.stack), adjoint.fresh("count", 1)
        adjoint.add(zeroed(bar), copied(pop.count, left))
        adjoint.add(Push(bar, left, tuple([adjoint.bar_or_zero(name) for name in pop.rows])))
        adjoint.collect(pop.stack, bar)
