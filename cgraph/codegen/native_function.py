"""Native: a graph as machine code, for one point and for vectors of them."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..autodiff.direction_split import DirectionSplit
from ..core.evaluation import Array
from ..core.graph import Graph
from ..core.scope import without_collection
from . import llvm_engine as llvm
from .batch_code import BatchCode
from .batch_ir import Batch, batch_ir
from .bound_call import bound_call
from .compiled import Compiled, Options
from .disk_cache import open_cache
from .llvm_ir import libm_functions, scalar_ir
from .native_sweep import NativeSweep

_POINT = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)  # too short a call to give the interpreter away for
WORK = 2**23  # nodes times columns in a block of a batch: some tenths of a millisecond, several times a thread's start
_Buffers = tuple[Any, Array, memoryview, Callable[[], None]]  # memory of x; y, as an array and as memory; the call
_FAST = "reassoc nsz arcp contract afn"  # all but the promise that there is no NaN and no infinity


def flags_of(fast: bool, fma: bool) -> str:
    """What the arithmetic may do, in LLVM's words."""
    return _FAST if fast else "contract" if fma else ""


class Native(Compiled):
    """Machine code through LLVM. The function of one point is made at once, that of batches at its first use.

    options: fast, fma and cache, see `compile`. Any number of threads may call it at once.
    """

    takes_rows = True

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        super().__init__(graph, backend, options)
        self._flags = flags_of(options["fast"], options["fma"])
        self._cache = open_cache(options["cache"])
        self._host = llvm.host()
        with without_collection():
            self.source = scalar_ir(graph, self._flags, self._host.registers)
        self._entry = self._code(self.source).function("point", _POINT)
        self._free: list[_Buffers] = []  # pop and append are atomic: no lock, and a call inside a call is safe
        self._pack, self._unpack = Struct(f"{self.n_in}d").pack_into, Struct(f"{self.n_out}d").unpack_from
        self._batch: BatchCode | None = None
        self._batch_lock = threading.Lock()

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point, through buffers that a call at a time has for itself."""
        buffers = self._take()
        x_memory, y, _, run = buffers
        point = x if type(x) is np.ndarray else self._point(x)
        try:
            x_memory[:] = point  # compares shape and type, and copies: quicker than to look at them first
        except ValueError:
            x_memory[:] = self._point(point).copy()
        run()
        result = y.copy()
        self._free.append(buffers)
        return result

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats."""
        buffers = self._take()
        x_memory, _, y_memory, run = buffers
        self._pack(x_memory, 0, *x)
        run()
        result = self._unpack(y_memory)
        self._free.append(buffers)
        return result

    def batch_source(self) -> str:
        """The text in LLVM's language of the function for batches."""
        return self._batch_text().source

    def _batch_text(self) -> Batch:
        with without_collection():
            return batch_ir(self.graph, self._host.lanes, self._flags, self._host.registers)

    def _take(self) -> _Buffers:
        """Where one call at a time puts its point and finds its result."""
        try:
            return self._free.pop()
        except IndexError:
            x, y = np.empty(self.n_in), np.empty(self.n_out)
            return x.data, y, y.data, self._bound(x, y)

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        return bound_call(self._entry, x, y)

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        lanes = self._host.lanes
        with self._batch_lock:
            if self._batch is None:
                text = self._batch_text()
                self._batch = BatchCode(self._code(text.source), lanes, text.size)
        return max(WORK // len(self.graph.nodes) // lanes, 1) * lanes, self._batch

    def _sweep(self, split: DirectionSplit, guarded: DirectionSplit | None) -> NativeSweep:
        return NativeSweep(split, self._host, self._flags, self._cache, guarded)

    def _code(self, text: str) -> llvm.Code:
        return self._host.compile(text, libm_functions(self.graph), len(self.graph.nodes), self._cache)
