"""Op: one row of the operation table, all that any part of the library knows of an operation; and its function."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..core.node import CONSTANT, VARIABLE, Node, Scalar, apply, named_node
from ..core.row import BY_UFUNC, ROWS, Row
from ..util.caches import kept_by_first
from .values import ieee

Interval = tuple[float, float]
Function = Callable[..., Node]

# How strongly a text binds: in parentheses goes what binds less than its place asks for.
RELATION, SUM, PRODUCT, FUNCTION, LEAF = range(5)
LIBRARY = 2.0  # units of rounding: libraries promise an ulp or so
_IN_BROWSER = "Math.{} ?? (() => NaN)"
_HELP = """\
{about}

Parameters
----------
{parameters} : Node or float
    Nodes, or numbers, which become constants.

Returns
-------
Node
    The node {name}({parameters}). Where the operation has no value, that of the node is NaN or infinite.

Raises
------
TypeError
    When an argument is neither a node nor a real number.
ValueError
    When an argument is NaN.

Examples
--------
>>> import cgraph as cg
>>> inputs = cg.variables("{names}")
>>> graph = cg.Graph(inputs, {{"result": cg.{name}(*inputs)}})
>>> round(graph.evaluate({values})["result"], 6)
{result!r}
"""


class MathML(NamedTuple):
    """An operation in presentation MathML, with {0}, {1}, .. where the arguments go.

    least: of each argument, how strongly it must bind to go without parentheses: 0 a relation, 1 a sum, 2 a product, 3
    a function, 4 a name or a number.  binding: how strongly the whole binds.

    >>> from cgraph.extend import MathML
    >>> MathML("<msqrt>{0}</msqrt>", (0,), 3).text.format("<mi>x</mi>")
    '<msqrt><mi>x</mi></msqrt>'
    """

    text: str
    least: tuple[int, ...]
    binding: int


@dataclass(frozen=True, eq=False, repr=False)
class Op(Row):
    """One row of the operation table: all that any part of the library knows of an operation.

    Six columns are needed; every other has a default that works, stated here. In the library the rows are in
    `cgraph/operations/table.py`; `register` adds one in a program of your own.

    Parameters
    ----------
    name : str
        An identifier; `cg.name` makes the node.
    arity : int
        Number of arguments.
    scalar : callable
        Value on floats. A function of `math` may raise: `array`'s NaN or infinity then is the value.
    array : callable
        Value on arrays that broadcast.
    partials : callable
        Of the output's node and the arguments': the partial derivative in each argument, a node or a number.
    samples : tuple of tuples of float
        Points inside the domain, away from kinks, for tests and for the help, which shows the first.
    arguments : str
        Names of the parameters, with spaces. Default "x", or "a b", or "a b c".
    about : str
        A sentence for the help. Default: which node is made.
    ufunc : numpy.ufunc or str
        What makes the node when called on nodes, or its name, if its package need not be there. Default `array`, where
        it is a ufunc.
    symbol : str
        In drawings. Default the name.
    infix : (str, int)
        In explanations, between two arguments, and how strongly it binds. Default name(a, b).
    mathml : MathML
        In the formulas of pages. Default name(a, b).
    commutative : bool
        Whether f(a, b) is f(b, a), and nodes of both are shared. Default False.
    selects : bool
        Whether an unused argument must not reach the result, not even as NaN. Default False.
    signs : tuple of int
        Of a sum, the sign of each argument. Default: no sum.
    fold : callable
        Of the arguments' nodes: the simpler node that stands for the operation on them, or None. Default none.
    domain : tuple of (float, float)
        For each argument an interval well inside, from which tests draw. Default half to 3/2 times the samples.
    interval : callable
        Of the arguments' bounds: bounds of the value. Default unbounded.
    interval_of_same : callable
        Of the bounds of the one node that both arguments are. Default as if they were two.
    singular : callable
        Of the arguments' bounds: where among them the slope is unbounded, in words, or None. Default None, but where
        there is no `interval` either, that no bounds are known.
    quotient : callable
        Of the output's node and the arguments': a divisor, and the partials times it, all finite and the divisor not 0
        where the value is finite; or None. By it the slopes need no guard against 0 times infinity. Default none.
    rounding : float
        Units of rounding, 2**-53, of its own result. Default two, as for a function of the C library.
    python, numpy : str
        Text over floats and over arrays, with {} or {0}, {1} for arguments. Default name(..), with `scalar` and `array`
        behind the name; of a ufunc np.ufunc(..).
    library : str
        Its function in the C library. Default of that name.
    llvm : tuple of str
        LLVM instructions, see `op_texts`. Default the call, in vectors lane by lane; where the C
        library has no such function, `cg.compile` falls back to generated Python.
    vector : str
        The polynomial of `codegen.vector_math` that serves vectors. Default none.
    c, c_helper : str
        C expression with {0}, {1} for arguments, and a C function that it calls, with {name} for the name of the one
        being written. Default the call of the library's function, and none.
    javascript : str
        A function. Default Math.name. Where a browser has none the inspector shows no number, and `cg.to_js`, by which
        live pages and lessons compute, raises ValueError.
    operator : callable
        Of numbers and expressions of any kind, made by their operators. Default none.
    precise : callable
        Of mpmath's numbers. Default `operator`, `piece`, mpmath's function of that name, else an error that says
        what is missing.
    piece : callable
        Of a piecewise operation: of the sign of the first argument, or of the difference of two, which argument (None:
        the number 1) times which factor is the value. Default: smooth.
    jumps : callable
        Of an operation that jumps: of the arguments as numbers, what is whole where it does. Default: it does not.
    series : callable
        Of the orders of a series, the output's node and the arguments': Taylor coefficient k, see
        `cgraph/operations/series.py`. Default by `signs`, by `piece`, else through the partials.

    Examples
    --------
    >>> import math, numpy as np
    >>> from cgraph.extend import Op
    >>> from cgraph import hypot
    >>> row = Op("asinh", 1, math.asinh, np.arcsinh, lambda y, x: (1.0 / hypot(1.0, x),), samples=((0.6,),))
    >>> row.numpy, row.c, row.rounding
    ('np.arcsinh({0})', 'asinh({0})', 2.0)
    """

    # its function and texts
    arguments: str = ""
    about: str = ""
    ufunc: np.ufunc | str | None = None
    symbol: str = ""
    infix: tuple[str, int] | None = None
    mathml: MathML | None = None
    # algebra
    signs: tuple[int, ...] = ()
    # bounds and errors
    domain: tuple[Interval, ...] = ()
    interval: Callable[..., Interval] | None = None
    interval_of_same: Callable[[Interval], Interval] | None = None
    rounding: float = LIBRARY
    # code
    python: str = ""
    numpy: str = ""
    library: str = ""
    llvm: tuple[str, ...] = ()
    vector: str = ""
    c: str = ""
    c_helper: str = ""
    javascript: str = ""
    # values in other numbers than floats
    operator: Callable[..., object] | None = None
    precise: Callable[..., object] | None = None
    piece: Callable[[int], tuple[int | None, int]] | None = None
    jumps: Callable[..., Any] | None = None
    series: Callable[..., Any] | None = None

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
            "javascript": _IN_BROWSER.format(self.name),
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
    def own_javascript(self) -> str:
        """The column `javascript` where it is given."""
        return "" if self.javascript == _IN_BROWSER.format(self.name) else self.javascript

    @cached_property
    def calls_library(self) -> bool:
        """Whether machine code calls a function of the C library for the operation."""
        return not self.llvm or any(["{call}" in line for line in self.llvm])

    @property
    def raising(self) -> Callable[..., float]:
        """Value on floats, which may raise outside the domain where it is quicker so."""
        function: Callable[..., float] = getattr(self.scalar, "__wrapped__", self.scalar)
        return function


OPS: dict[str, Op] = {}  # the table; filled by table.py
_LEAVES = {row.name: Op(row.name, 0, row.scalar, row.array, row.partials) for row in (VARIABLE, CONSTANT)}


def columns(row: Row) -> Op:
    """All columns of a node's operation, its `op`; those of a leaf are empty."""
    return row if isinstance(row, Op) else _LEAVES[row.name]


