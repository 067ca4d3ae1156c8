"""Entries of C: machine code of a graph as functions of the kinds that other software calls by their address."""

import ctypes
from typing import Any, NamedTuple

from . import llvm_engine as llvm

_NUMBERS = ctypes.POINTER(ctypes.c_double)
FUNCTION = ctypes.CFUNCTYPE(None, _NUMBERS, _NUMBERS)
INTEGRAND = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int, _NUMBERS)

# The code of a point takes a third address, of a memory that a graph alone does not use.
_TEXT = """\
define void @function(ptr %x, ptr %y) nounwind {{
  call void inttoptr (i64 {point} to ptr)(ptr %x, ptr %y, ptr null)
  ret void
}}

define double @integrand(i32 %n, ptr %x) nounwind {{
  %y = alloca [{n_out} x double]
  %fits = icmp eq i32 %n, {n_in}
  br i1 %fits, label %call, label %wrong
call:
  call void inttoptr (i64 {point} to ptr)(ptr %x, ptr %y, ptr null)
  %value = load double, ptr %y
  ret double %value
wrong:
  ret double 0x7FF8000000000000
}}
"""


class CEntry(NamedTuple):
    """Two functions of ctypes, which keep the machine code alive.

    function: `void (const double *x, double *y)`.  integrand: `double (int n, double *x)`, the first output, and NaN
    where n is not the number of inputs.
    """

    function: Any
    integrand: Any


def c_entry(point: Any, n_in: int, n_out: int) -> CEntry:
    """The functions that call `point`, machine code of a graph alone, see `llvm_ir.scalar_ir`."""
    address = ctypes.cast(point, ctypes.c_void_p).value
    code = llvm.host().compile(_TEXT.format(point=address, n_in=n_in, n_out=n_out), (), 0)
    entry = CEntry(code.function("function", FUNCTION), code.function("integrand", INTEGRAND))
    for function in entry:
        function.point = point
    return entry
