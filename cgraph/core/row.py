"""The row of an operation: what a node, evaluation and both modes of differentiation know of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Row:
    """Row of an operation as the core reads it; `cgraph.operations` has the rows, with the columns of other parts.

    name, arity: an identifier, and the number of arguments.
    scalar, array: value on floats, and on arrays that broadcast.
    partials: of the output's node and the arguments': the partial derivative in each argument, a node or a number.
    samples: points inside the domain, away from kinks.
    commutative: whether f(a, b) is f(b, a).
    selects: whether an argument that is not used must not reach the result, not even as NaN.
    fold: of the arguments' nodes, the simpler node that stands for the operation on them, or None.
    singular: not None where the slope may be unbounded.
    """

    name: str
    arity: int
    scalar: Callable[..., float]
    array: Callable[..., Any]
    partials: Callable[..., tuple[Any, ...]]
    samples: tuple[tuple[float, ...], ...] = ()
    commutative: bool = False
    selects: bool = False
    fold: Callable[..., Any] | None = None
    singular: Callable[..., str | None] | None = None

    def __repr__(self) -> str:
        return f"<op {self.name}>"


ROWS: dict[str, Row] = {}  # {name: row}, filled by `cgraph.operations`
BY_UFUNC: dict[np.ufunc | str, Row] = {}  # {ufunc of NumPy, or the name of one: its row}, likewise
