"""LLVM's text for a program: one function that runs the passes, and those that its statements call."""

from __future__ import annotations

from collections.abc import Mapping

from ...codegen.arithmetic import REGISTERS, Arithmetic
from ...codegen.llvm_engine import MissingFunctionError
from ...codegen.llvm_ir import libm_functions, point_arithmetic, preamble, scalar_ir
from ..llvm_functions import Functions
from ..program import Program, whole_graph
from ..statement import row_of
from ..writer import Writer, copy_text


def program_functions(program: Program) -> dict[str, int]:
    """The functions of the C library that the program's graphs call, {name: number of arguments}."""
    calls: dict[str, int] = {}
    for graph in program.graphs():
        calls |= libm_functions(graph)
    return dict(sorted(calls.items()))


def require_texts(program: Program) -> None:
    """Raises MissingFunctionError for a program with statements that have no LLVM text."""
    for statement in program.statements():
        if row_of(statement).text is None:
            raise MissingFunctionError(f"statement {type(statement).__name__} has no text for LLVM")


def offsets(registers: Mapping[str, int], width: int) -> dict[str, int]:
    """Place of each register in the memory, and, under "", the size of it all.

    A register of more than one number is padded to a multiple of `width`, so that whole vectors can be read and
    written.
    """
    at, places = 0, {}
    for name, length in registers.items():
        places[name] = at
        at += length if length < 2 else -(-length // width) * width
    places[""] = at
    return places


def program_ir(program: Program, arithmetic: Arithmetic, width: int = 1) -> str:
    """A module with the function `run`.

    int64_t run(
        double *memory, double *records, int64_t passes, int64_t every, int64_t *done, double *feed, int64_t stride
    )

    The registers lie in `memory` as `offsets` says, each number a vector of lanes. A row is written to `records`
    after every `every`th pass; the result is how many; the number of passes that were run goes to `done`. A row of
    `feed` is read before every pass, `stride` numbers after the last one.
    width: of the vectors in which `Map` goes through its elements.
    """
    functions = Functions(arithmetic, width)
    run = _RunFunction(program, functions).lines()
    return "\n".join([*preamble(program.graphs(), arithmetic), *functions.definitions, *run, ""])


def point_ir(
    program: Program, x: str, y: str, flags: str = "", width: int = 1, registers: int = REGISTERS
) -> tuple[str, dict[str, int]]:
    """A module with `void point(double *x, double *y, double *memory)`: one pass, of which two registers lie apart.

    The others lie in `memory`, at the places that come with it, see `offsets`.
    """
    graph = whole_graph(program, x)
    if graph is not None:
        return scalar_ir(graph, flags, registers), {"": 0}
    functions = Functions(point_arithmetic(flags, registers), width)
    writer = Writer(program.registers, functions)
    writer.pointers |= {x: "%x", y: "%y"}
    writer.run(program.body)
    # Single numbers last: others then begin where vectors may.
    lengths = sorted(program.registers.items(), key=lambda item: item[1] < 2)
    inner = {name: length for name, length in lengths if name not in (x, y)}
    places = offsets(inner, width)
    lines = [
        *preamble(program.graphs(), functions.arithmetic),
        *functions.definitions,
        "define void @point(ptr noalias %x, ptr noalias %y, ptr noalias %memory) nounwind {",
        "start:",
        *[f"  {writer.pointers[each]} = getelementptr double, ptr %memory, i64 {places[each]}" for each in inner],
        *writer.scratch,
        *writer.written,
    ]
    return "\n".join([*lines, "  ret void", "}", ""]), places


_ARGUMENTS = "ptr noalias %memory, ptr noalias %records, i64 %passes, i64 %every, ptr %done, ptr noalias %feed, "
_ARGUMENTS += "i64 %stride"


class _RunFunction(Writer):
    """The function `run`: the passes, and in each of them the statements, the record and the stop.

    for (done = 0; done < passes;) {
        read; statements; done++; if (--until == 0) { until = every; record } if (stop) break
    }
    """

    def __init__(self, program: Program, functions: Functions) -> None:
        super().__init__(program.registers, functions)
        self.program = program

    def lines(self) -> list[str]:
        """The whole function."""
        places = offsets(self.program.registers, self.functions.width)
        self.run(self.program.body)
        return [
            f"define i64 @run({_ARGUMENTS}) nounwind {{",
            "start:",
            *(
                f"  {pointer} = getelementptr {self.type}, ptr %memory, i64 {places[name]}"
                for name, pointer in self.pointers.items()
            ),
            *self.scratch,
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
            *self.written,
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
                copy_text(self.pointers[name], f"%fed{k}", length * self.size),
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
            lines += self.positive("%wanted", self.program.record_if)
            lines += ["  br i1 %wanted, label %write, label %recorded"]
        else:
            lines += ["  br label %write"]
        lines += ["write:", "  %row0 = load ptr, ptr %row"]
        for k, name in enumerate(self.program.record):
            length = self.program.registers[name]
            lines += [
                copy_text(f"%row{k}", self.pointers[name], length * self.size),
                f"  %row{k + 1} = getelementptr {self.type}, ptr %row{k}, i64 {length}",
            ]
        return [*lines, f"  store ptr %row{len(self.program.record)}, ptr %row", "  br label %recorded", "recorded:"]

    def _stop(self) -> list[str]:
        """if (stop != 0) break, where NaN counts as not 0."""
        if self.program.stop is None:
            return ["  br label %top"]
        return [
            f"  %stop.value = load double, ptr {self.pointers[self.program.stop]}, align 8",
            "  %stop = fcmp une double %stop.value, 0.0",
            "  br i1 %stop, label %end, label %top",
        ]
