"""Values of a system's graphs at states given as arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import real_array, real_number, require_mapping

from ..systems.arguments import TIME
from ..systems.system import System

STATE = ("q", "qd", "qdd", "tau")  # the prefixes of a graph's inputs, each an array of one number a coordinate
Array = np.ndarray[Any, np.dtype[np.float64]]


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
) -> tuple[dict[str, Any], tuple[int, ...]]:
    """Values of those inputs at a state {"q": .., "qd": .., "qdd": .., "tau": ..}, (n,) or (N, n) each; and () or (N,).

    What of the state is None or missing is zero, coordinates neutral. Parameters have the system's values unless given.
    Raises ValueError for another shape, what is not finite, or a parameter that the system does not have.
    """
    parameters = {} if parameters is None else require_mapping("parameters", parameters, "name: number")
    if unknown := sorted(map(str, set(parameters) - set(system.parameters))):
        has = ", ".join(system.parameters) or "none"
        raise ValueError(f"the system has no parameter {unknown[0]!r} (it has {has})")
    if parameters:
        system.require_values({**system.parameters, **parameters})
    time = real_number("t", t)
    if not math.isfinite(time):
        raise ValueError(f"t must be finite, got {time!r}")
    values: dict[str, Any] = {TIME: time, **system.parameters, **parameters}
    shape: tuple[int, ...] = ()
    for name in STATE:
        rows = _rows(system, name, state.get(name))
        try:
            shape = np.broadcast_shapes(shape, rows.shape[:-1])
        except ValueError:
            raise ValueError(
                f"the arrays of a state must have as many rows, or one, got {len(rows)} of {name} after {shape[0]}"
            ) from None
        values |= {f"{name}{i}": column if rows.ndim == 2 else float(column) for i, column in enumerate(rows.T)}
    return {name: values[name] for name in names}, shape


def _rows(system: System, name: str, values: ArrayLike | None) -> Array:
    """One part of the state, checked: (n,) or (N, n)."""
    known = system.coordinates if name == "q" else system.velocities
    n = len(known)
    missing = np.array(system.kinematics.neutral) if name == "q" else np.zeros(n)
    rows = missing if values is None else real_array(name, values)
    if rows.ndim not in (1, 2) or rows.shape[-1] != n:
        names = ", ".join(known[:8]) + (", ..." if n > 8 else "")
        raise ValueError(
            f"{name} must have the shape ({n},) or (N, {n}), one number for each of {names}; got {rows.shape}"
        )
    infinite = np.argwhere(~np.isfinite(rows))
    if len(infinite):
        at = tuple(infinite[0].tolist())
        where = f" in row {at[0]}" if rows.ndim == 2 else ""
        raise ValueError(f"{name} must be finite, got {rows[at]} for {known[at[-1]]!r}{where}")
    return rows
