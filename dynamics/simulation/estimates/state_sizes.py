"""State sizes: how large the components of a state have been, and the absolute tolerance that goes with them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cgraph.extend import Array

Flags = np.ndarray[Any, np.dtype[np.bool_]]

OTHERS = 1e-4  # of the largest component of its kind, below which one counts as no smaller: it may be rounding
ROUNDING = 1e-10  # of the largest component of its kind: where one is that small, rounding is no error of it


@dataclass(frozen=True, eq=False)
class StateKinds:
    """Which components of a state can be compared, (m,) each.

    kinds, groups: the same number for those of one kind, as coordinates, or of one quantity, as a quaternion's.
    lengths: what 1 of a component stands for beside 1 of others of its kind, see `System.lengths`.
    ordinary: whether it is that of a first-order system, whose components may all round each other.
    """

    kinds: tuple[int, ...]
    groups: tuple[int, ...]
    lengths: tuple[float, ...]
    ordinary: bool
    _lengths: Array = field(init=False, repr=False)
    _alike: Flags = field(init=False, repr=False)  # which are of one kind, (m, m)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_lengths", np.array(self.lengths))
        object.__setattr__(self, "_alike", _same(self.kinds))

    def largest_of_kind(self, values: Array) -> Array:
        """For each component the largest size of those of its kind, as one of its own, (.., m)."""
        result: Array = _largest(self._lengths * values, self._alike) / self._lengths
        return result

    def scale(self, size: Array) -> Array:
        """What errors are measured by, of components that have been so large, (.., m)."""
        alike = replace(self, kinds=(0,) * len(self.kinds)) if self.ordinary else self
        result: Array = size + ROUNDING * alike.largest_of_kind(size)
        return result


class StateSizes:
    """The absolute tolerance of a run that was given none, in the units of its states.

    rtol times the largest value that the component, or another of its group, has had so far, or a ten-thousandth of the
    largest of its kind, coordinates or velocities, angles and lengths compared by `lengths`. It grows with the motion.
    """

    def __init__(self, kinds: StateKinds, rtol: float, least: float) -> None:
        self.kinds, self._rtol, self._least, self._one = kinds, rtol, least, _same(kinds.groups)
        self._sizes = np.zeros(len(kinds.kinds))

    def see(self, states: Array) -> None:
        """Note the sizes of these states, (.., m)."""
        with np.errstate(invalid="ignore"):
            largest = np.abs(np.where(np.isfinite(states), states, 0.0)).max(axis=0, initial=0.0)
        self._sizes = np.maximum(self._sizes, _largest(largest, self._one))

    def tolerance(self) -> Array:
        """The tolerance, (m,), by the states noted so far."""
        sizes = np.maximum(self._sizes, OTHERS * self.kinds.largest_of_kind(self._sizes))
        result: Array = np.maximum(self._rtol * sizes, self._least)
        return result


def _same(numbers: tuple[int, ...]) -> Flags:
    """Which are the same, (m, m)."""
    same: Flags = np.equal.outer(numbers, numbers)
    return same


def _largest(values: Array, alike: Flags) -> Array:
    """For each the largest size of those alike, (.., m)."""
    largest: Array = np.where(alike, np.abs(values)[..., None, :], 0.0).max(axis=-1)
    return largest


def off_by(errors: Array, scale: Array, allowed: Array, components: tuple[str, ...]) -> str:
    """The component whose error, a share of its size, is the largest of those beyond what is allowed; "" if none is."""
    beyond = ~(errors * scale <= allowed)
    if not beyond.any():
        return ""
    worst = int(np.argmax(np.where(beyond, errors, -1.0)))
    return f"the state is off by an estimated {errors[worst]:.2g} of the size of {components[worst]}"
