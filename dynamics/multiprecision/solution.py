"""A trajectory known to many digits, with its error bound and the method that gave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, real_array


@dataclass(frozen=True)
class Reference:
    """States at some times, in decimal, as `reference` gives them.

    Parameters
    ----------
    t : tuple of float
        The times, (T,) [s].
    decimal : tuple of tuple of str
        States in decimal, (T, m): q and then qd [rad or m, per second], or the states of an OdeSystem.
    error : float
        Error bound of `decimal`, relative to the largest value of the same state.
    how : str
        The method, and how the error was estimated.

    Examples
    --------
    >>> exact = Reference((1.0,), (("0.33333333333333333333",),), 1e-20, "by hand")
    >>> print(exact.deviation([[1.0 / 3.0]]))
    [[-1.85003837e-17]]
    """

    t: tuple[float, ...]
    decimal: tuple[tuple[str, ...], ...]
    error: float
    how: str

    @cached_property
    def x(self) -> Array:
        """The states rounded to float64, (T, m)."""
        return np.array([[float(text) for text in row] for row in self.decimal]).reshape(len(self.t), -1)

    @cached_property
    def _rest(self) -> Array:
        """Remainder that the rounding of `x` left out."""
        rest = [[float(Fraction(text) - Fraction(float(text))) for text in row] for row in self.decimal]
        return np.array(rest).reshape(self.x.shape)

    def deviation(self, x: ArrayLike) -> Array:
        """x - reference, (T, m), exact to the last bits of x, where `x - self.x` would end at an ulp of it."""
        values = real_array("the states", x)
        if values.shape != self.x.shape:
            raise ValueError(f"the states must have the reference's shape {self.x.shape}, got {values.shape}")
        return (values - self.x) - self._rest

    def relative_error(self, x: ArrayLike) -> float:
        """The largest deviation relative to the largest value of its state; a state that is zero counts as is."""
        return float(np.max(np.abs(self.deviation(x)) / scale(self.x), initial=0.0))


def scale(x: Array) -> Array:
    """The largest value of each state over the times, (m,); 1 where it is zero throughout."""
    largest: Array = np.max(np.abs(x), axis=0, initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def from_text(t: Sequence[float], rows: Sequence[Sequence[str]], error: float, how: str) -> Reference:
    """A Reference of plain sequences."""
    return Reference(tuple(map(float, t)), tuple([tuple(row) for row in rows]), float(error), how)
