"""`runner`: a program as machine code, for one memory or a vector of them, or in Python where there is none."""

from __future__ import annotations

import ctypes
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...codegen import llvm_engine as llvm
from ...codegen.bound_call import LONG, SHORT, bound_call
from ...codegen.disk_cache import cache_choice, cache_folder
from ...codegen.function_writer import Arithmetic
from ...codegen.llvm_ir import libm_functions, point_arithmetic, preamble, scalar_ir
from ...core.evaluation import Array
from ...core.scope import without_collection
from ...util.caches import made_once
from ...util.explain_failure import explain_failure
from ...util.memory import aligned
from ...util.require import require_choice, require_flag, require_kind
from ..fuse import fused
from ..program import Program, outliving, whole_graph
from ..statement import row_of
from ..statements.call import Call
from ..writer import Functions, Writer, layout, offsets
from .runner import Record, Register, Registers, Runner, Start

if TYPE_CHECKING:
    from ...codegen.batch_ir import Batch
    from .batch_code import BatchCode, LaneCode

BACKENDS = ("auto", "python", "llvm")
_NUMBER = 8  # bytes
_POINTER, _COUNT = ctypes.c_void_p, ctypes.c_int64
WORK = 2**23  # nodes times points in a block of a batch: some tenths of a millisecond, several times a thread's start
MANY = 2**14  # operations that take some microseconds: time enough for Python's other threads
_RUN = ctypes.CFUNCTYPE(_COUNT, _POINTER, _POINTER, _COUNT, _COUNT, _POINTER, _POINTER, _COUNT, _POINTER)
_FAST = "reassoc nsz arcp contract afn"  # all but the promise that there is no NaN and no infinity


