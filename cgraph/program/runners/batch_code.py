"""Machine code of batches: one pass at many values of a register, and many memories, each until its own stop."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...codegen.batch_ir import Batch, Place, batch_ir, rows_ir
from ...codegen.function_writer import Arithmetic, FunctionWriter, bits
from ...codegen.llvm_engine import Code
from ...core.evaluation import Array
from ...util.memory import aligned, lies_in_rows
from ..fuse import fused
from ..many import many_keeping
from ..program import Program, whole_graph
from ..writer import layout

# A pass without a record.
ONE_RUN = "call i64 @run(ptr %w, ptr null, i64 1, i64 2, ptr {done}, ptr null, i64 0, ptr {shared})"
Source = Callable[[Program, Arithmetic], str]  # writes the module with `run`
Compiling = Callable[[str, int], Code]  # compiles a text in vectors of so many lanes
Counts = np.ndarray[Any, np.dtype[np.int64]]
Begin = Mapping[int, ArrayLike]  # {a vector of a memory: numbers from there on}
_LANES = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 3)
_BATCH = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_int64] * 3, ctypes.c_void_p)


class BatchCode:
    """The function of batches of a module; any number of threads may call it at once.

    start: {a vector of the memory: numbers from there on}, else 0.  shared: the same, numbers that may change between
    calls.  columns: whether points may be in columns, too.
    """

    def __init__(self, code: Code, lanes: int, text: Batch, start: Begin, shared: Begin, *, columns: bool) -> None:
        self._rows = code.function("rows", _BATCH)
        self._columns = code.function("batch", _BATCH) if columns else None
        self.source, self._size, self._lanes, self._start = text.source, text.size, lanes, start
        self._shared = shared
        self._free: list[Array] = []  # memories

    def __call__(self, points: Array, result: Array) -> None:
        """Results, (n_out, k), of points, (n_in, k), both in rows or both in columns."""
        rows = self._columns is None or lies_in_rows(points)
        axis, order, count = int(rows), "F" if rows else "C", points.shape[1]
        if points.strides[1 - axis] != points.itemsize or not points.flags.aligned:
            points = np.array(points, order=order)  # type: ignore[call-overload]
        if result.strides[1 - axis] != result.itemsize or not result.flags.aligned:
            values = np.empty(result.shape, order=order)  # type: ignore[call-overload]
            self(points, values)
            result[...] = values
            return
        whole = count - count % self._lanes
        if whole:
            self._run(points, result, whole, axis)
        if whole < count:  # the last few, filled up to a whole vector by repeating one
            last = points[:, np.minimum(np.arange(whole, whole + self._lanes), count - 1)]
            filled = np.array(last, order=order)  # type: ignore[call-overload]
            values = np.empty((len(result), self._lanes), order=order)  # type: ignore[call-overload]
            self._run(filled, values, self._lanes, axis)
            result[:, whole:] = values[:, : count - whole]

    def _run(self, points: Array, result: Array, count: int, axis: int) -> None:
        try:
            memory = self._free.pop()
        except IndexError:
            memory = aligned(self._size)
            memory[:] = 0.0
            _fill(memory, self._start, self._lanes)
        _fill(memory, self._shared, self._lanes)
        entry = self._rows if axis else self._columns
        strides = points.strides[axis] // points.itemsize, result.strides[axis] // result.itemsize
        entry(points.ctypes.data, result.ctypes.data, count, *strides, memory.ctypes.data)  # type: ignore[misc]
        self._free.append(memory)


def _fill(memory: Array, numbers: Begin, lanes: int) -> None:
    """Put numbers into all lanes of a memory."""
    for at, values in numbers.items():
        memory[at * lanes : (at + np.size(values)) * lanes] = np.repeat(values, lanes)


def pass_ir(program: Program, name: str, arithmetic: Arithmetic, source: Source) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`, of one pass, from the register of that name to its record."""
    if (graph := whole_graph(program, name)) is not None:
        return batch_ir(graph, arithmetic.lanes, arithmetic.flags, arithmetic.registers)
    places, size = layout(program.registers, program.shared, 1)
    point, *results = [Place(places[each], program.registers[each]) for each in (name, *program.record)]

    def compute(ir: FunctionWriter, *_: str) -> None:
        ir.line(ONE_RUN.format(done=ir.room(1, "i64"), shared=ir.at("%w", size)))

    driver = rows_ir(Arithmetic(arithmetic.flags, arithmetic.lanes), point, results, compute)
    text = source(replace(program, record=()), arithmetic)
    return Batch("\n".join([text, *driver, ""]), arithmetic.lanes * places[""])


