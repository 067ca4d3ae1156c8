"""Adjoint: reverse mode over statements, from cotangents of what they end with to those of what they begin with."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from ..statement import Names, Statement, effects, needed, reads_and_writes, row_of
from ..statements.call import Call, Map, added, zeroed
from .products import Products
from .single_assignment import Assignment, Registers, flat

HEAVY_GRAPH = 4  # operations of a graph for each of its outputs, from which on these are kept and not computed again


class Replayed(NamedTuple):
    """Recovery of the values that statements backwards read.

    again: what computes those that are cheap.  tape: registers to be recorded, results of heavy statements.
    wanted: registers that both need from before the assignments.
    """

    again: list[Statement]
    tape: Names
    wanted: set[str]


class Adjoint(Registers):
    """The statements that pull cotangents back through assignments.

    bars: {register: the one that has its cotangent}, of what comes after; the rules extend it.  active: registers that
    depend on what moves.  products: graphs of J^T y_bar.  turns: for how many turns a loop inside has a stack.
    recording: {assignment: the one that records for its way back}.
    """

    def __init__(
        self,
        bars: Mapping[str, str],
        active: Collection[str],
        lengths: dict[str, int],
        products: Products,
        kept: Iterable[str],
        turns: int,
        recording: dict[Assignment, Assignment] | None = None,
        own: str = "@",
    ) -> None:
        super().__init__(lengths, own)
        self.bars, self.active, self.products, self.turns = dict(bars), active, products, turns
        self._kept = set(kept)  # registers of cotangents that must stay as they are
        self.recording = {} if recording is None else recording  # {assignment: the one that records}

    def inner(self, bars: Mapping[str, str]) -> Adjoint:
        """Adjoint of a body, from cotangents of its end, which stay as they are."""
        more = bars.values(), self.turns, self.recording, self.own
        return Adjoint(bars, self.active, self.lengths, self.products, *more)

    def pull(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the last first."""
        for assignment in reversed(assignments):
            row = row_of(assignment.statement)
            if row.transpose is None:
                raise TypeError(f"a {row.kind.__name__} has no cotangents: its row has no `transpose`")
            row.transpose(assignment, self)

    def collect(self, register: str, bar: str) -> None:
        """Add a term to a register's cotangent."""
        if register not in self.bars:
            self.bars[register] = bar
            return
        before = self.bars[register]
        after = self.bar(register) if before in self._kept else before
        self.add(added(before, bar, after))
        self.bars[register] = after

    def bar(self, register: str) -> str:
        """A new register for a cotangent of one."""
        return self.fresh(f"{register}_bar", self.lengths[register])

    def bar_or_zero(self, register: str) -> str:
        """The cotangent of a register; a register of zeros where there is none."""
        if register in self.bars:
            return self.bars[register]
        zero = self.bar(register)
        self.add(zeroed(zero))
        return zero

    def seeded(self, outputs: Sequence[str]) -> tuple[int, ...]:
        """Numbers of the registers that have cotangents."""
        return tuple([k for k, name in enumerate(outputs) if name in self.bars])

    def wanted(self, inputs: Sequence[str]) -> tuple[int, ...]:
        """Numbers of the registers whose cotangents matter."""
        return tuple([k for k, name in enumerate(inputs) if name in self.active and self.lengths[name]])

    def recorded(self, assignment: Assignment, statement: Statement, copies: Sequence[Map]) -> None:
        """The statement records for its way back: this is what is run forward."""
        parts = tuple([tuple(self.forward(part)) for part in assignment.parts])
        self.recording[assignment] = replace(assignment, statement=statement, copies=tuple(copies), parts=parts)

    def forward(self, part: Sequence[Assignment]) -> list[Assignment]:
        """The assignments as they are run forward, recording where there is a way back."""
        return [self.recording.get(each, each) for each in part]


def replayed(assignments: Sequence[Assignment], values: Iterable[str]) -> Replayed:
    """Recovery of values that assignments computed: those of heavy statements are recorded, others made again."""
    wanted, tape = set(values), dict[str, None]()
    again: list[Statement] = []
    for assignment in reversed(assignments):
        outputs = set(reads_and_writes(assignment.statement)[1])
        for part in [] if row_of(assignment.statement).reruns else assignment.parts:  # a loop's come turn by turn
            if outputs.issuperset(effects(flat(part))[1]):
                inner = replayed(part, wanted)
                again, wanted, tape = [*inner.again, *again], inner.wanted, tape | dict.fromkeys(inner.tape)
            elif turn := needed(flat(part), wanted):  # of an iteration, one more than was run
                again, wanted = [*turn, *again], wanted | set(effects(turn)[0])
        here = [name for name in reads_and_writes(assignment.statement)[1] if name in wanted]
        if here and _heavy(assignment.statement):
            tape |= dict.fromkeys(here)
            wanted -= set(here)
        elif here:
            again = [*assignment.statements, *again]
            wanted |= set(effects(assignment.statements)[0])
    return Replayed(again, tuple(tape), wanted)


def _heavy(statement: Statement) -> bool:
    if row_of(statement).bodies:
        return True
    if not isinstance(statement, Call):
        return False
    graph = statement.graph
    return sum(1 for node in graph.nodes if node.args) > HEAVY_GRAPH * len(graph.outputs)
