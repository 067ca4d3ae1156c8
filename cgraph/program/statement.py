"""Statement: what a program does at a time; the table of the kinds of statements, a row each; what runs them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.checks import GraphError
from ..core.evaluation import Array
from ..core.graph import Graph
from ..util.require import require_sequence

Lengths = Mapping[str, int]  # of registers, by name
Names = tuple[str, ...]
Rule = Callable[..., None]  # of the statement, or its assignment, and of what it is written or run with


class Statement:
    """Base of the kinds of statements, each of which is a frozen dataclass and a `StatementRow`.

    >>> from cgraph.extend import Factor, Statement
    >>> isinstance(Factor("A", "pivots"), Statement)
    True
    """


@dataclass(frozen=True, eq=False)
class StatementRow:
    """One row of the table of statements: all that the library knows of a kind of statement, see docs/extending.md.

    >>> from cgraph.extend import STATEMENTS, Solve
    >>> STATEMENTS[Solve].reads, STATEMENTS[Solve].writes
    (('matrix', 'pivots', 'vector'), ('vector',))
    """

    kind: type[Statement]
    reads: Names  # its fields that name registers, each a name or a tuple of names
    writes: Names  # the same; a field in both is changed in place
    run: Rule  # (statement, state, execution): its effect on {register: list of float}
    check: Rule | None = None  # (statement, lengths): raises GraphError where registers do not fit
    bodies: Names = ()  # its fields that are statements, run as often as registers say
    graph: str = ""  # its field, or property, that is a graph, or several
    text: Rule | None = None  # (statement, writer): LLVM's text; without it, it runs in Python
    beside: Rule | None = None  # as `run`, on arrays (length, N); with it `text` has to write for vectors, too
    assign: Callable[..., Any] | None = None  # (statement, assigned): its assignment, which bodies need
    jvp: Rule | None = None  # (assignment, tangent): adds the statements that push tangents on
    transpose: Rule | None = None  # (assignment, adjoint): adds those that pull cotangents back


STATEMENTS: dict[type[Statement], StatementRow] = {}  # filled by statements/__init__.py


def register_statement(row: StatementRow) -> None:
    """Add a row to the table of statements: from then on programs may have statements of its kind.

    Raises TypeError for what is no row of a class over `Statement`; ValueError for a kind that is in the table already,
    or has no field of a name in `reads`, `writes`, `bodies`, `graph`.

    >>> from cgraph.extend import STATEMENTS, Call, register_statement
    >>> register_statement(STATEMENTS[Call])
    Traceback (most recent call last):
    ValueError: statement Call is in the table already
    """
    if not (isinstance(row, StatementRow) and isinstance(row.kind, type) and issubclass(row.kind, Statement)):
        raise TypeError(f"register_statement takes a StatementRow of a class over Statement, got {row!r:.60}")
    name = row.kind.__name__
    if row.kind in STATEMENTS:
        raise ValueError(f"statement {name} is in the table already")
    fields = getattr(row.kind, "__dataclass_fields__", {})
    if unknown := [each for each in (*row.reads, *row.writes, *row.bodies, row.graph) if each and each not in fields]:
        raise ValueError(f"statement {name} has no field {unknown[0]!r} (it has {', '.join(fields) or 'none'})")
    STATEMENTS[row.kind] = row


def row_of(statement: Statement) -> StatementRow:
    """Row of a statement. Raises TypeError for what is no statement of the table."""
    try:
        return STATEMENTS[type(statement)]
    except KeyError:
        raise TypeError(f"{statement!r:.60} is no statement of the table, see register_statement") from None


@dataclass(frozen=True)
class Execution:
    """Means of the rules in Python: graphs at a point, or at points (inputs, N); so `many` memories, -1: one alone."""

    lengths: Lengths
    values: Callable[[Graph, Sequence[float]], Sequence[float]]
    batch: Callable[[Graph, Array], Array]
    many: int = -1

    def run(self, statements: Sequence[Statement], state: dict[str, Any]) -> None:
        """Statements, one after another."""
        for statement in statements:
            row = row_of(statement)
            rule = row.run if self.many < 0 else row.beside
            assert rule is not None, "Runner.run has asked"
            rule(statement, state, self)

    def positive(self, values: Sequence[float] | Array) -> bool:
        """Whether the number of a register is, in any of the memories; NaN is not."""
        return bool(values[0] > 0.0 if self.many < 0 else np.any(np.asarray(values) > 0.0))

    def write(self, state: dict[str, Any], register: str, numbers: Array) -> None:
        """The numbers of a register, of one memory or of many, from an array of its own."""
        state[register] = numbers if self.many >= 0 else numbers.tolist()


def names_in(statement: Statement, fields: Iterable[str]) -> Names:
    """The registers that some fields name."""
    values = [getattr(statement, field) for field in fields]
    return tuple([name for value in values for name in ((value,) if isinstance(value, str) else value)])


def with_names(statement: Any, new: Callable[[str], str], fields: Iterable[str] | None = None) -> Any:
    """The statement with other registers in some fields, by default in all but those of its bodies."""
    row = row_of(statement)
    values = {field: getattr(statement, field) for field in ((*row.reads, *row.writes) if fields is None else fields)}
    changed = {k: new(v) if isinstance(v, str) else tuple([new(name) for name in v]) for k, v in values.items()}
    return replace(statement, **changed)


def bodies_of(statement: Statement) -> tuple[Sequence[Statement], ...]:
    """The statements that it runs itself."""
    return tuple([getattr(statement, field) for field in row_of(statement).bodies])


def graphs_of(statement: Statement) -> tuple[Graph, ...]:
    """The graphs that it runs."""
    found = getattr(statement, name) if (name := row_of(statement).graph) else ()
    return (found,) if isinstance(found, Graph) else tuple(found)


def reads_and_writes(statement: Statement) -> tuple[Names, Names]:
    """The registers that a statement reads, and those that it writes, with what its bodies do."""
    row = row_of(statement)
    reads, writes = names_in(statement, row.reads), names_in(statement, row.writes)
    for body in bodies_of(statement):
        first, last = effects(body)
        reads, writes = (*reads, *first), (*writes, *last)
    return reads, tuple(dict.fromkeys(writes))


def effects(statements: Iterable[Statement]) -> tuple[dict[str, None], dict[str, None]]:
    """The registers that are read before they are written, and those that are written, in order, as keys.

    >>> from cgraph.extend import copied, effects
    >>> first, written = effects([copied("x", "y"), copied("y", "z")])
    >>> list(first), list(written)
    (['x'], ['y', 'z'])
    """
    reads: dict[str, None] = {}
    writes: dict[str, None] = {}
    for statement in require_sequence("statements", statements, "statements", Statement):
        before, after = reads_and_writes(statement)
        reads |= {name: None for name in before if name not in writes}
        writes |= dict.fromkeys(after)
    return reads, writes


def needed(statements: Sequence[Statement], results: Iterable[str]) -> list[Statement]:
    """The statements that results depend on, in their order; one with bodies is whole or not there."""
    wanted, kept = set(results), []
    for statement in reversed(statements):
        reads, writes = reads_and_writes(statement)
        if wanted & set(writes):
            if not row_of(statement).bodies:  # which may run no time at all
                wanted -= set(writes)
            wanted |= set(reads)
            kept.append(statement)
    return kept[::-1]


def length_of(lengths: Lengths, where: object, name: str) -> int:
    """Length of a register. Raises GraphError for an unknown one, in the words of `where`."""
    if not isinstance(name, str) or name not in lengths:
        raise GraphError(f"{where} names register {name!r}, not among {', '.join(lengths) or 'none'}")
    return lengths[name]


def require_length(lengths: Lengths, where: object, name: str, length: int) -> None:
    """Raises GraphError if a register of that name is unknown or has another length; for the `check` of a row.

    >>> from cgraph.extend import require_length
    >>> require_length({"a": 2}, "Sort", "a", 3)
    Traceback (most recent call last):
    cgraph.core.checks.GraphError: Sort needs register 'a' to have length 3, got 2
    """
    if (actual := length_of(lengths, where, name)) != length:
        raise GraphError(f"{where} needs register {name!r} to have length {length}, got {actual}")


def require_once(where: object, names: Sequence[str]) -> None:
    """Raises GraphError if a register is written twice by one statement."""
    if twice := [name for name in names if names.count(name) > 1]:
        raise GraphError(f"{where} writes register {twice[0]!r} twice")
