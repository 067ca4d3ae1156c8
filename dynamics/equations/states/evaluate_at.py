"""Values of a system's graphs at states given as arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array, real_array, real_number, require_mapping

from ...systems.arguments import TIME
from ...systems.system import System

STATE = ("q", "qd", "qdd", "tau")  # the prefixes of a graph's inputs, each an array of one number a coordinate


def evaluate_at(
    system: System,
    graph: Graph,
    state: Mapping[str, ArrayLike | None],
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> Array:
    """The outputs, (n_out,) or (N, n_out), at a state as `input_values` takes it."""
    values, shape = input_values(system, graph.input_names, state, t, parameters)
    outputs = graph.evaluate(values).values()
    return np.stack([np.broadcast_to(np.asarray(each, dtype=np.float64), shape) for each in outputs], axis=-1)


def input_values(
    system: System,
    names: Sequence[str],
    state: Mapping[str, ArrayLike | None],
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> tuple[dict[str, float | Array], tuple[int, ...]]:
    """Values of those inputs at a state {"q": .., "qd": .., "qdd": .., "tau": ..}, (n,) or (N, n) each; and () or (N,).

    What of the state is None or missing is zero, coordinates neutral. Parameters have the system's values unless given.
    Raises ValueError for another shape, what is not finite, or a parameter that the system does not have.
    """
    values: dict[str, float | Array] = {**_numbers(system, t, parameters)}
    arrays, shape = _arrays(system, state)
    for name, rows in arrays.items():
        values |= {f"{name}{i}": column if rows.ndim == 2 else float(column) for i, column in enumerate(rows.T)}
    return {name: values[name] for name in names}, shape


class InputRows:
    """The inputs of a graph, by their names, at many states: one row (n_in,) for each, as `input_values` takes them."""

    def __init__(self, system: System, names: Sequence[str]) -> None:
        self._system, self._count = system, len(names)
        self._blocks: list[tuple[int, str, int, int]] = []  # a column, and the part of the state that begins there
        self._alone: dict[int, str] = {}  # columns of one number for all states
        places = {f"{name}{i}": (name, i) for name in STATE for i in range(max(system.nq, system.n))}
        following = None
        for k, input_name in enumerate(names):
            if input_name not in places:
                self._alone[k] = input_name
                continue
            part, i = places[input_name]
            if following == (k, part, i):
                start, _, first, _ = self._blocks.pop()
                self._blocks.append((start, part, first, i + 1))
            else:
                self._blocks.append((k, part, i, i + 1))
            following = k + 1, part, i + 1

    def __call__(
        self, state: Mapping[str, ArrayLike | None], t: float, parameters: Mapping[str, float] | None
    ) -> Array:
        """(N, n_in), or (n_in,) of one state."""
        numbers = _numbers(self._system, t, parameters)
        arrays, shape = _arrays(self._system, state)
        rows = np.empty((*shape, self._count))
        for start, name, first, last in self._blocks:
            rows[..., start : start + last - first] = arrays[name][..., first:last]
        for k, name in self._alone.items():
            rows[..., k] = numbers[name]
        return rows


def _numbers(system: System, t: float, parameters: Mapping[str, float] | None) -> dict[str, float]:
    """Time and parameters, the system's values unless given."""
    parameters = {} if parameters is None else require_mapping("parameters", parameters, "name: number")
    if unknown := sorted(map(str, set(parameters) - set(system.parameters))):
        has = ", ".join(system.parameters) or "none"
        raise ValueError(f"the system has no parameter {unknown[0]!r} (it has {has})")
    if parameters:
        system.require_values({**system.parameters, **parameters})
    time = real_number("t", t)
    if not math.isfinite(time):
        raise ValueError(f"t must be finite, got {time!r}")
    return {TIME: time, **system.parameters, **parameters}


def _arrays(system: System, state: Mapping[str, ArrayLike | None]) -> tuple[dict[str, Array], tuple[int, ...]]:
    """The parts of a state, checked, (n,) or (N, n) each, and () or (N,)."""
    arrays = {name: _rows(system, name, state.get(name)) for name in STATE}
    shapes = {(), *[rows.shape[:-1] for rows in arrays.values()]}
    if len(shapes) <= 2:
        return arrays, max(shapes)  # () and (N,)
    shape: tuple[int, ...] = ()
    for name, rows in arrays.items():
        try:
            shape = np.broadcast_shapes(shape, rows.shape[:-1])
        except ValueError:
            raise ValueError(
                f"the arrays of a state must have as many rows, or one, got {len(rows)} of {name} after {shape[0]}"
            ) from None
    return arrays, shape


def _rows(system: System, name: str, values: ArrayLike | None) -> Array:
    """One part of the state, checked: (n,) or (N, n)."""
    known = system.coordinates if name == "q" else system.velocities
    n = len(known)
    if values is None:
        return np.array(system.kinematics.neutral) if name == "q" else np.zeros(n)
    rows = real_array(name, values)
    if rows.ndim not in (1, 2) or rows.shape[-1] != n:
        names = ", ".join(known[:8]) + (", ..." if n > 8 else "")
        raise ValueError(
            f"{name} must have the shape ({n},) or (N, {n}), one number for each of {names}; got {rows.shape}"
        )
    finite = np.isfinite(rows)
    if not np.logical_and.reduce(finite, axis=None):
        at = tuple(np.argwhere(~finite)[0].tolist())
        where = f" in row {at[0]}" if rows.ndim == 2 else ""
        raise ValueError(f"{name} must be finite, got {rows[at]} for {known[at[-1]]!r}{where}")
    return rows
