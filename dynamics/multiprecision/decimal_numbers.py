"""Numbers of any precision: Python's decimal numbers, and the functions of them that mpmath has."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from contextlib import AbstractContextManager
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from functools import partial
from typing import TYPE_CHECKING, Any

from cgraph._shared import install
from cgraph.extend import Op

if TYPE_CHECKING:
    from mpmath.ctx_mp import MPContext

GUARD = 5  # digits more in mpmath
ARITHMETIC = (operator.add, operator.sub, operator.mul, operator.truediv, operator.neg)
NAN = Decimal("nan")


def working(digits: int) -> AbstractContextManager[Context]:
    """Arithmetic of so many digits, of any exponent, in which 0 / 0 is NaN."""
    return localcontext(Context(digits, Emin=MIN_EMIN, Emax=MAX_EMAX, traps=[]))


def number(value: object) -> Decimal:
    """A float or text as a number of the working precision."""
    return +Decimal(value)  # type: ignore[arg-type]


def mpmath_context(digits: int) -> MPContext:
    """mpmath with so many digits. Raises ImportError that names the extra."""
    try:
        from mpmath import MPContext
    except ImportError:
        raise ImportError(f"reference solutions need mpmath: {install('reference')}") from None
    mp = MPContext()
    mp.dps, mp.trap_complex = digits + GUARD, True
    return mp


def log10_size(x: Decimal) -> float:
    """log10 |x| of any exponent; -inf at zero, NaN when x is not finite."""
    if not x.is_finite():
        return math.nan
    return x.adjusted() + math.log10(abs(float(x.scaleb(-x.adjusted())))) if x else -math.inf


def sign(x: Decimal) -> int:
    """-1, 0 or 1; 0 of NaN."""
    return int(x > 0) - int(x < 0)


def value(op: Op, mp: MPContext) -> Callable[..., Decimal]:
    """The operation on numbers: by its row of the operation table, else mpmath's function of that name.

    It is NaN outside its domain. Raises NotImplementedError when there is neither.
    """
    if op.operator is not None and op.operator in ARITHMETIC:
        arithmetic: Callable[..., Any] = op.operator
        return arithmetic
    if op.precise is None and op.piece is not None:
        return partial(_piece, op.piece)
    function = op.precise or op.operator or getattr(mp, op.name, None)
    if function is None:
        raise NotImplementedError(
            f"{op.name} has no multiprecision value: its row of the operation table needs the column `precise`, a "
            "function of mpmath's numbers, which has none of that name"
        )

    def by_mpmath(*args: Decimal) -> Decimal:
        try:
            return number(str(function(*[mp.mpf(str(arg) if arg.is_finite() else float(arg)) for arg in args])))
        except (ArithmeticError, ValueError):
            return NAN

    return by_mpmath


def _piece(piece: Callable[[int], tuple[int | None, int]], *args: Decimal) -> Decimal:
    slot, factor = piece(sign(args[0] - args[1] if len(args) == 2 else args[0]))
    return Decimal(factor) if slot is None else factor * args[slot]
