"""Single assignment of programs, and tangents: programs that push x_dot to J x_dot through any number of passes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ...autodiff.products import jvp
from ...core.checks import GraphError
from ...core.graph import Graph
from ...core.node import Node
from ...simplification.simplify import simplify
from ...util.caches import kept_by_first
from ...util.require import require_kind, require_sequence
from ..program import Program, unused_sign
from ..statement import Names, Statement, effects, length_of, names_in, reads_and_writes, row_of, with_names
from ..statements.call import Map, copied

Numbers = tuple[int, ...]
Product = tuple[Graph | None, Numbers]  # of J x_dot or J^T y_bar, none where all is 0, and which results it has


def rule_of(statement: Statement, column: str) -> Callable[..., Any]:
    """The rule of a statement in a column. Raises TypeError where there is none."""
    row = row_of(statement)
    if (rule := getattr(row, column)) is None:
        loop = "; of loops only a FixedPoint has them" if row.bodies else ""
        raise TypeError(f"a {row.kind.__name__} has no derivatives: its row has no `{column}`{loop}")
    return rule  # type: ignore[no-any-return]


@dataclass(frozen=True, eq=False)
class Assignment:
    """A statement whose outputs no other one writes; `copies` first copy what it changes in place."""

    statement: Any  # of the kind that a rule is for
    copies: tuple[Map, ...] = ()
    parts: tuple[tuple[Assignment, ...], ...] = ()  # its bodies; of an iteration one turn more, which no pass runs
    after: tuple[Mapping[str, str], ...] = ()  # of each part, {register written: the one of its value at the end}
    carried: Names = ()  # of an iteration, the registers that a turn reads before it writes them

    @property
    def statements(self) -> tuple[Statement, ...]:
        """The statement after its copies."""
        return (*self.copies, self.statement)

    @property
    def sources(self) -> Names:
        """The registers that hold what it changes in place as it was before."""
        return tuple([copy.inputs[0] for copy in self.copies])

    @property
    def unrun(self) -> list[Statement]:
        """The statements that passes do not run: of iterations, also inside others, one more turn."""
        if self.carried:
            return statements_of(self.parts[0])
        return [statement for part in self.parts for each in part for statement in each.unrun]


def statements_of(assignments: Iterable[Assignment]) -> list[Statement]:
    """The statements of assignments, copies included."""
    return [statement for assignment in assignments for statement in assignment.statements]


@dataclass
class Registers:
    """Lengths of registers, new ones, in whose names alone `own` is, and statements; `active` depend on what moves."""

    lengths: dict[str, int]
    own: str
    active: Set[str]
    statements: list[Statement] = field(default_factory=list, init=False)

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
        """Add statements after those that are there."""
        self.statements += statements


def split(items: Sequence[Any], lengths: Sequence[int]) -> list[Sequence[Any]]:
    """The items, end to end, by the registers that hold them."""
    ends = list(itertools.accumulate(lengths, initial=0))
    return [items[start:end] for start, end in itertools.pairwise(ends)]


def nonzero(inputs: Sequence[Node], results: Mapping[int, Sequence[Node]]) -> Product:
    """Product with these results by number; a zero that is one whatever the numbers are is left out."""
    kept = {k: nodes for k, nodes in results.items() if any(node.value != 0.0 for node in nodes)}
    nodes = [node for group in kept.values() for node in group]
    return Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)}) if nodes else None, tuple(kept)


@kept_by_first
def tangent_graph(graph: Graph, inputs: Numbers, moving: Numbers, outputs: Numbers) -> Product:
    """Tangents of outputs from those of the inputs `moving`, by lengths of registers. Inputs: its own, tangents."""
    groups = split(graph.inputs, inputs)
    made = simplify(jvp(graph, [node for k in moving for node in groups[k]]))
    return nonzero(made.inputs, dict(enumerate(split(list(made.outputs.values()), outputs))))


@dataclass
class Tangent(Registers):
    """The statements that push tangents on through assignments.  dots: {register: the one that has its tangent}."""

    dots: dict[str, str]

    def push(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the first first."""
        for assignment in assignments:
            rule_of(assignment.statement, "jvp")(assignment, self)
            for name in set(reads_and_writes(assignment.statement)[1]) - self.active:
                self.dots.pop(name, None)

    def dot(self, register: str) -> str:
        """A new register for the tangent of one."""
        self.dots[register] = dot = self.fresh(f"{register}_dot", self.lengths[register])
        return dot


