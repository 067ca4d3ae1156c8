"""Derivatives of If, While, FixedPoint: of the branch taken, of the turns, and of the equations that turns solve."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...core.graph import Graph
from ...operations.table import maximum, where
from ...writing.naming import variables
from ..statement import Statement, bodies_of, effects, reads_and_writes, row_of, with_names
from ..statements.call import Call, Map, Sum, added, copied, copied_or_zero, zeroed
from ..statements.control import FixedPoint, If, While
from ..statements.memory import Pop, Push
from .jvp import Assignment, Passes, Registers, Tangent, statements_of
from .transpose import Adjoint, recovery

MOST_TURNS = 200.0
STALLS = 3.0  # turns whose change is no smaller than before: the rest is rounding


def _handed_on(after: Mapping[str, str]) -> list[Map]:
    """The ends of a body copied to where they are read."""
    return [copied(end, at) for at, end in after.items()]


# If: both bodies go from the same registers on; what one of them writes is copied at the end of both


def assign_if(statement: If, passes: Passes) -> Assignment:
    """Assignment of both bodies."""
    decides, before, parts, ends = passes.now(statement.register), dict(passes.current), [], []
    writes = list(dict.fromkeys([*effects(statement.body)[1], *effects(statement.otherwise)[1]]))
    for body in (statement.body, statement.otherwise):
        passes.current = dict(before)
        parts.append(tuple([passes.assignment(each) for each in body]))
        ends.append([passes.now(name) for name in writes])
    passes.current = before
    at = [passes.write(name) for name in writes]
    after = tuple([dict(zip(at, end, strict=True)) for end in ends])
    ways = [(*statements_of(part), *_handed_on(where)) for part, where in zip(parts, after, strict=True)]
    return Assignment(If(decides, *ways), parts=tuple(parts), after=after)


def push_if(assignment: Assignment, tangent: Tangent) -> None:
    """The tangents of the branch that is taken."""
    inner = [tangent.inner({}) for _ in assignment.parts]
    for each, part in zip(inner, assignment.parts, strict=True):
        each.push(part)
    ways = list(zip(inner, assignment.after, strict=True))
    found = [{name: each.dots[end] for name, end in after.items() if end in each.dots} for each, after in ways]
    names = [name for name in assignment.after[0] if name in tangent.active and any([name in of for of in found])]
    _add_if(assignment, tangent, inner, found, {name: tangent.dot(name) for name in names})


def pull_if(assignment: Assignment, adjoint: Adjoint) -> None:
    """The cotangents of the branch that was taken."""
    seeds = {name: adjoint.bars[name] for name in assignment.after[0] if name in adjoint.bars}
    if not seeds:
        return
    inner = [adjoint.inner({after[name]: bar for name, bar in seeds.items()}) for after in assignment.after]
    for each, part in zip(inner, assignment.parts, strict=True):
        each.pull(part)
    names = dict.fromkeys([name for each in inner for name in each.bars if name in adjoint.active])
    terms = {name: adjoint.bar(name) for name in names if name not in _written(assignment)}
    _add_if(assignment, adjoint, inner, [each.bars for each in inner], terms)
    for name, bar in terms.items():
        adjoint.collect(name, bar)


def _add_if(
    assignment: Assignment,
    to: Registers,
    inner: Sequence[Registers],
    found: Sequence[Mapping[str, str]],
    ends: Mapping[str, str],
) -> None:
    """Add both branches, at whose ends what each has `found` for a register is in that of `ends`, or else 0."""
    statement: If = assignment.statement  # type: ignore[assignment]
    ways = [
        (*each.statements, *[copied_or_zero(of.get(name), end) for name, end in ends.items()])
        for each, of in zip(inner, found, strict=True)
    ]
    if ends:
        to.add(If(statement.register, *ways))


def _written(assignment: Assignment) -> set[str]:
    """What bodies write inside."""
    return {name for part in assignment.parts for each in part for name in reads_and_writes(each.statement)[1]}


# While: a turn goes from registers `at` on, to which its ends are copied, {at: the same after the turn}


def _turn(body: Sequence[Statement], passes: Passes) -> tuple[dict[str, str], tuple[Assignment, ...], dict[str, str]]:
    """{register that a body writes: `at`}, its assignments from these on, and {at: the same after the turn}."""
    at = {name: passes.write(name) for name in effects(body)[1]}
    outside = dict(passes.current)
    turn = tuple([passes.assignment(each) for each in body])
    after = {place: passes.now(name) for name, place in at.items()}
    passes.current = outside
    return at, turn, after


def assign_while(statement: While, passes: Passes) -> Assignment:
    """Assignment of a turn, which begins with the record of `at` on a stack where there is a way back."""
    before = dict(passes.current)
    at, turn, after = _turn(statement.body, passes)
    copies = [copied(before.get(name, name), place) for name, place in at.items()]
    body: list[Statement] = [*statements_of(turn), *_handed_on(after)]
    if passes.turns:
        width = sum([passes.lengths[name] for name in after])
        stack, turns = passes.fresh("stack", passes.turns * width), passes.fresh("turns", 1)
        copies.append(zeroed(turns))
        body.insert(0, Push(stack, turns, tuple(after)))
    return Assignment(While(passes.now(statement.register), tuple(body)), tuple(copies), (turn,), (after,))


def push_while(assignment: Assignment, tangent: Tangent) -> None:
    """The loop again, with the tangents of a turn after its values."""
    (turn,), (after,), loop = assignment.parts, assignment.after, assignment.statement
    before = dict(tangent.dots)
    dots = {name: tangent.dot(name) for name in after if name in tangent.active}
    tangent.add(*assignment.copies)
    for source, at in zip(assignment.sources, after, strict=False):  # the last may be of the stack
        if at in dots:
            tangent.add(copied_or_zero(before.get(source), dots[at]))
    inner = tangent.inner({}, values=True)
    inner.push(turn)
    ends = [copied_or_zero(inner.dots.get(after[at]), dot) for at, dot in dots.items()]
    tangent.add(replace(loop, body=(*inner.statements, *_handed_on(after), *ends)))  # type: ignore[type-var]


def pull_while(assignment: Assignment, adjoint: Adjoint) -> None:
    """The turns backwards: each begins with what its forward run left on the stack, and is made again.

    Cotangents of the registers that turns hand on go from turn to turn; those of others are summed over the turns.
    """
    (turn,), (after,), loop = assignment.parts, assignment.after, assignment.statement
    outer = {name: adjoint.bars[name] for name in after if name in adjoint.bars}
    if not outer:
        return
    bars = {name: adjoint.bar(name) for name in after if name in adjoint.active}
    inner = adjoint.inner({after[name]: bar for name, bar in bars.items()})
    inner.pull(turn)
    inside = {*_written(assignment), *after}
    sums = {name: adjoint.bar(name) for name in inner.bars if name not in inside and name in adjoint.active}
    push: Push = bodies_of(loop)[0][0]  # type: ignore[assignment]
    left = adjoint.fresh("left", 1)
    adjoint.add(copied(push.count, left), *[copied_or_zero(outer.get(name), bar) for name, bar in bars.items()])
    adjoint.add(*[zeroed(total) for total in sums.values()])
    back = [added(total, inner.bars[name], total) for name, total in sums.items()]
    moved = {name: adjoint.bar(name) for name in bars}  # all are read before any is written
    back += [copied_or_zero(inner.bars.get(name), bar) for name, bar in moved.items()]
    back += [copied(bar, bars[name]) for name, bar in moved.items()]
    # x_bar_k = f_x^T x_bar_k+1 and e_bar += f_e^T x_bar_k+1, from the last turn back
    again = recovery(turn, effects(inner.statements)[0], light=False)[0]
    adjoint.add(While(left, (Pop(push.stack, left, push.rows), *again, *inner.statements, *back)))
    ends = (*bars.values(), *sums.values(), adjoint.unsolved)  # NaN after turns that the stack had no room for
    adjoint.add(*[Map(_UNLESS_FULL, (end, push.count), (end,)) for end in ends])
    for source, name in zip(assignment.sources, after, strict=False):
        if name in bars and source in adjoint.active:
            adjoint.collect(source, bars[name])
    for name, total in sums.items():
        adjoint.collect(name, total)


_BAR, _TURNS = variables("bar turns")
_UNLESS_FULL = Graph([_BAR, _TURNS], {"bar": where(_TURNS >= 0.0, _BAR, _TURNS)})

# FixedPoint: linear equations, solved by the iteration itself


def assign_fixed_point(statement: FixedPoint, passes: Passes) -> Assignment:
    """The iteration in registers of its own, and one more turn from where it ends, in single assignment."""
    if bad := [each for each in statement.body if bodies_of(each)]:
        raise TypeError(f"a FixedPoint with a {type(bad[0]).__name__} in its turns has no derivatives")
    before, first = dict(passes.current), (*effects(statement.body)[0], statement.register)
    at, turn, after = _turn(statement.body, passes)
    carried = [name for name in dict.fromkeys(first) if name in at]
    copies = tuple([copied(before.get(name, name), at[name]) for name in carried])
    rows = [(each, row_of(each)) for each in statement.body]
    body = tuple([with_names(each, dict.fromkeys((*row.reads, *row.writes)), passes.now) for each, row in rows])
    loop = FixedPoint(passes.now(statement.register), body)
    return Assignment(loop, copies, (turn,), (after,), tuple([at[name] for name in carried]))


def push_fixed_point(assignment: Assignment, tangent: Tangent) -> None:
    """v_dot = (dT/dv) v_dot + (dT/de) e_dot, iterated as v was."""
    (turn,), (after,) = assignment.parts, assignment.after
    carried = [name for name in assignment.carried if name in tangent.active]
    moving = {name: tangent.fresh(f"{name}_dot", tangent.lengths[name]) for name in carried}
    inner = tangent.inner(moving)
    inner.push(turn)
    if tangent.values:
        tangent.add(*statements_of(turn))
    rows = [(dot, None, inner.dots.get(after[name])) for name, dot in moving.items()]
    _add_settled(rows, inner.statements, tangent)
    tangent.dots |= {name: inner.dots[end] for name, end in after.items() if end in inner.dots} | moving


def pull_fixed_point(assignment: Assignment, adjoint: Adjoint) -> None:
    """u = v_bar + (dT/dv)^T u, iterated as v was; then e_bar = (dT/de)^T u."""
    (turn,), (after,) = assignment.parts, assignment.after
    outer = {name: adjoint.bars[name] for name in after if name in adjoint.bars}
    if not outer:
        return
    turning = {name: adjoint.bar(name) for name in assignment.carried if name in adjoint.active}
    inner = adjoint.inner({after[name]: bar for name, bar in {**outer, **turning}.items()})
    inner.pull(turn)
    rows = [(bar, outer.get(name), inner.bars.get(name)) for name, bar in turning.items()]
    _add_settled(rows, inner.statements, adjoint)
    for name, bar in inner.bars.items():
        if name not in after and name not in after.values() and name in adjoint.active:
            adjoint.collect(name, bar)


def _add_settled(
    rows: Sequence[tuple[str, str | None, str | None]], turn: Sequence[Statement], registers: Registers
) -> None:
    """Add u = v + A u for all rows (u, v, the result of A u that a turn leaves), to rounding; None is zero.

    Changes of registers are measured by their sizes, so that units do not matter.
    """
    going, turns, stalled, old, total, change, size = [
        registers.fresh(name, 1) for name in ("going", "turns", "stalled", "change_old", "change", "d", "s")
    ]
    body: list[Statement] = [*turn, Call(Graph([], {"zero": 0.0}), (), (total,))]
    registers.add(*[copied_or_zero(v, u) for u, v, _ in rows])
    for u, v, result in rows:
        if result is not None:
            new = registers.fresh("new", registers.lengths[u])
            body.append(copied(result, new) if v is None else added(v, result, new))  # u_new = v + A u
            body += [Sum(_SQUARED_CHANGE, (new, u), (change,)), Sum(_SQUARE, (new,), (size,)), copied(new, u)]
            body.append(Call(_SHARE, (total, change, size), (total,)))  # sum of |u_new - u|^2 / |u_new|^2
    state = (old, turns, stalled, registers.unsolved)
    body.append(Call(_JUDGED, (total, *state), (going, *state)))
    registers.add(Call(_BEGUN, (), (going, turns, stalled, old)), While(going, tuple(body)), *turn)


_A, _B = variables("a b")
_SQUARED_CHANGE = Graph([_A, _B], {"square": (_A - _B) * (_A - _B)})
_SQUARE = Graph([_A], {"square": _A * _A})
_TOTAL, _CHANGE, _SIZE = variables("total change size")
_SHARE = Graph([_TOTAL, _CHANGE, _SIZE], {"total": _TOTAL + where(_SIZE, _CHANGE / _SIZE, 0.0)})
_BEGUN = Graph([], {"going": 1.0, "turns": 0.0, "stalled": 0.0, "old": math.inf})


def _judge() -> Graph:
    change, old, turns, stalled, unsolved = inputs = variables("change old turns stalled unsolved")
    stalls = stalled + (1.0 - (change < old))
    most = turns + 1.0 >= MOST_TURNS
    going = (stalls < STALLS) * (change > 0.0) * (1.0 - most)
    lost = 1.0 - (change < math.inf)
    unsolved = unsolved + maximum(lost, most * (stalls < STALLS))
    outputs = {"going": going, "old": change, "turns": turns + 1.0, "stalled": stalls, "unsolved": unsolved}
    return Graph(inputs, outputs)


_JUDGED = _judge()
