"""Single assignment: statements written anew so that every value has a register of its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from cgraph.extend import Call, Factor, Map, Solve, Statement, Sum, While

from ...integrators.elementwise import SAME


@dataclass(frozen=True)
class Assignment:
    """A statement whose outputs no other one writes; what it overwrites in place is copied first.

    copies: before the statement.  turn: of an iteration, one turn from its fixed point on, in single assignment.
    after: {register at the fixed point: the same after the turn}.  carried: those that a turn reads before it writes.
    """

    statement: Statement
    copies: tuple[Map, ...] = ()
    turn: tuple[Assignment, ...] = ()
    after: Mapping[str, str] | None = None
    carried: tuple[str, ...] = ()

    @property
    def statements(self) -> tuple[Statement, ...]:
        """With the copies."""
        return (*self.copies, self.statement)


class Assigned:
    """Statements in single assignment, one after another.

    lengths: of all registers; grows.  current: {register: the one that has its value now}.
    """

    def __init__(self, statements: Sequence[Statement], lengths: dict[str, int], renamed: Mapping[str, Sequence[str]]):
        self.lengths = lengths
        self.current: dict[str, str] = {}
        self._renamed = renamed
        self.assignments = [self._assigned(statement) for statement in statements]

    def now(self, name: str) -> str:
        """The register that has the value of `name`."""
        return self.current.get(name, name)

    def _read(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple([self.now(part) for name in names for part in self._renamed.get(name, (name,))])

    def _written(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple([self._write(name) for name in names])

    def _write(self, name: str) -> str:
        self.current[name] = new = fresh(self.lengths, name, self.lengths[name])
        return new

    def _assigned(self, statement: Statement) -> Assignment:
        match statement:
            case Call():
                inputs = self._read(statement.inputs)
                return Assignment(Call(statement.graph, inputs, self._written(statement.outputs)))
            case Map():
                inputs, shared = self._read(statement.inputs), self._read(statement.shared)
                return Assignment(Map(statement.graph, inputs, self._written(statement.outputs), shared))
            case Sum():
                inputs = self._read(statement.inputs)
                return Assignment(Sum(statement.graph, inputs, self._write(statement.output)))
            case Factor():
                before, matrix = self.now(statement.matrix), self._write(statement.matrix)
                return Assignment(Factor(matrix, self._write(statement.pivots)), (Map(SAME, (before,), (matrix,)),))
            case Solve():
                before, matrix, pivots = (
                    self.now(name) for name in (statement.vector, statement.matrix, statement.pivots)
                )
                solution = self._write(statement.vector)
                return Assignment(Solve(matrix, pivots, solution), (Map(SAME, (before,), (solution,)),))
            case While():
                return self._iteration(statement)
        raise TypeError(f"a step cannot have a statement of the type {type(statement).__name__}")

    def _iteration(self, statement: While) -> Assignment:
        reads, writes = effects(statement.body)
        carried = [name for name in dict.fromkeys((*reads, statement.register)) if name in writes]
        before = {name: self.now(name) for name in carried}
        at = {name: self._write(name) for name in writes}
        copies = tuple([Map(SAME, (before[name],), (at[name],)) for name in carried])
        body = tuple([self._in_place(each) for each in statement.body])
        outside = dict(self.current)
        turn = tuple([self._assigned(each) for each in statement.body])
        after = {at[name]: self.now(name) for name in writes}
        self.current = outside
        loop = While(self.now(statement.register), body)
        return Assignment(loop, copies, turn, after, tuple([at[name] for name in carried]))

    def _in_place(self, statement: Statement) -> Statement:
        """With the registers of now, which it also writes."""
        match statement:
            case Call():
                return Call(statement.graph, self._read(statement.inputs), self._read(statement.outputs))
            case Map():
                inputs, outputs = self._read(statement.inputs), self._read(statement.outputs)
                return Map(statement.graph, inputs, outputs, self._read(statement.shared))
            case Sum():
                return Sum(statement.graph, self._read(statement.inputs), self.now(statement.output))
            case Solve():
                return Solve(self.now(statement.matrix), self.now(statement.pivots), self.now(statement.vector))
        raise TypeError(f"an iteration cannot have a statement of the type {type(statement).__name__}")


def fresh(lengths: dict[str, int], name: str, length: int) -> str:
    """A new register called after `name`."""
    stem = name.partition("@")[0]
    number = len(lengths)
    lengths[f"{stem}@{number}"] = length
    return f"{stem}@{number}"


def require_no_shared(statement: Map) -> None:
    """Raises TypeError for a Map with shared registers, of which there are no derivatives."""
    if statement.shared:
        raise TypeError(f"a Map with shared registers, {', '.join(statement.shared)}, has no derivatives here")


def reads_and_writes(statement: Statement) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The registers that a statement reads, and those that it writes."""
    match statement:
        case Call():
            return statement.inputs, statement.outputs
        case Map():
            return (*statement.shared, *statement.inputs), statement.outputs
        case Sum():
            return statement.inputs, (statement.output,)
        case Factor():
            return (statement.matrix,), (statement.matrix, statement.pivots)
        case Solve():
            return (statement.matrix, statement.pivots, statement.vector), (statement.vector,)
        case While():
            reads, writes = effects(statement.body)
            return (*reads, statement.register), tuple(writes)
    raise TypeError(f"a step cannot have a statement of the type {type(statement).__name__}")


def effects(statements: Iterable[Statement]) -> tuple[dict[str, None], dict[str, None]]:
    """The registers that are read before they are written, and those that are written, in order."""
    reads: dict[str, None] = {}
    writes: dict[str, None] = {}
    for statement in statements:
        before, after = reads_and_writes(statement)
        reads |= {name: None for name in before if name not in writes}
        writes |= dict.fromkeys(after)
    return reads, writes


def needed(statements: Sequence[Statement], results: Iterable[str]) -> list[Statement]:
    """The statements that results depend on, in their order; an iteration is whole or not there."""
    wanted, kept = set(results), []
    for statement in reversed(statements):
        reads, writes = reads_and_writes(statement)
        if wanted & set(writes):
            if not isinstance(statement, While | Factor | Solve):
                wanted -= set(writes)
            wanted |= set(reads)
            kept.append(statement)
    return kept[::-1]


def flat(assignments: Iterable[Assignment]) -> Iterator[Statement]:
    """The statements of assignments, copies included."""
    for assignment in assignments:
        yield from assignment.statements
