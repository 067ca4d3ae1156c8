"""Program: registers of numbers, and the statements that one pass runs over them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..core.graph import Graph
from ..errors import GraphError


@dataclass(frozen=True)
class Call:
    """outputs = graph(inputs): the registers, end to end, are the graph's inputs in order, and its outputs."""

    graph: Graph
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Map:
    """Each output register, element by element: graph(elements of the inputs). Inputs of length 1 serve every element.

    One register for each input and each output of the graph.
    """

    graph: Graph
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Sum:
    """output (length 1) = the sum of graph(elements of the inputs), from the first element to the last."""

    graph: Graph
    inputs: tuple[str, ...]
    output: str


@dataclass(frozen=True)
class While:
    """The body again and again, as long as the register (length 1) is positive; a NaN is not."""

    register: str
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class If:
    """The body when the register (length 1) is positive, else `otherwise`."""

    register: str
    body: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Factor:
    """LU = PA in place of the matrix (n * n, row by row), with partial pivoting; its row exchanges go to `pivots` (n).

    Of a singular matrix a pivot is 0, and `Solve` then gives infinities or NaN.
    """

    matrix: str
    pivots: str


@dataclass(frozen=True)
class Solve:
    """The solution of A x = b in place of b (n), by what `Factor` left of A."""

    matrix: str
    pivots: str
    vector: str


Statement = Call | Map | Sum | While | If | Factor | Solve


@dataclass(frozen=True)
class Program:
    """A loop body over named registers; see `runner` for how it is run.

    registers: {name: length}, all the numbers there are.  body: what one pass does.
    record: registers that make a row of the record, end to end.
    record_if: a register (length 1); a pass at whose end it is not positive records nothing.
    stop: a register (length 1); the passes end after one at whose end it is not 0.

    Raises GraphError, naming the statement, for an unknown register or lengths that do not fit.
    """

    registers: Mapping[str, int]
    body: Sequence[Statement]
    record: Sequence[str]
    record_if: str | None = None
    stop: str | None = None

    def __post_init__(self) -> None:
        for name, length in self.registers.items():
            if not isinstance(length, int) or length < 0:
                raise GraphError(f"register {name!r} needs a length, an integer not negative, got {length!r:.60}")
        for name in self.record:
            self._length("the record", name)
        for what, control in (("record_if", self.record_if), ("stop", self.stop)):
            if control is not None:
                self._need(what, control, 1)
        for statement in self.statements():
            _CHECKS[type(statement)](self, statement)

    def statements(self) -> Iterator[Statement]:
        """Every statement, outer before inner."""
        waiting = list(reversed(self.body))
        while waiting:
            statement = waiting.pop()
            yield statement
            if isinstance(statement, While | If):
                inner = [*statement.body, *(statement.otherwise if isinstance(statement, If) else ())]
                waiting += reversed(inner)

    @property
    def width(self) -> int:
        """Numbers in a row of the record."""
        return sum(self.registers[name] for name in self.record)

    def graphs(self) -> list[Graph]:
        """The graphs that statements run, each once."""
        found: dict[int, Graph] = {}
        for statement in self.statements():
            if isinstance(statement, Call | Map | Sum):
                found.setdefault(id(statement.graph), statement.graph)
        return list(found.values())

    def _length(self, where: str, name: str) -> int:
        if name not in self.registers:
            raise GraphError(f"{where} names register {name!r}, not among {', '.join(self.registers) or 'none'}")
        return self.registers[name]

    def _need(self, where: str, name: str, length: int) -> None:
        if (found := self._length(where, name)) != length:
            raise GraphError(f"{where} needs register {name!r} to have length {length}, got {found}")

    def _check_call(self, call: Call) -> None:
        where = f"Call of {call.graph!r}"
        sides = (("inputs", call.inputs, len(call.graph.inputs)), ("outputs", call.outputs, len(call.graph.outputs)))
        for what, names, needed in sides:
            if (found := sum(self._length(where, name) for name in names)) != needed:
                raise GraphError(f"{where} needs {needed} {what}, the registers {', '.join(names)} hold {found}")
        _check_once(where, call.outputs)

    def _check_elements(self, statement: Map | Sum) -> None:
        where = f"{type(statement).__name__} of {statement.graph!r}"
        outputs = statement.outputs if isinstance(statement, Map) else (statement.output,)
        counts = ((statement.inputs, len(statement.graph.inputs)), (outputs, len(statement.graph.outputs)))
        for names, needed in counts:
            if len(names) != needed:
                raise GraphError(f"{where} needs {needed} registers, got {len(names)}: {', '.join(names)}")
        for name in (*statement.inputs, *outputs):
            self._length(where, name)
        count = self.elements(statement)
        for name in statement.inputs:
            if self.registers[name] not in (1, count):
                raise GraphError(f"{where}: register {name!r} needs length {count} or 1, got {self.registers[name]}")
        for name in outputs:
            self._need(where, name, count if isinstance(statement, Map) else 1)
        _check_once(where, outputs)

    def elements(self, statement: Map | Sum) -> int:
        """Over how many elements it runs."""
        names = statement.outputs if isinstance(statement, Map) else statement.inputs
        return max([self.registers[name] for name in names], default=1)

    def _check_control(self, statement: While | If) -> None:
        self._need(type(statement).__name__, statement.register, 1)

    def _check_matrix(self, statement: Factor | Solve) -> None:
        where = type(statement).__name__
        n = self._length(where, statement.pivots)
        self._need(where, statement.matrix, n * n)
        if isinstance(statement, Solve):
            self._need(where, statement.vector, n)


_CHECKS: dict[type, Callable[[Program, Any], None]] = {
    Call: Program._check_call,
    Map: Program._check_elements,
    Sum: Program._check_elements,
    While: Program._check_control,
    If: Program._check_control,
    Factor: Program._check_matrix,
    Solve: Program._check_matrix,
}


def _check_once(where: str, names: Sequence[str]) -> None:
    if twice := [name for name in names if names.count(name) > 1]:
        raise GraphError(f"{where} writes register {twice[0]!r} twice")
