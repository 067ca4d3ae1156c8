"""`register`: rows that programs add to the operation table, checked."""

from __future__ import annotations

import sys
from keyword import iskeyword

from ..core.node import Node, variable
from .operation import OPS, Op, enter

_GENERATED = ("float", "function", "inf", "np", "x")  # which mean something in generated Python
_LIBRARY = sys.modules[__name__.partition(".")[0]]  # `cg.name` of one of its names would not be the row's function


def register(op: Op) -> None:
    """Add a row to the operation table: from then on every part of the library knows the operation.

    `cg.name` is then the function that makes its nodes, and its `ufunc` makes them too. Raises TypeError for what is no
    Op, or has no function in its first columns, ValueError for a name, samples or partials that do not fit.

    >>> from cgraph.extend import OPS, register
    >>> register(OPS["sin"])
    Traceback (most recent call last):
    ValueError: operation 'sin' is in the table already
    """
    if not isinstance(op, Op):
        raise TypeError(f"register takes an Op, got {type(op).__name__}: {op!r:.60}")
    if op.name in OPS:
        raise ValueError(f"operation {op.name!r} is in the table already")
    if not op.name.isidentifier() or iskeyword(op.name):
        raise ValueError(f"an operation's name must be an identifier of Python, got {op.name!r}")
    if op.name in _GENERATED or op.name in dir(_LIBRARY):
        raise ValueError(f"an operation cannot be called {op.name!r}, which means something else in cgraph")
    for column in ("scalar", "array", "partials"):
        if not callable(getattr(op, column)):
            raise TypeError(f"operation {op.name!r}: {column} must be a function, got {getattr(op, column)!r:.60}")
    if len(op.parameters) != op.arity:
        raise ValueError(f"operation {op.name!r} takes {op.arity} argument(s), got the names {op.arguments!r}")
    if not op.samples or any([len(sample) != op.arity for sample in op.samples]):
        raise ValueError(f"operation {op.name!r} needs samples of {op.arity} number(s) each, got {op.samples!r}")
    OPS[op.name] = op  # partials may have nodes of the operation itself
    try:
        _check_partials(op)
    except BaseException:
        del OPS[op.name]
        raise
    enter(op)


def _check_partials(op: Op) -> None:
    """See that there is a partial for each argument."""
    args = tuple([variable(f"argument{slot}") for slot in range(op.arity)])
    partials = op.partials(Node(op, args), *args)
    if not isinstance(partials, tuple):
        raise TypeError(f"operation {op.name!r}: partials must give a tuple, got {partials!r:.60}")
    if len(partials) != op.arity:
        raise ValueError(f"operation {op.name!r} takes {op.arity} argument(s), its partials are {len(partials)}")
