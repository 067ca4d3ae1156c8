"""Native: a graph as machine code, for one point and for vectors of them."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import partial
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..evaluate import Array
from ..graph import Graph
from . import llvm
from .compiled import Compiled
from .ir import batch_ir, libm_functions, scalar_ir

_POINT = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)  # too short a call to give the interpreter away for
_BATCH = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
_FAST = "reassoc nsz arcp contract afn"  # all but the promise that there is no NaN and no infinity


class _Buffers(NamedTuple):
    """Where one call at a time puts its point and finds its result."""

    x: Array
    y: Array
    x_bytes: memoryview
    y_bytes: memoryview
    run: Callable[[], None]


class Native(Compiled):
    """Machine code through LLVM. The function of one point is made at once, that of batches at its first use.

    fast, fma: what its arithmetic may do, see `compile`. Any number of threads may call it at once.
    """

    def __init__(self, graph: Graph, backend: str, *, fast: bool, fma: bool) -> None:
        super().__init__(graph, backend)
        self.fast, self.fma = fast, fma
        self._flags = _FAST if fast else "contract" if fma else ""
        host = llvm.host()
        self.source = scalar_ir(graph, self._flags)
        self._point_code = host.compile(self.source, libm_functions(graph))
        self._entry = _POINT(self._point_code.address("point"))
        self._free: list[_Buffers] = []  # pop and append are atomic: no lock, and a call inside a call is safe
        self._pack, self._unpack = Struct(f"{self.n_in}d").pack_into, Struct(f"{self.n_out}d").unpack_from
        self._lanes = host.lanes
        self._batch_code: llvm.Code | None = None
        self._batch_lock = threading.Lock()

    def __call__(self, x: ArrayLike) -> Array:
        """See Compiled."""
        point = self._point(x)
        buffers = self._take()
        buffers.x[:] = point
        buffers.run()
        result = buffers.y.copy()
        self._free.append(buffers)
        return result

    def values(self, x: list[float]) -> tuple[float, ...]:
        """See Compiled."""
        buffers = self._take()
        self._pack(buffers.x_bytes, 0, *x)
        buffers.run()
        result = self._unpack(buffers.y_bytes)
        self._free.append(buffers)
        return result

    def batch_source(self) -> str:
        """The text in LLVM's language of the function for batches."""
        return batch_ir(self.graph, self._lanes, self._flags)

    def _take(self) -> _Buffers:
        try:
            return self._free.pop()
        except IndexError:
            x, y = np.empty(self.n_in), np.empty(self.n_out)
            pointers = ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(y.ctypes.data)
            return _Buffers(x, y, x.data, y.data, partial(self._entry, *pointers))

    def _columns(self, points: Array) -> Array:
        """Vectors of columns; the last few are filled up to a whole vector by repeating one."""
        points = np.ascontiguousarray(points)
        count = points.shape[1]
        result = np.empty((self.n_out, count))
        whole = count - count % self._lanes
        if whole:
            self._sweep(points, result, whole)
        if whole < count:
            filled = np.repeat(points[:, -1:], self._lanes, axis=1)
            filled[:, : count - whole] = points[:, whole:]
            values = np.empty((self.n_out, self._lanes))
            self._sweep(filled, values, self._lanes)
            result[:, whole:] = values[:, : count - whole]
        return result

    def _sweep(self, points: Array, result: Array, count: int) -> None:
        with self._batch_lock:
            if self._batch_code is None:
                self._batch_code = llvm.host().compile(self.batch_source(), libm_functions(self.graph))
                self._batch_entry = _BATCH(self._batch_code.address("batch"))
        self._batch_entry(points.ctypes.data, result.ctypes.data, count, points.shape[1], result.shape[1])
