"""Derivatives of If and While: those of the branch that is taken, and of the turns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...core.graph import Graph
from ...operations.table import where
from ...writing.naming import variables
from ..statement import Statement, effects, reads_and_writes
from ..statements.call import Map, added, copied, copied_or_zero, zeroed
from ..statements.control import If, While
from ..statements.memory import Pop, Push
from .adjoint import Adjoint, replayed
from .single_assignment import Assigned, Assignment, flat
from .tangent import Tangent

Body = tuple[Statement, ...]

# If


def assign_if(statement: If, assigned: Assigned) -> Assignment:
    """Assignment of both bodies from the same registers on; what one of them writes is copied at the end of both."""
    decides = assigned.now(statement.register)
    writes = list(dict.fromkeys([*effects(statement.body)[1], *effects(statement.otherwise)[1]]))
    before, parts, ends = dict(assigned.current), [], []
    for body in (statement.body, statement.otherwise):
        assigned.current = dict(before)
        parts.append(tuple([assigned.assignment(each) for each in body]))
        ends.append([assigned.now(name) for name in writes])
    assigned.current = before
    at = [assigned.write(name) for name in writes]
    after = tuple([dict(zip(at, end, strict=True)) for end in ends])
    return Assignment(If(decides, *_ways(parts, after)), parts=tuple(parts), after=after)


def _ways(parts: Sequence[Sequence[Assignment]], after: Sequence[Mapping[str, str]]) -> list[Body]:
    """The bodies, at the end of which what either writes is where it is read."""
    return [(*flat(part), *_turned(where)) for part, where in zip(parts, after, strict=True)]


def push_if(assignment: Assignment, tangent: Tangent) -> None:
    """The tangents of the branch that is taken."""
    inner = [tangent.inner() for _ in assignment.parts]
    for each, part in zip(inner, assignment.parts, strict=True):
        each.push(part)
    moved = {
        name: tangent.dot(name)
        for name in assignment.after[0]
        if name in tangent.active
        and any([where[name] in each.dots for each, where in zip(inner, assignment.after, strict=True)])
    }
    ways = [
        (*each.statements, *[copied_or_zero(each.dots.get(where[name]), dot) for name, dot in moved.items()])
        for each, where in zip(inner, assignment.after, strict=True)
    ]
    if moved:
        tangent.add(If(_decides(assignment), *ways))


def pull_if(assignment: Assignment, adjoint: Adjoint) -> None:
    """The cotangents of the branch that was taken."""
    seeds = {name: adjoint.bars[name] for name in assignment.after[0] if name in adjoint.bars}
    if not seeds:
        return
    inner = []
    for part, ends in zip(assignment.parts, assignment.after, strict=True):
        inner.append(adjoint.inner({ends[name]: bar for name, bar in seeds.items()}))
        inner[-1].pull(part)
    if any([each in adjoint.recording for part in assignment.parts for each in part]):
        ways = _ways([adjoint.forward(part) for part in assignment.parts], assignment.after)
        adjoint.recorded(assignment, If(_decides(assignment), *ways), ())
    written = {name for part in assignment.parts for name in _written(part)}
    outer = dict.fromkeys([name for each in inner for name in each.bars if name not in written])
    terms = {name: adjoint.bar(name) for name in outer if name in adjoint.active}
    ways = [
        (*each.statements, *[copied_or_zero(each.bars.get(name), bar) for name, bar in terms.items()]) for each in inner
    ]
    if terms:
        adjoint.add(If(_decides(assignment), *ways))
    for name, bar in terms.items():
        adjoint.collect(name, bar)


def _decides(assignment: Assignment) -> str:
    statement = assignment.statement
    assert isinstance(statement, While | If)
    return statement.register


def _written(part: Sequence[Assignment]) -> set[str]:
    return {name for each in part for name in reads_and_writes(each.statement)[1]}


# While


def assign_while(statement: While, assigned: Assigned) -> Assignment:
    """A turn from registers `at` on, to which its ends are copied: {at: the same after the turn}."""
    writes = list(effects(statement.body)[1])
    before = [assigned.now(name) for name in writes]
    at = [assigned.write(name) for name in writes]
    outside = dict(assigned.current)
    turn = tuple([assigned.assignment(each) for each in statement.body])
    after = dict(zip(at, [assigned.now(name) for name in writes], strict=True))
    assigned.current = outside
    copies = tuple([copied(source, name) for source, name in zip(before, at, strict=True)])
    loop = While(assigned.now(statement.register), (*flat(turn), *_turned(after)))
    return Assignment(loop, copies, parts=(turn,), after=(after,))


def _turned(after: Mapping[str, str]) -> list[Map]:
    return [copied(end, at) for at, end in after.items()]


def push_while(assignment: Assignment, tangent: Tangent) -> None:
    """The loop again, with the tangents of a turn after its values."""
    (turn,), (after,), loop = assignment.parts, assignment.after, assignment.statement
    assert isinstance(loop, While)
    before = dict(tangent.dots)
    dots = {name: tangent.dot(name) for name in after if name in tangent.active}
    tangent.add(*assignment.copies)
    for source, at in zip(assignment.sources, after, strict=True):
        if at in dots:
            tangent.add(copied_or_zero(before.get(source), dots[at]))
    inner = tangent.inner(values=True)
    inner.push(turn)
    ends = [copied_or_zero(inner.dots.get(after[at]), dot) for at, dot in dots.items()]
    tangent.add(replace(loop, body=(*inner.statements, *_turned(after), *ends)))


def pull_while(assignment: Assignment, adjoint: Adjoint) -> None:
    """The turns backwards: each reads what its forward run left on a stack.

    Cotangents of the registers that turns hand on go from turn to turn; those of others are summed over the turns.
    """
    (turn,), (after,), loop = assignment.parts, assignment.after, assignment.statement
    assert isinstance(loop, While)
    outer = {name: adjoint.bars[name] for name in after if name in adjoint.bars}
    if not outer:
        return
    bars = {name: adjoint.bar(name) for name in outer}
    while True:  # which of the registers that turns hand on have cotangents
        inner = adjoint.inner({after[name]: bar for name, bar in bars.items()})
        inner.pull(turn)
        more = [name for name in after if name in inner.bars and name not in bars and name in adjoint.active]
        if not more:
            break
        bars |= {name: adjoint.bar(name) for name in more}
    inside = {*_written(turn), *after}
    sums = {name: adjoint.bar(name) for name in inner.bars if name not in inside and name in adjoint.active}
    forward = adjoint.forward(turn)
    values = replayed(forward, effects(inner.statements)[0])
    record = (*[name for name in after if name in values.wanted], *values.tape)
    width = sum(adjoint.of(record))
    stack, turns, left = (
        adjoint.fresh(name, length) for name, length in (("stack", adjoint.turns * width), ("turns", 1), ("left", 1))
    )
    body = (*flat(forward), Push(stack, turns, record), *_turned(after))
    adjoint.recorded(assignment, replace(loop, body=body), (*assignment.copies, zeroed(turns)))
    adjoint.add(copied(turns, left))
    adjoint.add(*[copied_or_zero(outer.get(name), bar) for name, bar in bars.items()])
    adjoint.add(*[zeroed(total) for total in sums.values()])
    handed = {bar: inner.bars.get(name) for name, bar in bars.items()}
    both = [source for source in handed.values() if source is not None and source in handed]  # read after written
    beside = {source: adjoint.fresh("beside", adjoint.lengths[source]) for source in both}
    back = [added(total, inner.bars[name], total) for name, total in sums.items()]
    back += [copied(source, other) for source, other in beside.items()]
    back += [copied_or_zero(source and beside.get(source, source), bar) for bar, source in handed.items()]
    # x_bar_k = f_x^T x_bar_k+1 and e_bar += f_e^T x_bar_k+1, from the last turn back
    adjoint.add(While(left, (Pop(stack, left, record), *values.again, *inner.statements, *back)))
    ends = (*bars.values(), *sums.values(), adjoint.unsolved)  # NaN after turns that the stack had no room for
    adjoint.add(*[Map(_UNLESS_FULL, (end, turns), (end,)) for end in ends])
    for source, name in zip(assignment.sources, after, strict=True):
        if name in bars and source in adjoint.active:
            adjoint.collect(source, bars[name])
    for name, total in sums.items():
        adjoint.collect(name, total)


_BAR, _TURNS = variables("bar turns")
_UNLESS_FULL = Graph([_BAR, _TURNS], {"bar": where(_TURNS >= 0.0, _BAR, _TURNS)})
