"""Single assignment: statements written anew so that every value has a register of its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ..statement import Names, Statement, bodies_of, names_in, row_of, with_names
from ..statements.call import Map, copied


@dataclass(frozen=True, eq=False)
class Assignment:
    """A statement whose outputs no other one writes; what it changes in place is copied first, by `copies`.

    parts: of a statement with bodies, each body in single assignment.
    after: for each part, {register that the statement writes: the one that has its value at the end of the part}.
    carried: of an iteration, the registers that a turn reads before it writes them.
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


@dataclass
class Registers:
    """Lengths of registers by name, and new ones, in whose names alone `own` is."""

    lengths: dict[str, int]
    own: str = "@"
    statements: list[Statement] = field(default_factory=list)  # what has been added

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

    def of(self, names: Iterable[str]) -> tuple[int, ...]:
        """Lengths of registers."""
        return tuple([self.lengths[name] for name in names])


@dataclass
class Assigned(Registers):
    """Statements in single assignment, one after another.

    current: {register of the program: the one that has its value now}, where that is another.
    """

    current: dict[str, str] = field(default_factory=dict)

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

    def in_place(self, statement: Statement) -> Statement:
        """Statement over the registers of now, which it also writes. Raises TypeError for one with bodies."""
        if bodies_of(statement):
            raise TypeError(f"a FixedPoint with a {type(statement).__name__} in its turns has no derivatives")
        row = row_of(statement)
        return with_names(statement, dict.fromkeys((*row.reads, *row.writes)), self.now)


def flat(assignments: Iterable[Assignment]) -> list[Statement]:
    """The statements of assignments, copies included."""
    return [statement for assignment in assignments for statement in assignment.statements]
