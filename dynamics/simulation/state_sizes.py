"""State sizes: how large the components of a state have been, and the absolute tolerance that goes with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array

OTHERS = 1e-6  # of the largest component of its kind, below which one counts as no smaller: it may be rounding


class StateSizes:
    """The absolute tolerance of a run that was given none, in the units of its states.

    rtol times the largest value that the component has had so far, or a millionth of the largest of its kind,
    coordinates or velocities. It grows with the motion.

    kinds: for each component a number, the same for those of one kind, (m,).
    """

    def __init__(self, rtol: float, kinds: Sequence[int], least: float) -> None:
        kind = np.array(kinds)
        self._alike = kind[:, None] == kind[None, :]
        self._rtol, self._least = rtol, least
        self._sizes = np.zeros(len(kind))

    def see(self, states: Array) -> None:
        """Note the sizes of these states, (.., m)."""
        with np.errstate(invalid="ignore"):
            largest = np.abs(np.where(np.isfinite(states), states, 0.0)).max(axis=0, initial=0.0)
        self._sizes = np.maximum(self._sizes, largest)

    def tolerance(self) -> Array:
        """The tolerance, (m,), by the states noted so far."""
        sizes = np.maximum(self._sizes, OTHERS * self.largest_of_kind(self._sizes))
        result: Array = np.maximum(self._rtol * sizes, self._least)
        return result

    def largest_of_kind(self, values: Array) -> Array:
        """For each component the largest size of those of its kind, (m,)."""
        largest: Array = np.where(self._alike, np.abs(values), 0.0).max(axis=1)
        return largest
