"""The row of an operation: what a node, evaluation and both modes of differentiation know of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Row:
    """Row of an operation as the core reads it; `cgraph.operations` has the rows, with the columns of other parts.

    scalar, array: value on floats, and on arrays that broadcast.  samples: points inside the domain, away from kinks.
    partials(y, *args): the partial derivative in each argument, a node or a number.
    commutative: f(a, b) = f(b, a).  selects: whether an argument that is not used must not reach the result.
    fold(*args): the simpler node of the operation, or None.  singular: not None where a slope is unbounded.
    quotient(y, *args): a divisor and the partials times it, all finite where y is, the divisor not 0; or None.
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
    quotient: Callable[..., tuple[Any, tuple[Any, ...]] | None] | None = None

    def __repr__(self) -> str:
        return f"<op {self.name}>"


ROWS: dict[str, Row] = {}  # {name: row}, filled by `cgraph.operations`
BY_UFUNC: dict[np.ufunc | str, Row] = {}  # {ufunc of NumPy, or the name of one: its row}, likewise
