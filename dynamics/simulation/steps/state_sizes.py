"""State sizes: which components of a state can be compared, and how large those of a kind are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import Call, Map, Statement

Flags = np.ndarray[Any, np.dtype[np.bool_]]

OTHERS = 1e-4  # of the largest component of its kind, below which one counts as no smaller: it may be rounding
STILL = 2.0**-54  # of a coordinate, a quarter of its last digit: a step that moves it by less does not move it
ROUNDING_SIZE = 1e-10  # of the largest component of its kind: where one is that small, rounding is no error of it


@dataclass(frozen=True, eq=False)
class StateKinds:
    """Components of a state that can be compared, (m,) each.

    kinds, groups: the same number for those of one kind, as coordinates, or of one quantity, as a quaternion's.
    lengths: what 1 of a component stands for beside 1 of others of its kind, see `System.lengths`.
    ordinary: whether it is that of a first-order system, whose components may all round each other.
    moved: of a velocity the coordinates that velocities like it move, by number; () of all else.
    """

    kinds: tuple[int, ...]
    groups: tuple[int, ...]
    lengths: tuple[float, ...]
    ordinary: bool
    moved: tuple[tuple[int, ...], ...]

    def largest_of_kind(self, values: Array) -> Array:
        """Largest size among components of one kind, as one of each component's own, (.., m)."""
        columns = dict(zip(self.largest.input_names, np.moveaxis(values, -1, 0), strict=True))
        return np.stack(list(self.largest.evaluate(columns).values()), axis=-1)

    def scale(self, size: Array) -> Array:
        """Scale of errors of components that have been so large, (.., m)."""
        alike = replace(self, kinds=(0,) * len(self.kinds)) if self.ordinary else self
        result: Array = size + ROUNDING_SIZE * alike.largest_of_kind(size)
        return result

    @cached_property
    def largest(self) -> Graph:
        """`largest_of_kind` as a graph, (m) to (m)."""
        values = cg.variables([f"x{k}" for k in range(len(self.kinds))])
        pairs = list(zip(values, self.lengths, strict=True))
        sizes = _largest_nodes([abs(value if length == 1.0 else length * value) for value, length in pairs], self.kinds)
        return _numbered(values, [size / length for size, length in zip(sizes, self.lengths, strict=True)])

    @cached_property
    def coordinate(self) -> Graph:
        """Largest of the coordinates that velocities like this one move, of each component, (m) to (m); 0 of none."""
        sizes = cg.variables([f"x{k}" for k in range(len(self.moved))])
        weighed = [length * abs(size) for size, length in zip(sizes, self.lengths, strict=True)]
        largest = {those: reduce(cg.maximum, [weighed[k] for k in those], cg.constant(0.0)) for those in self.moved}
        return _numbered(
            sizes, [largest[those] / length for those, length in zip(self.moved, self.lengths, strict=True)]
        )

    @cached_property
    def together(self) -> Graph | None:
        """Sizes of components to those of quantities of several, such as a quaternion; None where there are none."""
        values = cg.variables([f"x{k}" for k in range(len(self.groups))])
        several = len(set(self.groups)) < len(values)
        return _numbered(values, _largest_nodes(values, self.groups)) if several else None


def _largest_nodes(values: Sequence[Node], alike: Sequence[int]) -> list[Node]:
    """Largest node among those of the same number, for each."""
    found: dict[int, Node] = {}
    for value, number in zip(values, alike, strict=True):
        found[number] = cg.maximum(found[number], value) if number in found else value
    return [found[number] for number in alike]


def _numbered(inputs: Sequence[Node], outputs: Sequence[Node]) -> Graph:
    return Graph(inputs, {f"y{k}": node for k, node in enumerate(outputs)})


def off_by(errors: Array, scale: Array, allowed: Array, components: tuple[str, ...]) -> str:
    """The component whose error, a share of its size, is the largest of those beyond what is allowed; "" if none is."""
    beyond = ~(errors * scale <= allowed)
    if not beyond.any():
        return ""
    worst = int(np.argmax(np.where(beyond, errors, -1.0)))
    return f"the state is off by an estimated {errors[worst]:.2g} of the size of {components[worst]}"


def at_rest_registers(kinds: StateKinds) -> dict[str, int]:
    """Registers of the statements; `rest.atol` is 0 when a run begins."""
    m = len(kinds.moved)
    return {"rest.moved": m, "rest.atol": m, "rest.mean": 1} if any(kinds.moved) else {}


def at_rest(kinds: StateKinds) -> list[Statement]:
    """Raise `start.tolerance` of velocities that, in a mean step of the run so far, do not move any coordinate.

    Of a body that rests in contact, velocities are what the rounding of large forces leaves, and no accuracy can be
    asked of them: steps by their sizes would have to be ever shorter. A velocity that is off by rtol times the
    coordinate over the length of the run moves it by no more than its tolerance.
    """
    if not any(kinds.moved):
        return []
    t, t0, trials = cg.variables("t t0 trials")
    atol, kind, mean, moved, relative, length, tolerance = cg.variables(
        "atol kind mean moved relative length tolerance"
    )
    still = (kind > 0.0) * (mean > 0.0) * (kind * mean <= STILL * moved)
    raised = cg.maximum(atol, cg.where(still, relative * moved / length, 0.0))
    states = ("rest.atol", "start.kind", "rest.mean", "rest.moved", "start.relative", "start.length")
    return [
        Call(kinds.coordinate, ("start.size",), ("rest.moved",)),
        Call(Graph([t, t0, trials], {"mean": abs(t - t0) / trials}), ("t", "start.t0", "trials"), ("rest.mean",)),
        Map(Graph([atol, kind, mean, moved, relative, length], {"atol": raised}), states, ("rest.atol",)),
        Map(
            Graph([tolerance, atol], {"tolerance": cg.maximum(tolerance, atol)}),
            ("start.tolerance", "rest.atol"),
            ("start.tolerance",),
        ),
    ]
