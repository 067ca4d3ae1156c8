"""A program as machine code, for one memory or a vector of them."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...codegen import llvm_engine as llvm
from ...codegen.arithmetic import Arithmetic
from ...codegen.bound_call import LONG, SHORT, bound_call
from ...codegen.llvm_ir import point_arithmetic
from ...core.evaluation import Array
from ...core.scope import without_collection
from ...util.memory import aligned
from ..fuse import fused
from ..program import Program, outliving, whole_graph
from ..statement import row_of
from .llvm_ir import offsets, point_ir, program_functions, program_ir, require_texts
from .runner import Record, Runner

if TYPE_CHECKING:
    from ...codegen.batch_ir import Batch
    from ...codegen.disk_cache import Cache
    from .batch_code import BatchCode, LaneCode

_NUMBER = 8  # bytes
_POINTER, _COUNT = ctypes.c_void_p, ctypes.c_int64
WORK = 2**23  # nodes times points in a block of a batch: some tenths of a millisecond, several times a thread's start
MANY = 2**14  # operations that take some microseconds: time enough for Python's other threads
_RUN = ctypes.CFUNCTYPE(_COUNT, _POINTER, _POINTER, _COUNT, _COUNT, _POINTER, _POINTER, _COUNT)


_FAST = "reassoc nsz arcp contract afn"  # all but the promise that there is no NaN and no infinity


def flags_of(fast: bool, fma: bool) -> str:
    """Liberties of the arithmetic, in LLVM's words."""
    return _FAST if fast else "contract" if fma else ""


class PointCode(NamedTuple):
    """One pass of which two registers lie apart: the text, the function, and where the other registers lie."""

    source: str
    entry: Any
    places: dict[str, int]