class Linearized(NamedTuple):
    """A program of tangents or cotangents."""

    program: Program
    vectors: Mapping[str, str]  # {register of a value: that of its tangent or cotangent, before and after a pass}
    unsolved: str  # a register that is not 0 after passes in which equations of a `FixedPoint` were not solved


class Passes(Registers):
    """A program in single assignment, of which derivatives are made.

    of: registers whose values after a pass matter.  wrt: those by which derivatives are taken,
    besides what a pass hands on: `inputs`, which stay the same, and `varied`, of the feed.  constant: those whose
    values have no derivatives.  plain: the assignments.  constants: registers that passes read and never write.
    handed: {register that a pass hands on to the next: the one that has its value after the pass}.  shared: as of the
    program, without those of `wrt`.
    """

    def __init__(self, program: Program, of: Sequence[str], wrt: Sequence[str], constant: Sequence[str] = ()) -> None:
        require_kind("program", program, Program)
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
        super().__init__(dict(program.registers), unused_sign("@", program.registers), set())
        self._with, self.fed = unused_sign(":", program.registers), tuple(program.feed)
        self.current = dict[str, str]()  # {register of the program: the one that has its value}, here in the body
        written = effects(program.body)[1]
        kept = [copied(name, name) for name in dict.fromkeys(of) if name not in written]
        self.plain = [self.assignment(each) for each in [*program.body, *kept]]
        reads = [name for name in effects(statements_of(self.plain))[0] if name in program.registers]
        handed = [name for name in dict.fromkeys((*of, *reads)) if name in self.current and name not in self.fed]
        self.handed = {name: self.now(name) for name in handed}
        self.shared = {name: numbers for name, numbers in program.shared.items() if name not in wrt}
        known = {*self.handed, *self.fed, *self.shared}
        self.constants = [name for name in reads if name not in known]
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
        if row.bodies:
            return rule_of(statement, "assign")(statement, self)  # type: ignore[no-any-return]
        before = {name: self.now(name) for name in names_in(statement, row.reads)}
        new = with_names(statement, self.now, [each for each in row.reads if each not in row.writes])
        new = with_names(new, self.write, row.writes)
        changed = names_in(statement, [each for each in row.writes if each in row.reads])
        return Assignment(new, tuple([copied(before[name], self.now(name)) for name in changed]))

    def tangents(self) -> tuple[Tangent, dict[str, str]]:
        """Tangents of what a pass hands on and reads, and their registers: they end where the next pass reads them."""
        moving = [name for name in self.handed if name in self.active]
        dots = {name: f"{name}{self._with}dot" for name in (*moving, *self.inputs, *self.varied)}
        lengths = self.lengths | {dot: self.lengths[name] for name, dot in dots.items()}
        tangent = Tangent(lengths, self.own, self.active, dict(dots))
        tangent.push(self.plain)
        tangent.add(*[copied(tangent.dots.get(self.handed[name]), dots[name]) for name in moving])
        return tangent, dots

    def program(
        self, made: Registers, body: list[Statement], record: Sequence[str], feed: Sequence[str], more: Iterable[str]
    ) -> Program:
        """The program of a body, with those registers of `made` that it uses, and more."""
        names = {name for statement in body for names in reads_and_writes(statement) for name in names}
        used = {*names, *record, *feed, *more, self.unsolved}
        lengths = {name: length for name, length in {**made.lengths, self.unsolved: 1}.items() if name in used}
        shared = {name: numbers for name, numbers in self.shared.items() if name in lengths}
        return Program(lengths, body, record=record, feed=feed, shared=shared)


def program_jvp(program: Program, wrt: Sequence[str] = (), *, constant: Sequence[str] = ()) -> Linearized:
    """A program with the tangents of its registers: J x_dot of any number of passes.

    Every register that is recorded or handed on, and every one of `wrt`, has a register "{name}:dot" for its tangent,
    which is set before the first pass and read after the last one: `vectors` of the result. Its record has the rows of
    the program's, then the tangents of what has tangents in them. A `FixedPoint` has the tangent of its equations, a
    `While` has none.

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
    passes = Passes(program, getattr(program, "record", ()), wrt, constant)
    tangent, dots = passes.tangents()
    body = [*statements_of(passes.plain), *[statement for each in passes.plain for statement in each.unrun]]
    body += [*tangent.statements, *[copied(after, before) for before, after in passes.handed.items()]]
    record = [*program.record, *[dots[name] for name in program.record if name in dots]]
    made = passes.program(tangent, body, record, program.feed, {*program.registers, *dots.values()})
    return Linearized(made, dots, passes.unsolved)


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
