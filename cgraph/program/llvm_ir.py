"""LLVM's text for a program: a function for each graph and layout of its arguments, and one that runs the passes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..codegen.llvm_ir import Arithmetic, body, libm_functions, point_arithmetic, preamble
from ..core.graph import Graph
from .lu_solve import factor_text, solve_text
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While

_ARGUMENT = {"x": "in", "y": "out"}  # by the names that `body` gives to the two sides of a graph
_Layout = tuple[int, ...]  # lengths of registers, of a graph's inputs or outputs


def program_functions(program: Program) -> dict[str, int]:
    """The functions of the C library that the program's graphs call, {name: number of arguments}."""
    found: dict[str, int] = {}
    for graph in program.graphs():
        found |= libm_functions(graph)
    return dict(sorted(found.items()))


def offsets(program: Program, width: int) -> dict[str, int]:
    """Where each register begins in the memory, and, under "", the size of it all.

    A register of more than one number fills up to a multiple of `width`, so that whole vectors can be read and written.
    """
    at, places = 0, {}
    for name, length in program.registers.items():
        places[name] = at
        at += length if length < 2 else -(-length // width) * width
    places[""] = at
    return places


def program_ir(program: Program, flags: str = "", lanes: int = 1, width: int = 1) -> str:
    """A module with `int64_t run(double *memory, double *records, int64_t passes, int64_t every, int64_t *done)`.

    The registers lie in `memory` as `offsets` says, each number a vector of `lanes`. A row is written to `records`
    after every `every`th pass; the result is how many; the number of passes that were run goes to `done`.
    width: of the vectors in which `Map` goes through its elements.
    """
    text = _Text(program, point_arithmetic(flags) if lanes == 1 else Arithmetic(flags, lanes), width)
    main = text.main()
    return "\n".join([*preamble(program.graphs(), text.arithmetic), *text.definitions, *main, ""])


class _Text:
    def __init__(self, program: Program, arithmetic: Arithmetic, width: int) -> None:
        self.program, self.arithmetic, self.width = program, arithmetic, width
        self.type, self.size = arithmetic.type, 8 * arithmetic.lanes
        self.definitions: list[str] = []
        self._named: dict[tuple[object, ...], str] = {}
        self._lines: list[str] = []
        self._scratch: list[str] = []  # allocations, made once at the start
        self._count = 0

    def main(self) -> list[str]:
        """The function that runs the passes; the definitions that it calls are made on the way."""
        program, places = self.program, offsets(self.program, self.width)
        registers = [
            f"  %r{number} = getelementptr {self.type}, ptr %memory, i64 {places[name]}"
            for number, name in enumerate(program.registers)
        ]
        self._numbers = {name: f"%r{number}" for number, name in enumerate(program.registers)}
        self._run(program.body)
        return [
            "define i64 @run(ptr noalias %memory, ptr noalias %records, i64 %passes, i64 %every, ptr %done) nounwind {",
            "start:",
            *registers,
            *self._scratch,
            "  %row = alloca ptr, align 8",
            "  %until = alloca i64, align 8",
            "  store ptr %records, ptr %row",
            "  store i64 %every, ptr %until",
            "  store i64 0, ptr %done",
            "  br label %top",
            "top:",
            "  %before = load i64, ptr %done",
            "  %more = icmp slt i64 %before, %passes",
            "  br i1 %more, label %pass, label %end",
            "pass:",
            *self._lines,
            "  %after = add i64 %before, 1",
            "  store i64 %after, ptr %done",
            *self._record(),
            *self._stop(),
            "end:",
            "  %last = load ptr, ptr %row",
            "  %last.at = ptrtoint ptr %last to i64",
            "  %first.at = ptrtoint ptr %records to i64",
            "  %bytes = sub i64 %last.at, %first.at",
            f"  %rows = sdiv i64 %bytes, {max(1, program.width) * self.size}",
            "  ret i64 %rows",
            "}",
        ]

    def _record(self) -> list[str]:
        """Count the pass, and write a row when one is due."""
        lines = [
            "  %waited = load i64, ptr %until",
            "  %waits = sub i64 %waited, 1",
            "  store i64 %waits, ptr %until",
            "  %due = icmp eq i64 %waits, 0",
            "  br i1 %due, label %due.now, label %recorded",
            "due.now:",
            "  store i64 %every, ptr %until",
        ]
        if self.program.record_if is not None:
            lines += self._positive("%wanted", self.program.record_if)
            lines += ["  br i1 %wanted, label %write, label %recorded"]
        else:
            lines += ["  br label %write"]
        lines += ["write:", "  %row0 = load ptr, ptr %row"]
        for k, name in enumerate(self.program.record):
            length = self.program.registers[name]
            lines += [
                _copied(f"%row{k}", self._numbers[name], length * self.size),
                f"  %row{k + 1} = getelementptr {self.type}, ptr %row{k}, i64 {length}",
            ]
        return [*lines, f"  store ptr %row{len(self.program.record)}, ptr %row", "  br label %recorded", "recorded:"]

    def _stop(self) -> list[str]:
        if self.program.stop is None:
            return ["  br label %top"]
        return [
            f"  %stop.value = load double, ptr {self._numbers[self.program.stop]}, align 8",
            "  %stop = fcmp une double %stop.value, 0.0",
            "  br i1 %stop, label %end, label %top",
        ]

    def _positive(self, result: str, register: str) -> list[str]:
        return [
            f"  {result}.value = load double, ptr {self._numbers[register]}, align 8",
            f"  {result} = fcmp ogt double {result}.value, 0.0",
        ]

    def _run(self, statements: Sequence[Statement]) -> None:
        for statement in statements:
            self._count += 1
            _WRITERS[type(statement)](self, statement)

    def _call(self, call: Call) -> None:
        name = self._function(call.graph, self._lengths(call.inputs), self._lengths(call.outputs))
        self._calls(name, call.inputs, call.outputs)

    def _map(self, statement: Map) -> None:
        if count := self.program.elements(statement):
            name = self._mapped(statement.graph, self._lengths(statement.inputs), count)
            self._calls(name, statement.inputs, statement.outputs)

    def _sum(self, statement: Sum) -> None:
        count = self.program.elements(statement)
        name = self._summed(statement.graph, self._lengths(statement.inputs), count)
        self._calls(name, statement.inputs, (statement.output,))

    def _while(self, statement: While) -> None:
        label = f"while{self._count}"
        self._lines += [f"  br label %{label}", f"{label}:"]
        self._lines += self._positive(f"%{label}.on", statement.register)
        self._lines += [f"  br i1 %{label}.on, label %{label}.body, label %{label}.end", f"{label}.body:"]
        self._run(statement.body)
        self._lines += [f"  br label %{label}", f"{label}.end:"]

    def _if(self, statement: If) -> None:
        label = f"if{self._count}"
        self._lines += self._positive(f"%{label}.on", statement.register)
        self._lines += [f"  br i1 %{label}.on, label %{label}.yes, label %{label}.no", f"{label}.yes:"]
        self._run(statement.body)
        self._lines += [f"  br label %{label}.end", f"{label}.no:"]
        self._run(statement.otherwise)
        self._lines += [f"  br label %{label}.end", f"{label}.end:"]

    def _factor(self, statement: Factor) -> None:
        name = self._define(("factor",), lambda _: factor_text(self.arithmetic.flags), "lu.factor")
        at, n = self._numbers, self.program.registers[statement.pivots]
        self._lines.append(f"  call void @{name}(ptr {at[statement.matrix]}, ptr {at[statement.pivots]}, i64 {n})")

    def _solve(self, statement: Solve) -> None:
        name = self._define(("solve",), lambda _: solve_text(self.arithmetic.flags), "lu.solve")
        at, n = self._numbers, self.program.registers[statement.pivots]
        arguments = ", ".join(f"ptr {at[each]}" for each in (statement.matrix, statement.pivots, statement.vector))
        self._lines.append(f"  call void @{name}({arguments}, i64 {n})")

    def _calls(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Call a function of registers. What it both reads and writes is written beside, and copied afterwards."""
        targets, copies = [], []
        for k, output in enumerate(outputs):
            target, length = self._numbers[output], self.program.registers[output]
            if output in inputs:
                beside = f"%beside{self._count}.{k}"
                self._scratch.append(f"  {beside} = alloca {self.type}, i64 {length + self.width}, align 64")
                copies.append(_copied(target, beside, length * self.size))
                target = beside
            targets.append(target)
        arguments = ", ".join(f"ptr {each}" for each in (*(self._numbers[name] for name in inputs), *targets))
        self._lines += [f"  call void @{name}({arguments})", *copies]

    def _lengths(self, names: Sequence[str]) -> _Layout:
        return tuple([self.program.registers[name] for name in names])

    def _define(self, key: tuple[object, ...], make: Callable[[str], list[str]], name: str) -> str:
        if key not in self._named:
            self._named[key] = name
            self.definitions += make(name)
        return self._named[key]

    def _function(self, graph: Graph, inputs: _Layout, outputs: _Layout) -> str:
        """`void f(register of inputs, .., register of outputs, ..)`."""
        places = {
            base: [(group, k) for group, length in enumerate(lengths) for k in range(length)]
            for base, lengths in (("x", inputs), ("y", outputs))
        }

        def address(base: str, name: str, row: int) -> list[str]:
            group, k = places[base][row]
            return [f"  {name} = getelementptr {self.type}, ptr %{_ARGUMENT[base]}{group}, i64 {k}"]

        def make(name: str) -> list[str]:
            head = f"define internal void @{name}({_arguments(len(inputs), len(outputs))}) nounwind {{"
            return [head, "start:", *body(graph, self.arithmetic, address), "  ret void", "}"]

        return self._define((id(graph), inputs, outputs), make, f"call{len(self._named)}")

    def _mapped(self, graph: Graph, inputs: _Layout, count: int) -> str:
        """The graph of one element, for each element."""

        def address(base: str, name: str, row: int) -> list[str]:
            moving = base == "y" or inputs[row] == count
            return [f"  {name} = getelementptr {self.type}, ptr %{_ARGUMENT[base]}{row}, i64 {'%i' if moving else 0}"]

        def make(name: str) -> list[str]:
            head = f"define internal void @{name}({_arguments(len(inputs), len(graph.outputs))}) nounwind {{"
            return [head, "start:", *_each(body(graph, self.arithmetic, address), [], count), "  ret void", "}"]

        vectors = self.arithmetic.lanes == 1 and self.width > 1 and count > 1 and not libm_functions(graph)
        chosen = self._mapped_by_vectors(graph, inputs, count) if vectors else make
        return self._define(("map", id(graph), inputs, count), chosen, f"map{len(self._named)}")

    def _mapped_by_vectors(self, graph: Graph, inputs: _Layout, count: int) -> Callable[[str], list[str]]:
        """As `_mapped`, a vector of elements at a time; what is computed beyond the last stays in the filling."""
        arithmetic = Arithmetic(self.arithmetic.flags, self.width)
        t, same = arithmetic.type, [k for k, length in enumerate(inputs) if length != count]

        def address(base: str, name: str, row: int) -> list[str]:
            if base == "x" and row in same:
                return [f"  {name} = getelementptr {t}, ptr %same{row}, i64 0"]
            return [f"  {name} = getelementptr {t}, ptr %{_ARGUMENT[base]}{row}, i64 %i"]

        def make(name: str) -> list[str]:
            spread = []
            for k in same:
                spread += [
                    f"  %same{k} = alloca {t}, align 64",
                    f"  %one{k} = load double, ptr %in{k}, align 8",
                    f"  %first{k} = insertelement {t} poison, double %one{k}, i32 0",
                    f"  %all{k} = shufflevector {t} %first{k}, {t} poison, <{self.width} x i32> zeroinitializer",
                    f"  store {t} %all{k}, ptr %same{k}, align 64",
                ]
            head = f"define internal void @{name}({_arguments(len(inputs), len(graph.outputs))}) nounwind {{"
            lines = _each(body(graph, arithmetic, address), [], -(-count // self.width))
            return [head, "start:", *spread, *lines, "  ret void", "}"]

        return make

    def _summed(self, graph: Graph, inputs: _Layout, count: int) -> str:
        """The graph's values at all elements, added up."""
        t = self.type

        def address(base: str, name: str, row: int) -> list[str]:
            if base == "y":
                return [f"  {name} = getelementptr {t}, ptr %one, i64 0"]
            return [f"  {name} = getelementptr {t}, ptr %in{row}, i64 {'%i' if inputs[row] == count else 0}"]

        def make(name: str) -> list[str]:
            zero = self.arithmetic.number(0.0)
            add = [
                f"  %so.far = load {t}, ptr %out0, align 8",
                f"  %here = load {t}, ptr %one, align 8",
                f"  %total = fadd {t} %so.far, %here",
                f"  store {t} %total, ptr %out0, align 8",
            ]
            return [
                f"define internal void @{name}({_arguments(len(inputs), 1)}) nounwind {{",
                "start:",
                f"  %one = alloca {t}, align 64",
                f"  store {t} {zero}, ptr %out0, align 8",
                *(_each(body(graph, self.arithmetic, address), add, count) if count else []),
                "  ret void",
                "}",
            ]

        return self._define(("sum", id(graph), inputs, count), make, f"sum{len(self._named)}")


_WRITERS: dict[type, Callable[..., None]] = {
    Call: _Text._call,
    Map: _Text._map,
    Sum: _Text._sum,
    While: _Text._while,
    If: _Text._if,
    Factor: _Text._factor,
    Solve: _Text._solve,
}


def _arguments(inputs: int, outputs: int) -> str:
    return ", ".join(
        [*(f"ptr noalias %in{k}" for k in range(inputs)), *(f"ptr noalias %out{k}" for k in range(outputs))]
    )


def _each(lines: list[str], after: list[str], count: int) -> list[str]:
    """The lines for %i = 0 .. count - 1."""
    return [
        "  br label %each",
        "each:",
        "  %i = phi i64 [ 0, %start ], [ %next, %last ]",
        *lines,
        "  br label %last",
        "last:",
        *after,
        "  %next = add i64 %i, 1",
        f"  %more = icmp slt i64 %next, {count}",
        "  br i1 %more, label %each, label %end",
        "end:",
    ]


def _copied(target: str, source: str, size: int) -> str:
    return f"  call void @llvm.memcpy.p0.p0.i64(ptr {target}, ptr {source}, i64 {size}, i1 false)"
