"""Entries of machine code: calls on fixed arrays, which Python enters without converting anything, and functions of C.

A call through ctypes converts every argument every time, which takes longer than the equations of a small robot.
"""

import ctypes
import struct
import sys
from collections.abc import Callable
from functools import partial
from types import BuiltinFunctionType
from typing import Any, NamedTuple, NoReturn, SupportsIndex

from ..core.evaluation import Array
from ..util.caches import memo
from . import llvm_engine as llvm

SHORT = ctypes.PYFUNCTYPE(None, *[ctypes.c_void_p] * 3)  # too short a call to give the interpreter away for
LONG = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)
_NO_ARGUMENTS = 4  # METH_NOARGS of CPython's methodobject.h

# What CPython calls: `self` are bytes with the addresses of the function, its arguments and None
_ENTER = """\
define ptr @enter(ptr %self, ptr %none) nounwind {{
  %bytes = call ptr inttoptr (i64 {PyBytes_AsString} to ptr)(ptr %self)
  %x.at = getelementptr ptr, ptr %bytes, i64 1
  %y.at = getelementptr ptr, ptr %bytes, i64 2
  %memory.at = getelementptr ptr, ptr %bytes, i64 3
  %result.at = getelementptr ptr, ptr %bytes, i64 4
  %function = load ptr, ptr %bytes
  %x = load ptr, ptr %x.at
  %y = load ptr, ptr %y.at
  %memory = load ptr, ptr %memory.at
  %result = load ptr, ptr %result.at
  call void %function(ptr %x, ptr %y, ptr %memory)
  call void inttoptr (i64 {Py_IncRef} to ptr)(ptr %result)
  ret ptr %result
}}
"""

_NUMBERS = ctypes.POINTER(ctypes.c_double)
FUNCTION = ctypes.CFUNCTYPE(None, _NUMBERS, _NUMBERS)
INTEGRAND = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int, _NUMBERS)

# The code of a point takes a third address, of a memory that a graph alone does not use.
_C_ENTRY = """\
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


class _Method(ctypes.Structure):
    """PyMethodDef of CPython's methodobject.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("text", ctypes.c_char_p),
    )


class _Stays:
    """What is not to be copied."""

    def __reduce_ex__(self, protocol: SupportsIndex) -> NoReturn:
        raise TypeError("a bound call holds addresses of this process: pickle the compiled graph and bind it again")


class _Addresses(_Stays, bytes):
    """Needs of a call, `self` of its function: as addresses, and as objects that stay alive with it."""

    kept: tuple[object, ...]


class _Bound(_Stays, partial[None]):
    """A call of a function of Python."""


def bound(run: Callable[[], None]) -> Callable[[], None]:
    """The call, which says of itself that it stays in its process. What `bound_call` made does already."""
    return run if isinstance(run, BuiltinFunctionType) else _Bound(run)


def bound_call(entry: Any, x: Array, y: Array, memory: Array | None = None) -> Callable[[], None]:
    """A function of nothing that calls `entry`, of type SHORT or LONG, with the addresses of arrays."""
    arrays = x, y, y if memory is None else memory
    if not isinstance(entry, SHORT) or (made := _enter()) is None:
        return partial(entry, *[array.ctypes.data_as(ctypes.c_void_p) for array in arrays])
    new_function, method = made
    self = _Addresses(struct.pack("5P", _address(entry), *[array.ctypes.data for array in arrays], id(None)))
    self.kept = entry, arrays, method
    function: Callable[[], None] = new_function(ctypes.addressof(method), self, None)
    return function


@memo(1)
def _enter() -> tuple[Any, _Method] | None:
    """CPython's PyCFunction_NewEx, and the method that `_ENTER` is; None for another Python."""
    if sys.implementation.name != "cpython":
        return None
    try:
        names = ("PyBytes_AsString", "Py_IncRef", "PyCFunction_NewEx")
        addresses = {name: _address(getattr(ctypes.pythonapi, name)) for name in names}
    except AttributeError:  # a build that does not export them
        return None
    code = llvm.host().compile(_ENTER.format(**addresses), (), 0)
    method = _Method(b"bound", code.address("enter"), _NO_ARGUMENTS, None)
    method.code = code
    kind = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    return kind(addresses["PyCFunction_NewEx"]), method


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


class CEntry(NamedTuple):
    """Two functions of ctypes, which keep the machine code alive.

    function: `void (const double *x, double *y)`.  integrand: `double (int n, double *x)`, the first output, and NaN
    where n is not the number of inputs.
    """

    function: Any
    integrand: Any


def c_entry(point: Any, n_in: int, n_out: int) -> CEntry:
    """The functions that call `point`, machine code of a graph alone, see `llvm_ir.scalar_ir`."""
    code = llvm.host().compile(_C_ENTRY.format(point=_address(point), n_in=n_in, n_out=n_out), (), 0)
    entry = CEntry(code.function("function", FUNCTION), code.function("integrand", INTEGRAND))
    for function in entry:
        function.point = point
    return entry
