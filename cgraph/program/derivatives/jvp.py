"""Tangents: programs that push x_dot to J x_dot through any number of passes; and the single assignment behind them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from ...autodiff.products import jvp
from ...core.checks import GraphError
from ...core.graph import Graph
from ...core.node import Node
from ...simplification.simplify import simplify
from ...util.caches import kept_by_first
from ...util.require import require_sequence
from ..program import Program
from ..statement import Names, Statement, effects, length_of, names_in, reads_and_writes, row_of, with_names
from ..statements.call import Map, copied, copied_or_zero, zeroed

T = TypeVar("T")
Numbers = tuple[int, ...]
Product = tuple[Graph | None, Numbers]  # of J x_dot or J^T y_bar, none where all is 0, and which results it has


@dataclass(frozen=True, eq=False)
class Assignment:
    """A statement whose outputs no other one writes; what it changes in place is copied first, by `copies`.

    parts: of a statement with bodies, each body in single assignment.
    after: for each part, {register that the statement writes: the one that has its value at the end of the part}.
    carried: of an iteration, whose part is one turn more, the registers that a turn reads before it writes them.
    """

    statement: Statement
    copies: tuple[Map, ...] = ()
    parts: tuple[tuple[Assignment, ...], ...] = ()
    after: tuple[Mapping[str, str], ...] = ()
    carried: Names = ()

    @property
    def statements(self) -> tuple[Statement, ...]:
        """The statement after its copies."""
        return (*self.copies, self.statement)

    @property
    def sources(self) -> Names:
        """The registers that its copies are of: the values before, of what it changes in place."""
        return tuple([copy.inputs[0] for copy in self.copies])


def statements_of(assignments: Iterable[Assignment]) -> list[Statement]:
    """The statements of assignments, copies included."""
    return [statement for assignment in assignments for statement in assignment.statements]


@dataclass
class Registers:
    """Lengths of registers by name, and new ones, in whose names alone `own` is; and statements over them."""

    lengths: dict[str, int]
    own: str = "@"
    statements: list[Statement] = field(default_factory=list, init=False)  # what has been added

    @property
    def unsolved(self) -> str:
        """The register that counts linear iterations which came to no end."""
        return f"unsolved{self.own}"

    def fresh(self, name: str, length: int) -> str:
        """A new register, called after another."""
        new = f"{name.partition(self.own)[0]}{self.own}{len(self.lengths)}"
        self.lengths[new] = length
        return new

    def add(self, *statements: Statement) -> None:
        """Statements after those that are there."""
        self.statements += statements

    def zero(self, like: str) -> str:
        """A new register of zeros, as long as another."""
        new = self.fresh(like, self.lengths[like])
        self.add(zeroed(new))
        return new


def nonzero(inputs: Sequence[Node], results: Mapping[int, Sequence[Node]]) -> Product:
    """Product with these results by number; a zero that is one whatever the numbers are is left out."""
    kept = {k: nodes for k, nodes in results.items() if any(node.value != 0.0 for node in nodes)}
    nodes = [node for group in kept.values() for node in group]
    return Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)}) if nodes else None, tuple(kept)


@kept_by_first
def tangent_graph(graph: Graph, inputs: Numbers, moving: Numbers, outputs: Numbers) -> Product:
    """Tangents of outputs from those of the inputs `moving`. Inputs of the graph: its own, tangents.

    inputs, outputs: lengths of the registers that are the inputs of the graph, or its outputs.
    """
    groups = split(graph.inputs, inputs)
    made = simplify(jvp(graph, [node for k in moving for node in groups[k]]))
    return nonzero(made.inputs, dict(enumerate(split(list(made.outputs.values()), outputs))))


def split(items: Sequence[T], lengths: Sequence[int]) -> list[Sequence[T]]:
    """The items, end to end, by the registers that hold them."""
    ends = list(itertools.accumulate(lengths, initial=0))
    return [items[start:end] for start, end in itertools.pairwise(ends)]


class Tangent(Registers):
    """The statements that push tangents on through assignments.

    dots: {register: the one that has its tangent}; the rules extend it.  active: registers that depend on what moves.
    values: whether the statements themselves are among `statements`, each before its tangents.
    """

    def __init__(
        self, dots: Mapping[str, str], active: Set[str], lengths: dict[str, int], own: str, *, values: bool
    ) -> None:
        super().__init__(lengths, own)
        self.dots, self.active, self.values = dict(dots), active, values

    def inner(self, more: Mapping[str, str], *, values: bool = False) -> Tangent:
        """Tangent of a body: what has tangents here has them there, and more registers."""
        return Tangent(self.dots | dict(more), self.active, self.lengths, self.own, values=self.values or values)

    def push(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the first first."""
        for assignment in assignments:
            row = row_of(assignment.statement)
            if row.jvp is None:
                raise TypeError(f"a {row.kind.__name__} has no tangents: its row has no `jvp`")
            if self.values and not row.reruns:
                self.add(*assignment.statements)
            row.jvp(assignment, self)
            for name in set(reads_and_writes(assignment.statement)[1]) - self.active:
                self.dots.pop(name, None)

    def dot(self, register: str) -> str:
        """A new register for the tangent of one."""
        self.dots[register] = dot = self.fresh(f"{register}_dot", self.lengths[register])
        return dot


