"""LLVM's text for one pass of a program at many states, which lie row by row: a vector of states after another."""

from __future__ import annotations

from dataclasses import replace

from ...codegen.arithmetic import Arithmetic
from ...codegen.batch_ir import Batch
from ...codegen.transposed_ir import Place, rows_ir
from ..program import Program
from .llvm_ir import offsets, program_ir


def program_rows_ir(program: Program, name: str, lanes: int, flags: str, registers: int) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`: from the register of that name to what a pass records.

    Both are read and written where they lie among the registers.
    """
    places = offsets(program.registers, 1)
    point, *results = [Place(places[each], program.registers[each]) for each in (name, *program.record)]
    calls = ["  %rows = call i64 @run(ptr %w, ptr null, i64 1, i64 1, ptr %done, ptr null)"]
    driver = rows_ir(Arithmetic(flags, lanes), point, results, calls, ["  %done = alloca i64, align 8"])
    source = program_ir(replace(program, record=()), flags, lanes, 1, registers)
    return Batch("\n".join([source, *driver, ""]), lanes * places[""])
