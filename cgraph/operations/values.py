"""Value of operations on floats and on arrays, where Python's or NumPy's own are not IEEE's."""

import math
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np

from ..core.evaluation import Array, Value

Factor = TypeVar("Factor")


def ieee(function: Callable[..., float], ufunc: Callable[..., Value]) -> Callable[..., float]:
    """`function` of the math module, with NumPy's IEEE result (NaN, infinity) where it would raise."""

    @wraps(function)
    def value(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError, ZeroDivisionError):
            with np.errstate(all="ignore"):
                return float(ufunc(*args))

    return value


def flag(ufunc: np.ufunc) -> Callable[..., object]:
    """A comparison of arrays as 1.0 and 0.0."""
    return lambda a, b: ufunc(a, b) * 1.0


def power_arrays(a: Value, b: Value) -> Value:
    """a ** b, one rule for every exponent."""
    # With one exponent for all, np.power(a, 0.5) would be a square root: -0.0 at -0.0 and NaN at -inf.
    base, exponent = np.broadcast_arrays(a, b)
    powers: Array = np.power(base, exponent.copy())
    return powers


def hypot(a: float, b: float) -> float:
    """The C library's, as in NumPy and in machine code; Python's own differs from it in the last bit."""
    with np.errstate(all="ignore"):
        return float(np.hypot(a, b))


def by_element(function: Callable[..., float]) -> Callable[..., Value]:
    """A function of floats, on arrays that broadcast, one element after another."""
    return lambda *args: np.asarray(np.frompyfunc(function, len(args), 1)(*args), dtype=np.float64)


def whole_power(base: Factor, exponent: int, times: Callable[[Factor, Factor], Factor]) -> Factor:
    """base ** exponent of anything that can be multiplied, by squares, for an exponent from 1."""
    result: Factor | None = None
    while True:
        if exponent % 2:
            result = base if result is None else times(result, base)
        exponent //= 2
        if not exponent:
            assert result is not None
            return result
        base = times(base, base)


# From here on a double has no digits behind the point; infinities and NaN are beyond, too.
_WHOLE = 2.0**52


def floor(a: float) -> float:
    """The largest whole number that is not above a."""
    return a // 1.0 if abs(a) < _WHOLE else a


def ceil(a: float) -> float:
    """The smallest whole number that is not below a."""
    return -(-a // 1.0) if abs(a) < _WHOLE else a


def round(a: float) -> float:
    """The whole number next to a, of two the even one: adding 2**52 rounds so."""
    return math.copysign((abs(a) + _WHOLE) - _WHOLE, a) if abs(a) < _WHOLE else a


def logistic(a: float) -> float:
    """1 / (1 + exp(-a))."""
    e = math.exp(-abs(a))
    return (e if a < 0.0 else 1.0) / (1.0 + e)


def logistic_arrays(a: Value) -> Value:
    """1 / (1 + exp(-a))."""
    e = np.exp(-np.abs(a))
    return np.where(a < 0.0, e, 1.0) / (1.0 + e)


def precise_cbrt(a: Value) -> Value:
    """The real cube root of a multiprecision number."""
    third = type(a)(1) / 3
    return -((-a) ** third) if a < 0 else a**third if a > 0 else a