class Linearized(NamedTuple):
    """A program of tangents or cotangents, and the registers of its vectors.

    vectors: {register of a value: that of its cotangent or tangent, before and after a pass}.
    unsolved: a register that is not 0 after passes in which equations of a `FixedPoint` were not solved, and NaN after
    a loop of more turns than there is room for.
    """

    program: Program
    vectors: Mapping[str, str]
    unsolved: str


class Passes(Registers):
    """A program in single assignment, of which derivatives are made.

    of: registers whose values after a pass matter.  wrt: those by which derivatives are taken, besides what a pass
    hands on; as attributes those that stay the same, `inputs`, and those of the feed, `varied`.  constant: those whose
    values have no derivatives.  turns: for how many turns a `While` records what its way back reads; 0 without one.

    plain: the assignments of a pass.  active: registers that depend on what moves.
    handed: {register that a pass hands on to the next: the one that has its value after the pass}.
    constants: registers that passes read and never write.
    current: {register of the program: the one that has its value now}, while they are made.
    """

    def __init__(
        self, program: Program, of: Sequence[str], wrt: Sequence[str], constant: Sequence[str] = (), turns: int = 0
    ) -> None:
        if not isinstance(program, Program):
            raise TypeError(f"program must be a Program, got {type(program).__name__}: {program!r:.60}")
        if controls := [name for name in ("record_if", "stop") if getattr(program, name) is not None]:
            raise GraphError(f"a run has derivatives if it does not depend on numbers how long it is: no {controls[0]}")
        for what, names in (("of", of), ("wrt", wrt), ("constant", constant)):
            for name in require_sequence(what, names, "registers", str):
                length_of(program.registers, what, name)
            if isinstance(names, str):
                raise TypeError(f"{what} must be a sequence of registers, got the text {names!r:.60}")
        if both := [name for name in wrt if name in constant]:
            raise GraphError(f"wrt names register {both[0]!r}, which is constant")
        if fed := [name for name in of if name in program.feed]:
            raise GraphError(f"of names register {fed[0]!r}, which is fed: what a pass makes of it is lost in the next")
        super().__init__(dict(program.registers), _unused("@", program))
        self._with, self.fed = _unused(":", program), tuple(program.feed)
        self.turns, self.current = turns, dict[str, str]()
        written = effects(program.body)[1]
        kept = [copied(name, name) for name in dict.fromkeys(of) if name not in written]
        self.plain = [self.assignment(each) for each in [*program.body, *kept]]
        reads = [name for name in effects(statements_of(self.plain))[0] if name in program.registers]
        handed = [name for name in dict.fromkeys((*of, *reads)) if name in self.current and name not in self.fed]
        self.handed = {name: self.now(name) for name in handed}
        self.constants = [name for name in reads if name not in self.handed and name not in self.fed]
        self.inputs = [name for name in dict.fromkeys(wrt) if name not in self.fed and name not in self.handed]
        self.varied = [name for name in dict.fromkeys(wrt) if name in self.fed]
        moving = {*self.inputs, *self.varied, *[name for name in handed if name not in constant]}
        self.active = _active(self.plain, moving, frozenset(constant), self.own)

    def now(self, name: str) -> str:
        """The register that has the value of `name`."""
        return self.current.get(name, name)

    def write(self, name: str) -> str:
        """A register for a new value of `name`."""
        self.current[name] = new = self.fresh(name, self.lengths[name])
        return new

    def assignment(self, statement: Statement) -> Assignment:
        """The statement in single assignment, after those before it."""
        row = row_of(statement)
        if row.assign is not None:
            made: Assignment = row.assign(statement, self)
            return made
        if row.bodies:
            raise TypeError(f"a {type(statement).__name__} has no derivatives: its row has no `assign`")
        before = {name: self.now(name) for name in names_in(statement, row.reads)}
        new = with_names(statement, [each for each in row.reads if each not in row.writes], self.now)
        new = with_names(new, row.writes, self.write)
        changed = names_in(statement, [each for each in row.writes if each in row.reads])
        return Assignment(new, tuple([copied(before[name], self.now(name)) for name in changed]))

    def tangents(self, directions: Sequence[str], *, values: bool) -> tuple[Tangent, dict[str, str]]:
        """Tangents of what a pass hands on and of more, and their registers: they end where the next pass reads them.

        values: whether the passes themselves are beside them.
        """
        moving = [name for name in self.handed if name in self.active]
        dots = {name: f"{name}{self._with}dot" for name in (*moving, *directions)}
        lengths = self.lengths | {dot: self.lengths[name] for name, dot in dots.items()}
        tangent = Tangent(dots, self.active, lengths, self.own, values=values)
        tangent.push(self.plain)
        tangent.add(*[copied_or_zero(tangent.dots.get(self.handed[name]), dots[name]) for name in moving])
        return tangent, dots

    def program(
        self,
        made: Registers,
        body: Sequence[Statement],
        record: Sequence[str],
        feed: Sequence[str],
        more: Iterable[str],
    ) -> Program:
        """The program of a body, with those registers of `made` that it uses, and more."""
        names = {name for statement in body for names in reads_and_writes(statement) for name in names}
        used = {*names, *record, *feed, *more, self.unsolved}
        lengths = {name: length for name, length in {**made.lengths, self.unsolved: 1}.items() if name in used}
        return Program(lengths, body, record=record, feed=feed)


