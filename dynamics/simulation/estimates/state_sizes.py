"""State sizes: which components of a state can be compared, and how large those of a kind are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
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

    @cached_property
    def largest(self) -> Graph:
        """`largest_of_kind` as a graph, (m) to (m)."""
        values = cg.variables([f"x{k}" for k in range(len(self.kinds))])
        pairs = list(zip(values, self.lengths, strict=True))
        sizes = _largest_nodes([abs(value if length == 1.0 else length * value) for value, length in pairs], self.kinds)
        return _numbered(values, [size / length for size, length in zip(sizes, self.lengths, strict=True)])

    @cached_property
    def together(self) -> Graph | None:
        """Sizes of components to those of quantities of several, such as a quaternion; None where there are none."""
        values = cg.variables([f"x{k}" for k in range(len(self.groups))])
        several = len(set(self.groups)) < len(values)
        return _numbered(values, _largest_nodes(values, self.groups)) if several else None


def _same(numbers: tuple[int, ...]) -> Flags:
    """Which are the same, (m, m)."""
    same: Flags = np.equal.outer(numbers, numbers)
    return same


def _largest_nodes(values: Sequence[Node], alike: Sequence[int]) -> list[Node]:
    """For each the largest of those of the same number."""
    found: dict[int, Node] = {}
    for value, number in zip(values, alike, strict=True):
        found[number] = cg.maximum(found[number], value) if number in found else value
    return [found[number] for number in alike]


def _numbered(inputs: Sequence[Node], outputs: Sequence[Node]) -> Graph:
    return Graph(inputs, {f"y{k}": node for k, node in enumerate(outputs)})


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
