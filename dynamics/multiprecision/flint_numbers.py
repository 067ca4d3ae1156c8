"""Numbers of any precision: python-flint's, the value of operations on them, and their decimal text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, TypeAlias

from cgraph._shared import install
from cgraph.extend import Op

if TYPE_CHECKING:
    from flint import arb

Number: TypeAlias = "arb"  # a midpoint of the working precision with a bound on its rounding error

BITS_PER_DIGIT = math.log2(10.0)


def flint() -> ModuleType:
    """The package. Raises ImportError that names the extra."""
    try:
        import flint
    except ImportError:
        raise ImportError(f"reference solutions need python-flint: {install('reference')}") from None
    found: ModuleType = flint  # it has no types
    return found


@contextmanager
def working(digits: int) -> Iterator[Callable[[object], Number]]:
    """Arithmetic with so many decimal digits; gives the constructor of numbers."""
    package = flint()
    with package.ctx.workprec(math.ceil(digits * BITS_PER_DIGIT) + 8):
        yield package.arb


def text(x: Number, digits: int) -> str:
    """The midpoint in decimal, so many digits."""
    written: str = x.mid().str(digits, radius=False, more=True)
    return written


def log2_size(x: Number) -> float:
    """About log2 |x|, for any exponent; -inf at zero, NaN when x is not finite."""
    mid = x.mid()
    if not x.is_finite():
        return math.nan
    if mid == 0:
        return -math.inf
    mantissa, exponent = mid.man_exp()
    return math.log2(abs(int(mantissa))) + int(exponent)


def sign(x: Number) -> int:
    """-1, 0 or 1, of the midpoint."""
    mid = x.mid()
    return int(mid > 0) - int(mid < 0)


def value(op: Op) -> Callable[..., Number]:
    """The operation on numbers: by its row of the operation table, else the numbers' method of that name.

    Raises NotImplementedError when there is neither.
    """
    function = op.precise or op.operator
    if function is not None:
        return function
    if op.piece is not None:
        return partial(_piece, op.piece)
    method: Callable[..., Number] | None = getattr(flint().arb, op.name, None)
    if method is None:
        raise NotImplementedError(
            f"{op.name} has no multiprecision value: its row of the operation table needs the column `precise`, a "
            f"function of python-flint's numbers, which have no method of that name"
        )
    return method


def _piece(piece: Callable[[int], tuple[int | None, int]], *args: Number) -> Number:
    slot, factor = piece(sign(args[0] - args[1] if len(args) == 2 else args[0]))
    return 0 * args[0] + factor if slot is None else factor * args[slot]
