"""Fused programs: short statements that follow one another as one call, whose values stay in registers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..codegen.schedule import products_of
from ..core.graph import Graph
from ..core.node import Node, variable
from ..core.traversal import rebuild
from ..operations.operation import columns
from .program import Program
from .statement import Statement, row_of
from .statements.call import Call, Map, elements
from .statements.control import If

MOST = 1000  # operations of what is fused: it compiles in some tens of milliseconds, and a short run gains no more


def fused(program: Program, *, alike: bool = False) -> Program:
    """The program with calls and maps that follow one another as one call where all of them are short.

    Long ones stay as they are: what they share, such as the rate in the stages of a step, is code that is there once.
    Products are rounded where they were, so that results have the same bits wherever functions of the C library are
    not joined with others.
    alike: whether functions of the C library are joined with those that they are joined with already, and no others.
    """
    return replace(program, body=_fused(program, program.body, alike=alike))


def _fused(program: Program, statements: Sequence[Statement], *, alike: bool) -> tuple[Statement, ...]:
    done: list[Statement] = []
    run: list[Call | Map] = []
    for statement in statements:
        if isinstance(statement, Map) or (isinstance(statement, Call) and not statement.exact):
            if alike and not _as_before([*run, statement]):
                done += _one_call(program, run)
                run = []
            run.append(statement)
            continue
        done += _one_call(program, run)
        run = []
        names = () if isinstance(statement, If) and statement.seldom else row_of(statement).bodies
        bodies = {name: _fused(program, getattr(statement, name), alike=alike) for name in names}
        if bodies:
            statement = replace(statement, **bodies)  # type: ignore[type-var]
        done.append(statement)
    return (*done, *_one_call(program, run))


def _as_before(run: Sequence[Call | Map]) -> bool:
    """Whether functions that may be joined have no other company in one call than each in its own."""
    joining = [each for each in run if any(columns(node.op).vector for node in each.graph.nodes)]
    return not joining or (len(joining) == 1 and (len(run) == 1 or isinstance(joining[0], Call)))


def _one_call(program: Program, run: list[Call | Map]) -> list[Call | Map]:
    """The statements as one, if they are short and no product that is overwritten would go into a sum."""
    repeated = [1 if isinstance(each, Call) else elements(each, program.registers) for each in run]
    size = sum([len(each.graph.nodes) * count for each, count in zip(run, repeated, strict=True)])
    if len(run) < 2 or size > MOST:
        return run
    registers = _Registers(program)
    for statement, count in zip(run, repeated, strict=True):
        if isinstance(statement, Call):
            registers.call(statement)
        elif count:
            registers.map(statement, count)
    whole = registers.statement()
    return run if registers.overwritten.intersection(products_of(whole.graph).values()) else [whole]


class _Registers:
    """Values of registers while statements are followed."""

    def __init__(self, program: Program) -> None:
        self.overwritten: set[Node] = set()
        self._lengths = program.registers
        self._read: dict[str, list[Node]] = {}  # {register that is read before it is written: its values}
        self._written: dict[str, list[Node]] = {}

    def call(self, call: Call) -> None:
        """outputs = graph(inputs)."""
        results = applied(call.graph, [value for name in call.inputs for value in self._values(name)])
        for name in call.outputs:
            self._write(name, [results.pop(0) for _ in range(self._lengths[name])])

    def map(self, statement: Map, count: int) -> None:
        """outputs[i] = graph(shared, inputs[i])."""
        shared = [value for name in statement.shared for value in self._values(name)]
        columns = [self._values(name) for name in statement.inputs]
        rows = [
            applied(statement.graph, [*shared, *[column[i if len(column) == count else 0] for column in columns]])
            for i in range(count)
        ]
        for name, values in zip(statement.outputs, zip(*rows, strict=True), strict=True):
            self._write(name, list(values))

    def statement(self) -> Call:
        """All that was followed."""
        inputs = [value for values in self._read.values() for value in values]
        outputs = [value for values in self._written.values() for value in values]
        graph = Graph(inputs, {f"{k}": value for k, value in enumerate(outputs)})
        return Call(graph, tuple(self._read), tuple(self._written))

    def _values(self, name: str) -> list[Node]:
        if name in self._written:
            return self._written[name]
        if name not in self._read:
            first = sum(map(len, self._read.values()))
            self._read[name] = [variable(f"r{first + k}") for k in range(self._lengths[name])]
        return self._read[name]

    def _write(self, name: str, values: list[Node]) -> None:
        self.overwritten |= {*self._written.get(name, ())}
        self._written[name] = values


def applied(graph: Graph, values: Sequence[Node]) -> list[Node]:
    """The outputs of a graph at nodes, operation by operation as it has them: nothing is folded."""
    inputs = dict(zip(graph.inputs, values, strict=True))
    outputs = list(graph.outputs.values())
    copies = rebuild(outputs, inputs, lambda node, args: Node(node.op, args, node.label))
    return [copies[node] for node in outputs]
