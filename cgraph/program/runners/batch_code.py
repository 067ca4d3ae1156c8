"""Machine code of batches: one pass at many values of a register, and many memories, each until its own stop."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ...codegen.arithmetic import Arithmetic, bits
from ...codegen.batch_ir import Batch, Place, batch_ir, rows_ir
from ...codegen.function_writer import FunctionWriter
from ...codegen.llvm_engine import Code
from ...core.evaluation import Array
from ...util.memory import aligned, lies_in_rows
from ..fuse import fused
from ..many import many_keeping
from ..program import Program, whole_graph
from .llvm_ir import ONE_RUN, offsets, program_ir

Counts = np.ndarray[Any, np.dtype[np.int64]]
_LANES = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 3)
_BATCH = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_int64] * 3, ctypes.c_void_p)


class BatchCode:
    """The function of batches of a module; any number of threads may call it at once.

    size: of the memory that a call needs, which holds zeros at first and, from numbers of vectors on, those of `start`.
    columns: whether it takes points in columns, too, and not rows alone.
    """

    def __init__(self, code: Code, lanes: int, size: int, start: Mapping[int, Array], *, columns: bool = True) -> None:
        self._rows = code.function("rows", _BATCH)
        self._columns = code.function("batch", _BATCH) if columns else None
        self._lanes, self._size, self._start = lanes, size, start
        self._free: list[Array] = []  # memories

    def __call__(self, points: Array, result: Array) -> None:
        """Results, (n_out, k), of points, (n_in, k), both in rows or both in columns."""
        rows = self._columns is None or lies_in_rows(points)
        axis, order = (1, "F") if rows else (0, "C")
        if points.strides[1 - axis] != points.itemsize or not points.flags.aligned:
            points = np.array(points, order=order)  # type: ignore[call-overload]
        if result.strides[1 - axis] != result.itemsize or not result.flags.aligned:
            values = np.empty(result.shape, order=order)  # type: ignore[call-overload]
            self(points, values)
            result[...] = values
            return
        count = points.shape[1]
        whole = count - count % self._lanes
        if whole:
            self._run(points, result, whole, axis)
        if whole < count:  # the last few, filled up to a whole vector by repeating one
            filled = np.array(points[:, np.minimum(np.arange(whole, whole + self._lanes), count - 1)], order=order)  # type: ignore[call-overload]
            values = np.empty((len(result), self._lanes), order=order)  # type: ignore[call-overload]
            self._run(filled, values, self._lanes, axis)
            result[:, whole:] = values[:, : count - whole]

    def _run(self, points: Array, result: Array, count: int, axis: int) -> None:
        try:
            memory = self._free.pop()
        except IndexError:
            memory = aligned(self._size)
            memory[:] = 0.0
            for at, numbers in self._start.items():
                memory[at * self._lanes : (at + len(numbers)) * self._lanes] = np.repeat(numbers, self._lanes)
        entry = self._rows if axis else self._columns
        strides = points.strides[axis] // points.itemsize, result.strides[axis] // result.itemsize
        entry(points.ctypes.data, result.ctypes.data, count, *strides, memory.ctypes.data)  # type: ignore[misc]
        self._free.append(memory)


def pass_ir(program: Program, name: str, lanes: int, flags: str, registers: int) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`, of one pass, from the register of that name to its record."""
    if (graph := whole_graph(program, name)) is not None:
        return batch_ir(graph, lanes, flags, registers)
    places, arithmetic = offsets(program.registers, 1), Arithmetic(flags, lanes, registers)
    point, *results = [Place(places[each], program.registers[each]) for each in (name, *program.record)]

    def compute(ir: FunctionWriter, *_: str) -> None:
        ir.line(ONE_RUN.format(done=ir.room(1, "i64")))

    source = program_ir(replace(program, record=()), arithmetic, 1)
    driver = rows_ir(Arithmetic(flags, lanes), point, results, compute)
    return Batch("\n".join([source, *driver, ""]), lanes * places[""])


class LaneCode:
    """Machine code of memories in lanes: each runs until its own stop, and another then takes its lane.

    numbers: {register: place in the row of a memory}, of those registers that outlive a pass.  size: of such a row.
    Any number of threads may call it at once, on rows of their own.
    """

    def __init__(self, code: Code, program: Program, kept: Sequence[str], size: int) -> None:
        self._entry = code.function("lanes", _LANES)
        places = offsets(program.registers, 1)
        self.numbers = {name: slice(places[name], places[name] + program.registers[name]) for name in kept}
        self.size, self.width = sum([program.registers[name] for name in kept]), program.width
        self._memory = size

    def __call__(self, memories: Array, which: Counts, passes: Counts, most: int, rows: Array, marks: Array) -> None:
        """Run the memories that `which` names, rows of `memories` (N, size), at most so many passes each.

        passes: (N, 2), how many each has run, and how many of the marks it has passed; both go on.
        rows: (N, len(marks), width); row k of a memory is what it records in the pass that takes its clock to marks[k];
        those of marks that it passes in the same one stay as they are.  marks: of the clock, increasing.
        """
        memory = aligned(self._memory)
        memory[:] = 0.0
        arrays = (memory, memories, which, passes, rows, marks)
        self._entry(*[array.ctypes.data for array in arrays], len(which), most, len(marks))