class LaneCode:
    """Machine code of memories in lanes: each runs until its own stop, and another then takes its lane.

    numbers: {register: place in the row of a memory}, of those registers that outlive a pass.  size: of such a row.
    """

    def __init__(
        self, program: Program, kept: Sequence[str], clock: str, how: Arithmetic, source: Source, compiled: Compiling
    ) -> None:
        """program: its first registers are those `kept` between passes.  clock: a register, see `__call__`."""
        program = fused(many_keeping(program, kept), alike=how.alike)
        places, _ = layout(program.registers, program.shared, 1)
        self._shared, self._lanes = {places[name]: numbers for name, numbers in program.shared.items()}, how.lanes
        self.numbers = {name: slice(places[name], places[name] + program.registers[name]) for name in kept}
        self.size, self.width = sum([program.registers[name] for name in kept]), program.width
        self._memory = how.lanes * places[""]
        text = source(replace(program, record=(), record_if=None, stop=None), how)
        lines = _LaneWriter(program, self.size, clock, how).definitions()
        self._entry = compiled("\n".join([text, *lines, ""]), how.lanes).function("lanes", _LANES)

    def __call__(self, memories: Array, which: Counts, passes: Counts, most: int, rows: Array, marks: Array) -> None:
        """Run the memories that `which` names, rows of `memories` (N, size), at most so many passes each.

        passes: (N, 2), how many each has run, and how many of the marks it has passed; both go on.
        rows: (N, len(marks), width); row k of a memory is what it records in the pass that takes its clock to marks[k];
        those of marks that it passes in the same one stay as they are.  marks: of the clock, increasing.
        """
        memory = aligned(self._memory)
        memory[:] = 0.0
        _fill(memory, self._shared, self._lanes)
        arrays = (memory, memories, which, passes, rows, np.append(marks, math.nan))
        self._entry(*[array.ctypes.data for array in arrays], len(which), most, len(marks))


