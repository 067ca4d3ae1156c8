"""LLVM's text for a program: one function that runs the passes, and those that its statements call."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..codegen.arithmetic import REGISTERS, Arithmetic
from ..codegen.llvm_ir import libm_functions, point_arithmetic, preamble
from .llvm_functions import Functions, Lengths
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While


def program_functions(program: Program) -> dict[str, int]:
    """The functions of the C library that the program's graphs call, {name: number of arguments}."""
    calls: dict[str, int] = {}
    for graph in program.graphs():
        calls |= libm_functions(graph)
    return dict(sorted(calls.items()))


def offsets(program: Program, width: int) -> dict[str, int]:
    """Where each register begins in the memory, and, under "", the size of it all.

    A register of more than one number is padded to a multiple of `width`, so that whole vectors can be read and
    written.
    """
    at, places = 0, {}
    for name, length in program.registers.items():
        places[name] = at
        at += length if length < 2 else -(-length // width) * width
    places[""] = at
    return places


def program_ir(program: Program, flags: str = "", lanes: int = 1, width: int = 1, registers: int = REGISTERS) -> str:
    """A module with the function `run`.

    int64_t run(
        double *memory, double *records, int64_t passes, int64_t every, int64_t *done, double *feed, int64_t stride
    )

    The registers lie in `memory` as `offsets` says, each number a vector of `lanes`. A row is written to `records`
    after every `every`th pass; the result is how many; the number of passes that were run goes to `done`. A row of
    `feed` is read before every pass, `stride` numbers after the last one.
    width: of the vectors in which `Map` goes through its elements.
    """
    arithmetic = point_arithmetic(flags, registers) if lanes == 1 else Arithmetic(flags, lanes, registers)
    functions = Functions(arithmetic, width)
    run = _RunFunction(program, functions).lines()
    return "\n".join([*preamble(program.graphs(), arithmetic), *functions.definitions, *run, ""])


_ARGUMENTS = "ptr noalias %memory, ptr noalias %records, i64 %passes, i64 %every, ptr %done, ptr noalias %feed, "
_ARGUMENTS += "i64 %stride"


class _RunFunction:
    """The function `run`: the passes, and in each of them the statements, the record and the stop.

    for (done = 0; done < passes;) {
        read; statements; done++; if (--until == 0) { until = every; record } if (stop) break
    }
    """

    def __init__(self, program: Program, functions: Functions) -> None:
        self.program, self.functions = program, functions
        self.type, self.size = functions.arithmetic.type, 8 * functions.arithmetic.lanes  # of a number, in bytes
        self._pointers = {name: f"%r{number}" for number, name in enumerate(program.registers)}
        self._lines: list[str] = []  # of the statements
        self._scratch: list[str] = []  # allocations, which stand once at the start
        self._count = 0  # of statements so far, for names

    def lines(self) -> list[str]:
        """The whole function."""
        places = offsets(self.program, self.functions.width)
        self._run(self.program.body)
        return [
            f"define i64 @run({_ARGUMENTS}) nounwind {{",
            "start:",
            *(
                f"  {pointer} = getelementptr {self.type}, ptr %memory, i64 {places[name]}"
                for name, pointer in self._pointers.items()
            ),
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
            *self._read(),
            *self._lines,
            "  %after = add i64 %before, 1",
            "  store i64 %after, ptr %done",
            *self._record(),
            *self._stop(),
            "end:",  # rows = (row - records) / bytes of a row
            "  %last = load ptr, ptr %row",
            "  %last.at = ptrtoint ptr %last to i64",
            "  %first.at = ptrtoint ptr %records to i64",
            "  %bytes = sub i64 %last.at, %first.at",
            f"  %rows = sdiv i64 %bytes, {max(1, self.program.width) * self.size}",
            "  ret i64 %rows",
            "}",
        ]

    def _read(self) -> list[str]:
        """Registers = row `done` of the feed."""
        if not self.program.feed:
            return []
        lines = [
            "  %fed = mul i64 %before, %stride",
            f"  %fed0 = getelementptr {self.type}, ptr %feed, i64 %fed",
        ]
        for k, name in enumerate(self.program.feed):
            length = self.program.registers[name]
            lines += [
                _copy(self._pointers[name], f"%fed{k}", length * self.size),
                f"  %fed{k + 1} = getelementptr {self.type}, ptr %fed{k}, i64 {length}",
            ]
        return lines

    def _record(self) -> list[str]:
        """if (--until == 0) { until = every; if (record_if > 0) write a row }."""
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
                _copy(f"%row{k}", self._pointers[name], length * self.size),
                f"  %row{k + 1} = getelementptr {self.type}, ptr %row{k}, i64 {length}",
            ]
        return [*lines, f"  store ptr %row{len(self.program.record)}, ptr %row", "  br label %recorded", "recorded:"]

    def _stop(self) -> list[str]:
        """if (stop != 0) break, where NaN counts as not 0."""
        if self.program.stop is None:
            return ["  br label %top"]
        return [
            f"  %stop.value = load double, ptr {self._pointers[self.program.stop]}, align 8",
            "  %stop = fcmp une double %stop.value, 0.0",
            "  br i1 %stop, label %end, label %top",
        ]

    def _positive(self, result: str, register: str) -> list[str]:
        """result = register > 0, where NaN is not."""
        return [
            f"  {result}.value = load double, ptr {self._pointers[register]}, align 8",
            f"  {result} = fcmp ogt double {result}.value, 0.0",
        ]

    def _run(self, statements: Sequence[Statement]) -> None:
        for statement in statements:
            self._count += 1
            _WRITERS[type(statement)](self, statement)

    def _call(self, call: Call) -> None:
        name = self.functions.call(call.graph, self._lengths(call.inputs), self._lengths(call.outputs))
        self._calls(name, call.inputs, call.outputs)

    def _map(self, statement: Map) -> None:
        if count := self.program.elements(statement):
            shared = self._lengths(statement.shared)
            name = self.functions.map(statement.graph, self._lengths(statement.inputs), count, shared)
            self._calls(name, (*statement.shared, *statement.inputs), statement.outputs)

    def _sum(self, statement: Sum) -> None:
        count = self.program.elements(statement)
        name = self.functions.sum(statement.graph, self._lengths(statement.inputs), count)
        self._calls(name, statement.inputs, (statement.output,))

    def _while(self, statement: While) -> None:
        """while (register > 0) body."""
        label = f"while{self._count}"
        self._lines += [f"  br label %{label}", f"{label}:"]
        self._lines += self._positive(f"%{label}.on", statement.register)
        self._lines += [f"  br i1 %{label}.on, label %{label}.body, label %{label}.end", f"{label}.body:"]
        self._run(statement.body)
        self._lines += [f"  br label %{label}", f"{label}.end:"]

    def _if(self, statement: If) -> None:
        """if (register > 0) body else otherwise."""
        label = f"if{self._count}"
        self._lines += self._positive(f"%{label}.on", statement.register)
        self._lines += [f"  br i1 %{label}.on, label %{label}.yes, label %{label}.no", f"{label}.yes:"]
        self._run(statement.body)
        self._lines += [f"  br label %{label}.end", f"{label}.no:"]
        self._run(statement.otherwise)
        self._lines += [f"  br label %{label}.end", f"{label}.end:"]

    def _factor(self, statement: Factor) -> None:
        at, n = self._pointers, self.program.registers[statement.pivots]
        arguments = f"ptr {at[statement.matrix]}, ptr {at[statement.pivots]}, i64 {n}"
        self._lines.append(f"  call void @{self.functions.factor()}({arguments})")

    def _solve(self, statement: Solve) -> None:
        n = self.program.registers[statement.pivots]
        registers = (statement.matrix, statement.pivots, statement.vector)
        arguments = ", ".join(f"ptr {self._pointers[name]}" for name in registers)
        self._lines.append(f"  call void @{self.functions.solve()}({arguments}, i64 {n})")

    def _calls(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Call a function of registers, whose arguments must not overlap.

        A register that it both reads and writes is written to scratch memory, and copied after the call.
        """
        targets, copies = [], []
        for k, output in enumerate(outputs):
            target, length = self._pointers[output], self.program.registers[output]
            if output in inputs:
                scratch = f"%beside{self._count}.{k}"
                self._scratch.append(f"  {scratch} = alloca {self.type}, i64 {length + self.functions.width}, align 64")
                copies.append(_copy(target, scratch, length * self.size))
                target = scratch
            targets.append(target)
        pointers = [*(self._pointers[register] for register in inputs), *targets]
        self._lines += [f"  call void @{name}({', '.join(f'ptr {pointer}' for pointer in pointers)})", *copies]

    def _lengths(self, names: Sequence[str]) -> Lengths:
        return tuple([self.program.registers[name] for name in names])


_WRITERS: dict[type, Callable[..., None]] = {
    Call: _RunFunction._call,
    Map: _RunFunction._map,
    Sum: _RunFunction._sum,
    While: _RunFunction._while,
    If: _RunFunction._if,
    Factor: _RunFunction._factor,
    Solve: _RunFunction._solve,
}


def _copy(target: str, source: str, size: int) -> str:
    return f"  call void @llvm.memcpy.p0.p0.i64(ptr {target}, ptr {source}, i64 {size}, i1 false)"
