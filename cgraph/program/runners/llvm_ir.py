"""LLVM's text for a program: one function that runs the passes, and those that its statements call."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from ...codegen.arithmetic import REGISTERS, Arithmetic
from ...codegen.function_writer import copied_bytes
from ...codegen.llvm_ir import point_arithmetic, preamble, scalar_ir
from ..program import Program, whole_graph
from ..statements.call import Call
from ..writer import Functions, Writer


def offsets(registers: Mapping[str, int], width: int) -> dict[str, int]:
    """Place of each register in the memory, its length padded to whole vectors; under "" the size of it all."""
    at, places = 0, {}
    for name, length in registers.items():
        places[name] = at
        at += length if length < 2 else -(-length // width) * width
    places[""] = at
    return places


def program_ir(program: Program, arithmetic: Arithmetic, width: int = 1) -> str:
    """A module with `run`, which gives the number of rows of `records` and writes that of passes to `done`.

    int64_t run(
        double *memory, double *records, int64_t passes, int64_t every, int64_t *done, double *feed, int64_t stride
    )

    stride: numbers from a row of the feed to the next.  width: of the vectors in which `Map` goes through its elements.
    """
    functions = Functions(arithmetic, width)
    run = _run_function(program, Writer(program.registers, functions))
    return "\n".join([*preamble(program.graphs(), arithmetic), *functions.definitions, *run, ""])


def point_ir(
    program: Program, x: str, y: str, flags: str = "", width: int = 1, registers: int = REGISTERS
) -> tuple[str, dict[str, int]]:
    """A module with `void point(double *x, double *y, double *memory)`, one pass, and the places of registers there."""
    if (graph := whole_graph(program, x)) is not None:
        return scalar_ir(graph, flags, registers), {"": 0}
    functions = Functions(point_arithmetic(flags, registers), width)
    ir = Writer(program.registers, functions)
    # Single numbers last: others then begin where vectors may.
    lengths = sorted(program.registers.items(), key=lambda item: item[1] < 2)
    inner = {name: length for name, length in lengths if name not in (x, y)}
    places = offsets(inner, width)
    ir.pointers = {x: "%x", y: "%y", **{name: ir.at("%memory", places[name]) for name in inner}}
    ir.run(program.body)
    point = ir.function("void @point(ptr noalias %x, ptr noalias %y, ptr noalias %memory) nounwind")
    lines = [*preamble(program.graphs(), functions.arithmetic), *functions.definitions, *point]
    return "\n".join([*lines, ""]), places


_ARGUMENTS = "ptr noalias %memory, ptr noalias %records, i64 %passes, i64 %every, ptr %done, ptr noalias %feed, "
_ARGUMENTS += "i64 %stride"
ONE_RUN = "call i64 @run(ptr %w, ptr null, i64 1, i64 2, ptr {done}, ptr null, i64 0)"  # a pass without a record


def _run_function(program: Program, ir: Writer) -> list[str]:
    """The function `run`.

    for (done = 0; done < passes;) {
        read; statements; done++; if (--until == 0) { until = every; record } if (stop) break
    }
    """
    ir.offsets = places = offsets(program.registers, ir.functions.width)
    ir.pointers = {name: ir.at("%memory", places[name]) for name in program.registers}
    calls = Counter([id(each.graph) for each in program.statements() if isinstance(each, Call)])
    ir.alone = frozenset([graph for graph, count in calls.items() if count == 1])
    row, until = ir.room(1, "ptr"), ir.room(1, "i64")
    ir.store_at("%records", row, "ptr")
    ir.store_at("%every", until, "i64")
    ir.store_at(0, "%done", "i64")
    with ir.repeat() as end:
        before = ir.load_at("%done", "i64")
        ir.leave_unless(ir.integer("icmp slt", before, "%passes"), end)
        if program.feed:  # registers = row `done` of the feed
            fed = ir.at("%feed", ir.integer("mul", before, "%stride"))
            _moved(ir, program.feed, fed, reading=True)
        ir.run(program.body)
        ir.store_at(ir.integer("add", before, 1), "%done", "i64")
        waits = ir.integer("sub", ir.load_at(until, "i64"), 1)
        ir.store_at(waits, until, "i64")
        with ir.when(ir.integer("icmp eq", waits, 0)):
            ir.store_at("%every", until, "i64")
            wanted = ir.positive(program.record_if) if program.record_if is not None else "true"
            with ir.when(wanted):
                ir.store_at(_moved(ir, program.record, ir.load_at(row, "ptr"), reading=False), row, "ptr")
        if program.stop is not None:  # NaN counts as not 0
            stopped = ir.compare("une", ir.load(program.stop), 0.0)
            ir.leave_unless(ir.value(f"xor i1 {stopped}, true"), end)
    first, last = [ir.value(f"ptrtoint ptr {each} to i64") for each in ("%records", ir.load_at(row, "ptr"))]
    rows = ir.integer("sdiv", ir.integer("sub", last, first), max(1, program.width) * ir.size)
    return ir.function(f"i64 @run({_ARGUMENTS}) nounwind", f"i64 {rows}")


def _moved(ir: Writer, names: Sequence[str], row: str, *, reading: bool) -> str:
    """Registers from a row, where they lie end to end, or to it; the address behind it."""
    for name in names:
        length, register = ir.registers[name], ir.pointer(name)
        target, source = (register, row) if reading else (row, register)
        ir.line(copied_bytes(target, source, length * ir.size))
        row = ir.at(row, length)
    return row
