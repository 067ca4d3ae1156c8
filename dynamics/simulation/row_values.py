"""Row values: what a graph of the state gives at every row of a trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array

BLOCK = 4096  # rows that are taken at once


def converted(graph: Graph | None, times: ArrayLike, states: Array, parameters: ArrayLike = 0.0) -> Array:
    """States (.., m) with what a graph gives of them in place of their last numbers, as qd of p; without one the same.

    times, parameters: see `row_values`; parameters are 0 where they are forces that it does not depend on.
    """
    if graph is None:
        return states
    last = row_values(graph, times, states, parameters)
    return np.concatenate([states[..., : -last.shape[-1]], last], axis=-1)


def row_values(graph: Graph, times: ArrayLike, states: Array, parameters: ArrayLike = ()) -> Array:
    """The outputs (.., k) of a graph over the states, t and parameters, at states (.., m).

    times: (..), or as many as go along the last axes.  parameters: (.., p) in the same way.
    """
    *shape, m = states.shape
    rows, t, count = states.reshape(-1, m), np.broadcast_to(times, shape).reshape(-1), len(graph.inputs) - m - 1
    held = np.broadcast_to(parameters, (*shape, count)).reshape(len(rows), count)
    names, result = graph.input_names, np.empty((len(rows), len(graph.outputs)))
    with np.errstate(all="ignore"):
        for start in range(0, len(rows), BLOCK):
            part = slice(start, start + BLOCK)
            values: dict[str, Any] = dict(zip(names, [*rows[part].T, t[part], *held[part].T], strict=True))
            for column, value in enumerate(graph.evaluate(values).values()):
                result[part, column] = value
    return result.reshape(*shape, len(graph.outputs))
