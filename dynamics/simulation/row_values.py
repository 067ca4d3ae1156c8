"""Row values: what a graph of the state gives at every row of a trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array

BLOCK = 4096  # rows that are taken at once


def converted(graph: Graph | None, times: Array, states: Array, parameters: ArrayLike | None = None) -> Array:
    """States (T, m) with what a graph gives of them in place of their last numbers, as qd of p; without one the same.

    parameters: its further inputs, (T, k), or (k,) for all rows; without them 0, of forces that it does not depend on.
    """
    if graph is None:
        return states
    count = len(graph.inputs) - states.shape[1] - 1
    held = np.broadcast_to(0.0 if parameters is None else np.asarray(parameters), (len(times), count))
    last = row_values(graph, times, states, held)
    return np.concatenate([states[:, : -last.shape[1]], last], axis=1)


def row_values(graph: Graph, times: Array, states: Array, held: Array | None = None) -> Array:
    """The outputs (T, k) of a graph over the states and t, at times (T,) and states (T, m).

    held: (T, n), the values of further inputs, which are forces that are held over periods.
    """
    result = np.empty((len(times), len(graph.outputs)))
    names = graph.input_names
    held = np.empty((len(times), 0)) if held is None else held
    with np.errstate(all="ignore"):
        for start in range(0, len(times), BLOCK):
            part = slice(start, start + BLOCK)
            values: dict[str, Any] = dict(zip(names, [*states[part].T, times[part], *held[part].T], strict=True))
            for column, value in enumerate(graph.evaluate(values).values()):
                result[part, column] = value
    return result