def program_jvp(program: Program, wrt: Sequence[str] = (), *, constant: Sequence[str] = ()) -> Linearized:
    """A program with the tangents of its registers: J x_dot of any number of passes.

    Every register that is recorded or handed on, and every one of `wrt`, has a register "{name}:dot" for its tangent,
    which is set before the first pass and read after the last one: `vectors` of the result. Its record has the rows of
    the program's, then the tangents of what has tangents in them. Values and tangents are computed side by side; a loop
    turns as often as its values say, and a `FixedPoint` has the tangent of its equations.

    program: without `record_if` and `stop`.  wrt: registers that passes read and do not write, or are fed; those that
    passes hand on come with them.  constant: registers whose values have no derivatives, such as guesses.
    Raises GraphError for an unknown register, TypeError for a statement without derivative.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, program_jvp, runner
    >>> x = cg.variable("x")
    >>> square = Program({"x": 1}, [Call(cg.Graph([x], {"x": x * x}), ("x",), ("x",))], record=["x"])
    >>> moved = program_jvp(square)
    >>> run = runner(moved.program)
    >>> run.run(run.memory({"x": 3.0, moved.vectors["x"]: 1.0}), passes=2).rows.tolist()
    [[9.0, 6.0], [81.0, 108.0]]
    """
    passes = Passes(program, program.record if isinstance(program, Program) else (), wrt, constant)
    tangent, dots = passes.tangents(list(wrt), values=True)
    body = [*tangent.statements, *[copied(after, before) for before, after in passes.handed.items()]]
    record = [*program.record, *[dots[name] for name in program.record if name in dots]]
    made = passes.program(tangent, body, record, program.feed, {*program.registers, *dots.values()})
    return Linearized(made, dots, passes.unsolved)


def _unused(sign: str, program: Program) -> str:
    """The sign, as often as no register of the program has it in its name."""
    own = sign
    while any([own in name for name in program.registers]):
        own += sign
    return own


def _active(assignments: Sequence[Assignment], moving: Set[str], constant: Set[str], own: str) -> set[str]:
    """Registers that depend on those that move; of an iteration, on what it reads and not on where it began."""
    active = set(moving)
    for each in assignments:
        inputs = effects(statements_of(each.parts[0]) if each.carried else each.statements)[0]
        if active & (set(inputs) - set(each.carried)):
            active |= {name for name in reads_and_writes(each.statement)[1] if name.partition(own)[0] not in constant}
            for part in each.parts:
                active = _active(part, active, constant, own)
    return active