def enter(op: Op) -> None:
    """Put a row into the table as it is, in place of one of its name."""
    before = columns(ROWS[op.name]) if op.name in ROWS else None
    if before is not None and BY_UFUNC.get(before.ufunc or "") is before:
        del BY_UFUNC[before.ufunc or ""]
    OPS[op.name] = ROWS[op.name] = op
    if (ufunc := op.ufunc) is not None:
        BY_UFUNC[ufunc] = op
        if isinstance(ufunc, np.ufunc) and not hasattr(Node, ufunc.__name__):
            # The method that NumPy asks of the elements of an array of objects, as in `np.sqrt(array)`.
            setattr(Node, ufunc.__name__, lambda *nodes: apply(BY_UFUNC[ufunc], *nodes))


def function(op: Op) -> Function:
    """The function that makes nodes of an operation."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    signature = inspect.Signature([inspect.Parameter(name, kind) for name in op.parameters])

    def make(*args: Scalar, **named: Scalar) -> Node:
        if named:
            try:
                args = signature.bind(*args, **named).args
            except TypeError as error:
                raise TypeError(f"{op.name}{signature}: {error}") from None
        try:
            return apply(op, *args)
        except (TypeError, ValueError):
            for name, value in zip(op.parameters, args, strict=False):
                named_node(f"{name} of {op.name}", value)
            raise

    make.__name__ = make.__qualname__ = op.name
    make.__doc__ = _help(op)
    make.__signature__ = signature  # type: ignore[attr-defined]
    return make


def of_name(name: str) -> Function:
    """The function of the row of that name: `cg.asinh` of a row "asinh" that was added to the table."""
    if name not in OPS:
        raise AttributeError(f"module 'cgraph' has no attribute {name!r}")
    return _of_row(OPS[name])


_of_row = kept_by_first(function)


def _help(op: Op) -> str:
    if not op.samples:
        return op.about
    sample = op.samples[0]
    return _HELP.format(
        about=op.about,
        parameters=", ".join(op.parameters),
        name=op.name,
        names=" ".join(op.parameters),
        values="{" + ", ".join(f'"{name}": {x}' for name, x in zip(op.parameters, sample, strict=True)) + "}",
        result=round(op.scalar(*sample), 6),
    )