def lane_ir(program: Program, kept: Sequence[str], clock: str, arithmetic: Arithmetic) -> tuple[Program, Batch]:
    """The program under masks, and its module with `lanes`, see `LaneCode`; its first registers, `kept`, stay."""
    program = fused(many_keeping(program, kept), alike=arithmetic.alike)
    source = program_ir(replace(program, record=(), record_if=None, stop=None), arithmetic, 1)
    lines = _LaneWriter(program, sum([program.registers[name] for name in kept]), clock, arithmetic).definitions()
    size = arithmetic.lanes * offsets(program.registers, 1)[""]
    return program, Batch("\n".join([source, *lines, ""]), size)


class _LaneWriter(FunctionWriter):
    """The function `lanes`: passes of memories, each of which begins in a lane where another one has ended.

    Number k of row j of an array of rows lies next to the one before, that of a lane as many apart as there are lanes.
    """

    def __init__(self, program: Program, kept: int, clock: str, arithmetic: Arithmetic) -> None:
        super().__init__(arithmetic)
        self._program, self._kept, self._clock = program, kept, clock
        self._places = offsets(program.registers, 1)
        self._integers = f"<{self.lanes} x i64>"
        # Of each lane: its memory, or -1; the passes that are left to it; and the next mark of its clock.
        self._holds, self._left, self._due = self.room(1, self._integers), self.room(1, self._integers), self.room()
        self._given, self._live, self._over = [self.room(1, "i64") for _ in range(3)]  # memories, and the lanes' bits

    def definitions(self) -> list[str]:
        """The function, and the one that it moves numbers with."""
        self.store_at("splat (i64 -1)", self._holds, self._integers)
        self.store_at("zeroinitializer", self._left, self._integers)
        self.store_at(self.number(math.inf), self._due)
        for address, value in ((self._given, 0), (self._live, 0), (self._over, -1)):  # all end, with nothing
            self.store_at(value, address, "i64")
        done = self.room(1, "i64")
        with self.repeat() as end:
            with self._lanes_of(self.load_at(self._over, "i64")) as lane:
                self._give_back(lane)
                self._take(lane)
            self.leave_unless(self.integer("icmp sgt", self.load_at(self._live, "i64"), 0), end)
            self.line(ONE_RUN.format(done=done))
            self._record_lanes()
            left = self.value(f"sub {self._integers} {self.load_at(self._left, self._integers)}, splat (i64 1)")
            self.store_at(left, self._left, self._integers)
            over = self.value(f"icmp sle {self._integers} {left}, zeroinitializer")
            if self._program.stop is not None:  # NaN counts as not 0
                stopped = self.compare("une", self._number(self._program.stop), 0.0)
                over = self.value(f"or {self.bits} {over}, {stopped}")
            self.store_at(self._mask(over), self._over, "i64")
        moving = FunctionWriter(Arithmetic())
        with moving.loop(0, "%count") as k:
            source, target = (moving.at(f"%{end}", moving.integer("mul", k, f"%{end}.step")) for end in ("from", "to"))
            moving.store_at(moving.load_at(source), target)
        return [
            *moving.function(f"internal void @move({_MOVE}) nounwind"),
            *self.function(f"void @lanes({_ALL}) nounwind"),
        ]

    def _number(self, register: str) -> str:
        return self.load_at(self.at("%w", self._places[register]))

    def _mask(self, condition: str) -> str:
        return self.value(f"zext i{self.lanes} {self.mask(condition)} to i64")

    @contextmanager
    def _lanes_of(self, mask: str) -> Iterator[str]:
        """The lines inside, for every lane whose bit is 1."""
        with self.when(self.integer("icmp ne", mask, 0)), self.loop(0, self.lanes) as lane:
            bit = self.value(f"trunc i64 {self.integer('lshr', mask, lane)} to i1")
            with self.when(bit):
                yield lane

    def _move(self, target: str, to_step: int, source: str, from_step: int, count: int) -> None:
        steps = f"i64 {count}, i64 {to_step}, i64 {from_step}"
        self.line(f"call void @move(ptr {target}, ptr {source}, {steps})")

    def _row(self, base: str, row: str, width: str | int) -> str:
        """The address of a row of doubles."""
        return self.at(base, self.integer("mul", row, width), "double")

    def _count_of(self, memory: str, column: int) -> str:
        """The address of how many passes a memory has run, or marks passed."""
        return self.at("%passes", self.integer("add", self.integer("mul", memory, 2), column), "i64")

    def _set_due(self, lane: str, mark: str) -> str:
        """The next mark of a lane, infinite behind the last; whether there is one."""
        due, there = self.at(self._due, lane, "double"), self.integer("icmp slt", mark, "%n")
        self.store_at(bits(math.inf), due, "double")
        with self.when(there):
            self.store_at(self.load_at(self.at("%marks", mark, "double"), "double"), due, "double")
        return there

    def _record_lanes(self) -> None:
        """A row in the lanes whose clock has reached a mark, where a row is wanted."""
        clock, program = self._number(self._clock), self._program
        reached = self.compare("oge", clock, self.load_at(self._due))
        wish = self.compare("ogt", self._number(program.record_if or self._clock), 0.0)
        with self._lanes_of(self._mask(self.value(f"and {self.bits} {reached}, {wish}"))) as lane:
            memory = self.load_at(self.at(self._holds, lane, "i64"), "i64")
            passed, mark = self._count_of(memory, 1), self.room(1, "i64")
            first = self.load_at(passed, "i64")
            number = self.integer("add", self.integer("mul", memory, "%n"), first)
            row, at = self._row("%rows", number, program.width), 0
            for name in program.record:
                source = self.at("%w", self.integer("add", lane, self._places[name] * self.lanes), "double")
                self._move(self.at(row, at, "double"), 1, source, self.lanes, program.registers[name])
                at += program.registers[name]
            here = self.load_at(self.at(self.at("%w", self._places[self._clock]), lane, "double"), "double")
            self.store_at(first, mark, "i64")
            with self.repeat() as skipped:  # marks that it has passed at once
                self.change(mark, "add 1")
                self.leave_unless(self._set_due(lane, self.load_at(mark, "i64")), skipped)
                due = self.load_at(self.at(self._due, lane, "double"), "double")
                self.leave_unless(self.value(f"fcmp ole double {due}, {here}"), skipped)
            self.store_at(self.load_at(mark, "i64"), passed, "i64")

    def _give_back(self, lane: str) -> None:
        """The memory of a lane that has ended goes back to its row."""
        held = self.at(self._holds, lane, "i64")
        memory = self.load_at(held, "i64")
        with self.when(self.integer("icmp sge", memory, 0)):
            self._move(
                self._row("%memories", memory, self._kept), 1, self.at("%w", lane, "double"), self.lanes, self._kept
            )
            left = self.load_at(self.at(self._left, lane, "i64"), "i64")
            self.change(self._count_of(memory, 0), f"add {self.integer('sub', '%most', left)}")
            self.change(self._live, "sub 1")
            self.store_at(-1, held, "i64")

    def _take(self, lane: str) -> None:
        """The next memory for a lane; where none waits it does what another one does, and records nothing."""
        here, left = self.at("%w", lane, "double"), self.at(self._left, lane, "i64")
        given = self.load_at(self._given, "i64")
        with self.when(self.integer("icmp slt", given, "%count")) as otherwise:
            self.change(self._given, "add 1")
            self.change(self._live, "add 1")
            new = self.load_at(self.at("%which", given, "i64"), "i64")
            self.store_at(new, self.at(self._holds, lane, "i64"), "i64")
            self.store_at("%most", left, "i64")
            self._move(here, self.lanes, self._row("%memories", new, self._kept), 1, self._kept)
            self._set_due(lane, self.load_at(self._count_of(new, 1), "i64"))
            otherwise()
            self.store_at(bits(math.inf), self.at(self._due, lane, "double"), "double")
            with self.loop(0, self.lanes) as other:
                memory = self.load_at(self.at(self._holds, other, "i64"), "i64")
                with self.when(self.integer("icmp sge", memory, 0)):
                    self._move(here, self.lanes, self.at("%w", other, "double"), self.lanes, self._kept)
                    self.store_at(self.load_at(self.at(self._left, other, "i64"), "i64"), left, "i64")


_ALL = ", ".join([f"ptr noalias %{name}" for name in ("w", "memories", "which", "passes", "rows", "marks")])
_ALL += ", i64 %count, i64 %most, i64 %n"
_MOVE = "ptr noalias %to, ptr noalias %from, i64 %count, i64 %to.step, i64 %from.step"
