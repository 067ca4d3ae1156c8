"""Values of a system's graphs at states given as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import real_array

from ..systems.system import TIME, System

STATE = ("q", "qd", "qdd", "tau")
Array = np.ndarray[Any, np.dtype[np.float64]]


def at_state(
    system: System,
    graph: Graph,
    state: Mapping[str, ArrayLike | None],
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> Array:
    """The outputs, (n_out,) or (N, n_out), at a state {"q": .., "qd": .., "qdd": .., "tau": ..}, (n,) or (N, n) each.

    What of the state is None or missing is zero. Parameters have the system's values unless given.
    Raises ValueError for another shape, what is not finite, or a parameter that the system does not have.
    """
    if unknown := set(parameters or {}) - set(system.parameters):
        raise ValueError(f"the system has no parameter {min(unknown)!r} (it has {', '.join(system.parameters)})")
    values: dict[str, Any] = {TIME: float(t), **system.parameters, **(parameters or {})}
    shape: tuple[int, ...] = ()
    for name in STATE:
        given = state.get(name)
        rows = np.zeros(system.n) if given is None else real_array(name, given)
        if rows.ndim not in (1, 2) or rows.shape[-1] != system.n:
            raise ValueError(f"{name} must have the shape ({system.n},) or (N, {system.n}), got {rows.shape}")
        if not np.isfinite(rows).all():
            raise ValueError(f"{name} must be finite, got {rows[~np.isfinite(rows)][0]}")
        shape = np.broadcast_shapes(shape, rows.shape[:-1])
        values |= {f"{name}{i}": column if rows.ndim == 2 else float(column) for i, column in enumerate(rows.T)}
    outputs = graph.evaluate({name: values[name] for name in graph.input_names}).values()
    return np.stack([np.broadcast_to(np.asarray(each, dtype=np.float64), shape) for each in outputs], axis=-1)
