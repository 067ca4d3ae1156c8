"""Row values: what a graph of the state gives at every row of a trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np

from cgraph import Graph
from cgraph.extend import Array

BLOCK = 4096  # rows that are taken at once


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
