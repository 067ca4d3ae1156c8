"""Program: registers of numbers, and the statements that one pass runs over them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import GraphError
from ..core.evaluation import real_array
from ..core.graph import Graph
from ..util.explain_failure import explain_failure
from ..util.require import require_mapping
from .listing import Listing
from .statement import (
    Statement,
    bodies_of,
    effects,
    graphs_of,
    length_of,
    names_in,
    require_length,
    require_once,
    row_of,
)
from .statements.call import Call
from .statements.rows import For, check_rows


@explain_failure
@dataclass(frozen=True)
class Program:
    """A loop body over named registers of numbers, which `runner` makes ready to run.

    registers: {name: length}, all the numbers that a program works on.  body: the statements of a pass, of the kinds in
    `STATEMENTS`.  record: registers which, end to end, make a row of the record; record_if: one of length 1, where a
    pass at whose end it is not positive records nothing.  stop: one of length 1; the passes end after one at whose end
    it is not 0.  feed: registers which, end to end, take a row of numbers before each pass, from those handed to the
    run.  shared: {register that passes only read: its numbers}, which stand once for all memories and are in none.
    Raises GraphError for a statement with an unknown register, or registers of lengths that do not fit; for rows of
    shared tables that `check_shared` refuses.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, runner
    >>> x = cg.variable("x")
    >>> halve = Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))
    >>> run = runner(Program({"x": 1}, [halve], record=["x"]))
    >>> run.run(run.memory({"x": 8.0}), passes=3).rows.ravel().tolist()
    [4.0, 2.0, 1.0]
    """

    registers: Mapping[str, int]
    body: Sequence[Statement]
    record: Sequence[str]
    record_if: str | None = None
    stop: str | None = None
    feed: Sequence[str] = ()
    shared: Mapping[str, ArrayLike] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        for name, length in self.registers.items():
            if not isinstance(length, int) or length < 0:
                raise GraphError(f"register {name!r} needs a length, an integer not negative, got {length!r:.60}")
        for where, names in (("the record", self.record), ("the feed", self.feed)):
            for name in names:
                length_of(self.registers, where, name)
        require_once("the feed", self.feed)
        for what in ("record_if", "stop"):
            if (number := getattr(self, what)) is not None:
                require_length(self.registers, what, number, 1)
        for statement in self.statements():
            row, kind = row_of(statement), type(statement).__name__
            for name in names_in(statement, (*row.reads, *row.writes)):
                length_of(self.registers, kind, name)
            require_once(kind, names_in(statement, row.writes))
            if row.check is not None:
                row.check(statement, self.registers)
        if changed := [name for name in (*self.feed, *effects(self.body)[1]) if name in self.shared]:
            raise GraphError(f"register {changed[0]!r} is written or fed, and all memories share it")
        self.check_shared(self.shared)

    def check_shared(self, numbers: Mapping[str, ArrayLike]) -> None:
        """Raises GraphError for numbers of shared registers that do not fit, as of a runner where they were changed.

        So do rows, if a `For` has all its tables here, that reach beyond a register or break the contract of `For`.
        """
        known = {}
        for name, value in require_mapping("shared", numbers, "register: numbers").items():
            length, array = length_of(self.registers, "shared", name), real_array(f"shared {name!r}", value)
            if array.shape not in ((), (length,)):
                raise GraphError(f"shared register {name!r} needs shape ({length},), got {array.shape}")
            known[name] = np.broadcast_to(array, (length,))
        for statement in self.statements() if known else ():
            if isinstance(statement, For):
                check_rows(statement, self.registers, known)

    def statements(self) -> Iterator[Statement]:
        """Every statement, outer before inner."""
        waiting = list(reversed(self.body))
        while waiting:
            statement = waiting.pop()
            yield statement
            waiting += reversed([each for body in bodies_of(statement) for each in body])

    def listing(self, names: Mapping[str, Graph] = MappingProxyType({})) -> str:
        """The program as a person would write it: lengths of registers, then the statements of a pass.

        Short graphs are formulas of registers, element by element where these hold several numbers; a longer one is a
        function with its number of operations.  names: {name of a function: its graph}; others are f1, f2, ..

        >>> import cgraph as cg
        >>> from cgraph.extend import Call, If, Program
        >>> x = cg.variable("x")
        >>> halve = Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))
        >>> print(Program({"x": 1, "more": 1}, [If("more", (halve,))], record=["x"]).listing())
        1 number: x, more
        each pass:
            if more > 0:
                x = 1/2 * x
        record: x
        """
        text = Listing(self.registers, require_mapping("names", names, "name: graph"))
        fed = [f"before each pass: {', '.join(self.feed)} from the feed"] if self.feed else []
        condition = f" if {self.record_if} > 0" if self.record_if else ""
        record = f"record{condition}: {', '.join(self.record) or 'nothing'}"
        stop = [f"stop if {self.stop} != 0"] if self.stop else []
        return "\n".join([*text.registers(), *fed, "each pass:", *text.body(self.body), record, *stop])

    @property
    def width(self) -> int:
        """Numbers in a row of the record."""
        return sum(self.registers[name] for name in self.record)

    @property
    def feed_width(self) -> int:
        """Numbers in a row of the feed."""
        return sum(self.registers[name] for name in self.feed)

    @property
    def alone(self) -> tuple[str, ...]:
        """Reasons why memories cannot run side by side: kinds of statements, `record_if`, `stop`."""
        kinds = {type(statement).__name__ for statement in self.statements() if row_of(statement).beside is None}
        return (*sorted(kinds), *[name for name in ("record_if", "stop") if getattr(self, name) is not None])

    def graphs(self) -> list[Graph]:
        """The graphs that statements run, each once."""
        graphs = [graph for statement in self.statements() for graph in graphs_of(statement)]
        return list({id(graph): graph for graph in graphs}.values())


def unused_sign(sign: str, names: Iterable[str]) -> str:
    """The sign, as often as it is in no name."""
    own = sign
    while any([own in name for name in names]):
        own += sign
    return own


def whole_graph(program: Program, x: str) -> Graph | None:
    """The graph, if a pass is one call of it: of the register x, giving the record."""
    call = program.body[0] if len(program.body) == 1 else None
    if isinstance(call, Call) and (call.inputs, call.outputs, call.products) == ((x,), tuple(program.record), None):
        return call.graph
    return None


def outliving(program: Program) -> list[str]:
    """The registers that a pass reads, or that are read after it, before it is sure to have set them."""
    read = {*program.record, *[name for name in (program.record_if, program.stop) if name is not None]}
    first = live_registers(program.body, read, {})
    return [name for name in program.registers if name in first and name not in program.shared]


def live_registers(statements: Sequence[Statement], read: Set[str], after: dict[int, Set[str]]) -> Set[str]:
    """Registers that matter before statements, if `read` do behind; `after` gets those behind bodies, by their ids."""
    live = set(read)
    for statement in reversed(statements):
        row, bodies = row_of(statement), bodies_of(statement)
        if bodies:  # which may run no time at all, or again
            inside = [name for body in bodies for name in live_registers(body, set(), {})]
            live |= {*names_in(statement, row.reads), *inside}
            after[id(statement)] = frozenset(live)
            for body in bodies:
                live_registers(body, live, after)
        else:
            live = (live - {*names_in(statement, row.writes)}) | {*names_in(statement, row.reads)}
    return live
