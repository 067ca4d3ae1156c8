"""LLVM's text for the functions that a program's statements call: a graph once, element by element, or summed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from ..codegen.arithmetic import Arithmetic
from ..codegen.llvm_ir import Address, Body, body, libm_functions
from ..core.graph import Graph

_ARGUMENT = {"x": "in", "y": "out"}  # by the names that `body` gives to the two sides of a graph
Lengths = tuple[int, ...]  # of the registers that are a function's arguments


class Functions:
    """The functions of one module, each written once.

    Every function takes pointers to registers, inputs first: `void f(in0, in1, .., out0, out1, ..)`.
    definitions: the lines of all functions.  width: of the vectors in which `map` goes through its elements.
    """

    def __init__(self, arithmetic: Arithmetic, width: int) -> None:
        self.arithmetic, self.width = arithmetic, width
        self.definitions: list[str] = []
        self._names: dict[tuple[object, ...], str] = {}

    def call(self, graph: Graph, inputs: Lengths, outputs: Lengths) -> str:
        """y = graph(x), where the input registers end to end are x, and the output registers y."""
        places = {
            base: [(group, k) for group, length in enumerate(lengths) for k in range(length)]
            for base, lengths in (("x", inputs), ("y", outputs))
        }

        def address(base: str, name: str, row: int) -> list[str]:
            group, k = places[base][row]
            return [f"  {name} = getelementptr {self.arithmetic.type}, ptr %{_ARGUMENT[base]}{group}, i64 {k}"]

        def lines() -> list[str]:
            written = self._body(graph, self.arithmetic, address, scope)
            return [*written.start, *written.lines]

        scope = [*_pointers("in", inputs), *_pointers("out", outputs)]
        return self._define((id(graph), inputs, outputs), "call", lines, len(inputs), len(outputs))

    def map(self, graph: Graph, inputs: Lengths, count: int, shared: Lengths = ()) -> str:
        """y[i] = graph(shared, x[i]) for i = 0 .. count - 1; an input of another length holds one number for all i."""
        t, known = self.arithmetic.type, _numbers(shared)
        inputs = (*shared, *inputs)

        def address(base: str, name: str, row: int) -> list[str]:
            if base == "x" and row < len(known):
                return [f"  {name} = getelementptr {t}, ptr %in{known[row][0]}, i64 {known[row][1]}"]
            row += len(shared) - len(known) if base == "x" else 0
            moves = base == "y" or inputs[row] == count
            return [f"  {name} = getelementptr {t}, ptr %{_ARGUMENT[base]}{row}, i64 {'%i' if moves else 0}"]

        def lines() -> list[str]:
            return _loop(self._body(graph, self.arithmetic, address, scope), [], count)

        scope = [*_pointers("in", inputs), *_pointers("out", graph.outputs), "i64 %i"]
        in_vectors = self.arithmetic.lanes == 1 and self.width > 1 and count > 1 and not libm_functions(graph)
        chosen = self._map_in_vectors(graph, inputs, count, shared) if in_vectors else lines
        key = ("map", id(graph), inputs, count, len(shared))
        return self._define(key, "map", chosen, len(inputs), len(graph.outputs))

    def _map_in_vectors(self, graph: Graph, inputs: Lengths, count: int, shared: Lengths) -> Callable[[], list[str]]:
        """As `map`, a vector of elements at a time; results beyond the last element go to the register's padding.

        inputs: the shared ones first.
        """
        arithmetic = self.arithmetic._replace(lanes=self.width, together=1)
        known, first = _numbers(shared), len(shared)
        t, scalars = arithmetic.type, [k for k, length in enumerate(inputs) if k >= first and length != count]

        def address(base: str, name: str, row: int) -> list[str]:
            if base == "x" and row < len(known):
                return [f"  {name} = getelementptr double, ptr %in{known[row][0]}, i64 {known[row][1]}"]
            row += first - len(known) if base == "x" else 0
            if base == "x" and row in scalars:
                return [f"  {name} = getelementptr {t}, ptr %same{row}, i64 0"]
            return [f"  {name} = getelementptr {t}, ptr %{_ARGUMENT[base]}{row}, i64 %i"]

        def lines() -> list[str]:
            spread = []  # a vector of equal numbers for each input that is the same for all elements
            for k in scalars:
                spread += [
                    f"  %same{k} = alloca {t}, align 64",
                    f"  %one{k} = load double, ptr %in{k}, align 8",
                    f"  %first{k} = insertelement {t} poison, double %one{k}, i32 0",
                    f"  %all{k} = shufflevector {t} %first{k}, {t} poison, <{self.width} x i32> zeroinitializer",
                    f"  store {t} %all{k}, ptr %same{k}, align 64",
                ]
            written = self._body(graph, arithmetic, address, scope, len(known))
            return [*spread, *_loop(written, [], -(-count // self.width))]

        scope = [*_pointers("in", inputs), *_pointers("out", graph.outputs), "i64 %i"]
        scope += [f"ptr %same{k}" for k in scalars]
        return lines

    def sum(self, graph: Graph, inputs: Lengths, count: int, shared: Lengths = (), outputs: Lengths = (1,)) -> str:
        """y = sum over i = 0 .. count - 1 of graph(shared, x[i]), added up in this order from 0."""
        t, known, first = self.arithmetic.type, _numbers(shared), len(shared)
        inputs, places = (*shared, *inputs), _numbers(outputs)
        terms = [f"%one{k}" if k else "%one" for k in range(len(places))]

        def address(base: str, name: str, row: int) -> list[str]:
            if base == "y":
                return [f"  {name} = getelementptr {t}, ptr {terms[row]}, i64 0"]
            if row < len(known):
                return [f"  {name} = getelementptr {t}, ptr %in{known[row][0]}, i64 {known[row][1]}"]
            row += first - len(known)
            return [f"  {name} = getelementptr {t}, ptr %in{row}, i64 {'%i' if inputs[row] == count else 0}"]

        def lines() -> list[str]:
            start, add = [], []
            for k, ((register, at), term) in enumerate(zip(places, terms, strict=True)):
                start += [f"  {term} = alloca {t}, align 64"]
                start += [f"  %sum{k} = getelementptr {t}, ptr %out{register}, i64 {at}"]
                start += [f"  store {t} {self.arithmetic.number(0.0)}, ptr %sum{k}, align 8"]
                add += [  # y += graph(shared, x[i])
                    f"  %so.far{k} = load {t}, ptr %sum{k}, align 8",
                    f"  %here{k} = load {t}, ptr {term}, align 8",
                    f"  %total{k} = fadd {t} %so.far{k}, %here{k}",
                    f"  store {t} %total{k}, ptr %sum{k}, align 8",
                ]
            return [*start, *(_loop(self._body(graph, self.arithmetic, address, scope), add, count) if count else [])]

        scope = [*_pointers("in", inputs), *[f"ptr {term}" for term in terms], "i64 %i"]
        key = ("sum", id(graph), inputs, count, first, outputs)
        return self._define(key, "sum", lines, len(inputs), len(outputs))

    def take(self, table: Sequence[int]) -> str:
        """y[i] = x[table[i]]."""
        t, size = self.arithmetic.type, len(table)

        def lines() -> list[str]:
            numbers = ", ".join(f"i64 {place}" for place in table)
            name = f"@table{len(self._names)}"
            self.definitions.append(f"{name} = internal unnamed_addr constant [{size} x i64] [{numbers}]")
            body = [
                f"  %place.at = getelementptr i64, ptr {name}, i64 %i",
                "  %place = load i64, ptr %place.at, align 8",
                f"  %from = getelementptr {t}, ptr %in0, i64 %place",
                f"  %to = getelementptr {t}, ptr %out0, i64 %i",
                f"  %taken = load {t}, ptr %from, align 8",
                f"  store {t} %taken, ptr %to, align 8",
            ]
            return _loop(Body([], body, []), [], size) if size else []

        return self._define(("take", tuple(table)), "take", lines, 1, 1)

    def _body(
        self, graph: Graph, arithmetic: Arithmetic, address: Address, scope: Sequence[str], uniform: int = 0
    ) -> Body:
        """The body of the function that is being defined, those that it calls defined before."""
        written = body(graph, arithmetic, address, next(reversed(self._names.values())), scope, uniform=uniform)
        self.definitions += written.definitions
        return written

    def _define(
        self, key: tuple[object, ...], kind: str, lines: Callable[[], list[str]], inputs: int, outputs: int
    ) -> str:
        """The name of the function of this key, which is written when it is first asked for."""
        if key not in self._names:
            name = self._names[key] = f"{kind}{len(self._names)}"
            arguments = [*(f"ptr noalias %in{k}" for k in range(inputs))]
            arguments += [f"ptr noalias %out{k}" for k in range(outputs)]
            head = f"define internal void @{name}({', '.join(arguments)}) nounwind {{"
            inner = lines()  # which may define functions of its own
            self.definitions += [head, "start:", *inner, "  ret void", "}"]
        return self._names[key]

    def text(self, name: str, text: Callable[[Arithmetic], Sequence[str]]) -> str:
        """A function of that name, whose lines `text` writes for the module's arithmetic."""
        if (name,) not in self._names:
            self._names[name,] = name
            self.definitions += text(self.arithmetic)
        return name


def _numbers(registers: Lengths) -> list[tuple[int, int]]:
    """Of the numbers of registers end to end, which register and where in it."""
    return [(register, k) for register, length in enumerate(registers) for k in range(length)]


def _pointers(name: str, registers: Iterable[object]) -> list[str]:
    return [f"ptr %{name}{k}" for k, _ in enumerate(registers)]


def _loop(written: Body, after: list[str], count: int) -> list[str]:
    """The body, which may hold blocks, and the lines after it for %i = 0 .. count - 1."""
    return [
        *written.start,
        "  br label %each",
        "each:",
        "  %i = phi i64 [ 0, %start ], [ %next, %last ]",
        *written.lines,
        "  br label %last",
        "last:",
        *after,
        "  %next = add i64 %i, 1",
        f"  %more = icmp slt i64 %next, {count}",
        "  br i1 %more, label %each, label %end",
        "end:",
    ]
