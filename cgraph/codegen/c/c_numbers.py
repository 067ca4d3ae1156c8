"""Numbers of a C program, double or float: their texts, and the texts of operations on them."""

import math
import re
from dataclasses import dataclass

import numpy as np

from ...core.row import Row
from ...operations.operation import columns

_MATH = frozenset(  # functions of real numbers in <math.h> of C99
    """acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma
    fmax fmin fmod hypot ldexp lgamma log log10 log1p log2 logb nan nearbyint nextafter pow remainder rint round scalbn
    sin sinh sqrt tan tanh tgamma trunc""".split()
)
_CALL = re.compile(r"(?<![\w}])([A-Za-z_]\w*)(?=\()")
_LITERAL = re.compile(
    r"(?<![\w.])(?:0[xX][0-9a-fA-F.]+[pP][+-]?\d+|(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?![\w.])"
)


@dataclass(frozen=True)
class CNumbers:
    """The numbers that a C program computes with: `double`, or `float` with functions and constants of its own."""

    type: str  # the word for them in C
    dtype: str  # the name of NumPy for them
    unit: float  # the largest relative error of a rounding

    def stored(self, value: float) -> float:
        """The number as the program has it; a constant too small to be there is the smallest normal one, not 0.

        Raises ValueError for a number that is too large.
        """
        if self.type == "double" or not math.isfinite(value):
            return value
        with np.errstate(over="ignore", under="ignore"):
            near = float(np.float32(value))
        if math.isinf(near):
            raise ValueError(f"the constant {value!r} is beyond float32, whose largest number is 3.4e38")
        return near if near or not value else math.copysign(float(np.finfo(np.float32).tiny), value)

    def text(self, value: float) -> str:
        """The number, exactly; in parentheses if it has a sign."""
        size = abs(self.stored(value))
        suffix = "f" * (self.type == "float")
        if math.isnan(value):
            text = f"({self.type})NAN"
        elif math.isinf(value):
            text = f"({self.type})INFINITY"
        elif size < 1e6 and size.is_integer():
            text = f"{size}{suffix}"
        else:
            text = f"{re.sub('[.]?0*p', 'p', size.hex())}{suffix} /* {abs(value)!r} */"
        return text if math.copysign(1.0, value) > 0 else f"(-{text})"

    def operation(self, op: Row) -> str:
        """C expression of the operation, with {0}, {1} for arguments. Raises ValueError where there is none."""
        row = columns(op)
        call = re.fullmatch(r"(\w+)\([^()]*\)", row.c)
        if call and call[1] == row.library and row.library not in _MATH and not row.c_helper:
            raise ValueError(
                f"operation {row.name!r} has no text in C, and <math.h> has no function {row.library}: "
                "its row needs the column `c`, with `c_helper` for a function that it calls"
            )
        return self.adapted(row.c)

    def adapted(self, text: str) -> str:
        """A text of doubles in these numbers."""
        if self.type == "double":
            return text
        text = _CALL.sub(lambda found: found[1] + "f" * (found[1] in _MATH), text)
        return _LITERAL.sub(lambda found: f"{found[0]}f", re.sub(r"\bdouble\b", self.type, text))


NUMBERS = {"float64": CNumbers("double", "float64", 2.0**-53), "float32": CNumbers("float", "float32", 2.0**-24)}
