"""Machine code of batches: one pass at many values of a register, and many memories, each until its own stop."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...codegen.arithmetic import Arithmetic
from ...codegen.batch_ir import Batch, Place, rows_ir
from ...codegen.llvm_engine import Code
from ...core.evaluation import Array
from ...util.memory import aligned, lies_in_rows
from ..program import Program
from .llvm_ir import offsets, program_ir

Counts = np.ndarray[Any, np.dtype[np.int64]]

_BATCH = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_int64] * 3, ctypes.c_void_p)
_LANES = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 3)


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
        """Results, (n_out, k), of points, (n_in, k), both in rows or both in columns.

        Vectors of points; the last few are filled up to a whole vector by repeating one.
        """
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
        if whole < count:
            filled = np.empty((len(points), self._lanes), order=order)  # type: ignore[call-overload]
            filled[:, : count - whole], filled[:, count - whole :] = points[:, whole:], points[:, -1:]
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


def program_rows_ir(program: Program, name: str, lanes: int, flags: str, registers: int) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`, of one pass: from the register of that name to what it records.

    Both are read and written where they lie among the registers.
    """
    places = offsets(program.registers, 1)
    point, *results = [Place(places[each], program.registers[each]) for each in (name, *program.record)]
    calls = ["  %rows = call i64 @run(ptr %w, ptr null, i64 1, i64 1, ptr %done, ptr null)"]
    driver = rows_ir(Arithmetic(flags, lanes), point, results, calls, ["  %done = alloca i64, align 8"])
    source = program_ir(replace(program, record=()), Arithmetic(flags, lanes, registers), 1)
    return Batch("\n".join([source, *driver, ""]), lanes * places[""])


class LaneCode:
    """Machine code of memories in lanes: each runs until its own stop, and another then takes its lane.

    numbers: {register: place in the row of a memory}, of those registers that outlive a pass.  size: of such a row.
    Any number of threads may call it at once, on rows of their own.

    Of x = x / 2, while x > 1:

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, runner
    >>> x = cg.variable("x")
    >>> halve = Call(cg.Graph([x], {"x": 0.5 * x, "done": 0.5 * x <= 1.0}), ("x",), ("x", "done"))
    >>> code = runner(Program({"x": 1, "done": 1}, [halve], ["x"], stop="done")).lane_code("x")
    >>> sorted(code.numbers)
    ['x']
    """

    def __init__(self, code: Code, program: Program, kept: Sequence[str], lanes: int, size: int) -> None:
        self._entry = code.function("lanes", _LANES)
        places = offsets(program.registers, 1)
        self.numbers = {name: slice(places[name], places[name] + program.registers[name]) for name in kept}
        self.size, self.width = sum([program.registers[name] for name in kept]), program.width
        self._memory = lanes * size

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


def lane_ir(program: Program, kept: int, clock: str, arithmetic: Arithmetic) -> Batch:
    """The module with `lanes`, see `LaneCode`, of a program under masks whose first `kept` numbers outlive a pass."""
    places, lanes = offsets(program.registers, 1), arithmetic.lanes
    source = program_ir(replace(program, record=(), record_if=None, stop=None), arithmetic, 1)
    row, at = [], 0
    for name in program.record:
        row.append(_ROW.format(at=at, place=places[name] * lanes, count=program.registers[name], lanes=lanes))
        at += program.registers[name]
    t, bits = arithmetic.type, f"i{lanes}"
    words = {"t": t, "n": f"<{lanes} x i64>", "b": f"<{lanes} x i1>", "bits": bits, "lanes": lanes, "kept": kept}
    words |= {"all": 2**lanes - 1, "width": program.width, "row": "\n".join(row)}
    words |= {"stop": places[program.stop] if program.stop is not None else 0, "clock": places[clock]}
    words["stopped"] = "%stopped.each" if program.stop is not None else "zeroinitializer"
    words["wanted"] = places[program.record_if] if program.record_if is not None else places[clock]
    return Batch("\n".join([source, _LANES_TEXT.format(**words)]), places[""])


# Number k of row `which` of an array of rows lies next to the one before, that of a lane as many apart as there are
# lanes. A lane holds memory %which, or -1; all begin as lanes that have ended with nothing.
_ROW = """\
  %row.to{at} = getelementptr double, ptr %row.to, i64 {at}
  %row.from{at}.lane = add i64 %r, {place}
  %row.from{at} = getelementptr double, ptr %w, i64 %row.from{at}.lane
  call void @move(ptr %row.to{at}, ptr %row.from{at}, i64 {count}, i64 1, i64 {lanes})"""
