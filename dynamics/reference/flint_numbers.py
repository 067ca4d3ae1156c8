"""Numbers of any precision: python-flint's, the value of every operation on them, and their decimal text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from cgraph.extend import install

Number = Any  # flint.arb: a midpoint of the working precision with a bound on its rounding error

BITS_PER_DIGIT = math.log2(10.0)


def flint() -> Any:
    """The package. Raises ImportError that names the extra."""
    try:
        import flint
    except ImportError:
        raise ImportError(f"reference solutions need python-flint: {install('reference')}") from None
    return flint


@contextmanager
def working(digits: int) -> Iterator[Callable[[Any], Number]]:
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


def _pow(a: Number, b: Number) -> Number:
    whole = b.unique_fmpz() if b.is_exact() else None
    return a ** (b if whole is None else int(whole))


def _hypot(a: Number, b: Number) -> Number:
    return (a * a + b * b).sqrt()


# fmt: off   (a table is read by columns)
VALUES: dict[str, Callable[..., Number]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "pow": _pow,
    "sqrt": lambda a: a.sqrt(),
    "exp": lambda a: a.exp(),
    "expm1": lambda a: a.expm1(),
    "log": lambda a: a.log(),
    "log1p": lambda a: a.log1p(),
    "sin": lambda a: a.sin(),
    "cos": lambda a: a.cos(),
    "tan": lambda a: a.tan(),
    "asin": lambda a: a.asin(),
    "acos": lambda a: a.acos(),
    "atan": lambda a: a.atan(),
    "atan2": lambda a, b: type(a).atan2(a, b),
    "hypot": _hypot,
    "sinh": lambda a: a.sinh(),
    "cosh": lambda a: a.cosh(),
    "tanh": lambda a: a.tanh(),
    "abs": lambda a: -a if sign(a) < 0 else a,
    "sign": lambda a: 0 * a + sign(a),
    "minimum": lambda a, b: a if sign(a - b) <= 0 else b,
    "maximum": lambda a, b: a if sign(a - b) >= 0 else b,
    "less": lambda a, b: 0 * a + (sign(a - b) < 0),
    "less_equal": lambda a, b: 0 * a + (sign(a - b) <= 0),
    "equal": lambda a, b: 0 * a + (sign(a - b) == 0),
    "not_equal": lambda a, b: 0 * a + (sign(a - b) != 0),
    "where": lambda c, a, b: a if sign(c) else b,
    "strong_mul": lambda a, b: a * b if sign(a) and sign(b) else 0 * (a if sign(a) == 0 else b),
}
# fmt: on
