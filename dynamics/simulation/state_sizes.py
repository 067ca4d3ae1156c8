"""State sizes: how large the components of a state have been, and the absolute tolerance that goes with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array

SMALL = 1e-6  # of what a component has been, or of the largest of its kind: below, it may be rounding, or done with


class StateSizes:
    """The absolute tolerance of a run that was given none, in the units of its states.

    rtol times the largest value that the component has had of late, a millionth of the largest that it ever had, or a
    millionth of the largest of its kind, coordinates or velocities, of late. Of late is since the last look, and looks
    are after 32, 64, 128, .. trials of a step.

    kinds: for each component a number, the same for those of one kind, (m,).
    """

    def __init__(self, rtol: float, kinds: Sequence[int], least: float) -> None:
        kind = np.array(kinds)
        self._alike = kind[:, None] == kind[None, :]
        self._rtol, self._least = rtol, least
        self._lately, self._ever = np.zeros(len(kind)), np.zeros(len(kind))

    def see(self, states: Array) -> None:
        """Note the sizes of these states, (.., m)."""
        with np.errstate(invalid="ignore"):
            largest = np.abs(np.where(np.isfinite(states), states, 0.0)).max(axis=0, initial=0.0)
        self._lately = np.maximum(self._lately, largest)

    def look(self) -> Array:
        """The tolerance, (m,), by the states noted since the last look."""
        self._ever = np.maximum(self._ever, self._lately)
        sizes = np.maximum(self._lately, SMALL * np.maximum(self._ever, self.largest_of_kind(self._lately)))
        self._lately = np.zeros_like(self._lately)
        tolerance: Array = np.maximum(self._rtol * sizes, self._least)
        return tolerance

    def largest_of_kind(self, values: Array) -> Array:
        """For each component the largest size of those of its kind, (m,)."""
        largest: Array = np.where(self._alike, np.abs(values), 0.0).max(axis=1)
        return largest
