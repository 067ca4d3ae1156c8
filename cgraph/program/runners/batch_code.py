"""Machine code of batches: one pass of a program at many values of a register, in rows or in columns."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...codegen.arithmetic import Arithmetic
from ...codegen.batch_ir import Batch, Place, rows_ir
from ...codegen.llvm_engine import Code
from ...core.evaluation import Array
from ...util.memory import aligned, lies_in_rows
from ..program import Program
from .llvm_ir import offsets, program_ir

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
    source = program_ir(replace(program, record=()), flags, lanes, 1, registers)
    return Batch("\n".join([source, *driver, ""]), lanes * places[""])