class _LaneWriter(FunctionWriter):
    """The function `lanes`: passes of memories, each of which begins in a lane where another one has ended."""

    def __init__(self, program: Program, kept: int, clock: str, arithmetic: Arithmetic) -> None:
        super().__init__(arithmetic)
        self._program, self._kept, self._clock = program, kept, clock
        self._places, self._size = layout(program.registers, program.shared, 1)
        self._integers = f"<{self.lanes} x i64>"
        # Of each lane: its memory, or -1; the passes that are left to it; the next mark of its clock. Memories taken.
        self._holds, self._left, self._due = self.room(1, self._integers), self.room(1, self._integers), self.room()
        self._taken = self.room(1, "i64")

    def definitions(self) -> list[str]:
        """The function, and the one that it moves numbers with."""
        self.store_at("splat (i64 -1)", self._holds, self._integers)
        self.store_at("zeroinitializer", self._left, self._integers)  # all end, with nothing
        self.store_at(self.number(math.inf), self._due)
        self.store_at(0, self._taken, "i64")
        done = self.room(1, "i64")
        with self.repeat() as end:
            ended = self.value(f"icmp sle {self._integers} {self.load_at(self._left, self._integers)}, zeroinitializer")
            if self._program.stop is not None:  # NaN counts as not 0
                stopped = self.compare("une", self._register(self._program.stop), 0.0)
                ended = self.value(f"or {self.bits} {ended}, {stopped}")
            with self._lanes_of(ended) as lane:
                self._give_back(lane)
                self._take(lane)
            holds = self.load_at(self._holds, self._integers)
            self.leave_unless(self.some(self.value(f"icmp sge {self._integers} {holds}, zeroinitializer")), end)
            self.line(ONE_RUN.format(done=done, shared=self.at("%w", self._size)))
            self._record_lanes()
            left = self.value(f"sub {self._integers} {self.load_at(self._left, self._integers)}, splat (i64 1)")
            self.store_at(left, self._left, self._integers)
        arrays = [f"ptr noalias %{name}" for name in ("w", "memories", "which", "passes", "rows", "marks")]
        lanes = self.function(f"void @lanes({', '.join(arrays)}, i64 %count, i64 %most, i64 %n) nounwind")
        moving = FunctionWriter(Arithmetic())
        with moving.loop(0, "%count") as k:
            source, target = [moving.at(f"%{end}", moving.integer("mul", k, f"%{end}.step")) for end in ("from", "to")]
            moving.store_at(moving.load_at(source), target)
        steps = "i64 %count, i64 %to.step, i64 %from.step"
        return [*moving.function(f"internal void @move(ptr noalias %to, ptr noalias %from, {steps}) nounwind"), *lanes]

    def _register(self, name: str) -> str:
        return self.load_at(self.at("%w", self._places[name]))

    def _integer_at(self, base: str, index: str) -> tuple[str, str]:
        """The address of an integer of an array, and the integer."""
        address = self.at(base, index, "i64")
        return address, self.load_at(address, "i64")

    @contextmanager
    def _lanes_of(self, condition: str) -> Iterator[str]:
        """The lines inside, for every lane where a condition holds."""
        mask = self.value(f"zext i{self.lanes} {self.mask(condition)} to i64")
        with self.when(self.integer("icmp ne", mask, 0)), self.loop(0, self.lanes) as lane:
            bit = self.value(f"trunc i64 {self.integer('lshr', mask, lane)} to i1")
            with self.when(bit):
                yield lane

    def _move(self, target: str, to_step: int, source: str, from_step: int, count: int) -> None:
        steps = f"i64 {count}, i64 {to_step}, i64 {from_step}"
        self.line(f"call void @move(ptr {target}, ptr {source}, {steps})")

    def _row(self, base: str, row: str, width: str | int, kind: str = "double") -> str:
        """The address of a row of numbers."""
        return self.at(base, self.integer("mul", row, width), kind)

    def _set_due(self, lane: str, passed: str) -> str:
        """Set the next mark of a lane, NaN behind the last; passed: the address of how many there were."""
        mark = self.load_at(self.at("%marks", self.load_at(passed, "i64"), "double"), "double")
        self.store_at(mark, self.at(self._due, lane, "double"), "double")
        return mark

    def _record_lanes(self) -> None:
        """A row in the lanes whose clock has reached a mark, where a row is wanted."""
        clock, program = self._register(self._clock), self._program
        reached = self.compare("oge", clock, self.load_at(self._due))
        wish = self.compare("ogt", self._register(program.record_if or self._clock), 0.0)
        with self._lanes_of(self.value(f"and {self.bits} {reached}, {wish}")) as lane:
            _, memory = self._integer_at(self._holds, lane)
            passed, first = self._integer_at(self._row("%passes", memory, 2, "i64"), "1")
            row = self._row("%rows", self.integer("add", self.integer("mul", memory, "%n"), first), program.width)
            at = 0
            for name in program.record:
                source = self.at("%w", self.integer("add", lane, self._places[name] * self.lanes), "double")
                self._move(self.at(row, at, "double"), 1, source, self.lanes, program.registers[name])
                at += program.registers[name]
            here = self.load_at(self.at(self.at("%w", self._places[self._clock]), lane, "double"), "double")
            with self.repeat() as skipped:  # marks that it has passed at once
                self.change(passed, "add 1")
                due = self._set_due(lane, passed)
                self.leave_unless(self.value(f"fcmp ole double {due}, {here}"), skipped)

    def _give_back(self, lane: str) -> None:
        """The memory of a lane that has ended goes back to its row."""
        holds, memory = self._integer_at(self._holds, lane)
        with self.when(self.integer("icmp sge", memory, 0)):
            row = self._row("%memories", memory, self._kept)
            self._move(row, 1, self.at("%w", lane, "double"), self.lanes, self._kept)
            made = self.integer("sub", "%most", self._integer_at(self._left, lane)[1])
            self.change(self._row("%passes", memory, 2, "i64"), f"add {made}")
            self.store_at(-1, holds, "i64")

    def _take(self, lane: str) -> None:
        """The next memory for a lane; where none waits it does what another one does, and records nothing."""
        here, left = self.at("%w", lane, "double"), self.at(self._left, lane, "i64")
        number = self.load_at(self._taken, "i64")
        with self.when(self.integer("icmp slt", number, "%count")) as otherwise:
            self.change(self._taken, "add 1")
            _, new = self._integer_at("%which", number)
            self.store_at(new, self.at(self._holds, lane, "i64"), "i64")
            self.store_at("%most", left, "i64")
            self._move(here, self.lanes, self._row("%memories", new, self._kept), 1, self._kept)
            self._set_due(lane, self.at(self._row("%passes", new, 2, "i64"), "1", "i64"))
            otherwise()
            self.store_at(bits(math.inf), self.at(self._due, lane, "double"), "double")
            moving = f"icmp sge {self._integers} {self.load_at(self._holds, self._integers)}, zeroinitializer"
            with self._lanes_of(self.value(moving)) as other:
                self._move(here, self.lanes, self.at("%w", other, "double"), self.lanes, self._kept)
                self.store_at(self._integer_at(self._left, other)[1], left, "i64")
