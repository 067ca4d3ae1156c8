"""State sizes: how large the components of a state have been, and the absolute tolerance that goes with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cgraph.extend import Array

Flags = np.ndarray[Any, np.dtype[np.bool_]]

OTHERS = 1e-4  # of the largest component of its kind, below which one counts as no smaller: it may be rounding


class StateSizes:
    """The absolute tolerance of a run that was given none, in the units of its states.

    rtol times the largest value that the component, or another of its group, has had so far, or a ten-thousandth of the
    largest of its kind, coordinates or velocities, angles and lengths compared by `lengths`. It grows with the motion.

    kinds, groups: for each component a number, the same for those of one kind, or of one quantity, (m,).
    lengths: what 1 of a component stands for beside 1 of others of its kind, (m,).
    """

    def __init__(
        self, rtol: float, kinds: Sequence[int], groups: Sequence[int], least: float, lengths: Sequence[float]
    ) -> None:
        self._lengths = np.array(lengths)
        self._alike, self._one = _same(kinds), _same(groups)
        self._rtol, self._least = rtol, least
        self._sizes = np.zeros(len(kinds))

    def see(self, states: Array) -> None:
        """Note the sizes of these states, (.., m)."""
        with np.errstate(invalid="ignore"):
            largest = np.abs(np.where(np.isfinite(states), states, 0.0)).max(axis=0, initial=0.0)
        self._sizes = np.maximum(self._sizes, _largest(largest, self._one))

    def tolerance(self) -> Array:
        """The tolerance, (m,), by the states noted so far."""
        sizes = np.maximum(self._sizes, OTHERS * self.largest_of_kind(self._sizes))
        result: Array = np.maximum(self._rtol * sizes, self._least)
        return result

    def largest_of_kind(self, values: Array) -> Array:
        """For each component the largest size of those of its kind, as one of its own, (.., m)."""
        result: Array = _largest(self._lengths * values, self._alike) / self._lengths
        return result


def _same(numbers: Sequence[int]) -> Flags:
    """Which are the same, (m, m)."""
    number = np.array(numbers)
    same: Flags = number[:, None] == number[None, :]
    return same


def _largest(values: Array, alike: Flags) -> Array:
    """For each the largest size of those alike."""
    largest: Array = np.where(alike, np.abs(values)[..., None, :], 0.0).max(axis=-1)
    return largest
