"""The function of an operation, from nodes or numbers to a node, with the signature and the help that its row gives."""

from __future__ import annotations

import inspect
from collections.abc import Callable

from ..core.node import Node, Scalar, apply, constant
from ..util.caches import kept_by_first
from .operation import OPS, Op

Function = Callable[..., Node]

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
                if not isinstance(value, Node):
                    _require_constant(f"{name} of {op.name}", value)
            raise

    make.__name__ = make.__qualname__ = op.name
    make.__doc__ = _help(op)
    make.__signature__ = signature  # type: ignore[attr-defined]
    return make


def _require_constant(what: str, value: float) -> None:
    try:
        constant(value)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{what}: {error}") from None


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
