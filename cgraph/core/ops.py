"""The operation table: one row for each operation, read by evaluation, both AD modes, code generation and drawing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .node import (
    OPS as OPS,  # noqa: PLC0414 (who needs the table imports it from here, filled)
    Node,
    Op,
    Scalar,
    apply,
    register,
)


def _ieee(function: Callable[..., float], ufunc: Any) -> Callable[..., float]:
    """`function` of the math module, with NumPy's IEEE result (NaN, infinity) where it would raise."""

    def value(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError, ZeroDivisionError):
            with np.errstate(all="ignore"):
                return float(ufunc(*args))

    return value


def _flag(ufunc: Any) -> Callable[..., Any]:
    """A comparison of arrays as 1.0 and 0.0."""
    return lambda a, b: ufunc(a, b) * 1.0


def _strong_mul_arrays(a: Any, b: Any) -> Any:
    return np.where((a == 0) | (b == 0), 0.0, np.multiply(a, b))


def _power_arrays(a: Any, b: Any) -> Any:
    # With one exponent for all, np.power(a, 0.5) would be a square root: -0.0 at -0.0 and NaN at -inf.
    base, exponent = np.broadcast_arrays(a, b)
    return np.power(base, exponent.copy())


def _hypot(a: float, b: float) -> float:
    """The C library's, as in NumPy and in machine code; Python's own differs from it in the last bit."""
    with np.errstate(all="ignore"):
        return float(np.hypot(a, b))


def _sign(a: float) -> float:
    return a if a != a else float((a > 0) - (a < 0))


def _function(name: str, arity: int = 1) -> Callable[..., Node]:
    def function(*args: Scalar) -> Node:
        return apply(OPS[name], *args)

    function.__name__ = function.__qualname__ = name
    arguments = ", ".join(("c", "a", "b") if arity == 3 else ("a", "b")[:arity])
    function.__doc__ = f"The node {name}({arguments}); arguments are nodes or numbers. Operation table: `ops.py`."
    return function


sqrt, exp, expm1, log, log1p = map(_function, ("sqrt", "exp", "expm1", "log", "log1p"))
sin, cos, tan, asin, acos, atan = map(_function, ("sin", "cos", "tan", "asin", "acos", "atan"))
sinh, cosh, tanh, abs_, sign = map(_function, ("sinh", "cosh", "tanh", "abs", "sign"))
pow, atan2, hypot = (_function(name, 2) for name in ("pow", "atan2", "hypot"))
minimum, maximum, strong_mul = (_function(name, 2) for name in ("minimum", "maximum", "strong_mul"))
less, less_equal, equal, not_equal = (_function(name, 2) for name in ("less", "less_equal", "equal", "not_equal"))
where = _function("where", 3)


# Conventions where there is no derivative: abs'(0) = 0; a tie of minimum or maximum gives one half to each argument;
# sqrt'(0) = +inf, its limit; hypot'(0, 0) = 0; d(x**y)/dy at x = y = 0 is 0; atan2 at the origin is NaN.
def _pow_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    jump = equal(a, 0.0) * equal(b, 0.0)  # 0**b falls from 1 to 0 at b = 0
    return strong_mul(b, a ** (b - 1.0)), strong_mul(y - jump, log(a))


def _atan2_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    h = hypot(a, b)  # dividing twice by h neither overflows nor underflows where b / (a*a + b*b) would
    return b / h / h, -(a / h / h)


def _less_partials(y: Node, a: Node, b: Node, above: Node, below: Node) -> tuple[Node, Node]:
    return where(above, 1.0, where(below, 0.0, 0.5)), where(below, 1.0, where(above, 0.0, 0.5))


def _flat(y: Node, *args: Node) -> tuple[float, ...]:
    return (0.0,) * len(args)


