"""Linearization of a program: its passes, and programs that pull cotangents back through them, or push tangents on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ...core.checks import GraphError
from ...util.require import require_mapping, require_sequence, require_whole
from ..program import Program
from ..statement import Statement, effects, length_of, needed, reads_and_writes
from ..statements.call import added, copied, copied_or_zero
from .adjoint import Adjoint, replayed
from .products import Products, Pullback
from .single_assignment import Assigned, Assignment, flat
from .tangent import Tangent

TURNS = 64  # of a loop that its stack has room for, unless more are asked for


class Linearized(NamedTuple):
    """A program that goes along recorded passes, which are its feed, and the registers of its vectors.

    vectors: {register of a value: that of its cotangent or tangent, before and after a pass}.
    unsolved: a register that is not 0 after passes in which equations of a `FixedPoint` were not solved, and NaN after
    a loop of more turns than there is room for.

    >>> from cgraph.extend import Program, program_jvp
    >>> dict(program_jvp(Program({"x": 1}, [], record=["x"])).vectors)
    {'x': 'x:dot'}
    """

    program: Program
    vectors: Mapping[str, str]
    unsolved: str


class Linearization:
    """A program in single assignment: what it records, and its derivatives.

    of: registers whose values after a pass matter.  wrt: those by which derivatives are taken, besides what a pass
    hands on; as an attribute first those that stay the same, `inputs`, then those of the feed, `varied`.  constant:
    those whose values have no derivatives.  rules: {id of a graph: its own rule for J^T y_bar}.  turns: for how many
    turns of a `While` its way back has room.

    handed: {register that a pass hands on to the next: the one that has its value after the pass}.
    constants: registers that passes read and never write.

    >>> import cgraph as cg
    >>> from cgraph._shared import Linearization
    >>> from cgraph.extend import Call, Program
    >>> x, p = cg.variables("x p")
    >>> step = Call(cg.Graph([x, p], {"x": p * x}), ("x", "p"), ("x",))
    >>> passes = Linearization(Program({"x": 1, "p": 1}, [step], record=()), ["x"], ["p"])
    >>> passes.handed, passes.constants
    ({'x': 'x@2'}, ('p',))
    >>> back = passes.adjoint(["x"])
    >>> dict(back.vectors), back.program.feed
    ({'x': 'x:bar', 'p': 'p:sum'}, ['x'])
    """

    def __init__(
        self,
        program: Program,
        of: Sequence[str],
        wrt: Sequence[str],
        *,
        constant: Sequence[str] = (),
        rules: Mapping[int, Pullback] | None = None,
        turns: int = TURNS,
    ) -> None:
        require_program(program)
        for what, names in (("of", of), ("wrt", wrt), ("constant", constant)):
            for name in require_sequence(what, names, "registers", str):
                length_of(program.registers, what, name)
            if isinstance(names, str):
                raise TypeError(f"{what} must be a sequence of registers, got the text {names!r:.60}")
        of, wrt = list(dict.fromkeys(of)), list(dict.fromkeys(wrt))
        if both := [name for name in wrt if name in constant]:
            raise GraphError(f"wrt names register {both[0]!r}, which is constant")
        if fed := [name for name in of if name in program.feed]:
            raise GraphError(f"of names register {fed[0]!r}, which is fed: what a pass makes of it is lost in the next")
        self._at, self._with = _unused("@", program), _unused(":", program)
        self._products = Products({} if rules is None else require_mapping("rules", rules, "id of a graph: rule"))
        self._lengths, self.fed = dict(program.registers), tuple(program.feed)
        self.turns = require_whole("turns", turns, 1)
        self.inputs = tuple([name for name in wrt if name not in self.fed])
        self.varied = tuple([name for name in wrt if name in self.fed])
        written = effects(program.body)[1]
        assigned = Assigned(self._lengths, self._at)
        kept = [copied(name, name) for name in of if name not in written]
        self._plain = [assigned.assignment(each) for each in [*program.body, *kept]]
        self._recording: dict[Assignment, Assignment] = {}
        reads, _ = effects(flat(self._plain))
        handed = [name for name in dict.fromkeys((*of, *reads)) if name in assigned.current and name not in self.fed]
        self.handed = {name: assigned.now(name) for name in handed}
        self.inputs = tuple([name for name in self.inputs if name not in self.handed])
        self.constants = tuple([name for name in reads if name not in self.handed and name not in self.fed])
        moving = {*self.inputs, *self.varied, *[name for name in self.handed if name not in constant]}
        self.wrt = (*self.inputs, *self.varied)
        self._active = _active(self._plain, moving, frozenset(constant), self._at)

    def forward(self, tape: Sequence[str], results: Sequence[str] = ()) -> Program:
        """The passes themselves, with what they record for their way back.

        A pass begins with what the one before handed on, in the registers of `handed` after it: the start is put there.
        tape: what is recorded, the feed of a linearized program and more.  results: what is read when all are done.
        """
        ends = [self.handed.get(name, name) for name in results]
        assignments = [self._recording.get(each, each) for each in self._plain]
        body = needed(flat(assignments), {*self.handed.values(), *ends, *tape})
        used = _names(body)
        lengths = {name: self._lengths[name] for name in self._lengths if self._at not in name or name in used}
        copies = [copied(after, before) for before, after in self.handed.items() if self._lengths[before]]
        return Program(lengths, [*copies, *body], record=list(tape), feed=self.fed)

    def adjoint(self, seeds: Sequence[str]) -> Linearized:
        """A pass that pulls cotangents back, of what it hands on, `seeds` and more, and of its inputs.

        It is fed what was recorded, the last pass first, and records the cotangents of `varied`.
        """
        wanted = self._among("seeds", seeds, self.handed)
        while True:
            lengths = dict(self._lengths)
            ends = {name: self._called(name, "bar") for name in wanted} | {
                name: self._called(name, "sum") for name in self.inputs
            }
            lengths |= {bar: lengths[name] for name, bar in ends.items()}
            lengths[self.unsolved] = 1
            bars = {self.handed[name]: ends[name] for name in wanted}
            pulled = Adjoint(bars, self._active, lengths, self._products, ends.values(), self.turns, own=self._at)
            pulled.pull(self._plain)
            more = [name for name in self.handed if name in pulled.bars and name not in wanted and name in self._active]
            if not more:
                break
            wanted += more
        self._recording = pulled.recording
        for recording in pulled.recording.values():
            self._lengths |= {name: lengths[name] for name in _names(recording.statements)}
        after = [added(ends[name], pulled.bars[name], ends[name]) for name in self.inputs if name in pulled.bars]
        rows = {name: self._called(name, "row") for name in self.varied}
        lengths |= {row: lengths[name] for name, row in rows.items()}
        for name, end in [*[(name, ends[name]) for name in wanted], *rows.items()]:
            after.append(copied_or_zero(pulled.bars.get(name), end))
        results = {*ends.values(), *rows.values(), self.unsolved}
        return self._program(lengths, [*pulled.statements, *after], results, ends, list(rows.values()))

    def tangent(self, directions: Sequence[str], record: Sequence[str], then: Sequence[Statement] = ()) -> Linearized:
        """A pass that pushes tangents on, of what it hands on and of `directions`, inputs or varied registers.

        It is fed what was recorded, and records the tangents of `record` after a pass.  then: what else it does with
        the tangents, {name}:dot.
        """
        dots, lengths, statements = self._pushed(self._among("directions", directions, self._lengths), values=False)
        self._among("record", record, dots)
        results = {*dots.values(), self.unsolved}
        return self._program(lengths, [*statements, *then], results, dots, [dots[name] for name in record])

    def beside(self, directions: Sequence[str], record: Sequence[str]) -> Linearized:
        """The passes with the tangents beside their values: no tape.

        What is handed on begins, and ends, in the registers of the program itself.
        record: what is recorded after a pass, and then its tangents.
        """
        dots, lengths, statements = self._pushed(directions, values=True)
        body = [*statements, *[copied(after, before) for before, after in self.handed.items() if lengths[before]]]
        rows = [*record, *[dots[name] for name in record if name in dots]]
        used = {*_names(body), *rows, *dots.values(), *self.fed, self.unsolved}
        kept = {name: length for name, length in lengths.items() if self._at not in name or name in used}
        return Linearized(Program(kept, body, record=rows, feed=self.fed), dots, self.unsolved)

    @property
    def unsolved(self) -> str:
        """The register that counts linear iterations which came to no end."""
        return f"unsolved{self._at}"

    def _called(self, name: str, what: str) -> str:
        return f"{name}{self._with}{what}"

    @staticmethod
    def _among(what: str, names: Sequence[str], known: Mapping[str, object]) -> list[str]:
        """The names. Raises GraphError for one that is not among the known ones."""
        if unknown := [name for name in names if name not in known]:
            raise GraphError(f"{what} must be among {', '.join(known) or 'none'}, got {unknown[0]!r:.60}")
        return list(names)

    def _pushed(
        self, directions: Sequence[str], *, values: bool
    ) -> tuple[dict[str, str], dict[str, int], list[Statement]]:
        """The tangents of what a pass hands on and of more, the lengths of all registers, and what pushes them on.

        Tangents of what a pass hands on end where the next one reads them.
        """
        lengths = {**self._lengths, self.unsolved: 1}
        moving = [name for name in self.handed if name in self._active]
        dots = {name: self._called(name, "dot") for name in (*moving, *directions)}
        lengths |= {dot: lengths[name] for name, dot in dots.items()}
        pushed = Tangent(dots, self._active, lengths, self._products, values=values, own=self._at)
        pushed.push(self._plain)
        pushed.add(*[copied_or_zero(pushed.dots.get(self.handed[name]), dots[name]) for name in moving])
        return dots, lengths, pushed.statements

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
        assignments = [self._recording.get(each, each) for each in self._plain]
        values = replayed(assignments, effects(linear)[0])
        starts = [name for name in (*self.fed, *self.handed) if name in values.wanted]
        body = [*values.again, *linear]
        fed = list(dict.fromkeys([*starts, *values.tape]))
        used = {*_names(body), *fed, *record, *vectors.values(), *self.constants, self.unsolved}
        kept = {name: length for name, length in lengths.items() if name in used}
        return Linearized(Program(kept, body, record=record, feed=fed), vectors, self.unsolved)


def require_program(program: Program) -> None:
    """Raises TypeError for what is no program."""
    if not isinstance(program, Program):
        raise TypeError(f"program must be a Program, got {type(program).__name__}: {program!r:.60}")


def _unused(sign: str, program: Program) -> str:
    """The sign, as often as no register of the program has it in its name."""
    own = sign
    while any([own in name for name in program.registers]):
        own += sign
    return own


def _names(statements: Sequence[Statement]) -> set[str]:
    return {name for statement in statements for names in reads_and_writes(statement) for name in names}


def _active(assignments: Sequence[Assignment], moving: set[str], constant: frozenset[str], own: str) -> set[str]:
    """Registers that depend on those that move."""
    active = set(moving)
    for assignment in assignments:
        outputs = {name for name in reads_and_writes(assignment.statement)[1] if name.partition(own)[0] not in constant}
        if assignment.carried:  # of an iteration, whose solution depends on what it reads and not on where it began
            outside = set(effects(flat(assignment.parts[0]))[0])
            if active & (outside - set(assignment.carried)):
                active |= outputs
                active = _active(assignment.parts[0], active, constant, own)
            continue
        inputs = {name for statement in assignment.statements for name in reads_and_writes(statement)[0]}
        for copy in assignment.copies:
            if copy.inputs[0] in active:
                active |= {name for name in copy.outputs if name.partition(own)[0] not in constant}
        if active & inputs:
            active |= outputs
            for part in assignment.parts:
                active = _active(part, active, constant, own)
    return active
