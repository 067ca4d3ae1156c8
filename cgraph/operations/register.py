"""`register`: rows that programs add to the operation table, checked."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from keyword import iskeyword

import numpy as np

from ..core.graph import Graph
from ..core.node import Node, as_node, variable
from .operation import OPS, Op, enter
from .table import ROWS

_GENERATED = ("float", "function", "inf", "np", "x")  # which mean something in generated Python
_LIBRARY = sys.modules[__name__.partition(".")[0]]  # `cg.name` of one of its names would not be the row's function
_VALUES, _SLOPES = 1e-6, 1e-4  # relative: far above rounding, and the error of differences, and below a wrong formula
_LLVM = dict.fromkeys(("r", "t", "b", "f", "s", "zero", "one", "minus", "call"), "")  # words of `texts`
_STEP = 1e-3  # of differences, relative to the argument


def register(op: Op, *, replace: bool = False) -> None:
    """Add a row to the operation table: from then on every part of the library knows the operation.

    `cg.name` is then the function that makes its nodes, and its `ufunc` makes them too. The row is tried at its
    samples: `scalar` beside `array` and the texts `python` and `numpy`, `partials` beside differences of `scalar`; and
    `interval` at the samples, at the ends of `domain`, and between each two of these.

    Parameters
    ----------
    op : Op
        The row.
    replace : bool
        True puts it in the place of one of its name that `register` added before, as when a notebook's cell is run
        again. Nodes that were made by then keep the row that they were made with; a file that has them takes the new.

    Raises
    ------
    TypeError
        For what is no Op, or has no function in its first columns.
    ValueError
        For a name, samples, partials or texts that do not fit, for columns that disagree at a sample, and for an
        interval that does not hold a value.

    Examples
    --------
    >>> import math, numpy as np
    >>> import cgraph as cg
    >>> from cgraph.extend import OPS, Op, register
    >>> register(OPS["sin"])
    Traceback (most recent call last):
    ValueError: operation 'sin' is in the table already, as one of the library's
    >>> values = lambda x: 1.0 - math.cos(x), lambda x: 1.0 - np.cos(x)
    >>> register(Op("versin", 1, *values, lambda y, x: (cg.cos(x),), samples=((0.6,),)))
    Traceback (most recent call last):
    ValueError: operation 'versin': at x=0.6 its partial by x is 0.825336, where differences of scalar give 0.564642
    """
    if not isinstance(op, Op):
        raise TypeError(f"register takes an Op, got {type(op).__name__}: {op!r:.60}")
    before = OPS.get(op.name)
    if before in ROWS:
        raise ValueError(f"operation {op.name!r} is in the table already, as one of the library's")
    if before is not None and not replace:
        raise ValueError(f"operation {op.name!r} is in the table already; replace=True puts this row in its place")
    if not op.name.isidentifier() or iskeyword(op.name):
        raise ValueError(f"an operation's name must be an identifier of Python, got {op.name!r}")
    if op.name in _GENERATED or (before is None and op.name in dir(_LIBRARY)):
        raise ValueError(f"an operation cannot be called {op.name!r}, which means something else in cgraph")
    for column in ("scalar", "array", "partials"):
        if not callable(getattr(op, column)):
            raise TypeError(f"operation {op.name!r}: {column} must be a function, got {getattr(op, column)!r:.60}")
    if len(op.parameters) != op.arity:
        raise ValueError(f"operation {op.name!r} takes {op.arity} argument(s), got the names {op.arguments!r}")
    if not op.samples or any([len(sample) != op.arity for sample in op.samples]):
        raise ValueError(f"operation {op.name!r} needs samples of {op.arity} number(s) each, got {op.samples!r}")
    for line in op.llvm:
        _filled(op, "llvm", line, (), _LLVM)
    OPS[op.name] = op  # partials may have nodes of the operation itself
    try:
        forms = _slopes(op)
        for sample in op.samples:
            for partials in forms:
                _check_columns(op, partials, sample)
        _check_interval(op)
    except BaseException:
        if before is None:
            del OPS[op.name]
        else:
            OPS[op.name] = before
        raise
    enter(op)


def _slopes(op: Op) -> list[Graph]:
    """The partials, one for each argument, as a graph; and those by the column `quotient`, if it gives some."""
    args = tuple([variable(name) for name in op.parameters])
    y = Node(op, args)
    partials = op.partials(y, *args)
    if not isinstance(partials, tuple):
        raise TypeError(f"operation {op.name!r}: partials must give a tuple, got {partials!r:.60}")
    if len(partials) != op.arity:
        raise ValueError(f"operation {op.name!r} takes {op.arity} argument(s), its partials are {len(partials)}")
    forms = [partials]
    if op.quotient is not None and (form := op.quotient(y, *args)) is not None:
        forms.append(tuple([as_node(each) / form[0] for each in form[1]]))
    return [Graph(args, dict(zip(op.parameters, form, strict=True))) for form in forms]


def _check_columns(op: Op, partials: Graph, sample: tuple[float, ...]) -> None:
    """See that scalar, array and partials are of one function at a sample."""
    where = _where(op, sample)
    value = _scalar(op, sample)
    try:
        with np.errstate(all="ignore"):
            array = float(np.broadcast_to(op.array(*[np.array([x, x]) for x in sample]), 2)[1])
    except (TypeError, ValueError) as error:
        raise TypeError(f"operation {op.name!r}: array must take and give arrays: {error}") from error
    slopes = partials.evaluate(dict(zip(op.parameters, sample, strict=True)))
    sizes = [abs(value)]
    for slot, (name, slope) in enumerate(zip(op.parameters, map(float, slopes.values()), strict=True)):
        h = _STEP * (abs(sample[slot]) or 1.0)
        high, low, near, below = (
            _scalar(op, (*sample[:slot], sample[slot] + step, *sample[slot + 1 :]))
            for step in (h, -h, h / 2.0, -h / 2.0)
        )
        sizes += [abs(high), abs(low)]
        wide, narrow = (high - low) / (2.0 * h), (near - below) / h
        found = (4.0 * narrow - wide) / 3.0  # Richardson's extrapolation
        allowed = _SLOPES * max(abs(found), abs(slope)) + abs(narrow - wide) + 1e-9 * max(sizes) / h
        if math.isfinite(found) and not abs(found - slope) <= allowed:
            told = f"is {slope:.6g}, where differences of scalar give {found:.6g}"
            raise ValueError(f"{where} its partial by {name} {told}")
    points = [np.array([x, x]) for x in sample]
    values: dict[str, float | None] = {
        "array": array,
        "python": _text_value(op, "python", sample, {row.name: row.raising for row in OPS.values()}),
        "numpy": _text_value(op, "numpy", points, {row.name: row.array for row in OPS.values()}),
    }
    for column, other in values.items():
        if other is None or value == other or (value != value and other != other):
            continue
        if not abs(value - other) <= _VALUES * max(sizes):
            raise ValueError(f"{where} scalar is {value:.6g} and {column} {other:.6g}")


def _filled(op: Op, column: str, text: str, args: Sequence[str], words: Mapping[str, str]) -> str:
    """A column's text with arguments in their places."""
    try:
        return text.format(*(args or [f"a{slot}" for slot in range(op.arity)]), **words)
    except (LookupError, ValueError):
        places = ", ".join([f"{{{each}}}" for each in (*range(op.arity), *words)])
        raise ValueError(f"operation {op.name!r}: {column} has the places {places}, got {text!r:.80}") from None


