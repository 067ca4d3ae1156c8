"""A program as machine code, for one memory or a vector of them."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..codegen import llvm_engine as llvm
from ..codegen.batch_code import BatchCode
from ..core.evaluation import Array
from ..core.scope import without_collection
from .fuse import fused
from .llvm_ir import offsets, program_functions, program_ir, require_texts
from .program import Program
from .rows_ir import program_rows_ir
from .runner import Record, Runner

_NUMBER = 8  # bytes
_POINTER, _COUNT = ctypes.c_void_p, ctypes.c_int64
_RUN = ctypes.CFUNCTYPE(_COUNT, _POINTER, _POINTER, _COUNT, _COUNT, _POINTER, _POINTER, _COUNT)


class NativeRunner(Runner):
    """A program as machine code. Any number of threads may run it at once, on a memory each."""

    def __init__(self, program: Program, flags: str) -> None:
        host = llvm.host()
        super().__init__(program, host.lanes)
        require_texts(program)
        self._flags, self._host = flags, host
        self._fused = fused(program)
        self._functions = program_functions(self._fused)
        host.require(self._functions)
        self._lock = threading.Lock()
        self._one: Any = None  # what runs one memory, and a vector of them
        self._many: Any = None
        self._batches: dict[str, BatchCode] = {}  # by the register that varies

    def prepared(self) -> NativeRunner:
        """The machine code of one memory, which is otherwise made at its first use."""
        assert self._entry is not None
        return self

    def _compiled(self, text: str, *, looped: bool = False) -> llvm.Code:
        nodes = sum([len(graph.nodes) for graph in self._fused.graphs()])
        return self._host.compile(text, self._functions, nodes, looped=looped)

    @property
    def _entry(self) -> Any:
        """What runs one memory, made at its first use."""
        with self._lock:
            if self._one is None:
                text = program_ir(self._fused, self._flags, width=self.width, registers=self._host.registers)
                self._one = self._compiled(text).function("run", _RUN)
        return self._one

    @cached_property
    def _fused_many(self) -> Program:
        """The program of a vector of memories."""
        return self._fused if self.masked is self.program else fused(self.masked)

    @property
    def _entry_of_lanes(self) -> Any:
        """What runs a vector of memories, made at its first use."""
        with self._lock:
            if self._many is None:
                text = program_ir(self._fused_many, self._flags, self._host.lanes, self.width, self._host.registers)
                self._many = self._compiled(text).function("run", _RUN)
        return self._many

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        rows = np.empty((passes // every, self.program.width))
        done, (between, within) = ctypes.c_int64(), feed.strides
        if within != _NUMBER or between % _NUMBER:
            feed, between = np.ascontiguousarray(feed), _NUMBER * self.program.feed_width
        where = ctypes.addressof(done), feed.ctypes.data, between // _NUMBER
        count = self._entry(memory.ctypes.data, rows.ctypes.data, passes, every, *where)
        return Record(rows[:count], done.value)

    def _bound(self, memory: Array, rows: Array) -> Callable[[], None]:
        done, fed = np.zeros(1, np.int64), np.empty(1)
        arrays = memory, rows, done, fed
        at = [array.ctypes.data for array in arrays]
        call = partial(self._entry, at[0], at[1], len(rows), 1, at[2], at[3], 0)
        call.kept = self, arrays  # type: ignore[attr-defined]  # whose addresses it has
        return call

    def _rows_writer(self, name: str) -> Callable[[Array, Array], None]:
        with self._lock:
            if name not in self._batches:
                self._batches[name] = self._batch_code(name)
            code = self._batches[name]
        return lambda values, rows: code(values.T, rows.T)

    def _batch_code(self, name: str) -> BatchCode:
        lanes, registers = self._host.lanes, self._host.registers
        with without_collection():
            text = program_rows_ir(self._fused_many, name, lanes, self._flags, registers)
        return BatchCode(self._compiled(text.source, looped=True), lanes, text.size, columns=False)

    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record:
        lanes, size = self._host.lanes, self.size
        entry, total = self._entry_of_lanes, memories.shape[1]
        rows = np.empty((passes // every, self.program.width, total))
        block = np.zeros((offsets(self._fused_many, self.width)[""], lanes))  # the registers of masks behind the others
        part = np.empty((*rows.shape[:2], lanes))
        fed = np.empty((*feed.shape[:2], lanes))
        if feed.shape[2] == 1:
            fed[...] = feed
        done = ctypes.c_int64()
        # A vector of memories at a time; the last one is filled up with copies of its first memory.
        for start in range(0, total, lanes):
            here = slice(start, min(start + lanes, total))
            width = here.stop - start
            block[:size, :width], block[:size, width:] = memories[:, here], memories[:, start : start + 1]
            if feed.shape[2] > 1:
                fed[:, :, :width], fed[:, :, width:] = feed[:, :, here], feed[:, :, start : start + 1]
            where = ctypes.addressof(done), fed.ctypes.data, feed.shape[1]
            entry(block.ctypes.data, part.ctypes.data, passes, every, *where)
            memories[:, here], rows[:, :, here] = block[:size, :width], part[:, :, :width]
        return Record(rows, passes)