# A table is read by columns, so the formatter leaves it alone.
# fmt: off
_ROWS = (
    #  name      arity  on floats                      on arrays      partials of (output y, arguments)                 as Python, as NumPy                          symbol  samples
    Op("add",      2, lambda a, b: a + b,              np.add,        lambda y, a, b: (1.0, 1.0),                       "{} + {}", "{} + {}",                       "+",    ((0.3, -0.7),), commutative=True),
    Op("sub",      2, lambda a, b: a - b,              np.subtract,   lambda y, a, b: (1.0, -1.0),                      "{} - {}", "{} - {}",                       "−",    ((0.3, -0.7),)),
    Op("mul",      2, lambda a, b: a * b,              np.multiply,   lambda y, a, b: (b, a),                           "{} * {}", "{} * {}",                       "×",    ((0.3, -0.7), (0.0, 2.0)), commutative=True),
    Op("div",      2, _ieee(lambda a, b: a / b, np.divide), np.divide, lambda y, a, b: (1.0 / b, -(y / b)),             "{} / {}", "{} / {}",                       "÷",    ((0.3, -0.7),)),
    Op("neg",      1, lambda a: -a,                    np.negative,   lambda y, a: (-1.0,),                             "-{}", "-{}",                               "−",    ((0.3,),)),
    Op("pow",      2, _ieee(math.pow, np.power),       _power_arrays,  _pow_partials,                                    "pow({}, {})", "power({}, {})",             "xʸ",   ((0.6, -0.7), (1.7, 2.5))),
    Op("sqrt",     1, _ieee(math.sqrt, np.sqrt),       np.sqrt,       lambda y, a: (0.5 / y,),                          "sqrt({})", "np.sqrt({})",                  "√",    ((0.6,),)),
    Op("exp",      1, _ieee(math.exp, np.exp),         np.exp,        lambda y, a: (y,),                                "exp({})", "np.exp({})",                    "exp",  ((0.3,),)),
    Op("expm1",    1, _ieee(math.expm1, np.expm1),     np.expm1,      lambda y, a: (exp(a),),                           "expm1({})", "np.expm1({})",                "expm1", ((0.3,),)),
    Op("log",      1, _ieee(math.log, np.log),         np.log,        lambda y, a: (1.0 / a,),                          "log({})", "np.log({})",                    "log",  ((0.6,),)),
    Op("log1p",    1, _ieee(math.log1p, np.log1p),     np.log1p,      lambda y, a: (1.0 / (1.0 + a),),                  "log1p({})", "np.log1p({})",                "log1p", ((0.3,),)),
    Op("sin",      1, _ieee(math.sin, np.sin),         np.sin,        lambda y, a: (cos(a),),                           "sin({})", "np.sin({})",                    "sin",  ((0.3,), (-2.0,))),
    Op("cos",      1, _ieee(math.cos, np.cos),         np.cos,        lambda y, a: (-sin(a),),                          "cos({})", "np.cos({})",                    "cos",  ((0.3,), (-2.0,))),
    Op("tan",      1, _ieee(math.tan, np.tan),         np.tan,        lambda y, a: (1.0 + y * y,),                      "tan({})", "np.tan({})",                    "tan",  ((0.3,),)),
    Op("asin",     1, _ieee(math.asin, np.arcsin),     np.arcsin,     lambda y, a: (1.0 / sqrt((1.0 - a) * (1.0 + a)),),  "asin({})", "np.arcsin({})",              "asin", ((0.3,),)),
    Op("acos",     1, _ieee(math.acos, np.arccos),     np.arccos,     lambda y, a: (-1.0 / sqrt((1.0 - a) * (1.0 + a)),), "acos({})", "np.arccos({})",              "acos", ((0.3,),)),
    Op("atan",     1, _ieee(math.atan, np.arctan),     np.arctan,     lambda y, a: (1.0 / (1.0 + a * a),),              "atan({})", "np.arctan({})",                "atan", ((0.3,),)),
    Op("atan2",    2, _ieee(math.atan2, np.arctan2),   np.arctan2,    _atan2_partials,                                  "atan2({}, {})", "np.arctan2({}, {})",      "atan2", ((0.3, -0.7), (-0.4, 0.2))),
    Op("hypot",    2, _hypot,                          np.hypot,      lambda y, a, b: (where(y, a / y, 0.0), where(y, b / y, 0.0)), "hypot({}, {})", "np.hypot({}, {})", "hypot", ((0.3, -0.7),), commutative=True),
    Op("sinh",     1, _ieee(math.sinh, np.sinh),       np.sinh,       lambda y, a: (cosh(a),),                          "sinh({})", "np.sinh({})",                  "sinh", ((0.3,),)),
    Op("cosh",     1, _ieee(math.cosh, np.cosh),       np.cosh,       lambda y, a: (sinh(a),),                          "cosh({})", "np.cosh({})",                  "cosh", ((0.3,),)),
    Op("tanh",     1, _ieee(math.tanh, np.tanh),       np.tanh,       lambda y, a: (1.0 / (cosh(a) * cosh(a)),),        "tanh({})", "np.tanh({})",                  "tanh", ((0.3,),)),
    Op("abs",      1, abs,                             np.absolute,   lambda y, a: (sign(a),),                          "abs({})", "np.absolute({})",               "|x|",  ((0.3,), (-0.7,))),
    Op("sign",     1, _sign,                           np.sign,       _flat,                                            "sign({})", "np.sign({})",                  "sign", ((0.3,), (-0.7,))),
    Op("minimum",  2, lambda a, b: a if a <= b or a != a else b, np.minimum, lambda y, a, b: _less_partials(y, a, b, a < b, b < a), "minimum({}, {})", "np.minimum({}, {})", "min", ((0.3, -0.7), (-0.7, 0.3)), commutative=True, selects=True),
    Op("maximum",  2, lambda a, b: a if a >= b or a != a else b, np.maximum, lambda y, a, b: _less_partials(y, a, b, b < a, a < b), "maximum({}, {})", "np.maximum({}, {})", "max", ((0.3, -0.7), (-0.7, 0.3)), commutative=True, selects=True),
    Op("less",     2, lambda a, b: float(a < b),       _flag(np.less), _flat,                                           "float({} < {})", "({} < {}) * 1.0",        "<",    ((0.3, -0.7), (-0.7, 0.3))),
    Op("less_equal", 2, lambda a, b: float(a <= b),    _flag(np.less_equal), _flat,                                     "float({} <= {})", "({} <= {}) * 1.0",      "≤",    ((0.3, -0.7), (-0.7, 0.3))),
    Op("equal",    2, lambda a, b: float(a == b),      _flag(np.equal), _flat,                                          "float({} == {})", "({} == {}) * 1.0",      "=",    ((0.3, -0.7),), commutative=True),
    Op("not_equal", 2, lambda a, b: float(a != b),     _flag(np.not_equal), _flat,                                      "float({} != {})", "({} != {}) * 1.0",      "≠",    ((0.3, -0.7),), commutative=True),
    Op("where",    3, lambda c, a, b: a if c != 0 else b, lambda c, a, b: np.where(c != 0, a, b), lambda y, c, a, b: (0.0, where(c, 1.0, 0.0), where(c, 0.0, 1.0)), "({1} if {0} else {2})", "np.where({0} != 0, {1}, {2})", "where", ((1.0, 0.3, -0.7), (0.0, 0.3, -0.7)), selects=True),
    # A product in which an exact zero wins over infinity and NaN: what the chain rule needs behind a branch not taken.
    Op("strong_mul", 2, lambda a, b: a * b if a and b else 0.0, _strong_mul_arrays, lambda y, a, b: (b, a),             "({0} * {1} if {0} and {1} else 0.0)", "np.where(({0} == 0) | ({1} == 0), 0.0, {0} * {1})", "⊗", ((0.3, -0.7), (2.0, 1.5)), commutative=True, selects=True),
)
# fmt: on

_UFUNCS = {"pow": np.power, "less": np.less, "less_equal": np.less_equal}  # where the row has a function of its own
for _row in _ROWS:
    register(_row, _UFUNCS.get(_row.name))
