"""Iteration: linear equations u = v + A u, solved by repeating the statements that give A u."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Map, Statement, Sum, While

from ...integrators.elementwise import SAME, function
from .single_assignment import fresh

MOST_TURNS = 200.0
STALLS = 3.0  # turns whose change is no smaller than before: the rest is rounding
UNSOLVED = "unsolved"  # register: how many iterations came to no end

_A, _B = cg.variables("a b")
ADDED = function("a b", sum=_A + _B)
ZERO = function("a", zero=0.0)


def add_to(total: str, term: str) -> Map:
    """total += term."""
    return Map(ADDED, (total, term), (total,))


def until_settled(
    rows: Sequence[tuple[str, str | None, str | None]], turn: Sequence[Statement], lengths: dict[str, int]
) -> list[Statement]:
    """u = v + A u for all rows (u, v, the result of A u that a turn leaves), to rounding; None is zero.

    Changes of registers are measured by their sizes, so that units do not matter.
    """
    names = ("going", "turns", "stalled", "change_old", "change")
    going, turns, stalled, old, total = registers = [fresh(lengths, name, 1) for name in names]
    begin = Graph([], {"going": 1.0, "turns": 0.0, "stalled": 0.0, "old": math.inf})
    body: list[Statement] = [*turn, Call(Graph([], {"zero": 0.0}), (), (total,))]
    first: list[Statement] = []
    for u, v, result in rows:
        first.append(Map(ZERO, (u,), (u,)) if v is None else Map(SAME, (v,), (u,)))
        if result is None:
            continue
        new, change, size = (fresh(lengths, name, length) for name, length in (("new", lengths[u]), ("d", 1), ("s", 1)))
        body.append(Map(SAME, (result,), (new,)) if v is None else Map(ADDED, (v, result), (new,)))
        body += [Sum(_SQUARED_CHANGE, (new, u), change), Sum(_SQUARE, (new,), size), Map(SAME, (new,), (u,))]
        body.append(Call(_SHARE, (total, change, size), (total,)))
    judged = Call(_JUDGED, (total, old, turns, stalled, UNSOLVED), (going, old, turns, stalled, UNSOLVED))
    lengths[UNSOLVED] = 1
    start = Call(begin, (), tuple(registers[:4]))
    return [*first, start, While(going, (*body, judged)), *turn]


_SQUARED_CHANGE = function("a b", square=(_A - _B) * (_A - _B))
_SQUARE = function("a", square=_A * _A)
_TOTAL, _CHANGE, _SIZE = cg.variables("total change size")
_SHARE = Graph([_TOTAL, _CHANGE, _SIZE], {"total": _TOTAL + cg.where(_SIZE, _CHANGE / _SIZE, 0.0)})


def _judge() -> Graph:
    change, old, turns, stalled, unsolved = inputs = cg.variables("change old turns stalled unsolved")
    stalls = stalled + (1.0 - (change < old))
    most = turns + 1.0 >= MOST_TURNS
    going = (stalls < STALLS) * (change > 0.0) * (1.0 - most)
    lost = 1.0 - (change < math.inf)
    outputs = {
        "going": going,
        "old": change,
        "turns": turns + 1.0,
        "stalled": stalls,
        "unsolved": unsolved + cg.maximum(lost, most * (stalls < STALLS)),
    }
    return Graph(inputs, outputs)


_JUDGED = _judge()