def _text_value(op: Op, column: str, sample: Sequence[object], functions: Mapping[str, object]) -> float | None:
    """The value of a text of Python, None where floats have one node by node instead, as generated code then does."""
    args = {f"x{slot}": x for slot, x in enumerate(sample)}
    text = _filled(op, column, getattr(op, column), [*args], {})
    try:
        with np.errstate(all="ignore"):
            value = eval(text, {"np": np, "inf": math.inf, **functions, **args})  # noqa: S307 (the row's own text)
            return float(np.broadcast_to(value, 2)[1])
    except Exception as error:
        if column == "python" and isinstance(error, ValueError | OverflowError | ZeroDivisionError):
            return None
        told = f"{text!r:.60} raises {type(error).__name__}: {error}"
        raise ValueError(f"operation {op.name!r}: {column} must be an expression of Python: {told}") from error


def _check_interval(op: Op) -> None:
    """See that the interval of each point, and of the box around each two, holds the values at the points in it."""
    if op.interval is None:
        return
    points = dict.fromkeys([*op.samples, *zip(*op.domain, strict=True)])
    values = {point: _scalar(op, point) for point in points}
    for one, other in combinations_with_replacement(points, 2):
        box = [(min(ends), max(ends)) for ends in zip(one, other, strict=True)]
        given = ", ".join(
            [f"{name} in [{low:g}, {high:g}]" for name, (low, high) in zip(op.parameters, box, strict=True)]
        )
        try:
            low, high = map(float, op.interval(*box))
        except (TypeError, ValueError) as error:
            raise TypeError(f"operation {op.name!r}: interval must give two numbers for {given}: {error}") from error
        if not low <= high:
            raise ValueError(
                f"operation {op.name!r}: interval must give low <= high, got [{low:g}, {high:g}] for {given}"
            )
        for point, value in values.items():
            inside = all([a <= x <= b for x, (a, b) in zip(point, box, strict=True)])
            own = op.rounding * 2.0**-53 * abs(value)  # rounding of the value itself
            if inside and (value < low - own or value > high + own):
                told = f"for {given} the interval [{low:.6g}, {high:.6g}] does not hold it"
                raise ValueError(f"{_where(op, point)} scalar is {value:.6g}, and {told}")


def _where(op: Op, at: tuple[float, ...]) -> str:
    point = ", ".join([f"{x}={value:g}" for x, value in zip(op.parameters, at, strict=True)])
    return f"operation {op.name!r}: at {point}"


def _scalar(op: Op, at: tuple[float, ...]) -> float:
    """The value on floats, NaN where it raises."""
    try:
        return float(op.scalar(*at))
    except (ValueError, OverflowError, ZeroDivisionError):
        return math.nan