class NativeRunner(Runner):
    """A program as machine code. Any number of threads may run it at once, on a memory each."""

    vectors = 17

    def __init__(self, program: Program, *, fast: bool = False, fma: bool = True, cache: Path | None = None) -> None:
        host = llvm.host()
        super().__init__(program, host.lanes)
        self.lanes = host.lanes
        for statement in program.statements():
            if row_of(statement).text is None:
                raise llvm.MissingFunctionError(f"statement {type(statement).__name__} has no text for LLVM")
        self._flags, self._host, self._cache = _FAST if fast else "contract" if fma else "", host, cache
        self._fused = fused(program)
        self._common = self._all[self.size :]  # the numbers that memories share
        self._nodes = sum([len(graph.nodes) for graph in self._fused.graphs()])
        calls = [call for graph in self._fused.graphs() for call in libm_functions(graph).items()]
        self._functions = dict(sorted(calls))
        host.require(self._functions)

    def _compiled(self, text: str, lanes: int = 1, *, looped: bool = False) -> llvm.Code:
        return self._host.compile(text, self._functions, self._nodes, self._cache, lanes=lanes, looped=looped)

    @cached_property
    def _side(self) -> ModuleType:
        """The module for memories side by side."""
        from . import batch_code  # which a program of one memory does without

        return batch_code

    @cached_property
    def _fused_many(self) -> Program:
        return self._fused if self.masked is self.program else fused(self.masked)

    @made_once
    def _entry(self, lanes: int) -> Any:
        """Machine code that runs so many memories."""
        registers = self._host.registers
        one, vectors = point_arithmetic(self._flags, registers), Arithmetic(self._flags, lanes, registers)
        program, arithmetic = (self._fused, one) if lanes == 1 else (self._fused_many, vectors)
        return self._compiled(program_ir(program, arithmetic, self.width), lanes).function("run", _RUN)

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        rows = np.empty((passes // every, self.program.width))
        done, (between, within) = ctypes.c_int64(), feed.strides
        if within != _NUMBER or between % _NUMBER:
            feed, between = np.ascontiguousarray(feed), _NUMBER * self.program.feed_width
        where = ctypes.addressof(done), feed.ctypes.data, between // _NUMBER, self._common.ctypes.data
        count = self._entry(1)(memory.ctypes.data, rows.ctypes.data, passes, every, *where)
        return Record(rows[:count], done.value)

    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record:
        lanes, size, total = self.lanes, self.size, memories.shape[1]
        entry, rows = self._entry(lanes), np.empty((passes // every, self.program.width, total))
        sizes = layout(self._fused_many.registers, self.shared, self.width)[1]  # with those of masks
        block, common = np.zeros((sizes, lanes)), np.repeat(self._common, lanes)
        part, fed, done = np.empty((*rows.shape[:2], lanes)), np.empty((*feed.shape[:2], lanes)), ctypes.c_int64()
        if feed.shape[2] == 1:
            fed[...] = feed
        # A vector of memories at a time; the last one is filled up with copies of its first memory.
        for start in range(0, total, lanes):
            here = slice(start, min(start + lanes, total))
            width = here.stop - start
            block[:size, :width], block[:size, width:] = memories[:, here], memories[:, start : start + 1]
            if feed.shape[2] > 1:
                fed[:, :, :width], fed[:, :, width:] = feed[:, :, here], feed[:, :, start : start + 1]
            where = ctypes.addressof(done), fed.ctypes.data, feed.shape[1], common.ctypes.data
            entry(block.ctypes.data, part.ctypes.data, passes, every, *where)
            memories[:, here], rows[:, :, here] = block[:size, :width], part[:, :, :width]
        return Record(rows, passes)

    def _bind(self, memory: Array, rows: Array | None) -> Callable[..., None]:
        done, none, entry = np.zeros(1, np.int64), np.empty(1), self._entry(1)
        at, count, nowhere, common = memory.ctypes.data, done.ctypes.data, none.ctypes.data, self._common.ctypes.data
        if rows is not None:
            call: Callable[..., None] = partial(entry, at, rows.ctypes.data, len(rows), 1, count, nowhere, 0, common)
        else:

            def call(passes: int) -> None:
                entry(at, nowhere, passes, passes + 1, count, nowhere, 0, common)

        call.kept = self, memory, rows, done, none  # type: ignore[attr-defined]  # whose addresses it has
        return call

    def bind_pass(self, x: Register, y: Register) -> tuple[Callable[[], None], Registers]:
        """The arrays' addresses go into the call."""
        _, entry, places = self.point(x[0], y[0])
        memory, lengths = aligned(places[""]), self.program.registers
        memory[:] = 0.0
        registers = {name: memory[at : at + lengths[name]] for name, at in places.items() if name}
        for name, numbers in self.shared.items():
            registers[name][:] = numbers
        return bound_call(entry, x[1], y[1], memory), registers

    @made_once
    def point(self, x: str, y: str) -> tuple[str, Any, dict[str, int]]:
        """Machine code of one pass of which two registers lie apart: text, function, places of other registers."""
        with without_collection():
            text, places = point_ir(self._fused, x, y, self._flags, self.width, self._host.registers)
        return text, self._compiled(text).function("point", SHORT if self._nodes < MANY else LONG), places

    @made_once
    def _column_code(self, name: str) -> tuple[llvm.Code, Batch]:
        arithmetic, alone = Arithmetic(self._flags, self.lanes, self._host.registers), whole_graph(self._fused, name)
        with without_collection():
            text: Batch = self._side.pass_ir(self._fused, name, arithmetic, program_ir)
        return self._compiled(text.source, self.lanes, looped=alone is None), text

    def columns_from(self, name: str, start: Start) -> tuple[int, BatchCode]:
        """The machine code is there after the first call."""
        (code, text), alone = self._column_code(name), whole_graph(self._fused, name)
        places, _ = layout(self._fused.registers, self.shared, 1)
        shared = {places[other]: numbers for other, numbers in self.shared.items() if alone is None}
        begin = {places[other]: numbers for other, numbers in start().items()}
        width = max(WORK // max(1, self._nodes) // self.lanes, 1) * self.lanes
        return width, self._side.BatchCode(code, self.lanes, text, begin, shared, columns=alone is not None)

    def lane_code(self, clock: str, results: Sequence[str] = (), *, alike: bool = True) -> LaneCode | None:
        """Registers that outlive a pass, or are results, are in a memory; the others in the code's own."""
        if self.program.feed or any(row_of(each).beside is None for each in self.program.statements()):
            return None
        arithmetic = Arithmetic(self._flags, self.lanes, self._host.registers, alike=alike)
        lengths, first = self.program.registers, {*outliving(self._fused), *results}
        kept = [name for name in lengths if name in first]
        lengths = {name: lengths[name] for name in dict.fromkeys([*kept, *lengths])}
        program = replace(self._fused, registers=lengths, shared=self.shared)
        with without_collection():
            code: LaneCode = self._side.LaneCode(program, kept, clock, arithmetic, program_ir, self._compiled)
        return code

    def text(self, x: str) -> str:
        """The text in LLVM's language."""
        return self.point(require_kind("x", x, str), self.program.record[0])[0]


def program_ir(program: Program, arithmetic: Arithmetic, width: int = 1) -> str:
    """A module with `run`, which gives the number of rows of `records` and writes that of passes to `done`.

    int64_t run(
        double *memory, double *records, int64_t passes, int64_t every, int64_t *done, double *feed, int64_t stride,
        double *shared
    )

    stride: numbers from a row of the feed to the next.  shared: registers that memories share.
    width: of the vectors in which `Map` goes through its elements.
    """
    functions = Functions(arithmetic, width)
    ir, (places, size) = Writer(program.registers, functions), layout(program.registers, program.shared, width)
    ir.offsets = {name: place for name, place in places.items() if name not in program.shared}
    bases = {name: ("%shared", size) if name in program.shared else ("%memory", 0) for name in program.registers}
    ir.pointers = {name: ir.at(base, places[name] - begin) for name, (base, begin) in bases.items()}
    calls = Counter([id(each.graph) for each in program.statements() if isinstance(each, Call)])
    ir.alone = frozenset([graph for graph, count in calls.items() if count == 1])
    row = ir.room(1, "ptr")
    ir.store_at("%records", row, "ptr")
    ir.store_at(0, "%done", "i64")
    with ir.repeat() as end:
        before = ir.load_at("%done", "i64")
        ir.leave_unless(ir.integer("icmp slt", before, "%passes"), end)
        _moved(ir, program.feed, ir.at("%feed", ir.integer("mul", before, "%stride")), reading=True)
        ir.run(program.body)
        done = ir.integer("add", before, 1)
        ir.store_at(done, "%done", "i64")
        due = ir.integer("icmp eq", ir.integer("urem", done, "%every"), 0)
        with ir.when(due), ir.when("true" if program.record_if is None else ir.positive(program.record_if)):
            ir.store_at(_moved(ir, program.record, ir.load_at(row, "ptr"), reading=False), row, "ptr")
        if program.stop is not None:  # NaN counts as not 0
            ir.leave_unless(ir.compare("oeq", ir.load(program.stop), 0.0), end)
    first, last = [ir.value(f"ptrtoint ptr {each} to i64") for each in ("%records", ir.load_at(row, "ptr"))]
    rows = ir.integer("sdiv", ir.integer("sub", last, first), max(1, program.width) * ir.size)
    counts = "i64 %passes, i64 %every, ptr %done, ptr noalias %feed, i64 %stride, ptr noalias %shared"
    run = ir.function(f"i64 @run(ptr noalias %memory, ptr noalias %records, {counts}) nounwind", f"i64 {rows}")
    return "\n".join([*preamble(program.graphs(), arithmetic), *functions.definitions, *run, ""])


def point_ir(program: Program, x: str, y: str, flags: str, width: int, registers: int) -> tuple[str, dict[str, int]]:
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
    return "\n".join([*preamble(program.graphs(), functions.arithmetic), *functions.definitions, *point, ""]), places


def _moved(ir: Writer, names: Sequence[str], row: str, *, reading: bool) -> str:
    """Registers from a row, where they lie end to end, or to it; the address behind it."""
    for name in names:
        length, register = ir.registers[name], ir.pointer(name)
        ir.copy_bytes(*((register, row) if reading else (row, register)), length * ir.size)
        row = ir.at(row, length)
    return row


@explain_failure
def runner(
    program: Program,
    backend: str = "auto",
    *,
    fast: bool = False,
    fma: bool = True,
    cache: bool | str = False,
) -> Runner:
    """A program made ready to run.

    backend: "llvm" is machine code (extra `native`), "python" Python over lists; "auto" takes machine code where
    llvmlite is installed.  fast, fma, cache: as in `cg.compile`.
    Raises ValueError for an unknown backend, ImportError for "llvm" without llvmlite.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, runner
    >>> x = cg.variable("x")
    >>> halve = Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))
    >>> run = runner(Program({"x": 1}, [halve], record=["x"]))
    >>> run.run(run.memory({"x": 8.0}), passes=3).rows.ravel().tolist()
    [4.0, 2.0, 1.0]
    """
    require_choice("backend", backend, BACKENDS)
    fast, fma, kept = require_flag("fast", fast), require_flag("fma", fma), cache_choice(cache)
    if backend != "python":
        try:
            return NativeRunner(program, fast=fast, fma=fma, cache=cache_folder(kept))
        except (ImportError, llvm.MissingFunctionError):
            if backend == "llvm":
                raise
    from .python_runner import PythonRunner

    return PythonRunner(program, fma=fma)
