"""A sweep as machine code: directions in the lanes of vectors, groups of them in a loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices
from ..core.evaluate import Array
from .derivative_ir import FIELDS, sweep_ir
from .disk_cache import Cache
from .llvm_engine import Host
from .llvm_ir import libm_functions
from .sweep import NO_ENTRIES, Sweep

_SHORT = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)  # too short a call to give the interpreter away for
_LONG = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
LONG = 2**16  # instructions


class _Fields(ctypes.Structure):
    """What the one argument of the machine code points to."""

    _fields_: ClassVar = [(name, ctypes.c_int64) for name in FIELDS]
    arrays: dict[str, Any]


class NativeSweep(Sweep):
    """Machine code through LLVM. flags: of the arithmetic.  cache: where machine code is kept."""

    def __init__(self, split: DirectionSplit, host: Host, flags: str, cache: Cache | None) -> None:
        super().__init__(split, host.lanes)
        self.source = sweep_ir(split, host.lanes, flags)
        code = host.compile(self.source, libm_functions(split.primal), cache)
        self._short, self._long = code.function("sweep", _SHORT), code.function("sweep", _LONG)

    def bind(
        self, x: Array, s: Array, y: Array, take: Indices = NO_ENTRIES, put: Indices = NO_ENTRIES, values: Any = None
    ) -> Callable[[], None]:
        """As `Sweep.bind` says."""
        groups, p = len(s), np.empty(len(self.split.primal.outputs))
        arrays = {"x": x, "p": p, "s": s, "y": y, "take": take, "put": put, "values": y if values is None else values}
        counts = {"groups": groups, "entries": len(take)}
        numbers = [arrays[name].ctypes.data if name in arrays else counts[name] for name in FIELDS]
        fields = _Fields(*numbers)
        fields.arrays = arrays  # kept alive
        work = len(self.split.primal.nodes) + len(self.split.linear.nodes) * groups + len(take)
        return partial(self._short if work < LONG else self._long, ctypes.byref(fields))