_LANES_TEXT = """\
define internal void @move(ptr noalias %to, ptr noalias %from, i64 %count, i64 %to.step, i64 %from.step) nounwind {{
start:
  %some = icmp sgt i64 %count, 0
  br i1 %some, label %each, label %end
each:
  %k = phi i64 [ 0, %start ], [ %next, %each ]
  %to.at = mul i64 %k, %to.step
  %from.at = mul i64 %k, %from.step
  %a = getelementptr double, ptr %to, i64 %to.at
  %b = getelementptr double, ptr %from, i64 %from.at
  %value = load double, ptr %b, align 8
  store double %value, ptr %a, align 8
  %next = add i64 %k, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %each, label %end
end:
  ret void
}}
define void @lanes(ptr noalias %w, ptr noalias %memories, ptr noalias %which, ptr noalias %passes, ptr noalias %rows,
                   ptr noalias %marks, i64 %count, i64 %most, i64 %n) nounwind {{
start:
  %done = alloca i64, align 8
  %holds = alloca {n}, align 64
  %left = alloca {n}, align 64
  %due = alloca {t}, align 64
  %given = alloca i64, align 8
  %live = alloca i64, align 8
  store {n} splat (i64 -1), ptr %holds, align 64
  store {n} zeroinitializer, ptr %left, align 64
  store {t} splat (double 0x7FF0000000000000), ptr %due, align 64
  store i64 0, ptr %given, align 8
  store i64 0, ptr %live, align 8
  %clocks = getelementptr {t}, ptr %w, i64 {clock}
  %wishes = getelementptr {t}, ptr %w, i64 {wanted}
  %stops = getelementptr {t}, ptr %w, i64 {stop}
  br label %ended
pass:
  %unused = call i64 @run(ptr %w, ptr null, i64 1, i64 2, ptr %done, ptr null, i64 0)
  %clock = load {t}, ptr %clocks, align 8
  %wish = load {t}, ptr %wishes, align 8
  %due.now = load {t}, ptr %due, align 64
  %reached.each = fcmp oge {t} %clock, %due.now
  %wished.each = fcmp ogt {t} %wish, zeroinitializer
  %rows.each = and {b} %reached.each, %wished.each
  %rows.bits = bitcast {b} %rows.each to {bits}
  %rows.some = icmp ne {bits} %rows.bits, 0
  br i1 %rows.some, label %record, label %recorded
record:
  %r = phi i64 [ 0, %pass ], [ %r.next, %record.next ]
  %r.bit = trunc i64 %r to {bits}
  %r.bits = lshr {bits} %rows.bits, %r.bit
  %r.on = trunc {bits} %r.bits to i1
  br i1 %r.on, label %row, label %record.next
row:
  %r.holds.at = getelementptr i64, ptr %holds, i64 %r
  %r.holds = load i64, ptr %r.holds.at, align 8
  %r.count = mul i64 %r.holds, 2
  %r.mark = add i64 %r.count, 1
  %mark.at = getelementptr i64, ptr %passes, i64 %r.mark
  %mark = load i64, ptr %mark.at, align 8
  %row.first = mul i64 %r.holds, %n
  %row.number = add i64 %row.first, %mark
  %row.at = mul i64 %row.number, {width}
  %row.to = getelementptr double, ptr %rows, i64 %row.at
{row}
  %r.clock.at = getelementptr double, ptr %clocks, i64 %r
  %r.clock = load double, ptr %r.clock.at, align 8
  br label %skip
skip:
  %k = phi i64 [ %mark, %row ], [ %k.next, %skip.test ]
  %k.next = add i64 %k, 1
  %k.more = icmp slt i64 %k.next, %n
  br i1 %k.more, label %skip.test, label %skipped
skip.test:
  %next.at = getelementptr double, ptr %marks, i64 %k.next
  %next.mark = load double, ptr %next.at, align 8
  %passed = fcmp ole double %next.mark, %r.clock
  br i1 %passed, label %skip, label %skipped
skipped:
  %new.due = phi double [ 0x7FF0000000000000, %skip ], [ %next.mark, %skip.test ]
  store i64 %k.next, ptr %mark.at, align 8
  %r.due.at = getelementptr double, ptr %due, i64 %r
  store double %new.due, ptr %r.due.at, align 8
  br label %record.next
record.next:
  %r.next = add i64 %r, 1
  %r.more = icmp slt i64 %r.next, {lanes}
  br i1 %r.more, label %record, label %recorded
recorded:
  %left.before = load {n}, ptr %left, align 64
  %left.now = sub {n} %left.before, splat (i64 1)
  store {n} %left.now, ptr %left, align 64
  %stop = load {t}, ptr %stops, align 8
  %stopped.each = fcmp une {t} %stop, zeroinitializer
  %spent.each = icmp sle {n} %left.now, zeroinitializer
  %ended.each = or {b} %spent.each, {stopped}
  %ended.bits = bitcast {b} %ended.each to {bits}
  %ended.some = icmp ne {bits} %ended.bits, 0
  br i1 %ended.some, label %ended, label %pass
ended:
  %over = phi {bits} [ -1, %start ], [ %ended.bits, %recorded ]
  br label %lane
lane:
  %e = phi i64 [ 0, %ended ], [ %e.next, %lane.next ]
  %e.bit = trunc i64 %e to {bits}
  %e.bits = lshr {bits} %over, %e.bit
  %e.on = trunc {bits} %e.bits to i1
  %e.w = getelementptr double, ptr %w, i64 %e
  %e.holds.at = getelementptr i64, ptr %holds, i64 %e
  %e.left.at = getelementptr i64, ptr %left, i64 %e
  %e.due.at = getelementptr double, ptr %due, i64 %e
  br i1 %e.on, label %give.back, label %lane.next
give.back:
  %e.holds = load i64, ptr %e.holds.at, align 8
  %e.held = icmp sge i64 %e.holds, 0
  br i1 %e.held, label %put, label %take
put:
  %put.at = mul i64 %e.holds, {kept}
  %put.to = getelementptr double, ptr %memories, i64 %put.at
  call void @move(ptr %put.to, ptr %e.w, i64 {kept}, i64 1, i64 {lanes})
  %e.count = mul i64 %e.holds, 2
  %count.at = getelementptr i64, ptr %passes, i64 %e.count
  %count.before = load i64, ptr %count.at, align 8
  %e.left = load i64, ptr %e.left.at, align 8
  %e.passes = sub i64 %most, %e.left
  %count.now = add i64 %count.before, %e.passes
  store i64 %count.now, ptr %count.at, align 8
  %live.before = load i64, ptr %live, align 8
  %live.less = sub i64 %live.before, 1
  store i64 %live.less, ptr %live, align 8
  store i64 -1, ptr %e.holds.at, align 8
  br label %take
take:
  %g = load i64, ptr %given, align 8
  %g.more = icmp slt i64 %g, %count
  br i1 %g.more, label %get, label %look
get:
  %g.next = add i64 %g, 1
  store i64 %g.next, ptr %given, align 8
  %g.at = getelementptr i64, ptr %which, i64 %g
  %new = load i64, ptr %g.at, align 8
  store i64 %new, ptr %e.holds.at, align 8
  store i64 %most, ptr %e.left.at, align 8
  %live.few = load i64, ptr %live, align 8
  %live.more = add i64 %live.few, 1
  store i64 %live.more, ptr %live, align 8
  %get.at = mul i64 %new, {kept}
  %get.from = getelementptr double, ptr %memories, i64 %get.at
  call void @move(ptr %e.w, ptr %get.from, i64 {kept}, i64 {lanes}, i64 1)
  %new.count = mul i64 %new, 2
  %new.mark = add i64 %new.count, 1
  %new.mark.at = getelementptr i64, ptr %passes, i64 %new.mark
  %first = load i64, ptr %new.mark.at, align 8
  %first.more = icmp slt i64 %first, %n
  br i1 %first.more, label %get.due, label %get.none
get.due:
  %first.at = getelementptr double, ptr %marks, i64 %first
  %first.due = load double, ptr %first.at, align 8
  store double %first.due, ptr %e.due.at, align 8
  br label %lane.next
get.none:
  store double 0x7FF0000000000000, ptr %e.due.at, align 8
  br label %lane.next
look: ; nothing waits: the lane does what another one does, and records nothing
  %j = phi i64 [ 0, %take ], [ %j.next, %look.next ]
  %j.holds.at = getelementptr i64, ptr %holds, i64 %j
  %j.holds = load i64, ptr %j.holds.at, align 8
  %j.live = icmp sge i64 %j.holds, 0
  br i1 %j.live, label %follow, label %look.next
look.next:
  %j.next = add i64 %j, 1
  %j.more = icmp slt i64 %j.next, {lanes}
  br i1 %j.more, label %look, label %lane.next
follow:
  %j.w = getelementptr double, ptr %w, i64 %j
  call void @move(ptr %e.w, ptr %j.w, i64 {kept}, i64 {lanes}, i64 {lanes})
  %j.left.at = getelementptr i64, ptr %left, i64 %j
  %j.left = load i64, ptr %j.left.at, align 8
  store i64 %j.left, ptr %e.left.at, align 8
  store double 0x7FF0000000000000, ptr %e.due.at, align 8
  br label %lane.next
lane.next:
  %e.next = add i64 %e, 1
  %e.more = icmp slt i64 %e.next, {lanes}
  br i1 %e.more, label %lane, label %lanes.done
lanes.done:
  %live.now = load i64, ptr %live, align 8
  %goes.on = icmp sgt i64 %live.now, 0
  br i1 %goes.on, label %pass, label %end
end:
  ret void
}}
"""
