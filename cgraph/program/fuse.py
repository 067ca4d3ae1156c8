"""Fused programs: short statements that follow one another as one call, whose values stay in registers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..codegen.schedule import products_of
from ..core.graph import Graph
from ..core.node import Node, constant, variable
from ..core.row import Row
from ..operations.operation import OPS, columns
from .program import Program
from .statement import Statement, row_of
from .statements.call import Call, Map, Sum, elements, products_in, several
from .statements.control import If

MOST_OPERATIONS = 1000  # of one call: it compiles in some tens of milliseconds, and a short run gains no more
# Operations by which the code of a graph that several statements call may grow: beyond, calls take no longer.
COPIES = 100
# Elements of a `Map` or `Sum` that becomes straight code, and operations of them all. In vectors fewer instructions do
# more of them, but a vector of numbers that have just been written one by one waits until the last is in the cache.
FEW_ELEMENTS, STRAIGHT = 8, 200


def fused(program: Program, *, alike: bool = False) -> Program:
    """The program with short calls, maps and sums that follow one another as one call, products rounded as before.

    alike: whether calls of functions of the C library stay with those that they are joined with, to the bit.
    """
    uses = Counter([id(each.graph) for each in program.statements() if isinstance(each, Call)])

    def joined(statements: Sequence[Statement]) -> tuple[Statement, ...]:
        done: list[Statement] = []
        run: list[Call | Map | Sum] = []
        size = 0.0
        for statement in statements:
            work = _work(statement, program, uses, alike)
            if size + work > MOST_OPERATIONS:
                done += _one_call(program, run)
                run, size = [], 0.0
            if isinstance(statement, Call | Map | Sum) and work <= MOST_OPERATIONS:
                run.append(statement)
                size += work
                continue
            names = () if isinstance(statement, If) and statement.seldom else row_of(statement).bodies
            bodies = {name: joined(getattr(statement, name)) for name in names}
            done.append(replace(statement, **bodies) if bodies else statement)  # type: ignore[type-var]
        return (*done, *_one_call(program, run))

    return replace(program, body=joined(program.body))


def _work(statement: Statement, program: Program, uses: Counter[int], alike: bool) -> float:
    """The operations of a statement, infinite where it stays as it is."""
    if not isinstance(statement, Call | Map | Sum) or (isinstance(statement, Call) and statement.exact):
        return math.inf
    if alike and any(columns(node.op).vector for node in statement.graph.nodes):
        return math.inf
    size = sum([1 for node in statement.graph.nodes if node.args])
    if isinstance(statement, Call):
        return size if (uses[id(statement.graph)] - 1) * size <= COPIES else math.inf
    count = elements(statement, program.registers)
    if several(statement, program.registers) or count > FEW_ELEMENTS or size * count > STRAIGHT:
        return math.inf
    return size * count


def _one_call(program: Program, run: Sequence[Call | Map | Sum]) -> Sequence[Call | Map | Sum]:
    """The statements as one."""
    if not run or (len(run) == 1 and isinstance(run[0], Call)):
        return run
    registers = _Registers(program)
    for statement in run:
        registers.follow(statement)
    return [registers.statement()]


class _Registers:
    """Values of registers while statements are followed."""

    def __init__(self, program: Program) -> None:
        self._lengths = program.registers
        self._read: dict[str, list[Node]] = {}  # {register that is read before it is written: its values}
        self._written: dict[str, list[Node]] = {}
        self._known: dict[tuple[object, ...], Node] = {}  # {operation and arguments, or the digits of a constant: node}
        self._products: dict[Node, Node] = {}  # {sum: the product that it is rounded with}

    def follow(self, statement: Call | Map | Sum) -> None:
        """Values that the statement writes, computed from those that there are."""
        if isinstance(statement, Call):
            given = [value for name in statement.inputs for value in self._values(name)]
            values = self._applied(statement.graph, given, products_in(statement))
        else:
            count, products = elements(statement, self._lengths), products_of(statement.graph)
            shared = [value for name in statement.shared for value in self._values(name)]
            each = [self._values(name) for name in statement.inputs]
            points = [[*shared, *[values[i if len(values) == count else 0] for values in each]] for i in range(count)]
            rows = [self._applied(statement.graph, point, products) for point in points]
            outputs = len(statement.graph.outputs)
            if isinstance(statement, Map):
                values = [row[k] for k in range(outputs) for row in rows]
            else:
                values = [self._constant(constant(0.0))] * outputs
                for row in rows:
                    values = [self._operation(OPS["add"], pair) for pair in zip(values, row, strict=True)]
        for name in statement.outputs:
            length = self._lengths[name]
            self._written[name], values = values[:length], values[length:]

    def statement(self) -> Call:
        """Statement of all that was followed."""
        inputs = [value for values in self._read.values() for value in values]
        outputs = [value for values in self._written.values() for value in values]
        graph = Graph(inputs, {f"{k}": value for k, value in enumerate(outputs)})
        products = None if self._products == products_of(graph) else self._products
        return Call(graph, tuple(self._read), tuple(self._written), products)

    def _values(self, name: str) -> list[Node]:
        if name in self._written:
            return self._written[name]
        if name not in self._read:
            first = sum(map(len, self._read.values()))
            self._read[name] = [variable(f"r{first + k}") for k in range(self._lengths[name])]
        return self._read[name]

    def _applied(self, graph: Graph, values: Sequence[Node], products: Mapping[Node, Node]) -> list[Node]:
        """The outputs of a graph at nodes."""
        new = dict(zip(graph.inputs, values, strict=True))
        for node in graph.nodes:
            if node.args:
                product = new[products[node]] if node in products else None
                new[node] = self._operation(node.op, [new[arg] for arg in node.args], product)
            elif node not in new:
                new[node] = self._constant(node)
        return [new[node] for node in graph.outputs.values()]

    def _constant(self, node: Node) -> Node:
        assert node.value is not None
        return self._known.setdefault((node.value.hex(),), node)

    def _operation(self, op: Row, args: Sequence[Node], product: Node | None = None) -> Node:
        """The operation on these; product: the argument that it is rounded with."""
        key = (op.name, *args, product)
        if key not in self._known:
            node = self._known[key] = Node(op, tuple(args))
            if product is not None:
                self._products[node] = product
        return self._known[key]