class NativeRunner(Runner):
    """A program as machine code. Any number of threads may run it at once, on a memory each."""

    takes_rows, vectors = True, 17

    def __init__(self, program: Program, flags: str, cache: Cache | None = None) -> None:
        host = llvm.host()
        super().__init__(program, host.lanes)
        self.lanes = host.lanes
        require_texts(program)
        self._flags, self._host, self._cache = flags, host, cache
        self._fused = fused(program)
        self._nodes = sum([len(graph.nodes) for graph in self._fused.graphs()])
        self._functions = program_functions(self._fused)
        host.require(self._functions)
        self._lock = threading.Lock()
        self._codes: dict[int, Any] = {}  # {lanes: what runs so many memories}
        self._points: dict[tuple[str, str], PointCode] = {}  # by the registers that lie apart
        self._batches: dict[str, tuple[int, BatchCode]] = {}  # by the register that varies

    def prepared(self) -> NativeRunner:
        """The machine code of one memory, which is otherwise made at its first use."""
        assert self._entry is not None
        return self

    def _compiled(self, text: str, lanes: int = 1, *, looped: bool = False) -> llvm.Code:
        return self._host.compile(text, self._functions, self._nodes, self._cache, lanes=lanes, looped=looped)

    @property
    def _entry(self) -> Any:
        """Machine code that runs one memory, made at its first use."""
        return self._code(self._fused, 1)

    @cached_property
    def _fused_many(self) -> Program:
        """The program of a vector of memories."""
        return self._fused if self.masked is self.program else fused(self.masked)

    def _code(self, program: Program, lanes: int) -> Any:
        """Machine code that runs so many memories, made at its first use."""
        with self._lock:
            if lanes not in self._codes:
                registers = self._host.registers
                vectors = Arithmetic(self._flags, lanes, registers)
                one = point_arithmetic(self._flags, registers)
                text = program_ir(program, vectors if lanes > 1 else one, self.width)
                self._codes[lanes] = self._compiled(text, lanes).function("run", _RUN)
        return self._codes[lanes]

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

    def _advancing(self, memory: Array) -> Callable[[int], None]:
        done, none, entry = np.zeros(1, np.int64), np.empty(1), self._entry
        at, nowhere, count = memory.ctypes.data, none.ctypes.data, done.ctypes.data

        def advance(passes: int) -> None:
            entry(at, nowhere, passes, passes + 1, count, nowhere, 0)

        advance.kept = self, memory, none, done  # type: ignore[attr-defined]  # whose addresses it has
        return advance

    def _bind_pass(self, x: tuple[str, Array], y: tuple[str, Array]) -> tuple[Callable[[], None], Mapping[str, Array]]:
        code = self.point(x[0], y[0])
        memory = aligned(code.places[""])
        memory[:] = 0.0
        lengths = self.program.registers
        registers = {name: memory[at : at + lengths[name]] for name, at in code.places.items() if name}
        return bound_call(code.entry, x[1], y[1], memory), registers

    def point(self, x: str, y: str) -> PointCode:
        """Machine code of one pass of which two registers lie apart, made at its first use."""
        with self._lock:
            if (x, y) not in self._points:
                how = self._flags, self.width, self._host.registers
                with without_collection():
                    text, places = point_ir(self._fused, x, y, *how)
                entry = self._compiled(text).function("point", SHORT if self._nodes < MANY else LONG)
                self._points[x, y] = PointCode(text, entry, places)
            return self._points[x, y]

    def _columns(
        self, name: str, start: Mapping[str, Array] = MappingProxyType({})
    ) -> tuple[int, Callable[[Array, Array], None]]:
        if name not in self._batches:
            with self._lock:
                if name not in self._batches:
                    self._batches[name] = self._batch(name, start)
        return self._batches[name]

    @cached_property
    def _side(self) -> ModuleType:
        """The module for memories side by side."""
        from . import batch_code  # which a program of one memory does without

        return batch_code

    def _batch(self, name: str, start: Mapping[str, Array]) -> tuple[int, BatchCode]:
        """The points in a block, and the machine code."""
        lanes, text, alone = self._host.lanes, self._batch_module(name), whole_graph(self._fused, name) is not None
        code = self._compiled(text.source, lanes, looped=not alone)
        width = max(WORK // max(1, self._nodes) // lanes, 1) * lanes
        places = offsets(self._fused_many.registers, 1) if start else {}
        begin = {places[other]: numbers for other, numbers in start.items()}
        return width, self._side.BatchCode(code, lanes, text.size, begin, columns=alone)

    def lane_code(self, clock: str, results: Sequence[str] = (), *, alike: bool = True) -> LaneCode | None:
        """Machine code of memories in lanes; see `Runner`."""
        if self.program.feed or any(row_of(each).beside is None for each in self.program.statements()):
            return None
        lanes, lengths = self._host.lanes, self.program.registers
        arithmetic = Arithmetic(self._flags, lanes, self._host.registers, alike=alike)
        first = {*outliving(self._fused), *results}
        kept = [name for name in lengths if name in first]
        beside = replace(self._fused, registers={name: lengths[name] for name in dict.fromkeys([*kept, *lengths])})
        masked, size = self._side.kept_beside(beside, kept, alike), sum([lengths[name] for name in kept])
        with without_collection():
            text = self._side.lane_ir(masked, size, clock, arithmetic)
        code: LaneCode = self._side.LaneCode(self._compiled(text.source, lanes), masked, kept, lanes, text.size)
        return code

    def _point_text(self, x: str, y: str) -> str:
        """The text in LLVM's language."""
        return self.point(x, y).source

    def _batch_text(self, name: str) -> str:
        """The text in LLVM's language."""
        return self._batch_module(name).source

    def _batch_module(self, name: str) -> Batch:
        how = self._host.lanes, self._flags, self._host.registers
        with without_collection():
            text: Batch = self._side.pass_ir(self._fused, lambda: self._fused_many, name, *how)
        return text

    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record:
        lanes, size = self._host.lanes, self.size
        entry, total = self._code(self._fused_many, lanes), memories.shape[1]
        rows = np.empty((passes // every, self.program.width, total))
        block = np.zeros(
            (offsets(self._fused_many.registers, self.width)[""], lanes)
        )  # the registers of masks behind the others
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
