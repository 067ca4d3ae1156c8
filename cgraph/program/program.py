"""Program: registers of numbers, and the statements that one pass runs over them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..core.checks import GraphError
from ..core.graph import Graph
from ..util.explain_failure import explain_failure


@dataclass(frozen=True)
class Call:
    """outputs = graph(inputs).

    Attributes
    ----------
    graph : Graph
        The function.
    inputs, outputs : tuple of str
        Registers which, end to end, are the graph's inputs and outputs in order.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Call
    >>> a, b = cg.variables("a b")
    >>> swap = Call(cg.Graph([a, b], {"first": b, "second": a}), ("pair",), ("pair",))
    """

    graph: Graph
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Map:
    """outputs[i] = graph(inputs[i]) for every element i.

    Attributes
    ----------
    graph : Graph
        The function of one element.
    inputs, outputs : tuple of str
        A register for each input and each output of the graph, of one common length; an input of length 1 has the same
        value for every element.
    shared : tuple of str
        Registers which, end to end, are the graph's first inputs, before those of `inputs`: the same for every element.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Map
    >>> x, h = cg.variables("x h")
    >>> scale = Map(cg.Graph([x, h], {"y": x * h}), ("values", "step"), ("values",))
    """

    graph: Graph
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    shared: tuple[str, ...] = ()


@dataclass(frozen=True)
class Sum:
    """output = sum over i of graph(inputs[i]), from the first element to the last.

    Attributes
    ----------
    graph : Graph
        The function of one element, with one output.
    inputs : tuple of str
        A register for each input of the graph, of one common length or of length 1.
    output : str
        A register of length 1.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Sum
    >>> x = cg.variable("x")
    >>> norm = Sum(cg.Graph([x], {"square": x * x}), ("values",), "total")
    """

    graph: Graph
    inputs: tuple[str, ...]
    output: str


@dataclass(frozen=True)
class While:
    """while (register > 0) body.

    Attributes
    ----------
    register : str
        A register of length 1; NaN is not positive.
    body : tuple of Statement
        What is repeated.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Call, While
    >>> n = cg.variable("n")
    >>> countdown = While("n", (Call(cg.Graph([n], {"less": n - 1.0}), ("n",), ("n",)),))
    """

    register: str
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class If:
    """if (register > 0) body else otherwise.

    Attributes
    ----------
    register : str
        A register of length 1; NaN is not positive.
    body, otherwise : tuple of Statement
        What is run in either case.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Call, If
    >>> n = cg.variable("n")
    >>> not_below_zero = If("n", (), (Call(cg.Graph([], {"zero": 0.0}), (), ("n",)),))
    """

    register: str
    body: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Factor:
    """LU = PA in place of a matrix A, with partial pivoting.

    Of a singular matrix a pivot is 0, and `Solve` then gives infinities or NaN.

    Attributes
    ----------
    matrix : str
        A register of length n * n: A, row by row.
    pivots : str
        A register of length n, which receives the row exchanges.

    Examples
    --------
    >>> from cgraph.extend import Factor, Program, Solve
    >>> program = Program({"A": 4, "p": 2, "b": 2}, [Factor("A", "p"), Solve("A", "p", "b")], record=["b"])
    """

    matrix: str
    pivots: str


@dataclass(frozen=True)
class Solve:
    """The solution of A x = b in place of b.

    Attributes
    ----------
    matrix, pivots : str
        The registers of A and its row exchanges, after `Factor`.
    vector : str
        A register of length n: b, then x.

    Examples
    --------
    >>> from cgraph.extend import Program, Solve, runner
    >>> solve = runner(Program({"LU": 1, "p": 1, "b": 1}, [Solve("LU", "p", "b")], record=["b"]))
    >>> solve.run(solve.memory({"LU": 2.0, "p": 0.0, "b": 6.0}), passes=1).rows.tolist()
    [[3.0]]
    """

    matrix: str
    pivots: str
    vector: str


Statement = Call | Map | Sum | While | If | Factor | Solve


@explain_failure
@dataclass(frozen=True)
class Program:
    """A loop body over named registers of numbers, which `runner` makes ready to run.

    Parameters
    ----------
    registers : mapping of str to int
        {name: length}: all the numbers that a program works on.
    body : sequence of Statement
        What one pass does: `Call`, `Map`, `Sum`, `While`, `If`, `Factor`, `Solve`.
    record : sequence of str
        Registers which, end to end, make a row of the record.
    record_if : str, optional
        A register of length 1; a pass at whose end it is not positive records nothing.
    stop : str, optional
        A register of length 1; the passes end after one at whose end it is not 0.
    feed : sequence of str
        Registers which, end to end, take a row of numbers before each pass, from those handed to the run.

    Raises
    ------
    GraphError
        If a statement names an unknown register, or registers of lengths that do not fit.

    Examples
    --------
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

    def __post_init__(self) -> None:
        for name, length in self.registers.items():
            if not isinstance(length, int) or length < 0:
                raise GraphError(f"register {name!r} needs a length, an integer not negative, got {length!r:.60}")
        for name in self.record:
            self._length("the record", name)
        for name in self.feed:
            self._length("the feed", name)
        _check_once("the feed", self.feed)
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

    @property
    def feed_width(self) -> int:
        """Numbers in a row of the feed."""
        return sum(self.registers[name] for name in self.feed)

    def graphs(self) -> list[Graph]:
        """The graphs that statements run, each once."""
        graphs: dict[int, Graph] = {}
        for statement in self.statements():
            if isinstance(statement, Call | Map | Sum):
                graphs.setdefault(id(statement.graph), statement.graph)
        return list(graphs.values())

    def _length(self, where: str, name: str) -> int:
        if name not in self.registers:
            raise GraphError(f"{where} names register {name!r}, not among {', '.join(self.registers) or 'none'}")
        return self.registers[name]

    def _need(self, where: str, name: str, length: int) -> None:
        if (actual := self._length(where, name)) != length:
            raise GraphError(f"{where} needs register {name!r} to have length {length}, got {actual}")

    def _check_call(self, call: Call) -> None:
        where = f"Call of {call.graph!r}"
        sides = (("inputs", call.inputs, len(call.graph.inputs)), ("outputs", call.outputs, len(call.graph.outputs)))
        for what, names, needed in sides:
            if (total := sum(self._length(where, name) for name in names)) != needed:
                raise GraphError(f"{where} needs {needed} {what}, the registers {', '.join(names)} hold {total}")
        _check_once(where, call.outputs)

    def _check_elements(self, statement: Map | Sum) -> None:
        where = f"{type(statement).__name__} of {statement.graph!r}"
        outputs = statement.outputs if isinstance(statement, Map) else (statement.output,)
        known = sum([self._length(where, name) for name in statement.shared]) if isinstance(statement, Map) else 0
        if known > len(statement.graph.inputs):
            raise GraphError(f"{where} has {len(statement.graph.inputs)} inputs, the shared registers hold {known}")
        counts = ((statement.inputs, len(statement.graph.inputs) - known), (outputs, len(statement.graph.outputs)))
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
        """The number of elements that a statement runs over."""
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
