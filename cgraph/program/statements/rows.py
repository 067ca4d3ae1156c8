"""For: a graph for each row of a table, on numbers that lie where the row says: structure as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import GraphError
from ...core.evaluation import Array
from ...core.graph import Graph
from ..statement import Execution, Lengths, Names, Statement, length_of, require_length, require_once

if TYPE_CHECKING:
    from ..writer import Writer

Part = tuple[int, int]  # a block, by its number, and how many numbers of it
Parts = tuple[Part, ...]
Ends = list[tuple[str, str, int]]  # what rows use: register, table of its places or "", how many numbers
Kind = tuple[Graph, Ends, Ends, Ends]
USES = {  # and what is said of one that breaks the contract
    "writes": "writes what another writes",
    "adds to": "adds to what is written behind that",
    "reads": "reads what is not complete",
    "keeps": "reads as it was what another changes",
}
Integers = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True, eq=False)
class For(Statement):
    """for each row: the graph of its kind reads some blocks of numbers, writes others, and adds to others.

    A block is a register from the place on that a table has for the row. So one program, compiled once, runs over any
    tree or list whose structure stands in tables.

    graphs: one for each kind of row.  kind: register with the number of the graph of each row, where there are several.
    count: register with how many rows there are, at most as many as `kind` is long.  tables: registers with a number
    for each row, places.  Of memories side by side these are those of the first; they have no derivatives.
    inputs: registers that are read alone.  changed: those that are written or added to.  blocks: (number among inputs
    and changed, number among tables or -1 for the begin of the register).  reads, writes, adds: for each graph the
    blocks, (number, length), which end to end are its inputs, and its outputs: those that are written, then those that
    are added.  backwards: from the last row to the first.
    A row writes what no other row writes, or adds. All that is added or written is there before it is read; but what a
    row writes, it may read by the same block as it was before. `Program.check_shared` says so of tables that it knows.

    >>> import cgraph as cg
    >>> from cgraph.extend import For, Program, runner
    >>> x, y = cg.variables("x y")
    >>> sums = For((cg.Graph([x, y], {"sum": x + y}),), "kind", "count", ("own", "parent"), (), ("v",),
    ...     ((0, 0), (0, 1)), (((0, 1), (1, 1)),), (((0, 1),),), ((),))
    >>> run = runner(Program({"kind": 3, "count": 1, "own": 3, "parent": 3, "v": 4}, [sums], record=["v"]))
    >>> tree = {"count": 3.0, "own": [1, 2, 3], "parent": [0, 1, 1], "v": [0.0, 1.0, 2.0, 3.0]}
    >>> run.run(run.memory(tree), passes=1).rows.tolist()
    [[0.0, 1.0, 3.0, 4.0]]
    """

    graphs: tuple[Graph, ...]
    kind: str
    count: str
    tables: Names
    inputs: Names
    changed: Names
    blocks: tuple[tuple[int, int], ...]
    reads: tuple[Parts, ...]
    writes: tuple[Parts, ...]
    adds: tuple[Parts, ...]
    backwards: bool = False

    @property
    def registers(self) -> Names:
        """The registers that blocks are of."""
        return (*self.inputs, *self.changed)

    @property
    def uses(self) -> tuple[tuple[Parts, ...], ...]:
        """What kinds of rows read, write and add to."""
        return self.reads, self.writes, self.adds

    @property
    def kinds(self) -> list[Kind]:
        """The graph of each kind of row, and what it reads, writes and adds to."""
        at = [(self.registers[register], (*self.tables, "")[table]) for register, table in self.blocks]
        uses = [[[(*at[k], length) for k, length in parts] for parts in use] for use in self.uses]
        return list(zip(self.graphs, *uses, strict=True))


def for_rows(
    kinds: Sequence[Kind], over: tuple[str, str], changed: Sequence[str] = (), *, backwards: bool = False
) -> For:
    """The `For` of some kinds of rows, whose blocks are told by name: (register, table or "", length).

    over: registers with the kind of each row and with how many there are.  changed: registers that are, whether written
    or not.
    """
    uses: list[list[Ends]] = [list(each) for each in zip(*[kind[1:] for kind in kinds], strict=True)]
    blocks = list(dict.fromkeys([end[:2] for use in uses for ends in use for end in ends]))
    changed = list(dict.fromkeys([*changed, *[end[0] for use in uses[1:] for ends in use for end in ends]]))
    inputs = [name for name in dict.fromkeys([name for name, _ in blocks]) if name not in changed]
    tables = [table for table in dict.fromkeys([table for _, table in blocks]) if table]
    places = tuple([([*inputs, *changed].index(name), tables.index(table) if table else -1) for name, table in blocks])
    reads, writes, adds = [
        tuple([tuple([(blocks.index(end[:2]), end[2]) for end in ends]) for ends in use]) for use in uses
    ]
    graphs, names = tuple([graph for graph, *_ in kinds]), (tuple(tables), tuple(inputs), tuple(changed))
    return For(graphs, *over, *names, places, reads, writes, adds, backwards)


def sizes_of(ends: Ends) -> tuple[int, ...]:
    """How many numbers rows use of each block."""
    return tuple([length for *_, length in ends])


def check_for(statement: For, lengths: Lengths) -> None:
    """Raises GraphError if tables differ in length, or blocks are not as many numbers as a graph takes."""
    where, rows = "For", length_of(lengths, "For", statement.kind)
    require_length(lengths, where, statement.count, 1)
    for name in statement.tables:
        require_length(lengths, where, name, rows)
    for register, table in statement.blocks:
        if not (0 <= register < len(statement.registers) and -1 <= table < len(statement.tables)):
            raise GraphError(f"For has no register {register} or no table {table}")
    for block, length in [part for use in statement.uses for parts in use for part in parts]:
        if not (0 <= block < len(statement.blocks) and length >= 0):
            raise GraphError(f"For has no block {block}, or not {length} numbers of it")
    require_once(where, statement.registers)
    if any(len(use) != len(statement.graphs) for use in statement.uses):
        raise GraphError(f"For needs reads, writes and adds for each of {len(statement.graphs)} graphs")
    fixed = {*statement.inputs, *statement.tables, statement.kind, statement.count}
    for graph, reads, writes, adds in statement.kinds:
        for what, ends, wanted in (("in", reads, len(graph.inputs)), ("out", [*writes, *adds], len(graph.outputs))):
            if (total := sum(sizes_of(ends))) != wanted:
                raise GraphError(f"For: a graph has {wanted} {what}puts, its blocks hold {total} numbers")
        if wrong := [name for name, *_ in (*writes, *adds) if name in fixed]:
            raise GraphError(f"For writes register {wrong[0]!r}, which is not among those that it changes alone")


def check_rows(statement: For, lengths: Lengths, known: Mapping[str, Array]) -> None:
    """Raises GraphError if rows do not keep the contract of `For`, where all tables are known."""
    several = len(statement.graphs) > 1
    if not known.keys() >= {statement.count, *statement.tables, *([statement.kind] if several else [])}:
        return
    count, room, sign = known[statement.count][0], lengths[statement.kind], -1 if statement.backwards else 1
    if not (0 <= count <= room and count == int(count)):
        raise GraphError(f"For has {count:g} rows by register {statement.count!r}, and room for {room}")
    rows = np.arange(int(count))
    kind = known[statement.kind][: len(rows)] if several else np.zeros(len(rows))
    _refuse(~np.isin(kind, range(len(statement.graphs))), rows, f"of {len(statement.graphs)} kinds is none of")
    found: dict[tuple[str, str], list[Integers]] = {}  # by register and use, (row, place) of each number
    for number, (_, *uses) in enumerate(statement.kinds):
        here, own = rows[kind == number], {end[:2] for end in uses[1]}
        for use, ends in zip(("reads", "writes", "adds to"), uses, strict=True):
            for name, table, length in ends:
                begin = known[table][here] if table else np.zeros(len(here))
                beyond = ~((begin >= 0) & (begin + length <= lengths[name]) & (begin == np.floor(begin)))
                _refuse(beyond, here, f"{use} {length} numbers that are not all in register {name!r}:")
                places = begin.astype(np.int64)[:, None] + np.arange(length)
                key = name, "keeps" if use == "reads" and (name, table) in own else use
                found.setdefault(key, []).append(np.stack([here.repeat(length), places.ravel()]))
    for name in statement.changed:
        of = [np.concatenate(found.get((name, use), [np.empty((2, 0), np.int64)]), axis=1) for use in USES]
        (writes, adds, reads, keeps), at = [sign * row for row, _ in of], [places for _, places in of]
        written = np.full(lengths[name], -room - 1)  # when, by the order of rows
        written[at[0]] = writes
        last = written.copy()
        np.maximum.at(last, at[1], adds)
        twice = np.bincount(at[0], minlength=lengths[name])[at[0]] > 1
        others = (written[at[3]] != keeps) & (last[at[3]] >= -room)
        bad = twice, adds <= written[at[1]], last[at[2]] >= reads, others
        for said, which, (row, _) in zip(USES.values(), bad, of, strict=True):
            _refuse(which, row, f"{said} in register {name!r}:")


def _refuse(bad: Integers, rows: Integers, what: str) -> None:
    if bad.any():
        raise GraphError(f"For {what} row {rows[np.argmax(bad)]}")


def run_for(statement: For, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, row by row; of many memories each row as a batch, by the tables of the first."""
    many, kinds = execution.many >= 0, statement.kinds
    numbers = {name: np.asarray(state[name], dtype=np.float64) for name in statement.registers}
    numbers |= {name: numbers[name].copy() for name in statement.changed}
    names = (statement.count, statement.kind, *statement.tables)
    tables = {name: [int(each[0] if many else each) for each in state[name]] for name in names}
    rows = range(tables[statement.count][0])
    for row in reversed(rows) if statement.backwards else rows:
        graph, *uses = kinds[tables[statement.kind][row] if len(kinds) > 1 else 0]
        at = [[(name, tables[table][row] if table else 0, length) for name, table, length in ends] for ends in uses]
        reads, writes, adds = [[numbers[name][start : start + n] for name, start, n in ends] for ends in at]
        points = np.concatenate([np.empty((0, execution.many) if many else 0), *reads])
        values = np.asarray(execution.batch(graph, points) if many else execution.values(graph, points.tolist()))
        for part in writes:
            part[...], values = values[: len(part)], values[len(part) :]
        for part in adds:  # one after another: two may be of the same numbers
            part[...], values = part + values[: len(part)], values[len(part) :]
    for name in statement.changed:
        execution.write(state, name, numbers[name])


