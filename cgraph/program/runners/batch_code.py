"""Machine code of batches: one pass at many values of a register."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...codegen.arithmetic import Arithmetic
from ...codegen.batch_ir import Batch, Place, batch_ir, rows_ir
from ...codegen.function_writer import FunctionWriter
from ...codegen.llvm_engine import Code
from ...core.evaluation import Array
from ...util.memory import aligned, lies_in_rows
from ..program import Program, whole_graph
from .llvm_ir import ONE_RUN, offsets, program_ir

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


def pass_ir(
    program: Program, beside: Callable[[], Program], name: str, lanes: int, flags: str, registers: int
) -> Batch:
    """The text of one pass at many values of a register.  beside: gives the program of memories side by side."""
    if (graph := whole_graph(program, name)) is not None:
        return batch_ir(graph, lanes, flags, registers)
    return program_rows_ir(beside(), name, lanes, flags, registers)


def program_rows_ir(program: Program, name: str, lanes: int, flags: str, registers: int) -> Batch:
    """The module with `rows`, see `codegen.batch_ir`, of one pass: from the register of that name to what it records.

    Both are read and written where they lie among the registers.
    """
    places, arithmetic = offsets(program.registers, 1), Arithmetic(flags, lanes, registers)
    point, *results = [Place(places[each], program.registers[each]) for each in (name, *program.record)]

    def compute(ir: FunctionWriter, *_: str) -> None:
        ir.line(ONE_RUN.format(done=ir.room(1, "i64")))

    source = program_ir(replace(program, record=()), arithmetic, 1)
    driver = rows_ir(Arithmetic(flags, lanes), point, results, compute)
    return Batch("\n".join([source, *driver, ""]), lanes * places[""])
