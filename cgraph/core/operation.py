"""Op: one row of the operation table, which holds all that any part of the library knows of an operation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .op_values import ieee

Interval = tuple[float, float]

# How strongly a text binds: in parentheses goes what binds less than its place asks for.
RELATION, SUM, PRODUCT, FUNCTION, LEAF = range(5)
LIBRARY = 2.0  # units of rounding: libraries promise an ulp or so


class MathML(NamedTuple):
    """An operation in presentation MathML.

    text: with {0}, {1}, .. where the arguments go.  least: of each argument, what it must bind with to go without
    parentheses.  binding: what the whole binds with.
    """

    text: str
    least: tuple[int, ...]
    binding: int


@dataclass(frozen=True, eq=False)
class Op:
    """One row of the operation table (`ops.py`): all that any part of the library knows of an operation.

    The first five columns and a sample are needed; every other has a default that works, stated beside it. Nodes, where
    a column makes some, are written with operators and the functions of `ops.py`.
    """

    name: str
    arity: int
    scalar: Callable[..., float]  # value on floats; functions of `math` give `array`'s IEEE results where they raise
    array: Callable[..., Any]  # value on arrays
    partials: Callable[..., tuple[Any, ...]]  # of (output, *arguments): a node or number for each argument
    samples: tuple[tuple[float, ...], ...] = ()  # points inside the domain, away from kinks; the help shows the first

    # Its function `cg.name`, and texts.
    arguments: str = ""  # parameter names; default x, or a b, or a b c
    about: str = ""  # a sentence for the help; default says which node is made
    ufunc: Any = None  # of NumPy, makes the node of nodes, as np.sin(x) does; default `array` where it is one
    symbol: str = ""  # in drawings; default the name
    infix: tuple[str, int] | None = None  # in explanations, and how strongly it binds; default name(a, b)
    mathml: MathML | None = None  # in formulas of pages; default name(a, b)

    # What algebra knows.
    commutative: bool = False
    selects: bool = False  # an unused argument must not reach the result, not even as NaN
    signs: tuple[int, ...] = ()  # of a sum: the sign of each argument; default: no sum
    fold: Callable[..., Any] | None = None  # of arguments: the simpler node that stands for it, or None; default none
    double_double: Callable[..., Any] | None = None  # on pairs; default: float64's, low parts through the partials

    # What errors and bounds know.
    domain: tuple[Interval, ...] = ()  # an interval an argument, well inside; default half to 3/2 times the samples
    interval: Callable[..., Interval] | None = None  # bounds of the value from the arguments'; default unbounded
    interval_of_same: Callable[[Interval], Interval] | None = None  # if both are one node; default as if they were two
    # Where the slope is unbounded, in words; default nowhere, and without an interval that no bounds are known.
    singular: Callable[..., str | None] | None = None
    rounding: float = LIBRARY  # units of rounding, 2**-53, of its own result; default two, as for a library function

    # Code.
    python: str = ""  # over floats; default name(..), with `scalar` behind it
    numpy: str = ""  # over arrays; default np.ufunc(..), or name(..) with `array` behind it
    library: str = ""  # its function in the C library; default of that name
    llvm: tuple[str, ...] = ()  # instructions in place of a call; default the call, in vectors lane by lane
    vector: str = ""  # which polynomial of `codegen.vector_math` serves vectors; default none
    c: str = ""  # C expression; default the call
    c_helper: str = ""  # a C function that `c` calls; {name} is the function being written; default none
    javascript: str = ""  # a function; default Math.name, and NaN where a browser has none

    # Values in other numbers than floats.
    operator: Callable[..., Any] | None = None  # of any numbers and expressions, by their operators; default none
    # Of multiprecision numbers; default `operator`, `piece`, the numbers' method of that name, else a sentence.
    precise: Callable[..., Any] | None = None
    # Piecewise: of the sign of the first argument, or of the difference of two, which argument (None: 1) times which
    # factor is the value; default smooth.
    piece: Callable[[int], tuple[int | None, int]] | None = None
    series: Callable[..., Any] | None = None  # Taylor coefficient k of (k, y, *arguments); default through the partials
    rewrite: Callable[..., Any] | None = None  # the same by other operations, for their series; default none

    def __post_init__(self) -> None:
        if self.arity == 0:  # variable and constant have no texts
            return
        call = f"({', '.join(f'{{{slot}}}' for slot in range(self.arity))})"
        ufunc = self.array if isinstance(self.array, np.ufunc) else None
        in_numpy = ufunc is not None and getattr(np, ufunc.__name__, None) is ufunc
        library = self.library or self.name
        filled = {
            "arguments": "x" if self.arity == 1 else " ".join("abcdefgh"[: self.arity]),
            "about": f"The node {self.name}({', '.join(self.parameters or 'x')}).",
            "symbol": self.name,
            "domain": self._around_samples(),
            "python": f"{self.name}{call}",
            "ufunc": ufunc,
            "numpy": f"np.{self.array.__name__}{call}" if in_numpy else f"{self.name}{call}",
            "library": library,
            "c": f"{library}{call}",
            "javascript": f"Math.{self.name} ?? (() => NaN)",
        }
        for column, default in filled.items():
            if not getattr(self, column):
                object.__setattr__(self, column, default)
        if getattr(self.scalar, "__module__", None) == math.__name__ and not hasattr(self.scalar, "__wrapped__"):
            object.__setattr__(self, "scalar", ieee(self.scalar, self.array))

    def _around_samples(self) -> tuple[Interval, ...]:
        ends = [[c * x for x in column for c in (0.5, 1.5)] for column in zip(*self.samples, strict=True)]
        return tuple([(min(each), max(each)) for each in ends])

    @property
    def parameters(self) -> list[str]:
        """Names of the arguments."""
        return self.arguments.split()

    @property
    def raising(self) -> Callable[..., float]:
        """Value on floats, which may raise outside the domain where it is quicker so."""
        function: Callable[..., float] = getattr(self.scalar, "__wrapped__", self.scalar)
        return function

    def __repr__(self) -> str:
        return f"<op {self.name}>"