def for_text(statement: For, writer: Writer) -> None:
    """Write as machine code: a loop over the rows; of lanes, tables are those of the first."""

    def integer(register: str, index: str) -> str:
        number = writer.load_at(writer.double_at(writer.pointer(register), index, "0"), "double")
        return writer.value(f"fptosi double {number} to i64")

    def row_text(graph: Graph, *uses: Ends) -> None:
        blocks = list(dict.fromkeys([end[:2] for ends in uses for end in ends]))
        reads, writes, adds = [[(blocks.index(end[:2]), end[2]) for end in ends] for ends in uses]
        places = {table: integer(table, row) if table else "0" for _, table in blocks}
        at = [writer.at(writer.pointer(name), places[table]) for name, table in blocks]
        terms = [(at[block], k) for block, length in adds for k in range(length)]
        sums = writer.beside(len(terms))
        name = writer.functions.row(graph, len(at) + 1, reads, [*writes, (len(at), len(terms))])
        writer.call(name, [*at, sums])
        for j, (base, k) in enumerate(terms):  # one after another: two may be of the same numbers
            place, term = writer.at(base, k), writer.load_at(writer.at(sums, j))
            writer.store_at(writer.value(f"fadd {writer.type} {writer.load_at(place)}, {term}"), place)

    count, (*others, last) = integer(statement.count, "0"), statement.kinds
    with writer.loop(0, count) as i, ExitStack() as inside:
        row = writer.integer("sub", writer.integer("sub", count, 1), i) if statement.backwards else i
        kind = integer(statement.kind, row) if others else ""
        for number, each in enumerate(others):
            otherwise = inside.enter_context(writer.when(writer.integer("icmp eq", kind, number)))
            row_text(*each)
            otherwise()
        row_text(*last)
