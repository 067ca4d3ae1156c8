"""Linearization of statements: the programs that run them, pull cotangents back, and push tangents on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cgraph.extend import Call, Map, Program, Statement, While

from ...integrators.elementwise import SAME
from .adjoint import Adjoint
from .iteration import UNSOLVED, ZERO, add_to
from .products import Products
from .single_assignment import Assigned, Assignment, effects, flat, needed, reads_and_writes
from .tangent import Tangent

HEAVY = 8  # nodes of a graph for each of its outputs, from which on these are kept and not computed again


class Linearized(NamedTuple):
    """A program that goes through recorded passes, and the registers of its vectors.

    vectors: {register of a value: that of its cotangent or tangent, before and after a pass}.
    """

    program: Program
    vectors: Mapping[str, str]


class Linearization:
    """A pass of statements, over and over: what it records, and its derivatives.

    statements: of a pass.  lengths: of its registers.
    fed: registers that are new in every pass.  inputs: registers that stay the same, of which derivatives are wanted.
    varied: those of `fed` of which derivatives are wanted.  fixed: registers that have no derivatives.
    carried: registers that a pass hands on to the next, besides those that it reads before it writes them.
    renamed: {register that is several, end to end: these}.
    """

    def __init__(
        self,
        statements: Sequence[Statement],
        lengths: Mapping[str, int],
        *,
        fed: Sequence[str],
        inputs: Sequence[str],
        varied: Sequence[str],
        fixed: Sequence[str],
        carried: Sequence[str],
        renamed: Mapping[str, Sequence[str]],
        products: Products,
    ) -> None:
        self._lengths, self._products = dict(lengths), products
        self.fed, self.inputs, self.varied = tuple(fed), tuple(inputs), tuple(varied)
        written = effects(statements)[1]
        kept = [Map(SAME, (name,), (name,)) for name in carried if name not in written]
        assigned = Assigned([*statements, *kept], self._lengths, renamed)
        self.assignments = assigned.assignments
        reads, _ = effects(flat(self.assignments))
        handed = [name for name in dict.fromkeys((*carried, *reads)) if name in assigned.current and name not in fed]
        self.handed = {name: assigned.now(name) for name in handed}  # {before a pass: after it}
        self.constants = tuple([name for name in reads if name not in self.handed and name not in self.fed])
        moving = {*self.inputs, *self.varied, *[name for name in self.handed if name not in fixed]}
        self._active = _active(self.assignments, moving, frozenset(fixed))

    def forward(self, tape: Sequence[str], results: Sequence[str] = ()) -> Program:
        """The passes themselves. Each is fed, and records `tape`.  results: what is read when all are done."""
        ends = [self.handed.get(name, name) for name in results]
        body = needed([*flat(self.assignments)], {*self.handed.values(), *ends, *tape})
        lengths = {name: self._lengths[name] for name in self._lengths if "@" not in name or name in _names(body)}
        copies = [Map(SAME, (after,), (before,)) for before, after in self.handed.items() if self._lengths[before]]
        return Program(lengths, [*copies, *body], record=list(tape), feed=self.fed)

    def adjoint(self, seeds: Sequence[str]) -> Linearized:
        """A pass that pulls cotangents back, of what it hands on, `seeds` and more, and of its inputs.

        It is fed what was recorded, the last pass first, and records the cotangents of `varied`.
        """
        wanted = list(seeds)
        while True:
            lengths = dict(self._lengths)
            ends = {name: f"{name}:bar" for name in wanted} | {name: f"{name}:sum" for name in self.inputs}
            lengths |= {bar: lengths[name] for name, bar in ends.items()}
            bars = {self.handed[name]: ends[name] for name in wanted}
            pulled = Adjoint(bars, self._active, lengths, self._products, ends.values())
            pulled.pull(self.assignments)
            more = [name for name in self.handed if name in pulled.bars and name not in wanted and name in self._active]
            if not more:
                break
            wanted += more
        after: list[Statement] = []
        after += [add_to(ends[name], pulled.bars[name]) for name in self.inputs if name in pulled.bars]
        rows = {name: f"{name}:row" for name in self.varied}
        lengths |= {row: lengths[name] for name, row in rows.items()}
        for name, end in [*[(name, ends[name]) for name in wanted], *rows.items()]:
            bar = pulled.bars.get(name)
            after.append(Map(ZERO, (end,), (end,)) if bar is None else Map(SAME, (bar,), (end,)))
        results = {*ends.values(), *rows.values(), UNSOLVED}
        return self._program(lengths, [*pulled.statements, *after], results, ends, list(rows.values()))

    def tangent(self, directions: Sequence[str]) -> Linearized:
        """A pass that pushes tangents on, of what it hands on and of `directions`, inputs or varied registers.

        It is fed what was recorded, and records the tangent of `x`. Those of t grow by those of h.
        """
        lengths = dict(self._lengths)
        moving = [name for name in self.handed if name in self._active]
        dots = {name: f"{name}:dot" for name in (*moving, *directions)}
        lengths |= {dot: lengths[name] for name, dot in dots.items()}
        pushed = Tangent(dots, self._active, lengths, self._products)
        pushed.push(self.assignments)
        after: list[Statement] = []
        for name in moving:
            dot = pushed.dots.get(self.handed[name])
            after.append(Map(ZERO, (dots[name],), (dots[name],)) if dot is None else Map(SAME, (dot,), (dots[name],)))
        if {"t", "h"} <= set(directions):
            after.append(add_to(dots["t"], dots["h"]))
        results = {*dots.values(), UNSOLVED}
        return self._program(lengths, [*pushed.statements, *after], results, dots, [dots["x"]])

    def _program(
        self,
        lengths: dict[str, int],
        statements: Sequence[Statement],
        results: set[str],
        vectors: Mapping[str, str],
        record: list[str],
    ) -> Linearized:
        """The statements, after those that compute what they need of a pass from what was recorded of it."""
        linear = needed(statements, results)
        wanted = set(effects(linear)[0])
        tape: dict[str, None] = {}
        again: list[Statement] = []
        for assignment in reversed(self.assignments):
            outputs = reads_and_writes(assignment.statement)[1]
            inner = [*flat(assignment.turn)]
            if turns := needed(inner, wanted):
                wanted |= set(effects(turns)[0])
                again = [*turns, *again]
            here = [name for name in outputs if name in wanted]
            if not here:
                continue
            if _heavy(assignment):
                tape |= dict.fromkeys(here)
                wanted -= set(here)
            else:
                again = [*assignment.statements, *again]
                wanted |= set(effects(assignment.statements)[0])
        starts = [name for name in (*self.fed, *self.handed) if name in wanted]
        body = [*again, *linear]
        fed = list(dict.fromkeys([*starts, *tape]))
        used = {*_names(body), *fed, *record, *vectors.values(), *self.constants}
        lengths.setdefault(UNSOLVED, 1)
        kept = {name: length for name, length in lengths.items() if name in {*used, UNSOLVED}}
        return Linearized(Program(kept, body, record=record, feed=fed), vectors)


def _heavy(assignment: Assignment) -> bool:
    statement = assignment.statement
    if isinstance(statement, While):
        return True
    return isinstance(statement, Call) and len(statement.graph.nodes) > HEAVY * len(statement.graph.outputs)


def _names(statements: Sequence[Statement]) -> set[str]:
    return {name for statement in statements for names in reads_and_writes(statement) for name in names}


def _active(assignments: Sequence[Assignment], moving: set[str], fixed: frozenset[str]) -> set[str]:
    """Registers that depend on those that move."""
    active = set(moving)
    for assignment in assignments:
        outputs = reads_and_writes(assignment.statement)[1]
        if assignment.turn:
            outside = set(effects(flat(assignment.turn))[0])
            if active & (outside - set(assignment.carried)):
                active |= {name for name in outputs if name.partition("@")[0] not in fixed}
                active = _active(assignment.turn, active, fixed)
            continue
        inputs = {name for statement in assignment.statements for name in reads_and_writes(statement)[0]}
        if active & inputs:
            active |= {name for name in outputs if name.partition("@")[0] not in fixed}
    return active
