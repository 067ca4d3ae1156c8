"""Row values: what graphs of the state give at every row of a trajectory, and what gave one that is not finite."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, _shared
from cgraph._shared import Array, kept_by_first

from ...systems.evaluation import ByRows

BLOCK = 4096  # rows that are taken at once

tangent = kept_by_first(cg.jvp)


@kept_by_first
def compiled(graph: Graph, backend: str = "auto") -> Any:
    """The graph as a function, made once; one by rows is its own."""
    return graph if isinstance(graph, ByRows) else cg.compile(graph, backend)


def values_of(graph: Graph, inputs: Iterable[Any], *shape: int) -> Array:
    """The outputs of a graph, (k, *shape), at numbers or arrays for its inputs."""
    if isinstance(graph, ByRows):
        columns = np.stack([np.broadcast_to(each, shape) for each in inputs])
        return graph.batch(columns.reshape(len(columns), -1)).reshape(-1, *shape)
    result = np.empty((len(graph.outputs), *shape))
    for k, value in enumerate(graph.evaluate(dict(zip(graph.input_names, inputs, strict=True))).values()):
        result[k] = value
    return result


def converted(graph: Graph | None, times: ArrayLike, states: Array, parameters: ArrayLike = 0.0) -> Array:
    """States (.., m) with what a graph gives in place of their last numbers, as qd of p; without one the same."""
    if graph is None:
        return states
    last = row_values(graph, times, states, parameters)
    return np.concatenate([states[..., : -last.shape[-1]], last], axis=-1)


def row_values(graph: Graph, times: ArrayLike, states: Array, parameters: ArrayLike = ()) -> Array:
    """Outputs (.., k) of a graph over states (.., m), t and parameters, of as many points as go along the last axes."""
    *shape, m = states.shape
    rows, t, count = states.reshape(-1, m), np.broadcast_to(times, shape).reshape(-1), len(graph.inputs) - m - 1
    held = np.broadcast_to(parameters, (*shape, count)).reshape(len(rows), count)
    parts = [slice(start, start + BLOCK) for start in range(0, max(len(rows), 1), BLOCK)]
    with np.errstate(all="ignore"):
        values = [values_of(graph, [*rows[part].T, t[part], *held[part].T], len(t[part])).T for part in parts]
    result = np.concatenate(values)
    return result.reshape(*shape, result.shape[1])


def origin(
    rate: Graph, times: Array, states: Array, held: ArrayLike, names: Mapping[str, str], beyond: float
) -> _shared.WhyNan:
    """Where the first rate, or slope of it, comes from that is not finite.  beyond: the step [s] that failed, or 0."""
    m, forces = states.shape[1], np.broadcast_to(held, (len(times), len(rate.inputs) - states.shape[1] - 1))
    tried = [np.column_stack([states, times, forces])]
    if beyond and len(times):
        direction = -1.0 if len(times) > 1 and times[-1] < times[0] else 1.0
        ahead = direction * beyond * np.array([0.5, 1.0])
        further = states[-1:] + ahead[:, None] * row_values(rate, times[-1:], states[-1:], forces[-1:])
        tried.append(np.column_stack([further, times[-1] + ahead, np.repeat(forces[-1:], 2, axis=0)]))
    for graph in (rate, cg.jacobian(rate, list(rate.inputs[:m]))):
        for rows in tried:
            values = row_values(graph, rows[:, m], rows[:, :m], rows[:, m + 1 :])
            if len(bad := np.flatnonzero(~np.isfinite(values).all(axis=1))):
                return cg.why_nan(rate, dict(zip(rate.input_names, rows[bad[0]], strict=True)), names=names)
    return _shared.WhyNan(rate)
