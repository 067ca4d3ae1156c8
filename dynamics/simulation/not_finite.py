"""Origin of what is not finite in a motion: the first state at which a rate is not, and the operation that began it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, WhyNan

from .row_values import row_values


def origin(
    rate: Graph, times: Array, states: Array, held: ArrayLike, names: Mapping[str, str], beyond: float
) -> WhyNan:
    """Where the first rate comes from that is not finite, or the first derivative of one.

    rate: over the states, t and forces.  times: (T,).  states: (T, m).  held: forces, (T, p) or ().
    beyond: the step [s] of a run that stopped at the last row, which is taken along the rate; 0 of one that did not.
    """
    forces = np.broadcast_to(held, (len(times), len(rate.inputs) - states.shape[1] - 1))
    tried = [(times, states, forces)]
    if beyond and len(times):
        direction = -1.0 if len(times) > 1 and times[-1] < times[0] else 1.0
        slope = row_values(rate, times[-1:], states[-1:], forces[-1:])[0]
        ahead = direction * beyond * np.array([0.5, 1.0])
        tried.append((times[-1] + ahead, states[-1] + ahead[:, None] * slope, np.repeat(forces[-1:], 2, axis=0)))
    for graph in (rate, cg.jacobian(rate, list(rate.inputs[: states.shape[1]]))):
        for t, rows, force in tried:
            bad = np.flatnonzero(~np.isfinite(row_values(graph, t, rows, force)).all(axis=1))
            if len(bad):
                k = int(bad[0])
                return cg.why_nan(
                    rate, dict(zip(rate.input_names, [*rows[k], t[k], *force[k]], strict=True)), names=names
                )
    return WhyNan(rate)
