"""`many`: the program of memories side by side, which takes the course of each of them: by masks and choices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

from ..core.graph import Graph
from ..operations.table import where
from ..util.require import require_kind
from ..writing.naming import variables
from .program import Program, live_registers, outliving, unused_sign
from .statement import Statement, reads_and_writes, row_of
from .statements.call import Call, Map, copied
from .statements.control import FixedPoint, If, While


def many(program: Program) -> Program:
    """The program with its branches and loops under masks, for memories side by side.

    What its `If` and `While` decide by is 1 where they apply and else 0, and what they write is put back where they do
    not. So every memory, a lane, ends with the same numbers whether other lanes take another course or not: an `If` is
    run if any lane is positive, and a `While` as long as any is; a `FixedPoint` becomes a `While`, so that derivatives
    are taken before. Registers for masks, and for what is put back, stand after those of the program. `Runner.run`
    makes it of N memories.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, While, many
    >>> n = cg.variable("n")
    >>> count = While("n", (Call(cg.Graph([n], {"n": n - 1.0}), ("n",), ("n",)),))
    >>> (turns,) = [each for each in many(Program({"n": 1}, [count], record=["n"])).body if isinstance(each, While)]
    >>> [type(each).__name__ for each in turns.body]  # keep n, a turn, choose, go on?
    ['Map', 'Call', 'Map', 'Call']
    """
    require_kind("program", program, Program)
    return many_keeping(program, program.registers)


def many_keeping(program: Program, kept: Iterable[str]) -> Program:
    """`many`, but what is neither kept nor outlives a pass is put back only where something reads it."""
    if not any([row_of(each).bodies for each in program.statements()]):
        return program
    lengths, after = dict(program.registers), dict[int, Set[str]]()
    live_registers(program.body, {*kept, *outliving(program)}, after)
    masked = _Masked(lengths, unused_sign(":", lengths), after)
    masked.run(program.body)
    return replace(program, registers=lengths, body=tuple(masked.statements))


@dataclass
class _Masked:
    """Statements that change the lanes of a mask alone, when what they write is put back in the others.

    own: a sign in no name of the program's.  after: {id of a statement: the registers that are read behind its bodies}.
    mask: the register that is 1 in its lanes, else 0; none: all lanes.  written: registers to be put back.
    """

    lengths: dict[str, int]
    own: str
    after: Mapping[int, Set[str]]
    mask: tuple[str, ...] = ()
    depth: int = 0
    statements: list[Statement] = field(default_factory=list)
    written: dict[str, None] = field(default_factory=dict)

    def run(self, statements: Sequence[Statement]) -> None:
        """Add statements, one after another."""
        for statement in statements:
            if isinstance(statement, If):
                self._branch(statement)
            elif isinstance(statement, While | FixedPoint):
                self._loop(statement)
            else:
                self.statements.append(statement)
                self.written |= dict.fromkeys(reads_and_writes(statement)[1])

    def _branch(self, statement: If) -> None:
        """Add both bodies, each in its lanes."""
        on, off = self._register("on"), self._register("off")
        graph = _WAYS_IN_MASK if self.mask else _WAYS
        self.statements.append(Call(graph, (statement.register, *self.mask), (on, off)))
        for way, body in ((on, statement.body), (off, statement.otherwise)):
            if body:
                self.statements.append(If(way, self._body(statement, body, way), seldom=statement.seldom))

    def _loop(self, statement: While | FixedPoint) -> None:
        """Add turns in the lanes that still go on."""
        going, graph = self._register("going"), _GOING_IN_MASK if self.mask else _GOING
        turn = self._body(statement, statement.body, going)
        self.statements.append(Call(graph, (statement.register, *self.mask), (going,)))
        self.statements.append(While(going, (*turn, Call(_GOING_IN_MASK, (statement.register, going), (going,)))))

    def _body(self, statement: Statement, statements: Sequence[Statement], mask: str) -> tuple[Statement, ...]:
        """A body in the lanes of a mask: what it writes is kept before, and put back in the others."""
        inner = replace(self, mask=(mask,), depth=self.depth + 1, statements=[], written={})
        inner.run(statements)
        back = [name for name in inner.written if name in self.after[id(statement)]]
        before = {name: inner._register(f"{name} before", self.lengths[name]) for name in back}
        keep = [copied(name, kept) for name, kept in before.items()]
        choose = [Map(_CHOSEN, (mask, name, kept), (name,)) for name, kept in before.items()]
        return (*keep, *inner.statements, *choose)

    def _register(self, name: str, length: int = 1) -> str:
        """A register for a body at this depth, which others at this depth share."""
        own = f"{name}{self.own}{self.depth}"
        self.lengths.setdefault(own, length)
        return own


_C, _MASK, _NEW, _OLD = variables("c mask new old")
_ON = _C > 0.0  # where NaN is not
_CHOSEN = Graph([_MASK, _NEW, _OLD], {"chosen": where(_MASK, _NEW, _OLD)})
_GOING = Graph([_C], {"going": _ON})
_GOING_IN_MASK = Graph([_C, _MASK], {"going": where(_ON, _MASK, 0.0)})
_WAYS = Graph([_C], {"on": _ON, "off": where(_ON, 0.0, 1.0)})
_WAYS_IN_MASK = Graph([_C, _MASK], {"on": where(_ON, _MASK, 0.0), "off": where(_ON, 0.0, _MASK)})
