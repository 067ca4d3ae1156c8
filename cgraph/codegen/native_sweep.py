"""A sweep as machine code: directions in the lanes of vectors, groups of them in a loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import ClassVar

from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices
from ..core.evaluation import Array
from .derivative_ir import FIELDS, sweep_ir, whole
from .disk_cache import Cache
from .llvm_engine import Host
from .llvm_ir import libm_functions
from .sweep import Sweep, aligned

LONG = 2**16  # instructions


class _Fields(ctypes.Structure):
    """What the one argument of the machine code points to."""

    _fields_: ClassVar = [(name, ctypes.c_int64) for name in FIELDS]
    arrays: object  # which it keeps alive


class NativeSweep(Sweep):
    """Machine code through LLVM. flags: of the arithmetic.  cache: where machine code is kept."""

    def __init__(
        self,
        split: DirectionSplit,
        host: Host,
        flags: str,
        cache: Cache | None,
        guarded: DirectionSplit | None = None,
    ) -> None:
        super().__init__(split, host.lanes, guarded)
        self._how = (host, flags, cache)
        self.source = sweep_ir(split, host.lanes, flags, host.registers, check=guarded is not None)
        nodes = len(split.primal.nodes) + len(split.linear.nodes)
        code = host.compile(self.source, libm_functions(split.primal), nodes, cache)
        result = None if guarded is None else ctypes.c_int
        # A call that is short is not worth giving the interpreter away for.
        self._short = code.function("sweep", ctypes.PYFUNCTYPE(result, ctypes.c_void_p))
        self._long = code.function("sweep", ctypes.CFUNCTYPE(result, ctypes.c_void_p))

    def _like(self, split: DirectionSplit) -> NativeSweep:
        return NativeSweep(split, *self._how)

    def _bound(self, x: Array, s: Array, y: Array, take: Indices, put: Indices, values: Array) -> Callable[[], object]:
        groups, p = len(s), aligned((whole(len(self.split.primal.outputs), self.lanes),))
        p[:] = 0.0
        arrays = {"x": x, "p": p, "s": s, "y": y, "take": take, "put": put, "values": values}
        counts = {"groups": groups, "entries": len(take)}
        numbers = [arrays[name].ctypes.data if name in arrays else counts[name] for name in FIELDS]
        fields = _Fields(*numbers)
        fields.arrays = arrays  # kept alive
        work = len(self.split.primal.nodes) + len(self.split.linear.nodes) * groups + len(take)
        return partial(self._short if work < LONG else self._long, ctypes.byref(fields))
