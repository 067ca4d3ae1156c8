"""LLVM's text for one pass of a program at many states, which lie row by row: a vector of states after another."""

from __future__ import annotations

from ..codegen.arithmetic import Arithmetic
from ..codegen.batch_ir import Batch
from ..codegen.transposed_ir import rows_ir
from .llvm_ir import offsets, program_ir
from .program import Program


def program_rows_ir(program: Program, name: str, lanes: int, flags: str, registers: int) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`: from the register of that name to what a pass records."""
    places = offsets(program, 1)
    n_in, t = program.registers[name], Arithmetic(flags, lanes).type
    calls = [
        f"  call void @llvm.memcpy.p0.p0.i64(ptr %register, ptr %points, i64 {8 * lanes * n_in}, i1 false)",
        "  %recorded = call i64 @run(ptr %w, ptr %results, i64 1, i64 1, ptr %done, ptr null)",
    ]
    start = [f"  %register = getelementptr {t}, ptr %w, i64 {places[name]}", "  %done = alloca i64, align 8"]
    driver = rows_ir(Arithmetic(flags, lanes), places[""], n_in, program.width, calls, start)
    source = program_ir(program, flags, lanes, 1, registers)
    return Batch("\n".join([source, *driver, ""]), lanes * (places[""] + n_in + program.width))
