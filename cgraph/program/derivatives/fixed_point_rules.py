"""Derivatives of FixedPoint: linear equations, solved by the iteration itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...core.graph import Graph
from ...operations.table import maximum, where
from ...writing.naming import variables
from ..statement import Statement, effects
from ..statements.call import Call, Sum, added, copied, copied_or_zero
from ..statements.control import FixedPoint, While
from .adjoint import Adjoint
from .single_assignment import Assigned, Assignment, Registers, flat
from .tangent import Tangent

MOST_TURNS = 200.0
STALLS = 3.0  # turns whose change is no smaller than before: the rest is rounding


def assign_fixed_point(statement: FixedPoint, assigned: Assigned) -> Assignment:
    """The iteration in registers of its own, and one more turn from where it ends, in single assignment."""
    reads, writes = effects(statement.body)
    carried = [name for name in dict.fromkeys((*reads, statement.register)) if name in writes]
    before = [assigned.now(name) for name in carried]
    at = {name: assigned.write(name) for name in writes}
    copies = tuple([copied(source, at[name]) for source, name in zip(before, carried, strict=True)])
    body = tuple([assigned.in_place(each) for each in statement.body])
    outside = dict(assigned.current)
    turn = tuple([assigned.assignment(each) for each in statement.body])
    after = {at[name]: assigned.now(name) for name in writes}
    assigned.current = outside
    loop = FixedPoint(assigned.now(statement.register), body)
    carried_on = tuple([at[name] for name in carried])
    return Assignment(loop, copies, parts=(turn,), after=(after,), carried=carried_on)


def push_fixed_point(assignment: Assignment, tangent: Tangent) -> None:
    """v_dot = (dT/dv) v_dot + (dT/de) e_dot, iterated as v was."""
    (turn,), (after,) = assignment.parts, assignment.after
    moving: dict[str, str] = {}
    while True:  # which of the registers that turns hand on have tangents
        inner = tangent.inner(moving)
        inner.push(turn)
        more = [name for name in assignment.carried if after[name] in inner.dots and name not in moving]
        more = [name for name in more if name in tangent.active]
        if not more:
            break
        moving |= {name: tangent.fresh(f"{name}_dot", tangent.lengths[name]) for name in more}
    if tangent.values:
        tangent.add(*flat(turn))
    rows = [(dot, None, inner.dots.get(after[name])) for name, dot in moving.items()]
    tangent.add(*until_settled(rows, inner.statements, tangent))
    for name, end in after.items():
        if name in moving:
            tangent.dots[name] = moving[name]
        elif end in inner.dots:
            tangent.dots[name] = inner.dots[end]


def pull_fixed_point(assignment: Assignment, adjoint: Adjoint) -> None:
    """u = v_bar + (dT/dv)^T u, iterated as v was; then e_bar = (dT/de)^T u."""
    (turn,), (after,) = assignment.parts, assignment.after
    outer = {name: adjoint.bars[name] for name in after if name in adjoint.bars}
    if not outer:
        return
    turning = {name: adjoint.bar(name) for name in outer if name in assignment.carried}
    while True:  # which of the registers that turns hand on have cotangents
        seeds = {after[name]: turning.get(name, outer.get(name, "")) for name in (*outer, *turning)}
        inner = adjoint.inner(seeds)
        inner.pull(turn)
        more = [name for name in assignment.carried if name in inner.bars and name not in turning]
        if not more:
            break
        turning |= {name: adjoint.bar(name) for name in more}
    rows = [(bar, outer.get(name), inner.bars.get(name)) for name, bar in turning.items()]
    adjoint.add(*until_settled(rows, inner.statements, adjoint))
    for name, bar in inner.bars.items():
        if name not in after and name not in seeds and name in adjoint.active:
            adjoint.collect(name, bar)


def until_settled(
    rows: Sequence[tuple[str, str | None, str | None]],
    turn: Sequence[Statement],
    registers: Registers,
) -> list[Statement]:
    """u = v + A u for all rows (u, v, the result of A u that a turn leaves), to rounding; None is zero.

    Changes of registers are measured by their sizes, so that units do not matter.
    """
    fresh, lengths, unsolved = registers.fresh, registers.lengths, registers.unsolved
    going, turns, stalled, old, total = begun = [
        fresh(name, 1) for name in ("going", "turns", "stalled", "change_old", "change")
    ]
    begin = Graph([], {"going": 1.0, "turns": 0.0, "stalled": 0.0, "old": math.inf})
    body: list[Statement] = [*turn, Call(Graph([], {"zero": 0.0}), (), (total,))]
    first: list[Statement] = []
    for u, v, result in rows:
        first.append(copied_or_zero(v, u))
        if result is None:
            continue
        new, change, size = fresh("new", lengths[u]), fresh("d", 1), fresh("s", 1)
        body.append(copied(result, new) if v is None else added(v, result, new))  # u_new = v + A u
        body += [Sum(_SQUARED_CHANGE, (new, u), (change,)), Sum(_SQUARE, (new,), (size,)), copied(new, u)]
        body.append(Call(_SHARE, (total, change, size), (total,)))  # sum of |u_new - u|^2 / |u_new|^2
    judged = Call(_JUDGED, (total, old, turns, stalled, unsolved), (going, old, turns, stalled, unsolved))
    start = Call(begin, (), tuple(begun[:4]))
    return [*first, start, While(going, (*body, judged)), *turn]


_A, _B = variables("a b")
_SQUARED_CHANGE = Graph([_A, _B], {"square": (_A - _B) * (_A - _B)})
_SQUARE = Graph([_A], {"square": _A * _A})
_TOTAL, _CHANGE, _SIZE = variables("total change size")
_SHARE = Graph([_TOTAL, _CHANGE, _SIZE], {"total": _TOTAL + where(_SIZE, _CHANGE / _SIZE, 0.0)})


def _judge() -> Graph:
    change, old, turns, stalled, unsolved = inputs = variables("change old turns stalled unsolved")
    stalls = stalled + (1.0 - (change < old))
    most = turns + 1.0 >= MOST_TURNS
    going = (stalls < STALLS) * (change > 0.0) * (1.0 - most)
    lost = 1.0 - (change < math.inf)
    outputs = {
        "going": going,
        "old": change,
        "turns": turns + 1.0,
        "stalled": stalls,
        "unsolved": unsolved + maximum(lost, most * (stalls < STALLS)),
    }
    return Graph(inputs, outputs)


_JUDGED = _judge()
