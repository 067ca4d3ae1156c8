"""Row values: what graphs of the state give at every row of a trajectory, and what gave one that is not finite."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, _shared
from cgraph._shared import Array

from ..integrators import Problem
from .estimates.state_sizes import OTHERS

BLOCK = 4096  # rows that are taken at once
LOOSE = 1e-6  # of a momentum, or so much of the largest: what an iteration may leave of it; of a velocity the same
SLOW = 1e-2  # of the largest velocity: below, one counts as no smaller


def values_of(graph: Graph, inputs: Iterable[Any], *shape: int) -> Array:
    """The outputs of a graph, (k, *shape), at numbers or arrays for its inputs."""
    result = np.empty((len(graph.outputs), *shape))
    for k, value in enumerate(graph.evaluate(dict(zip(graph.input_names, inputs, strict=True))).values()):
        result[k] = value
    return result


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
    result = np.empty((len(rows), len(graph.outputs)))
    with np.errstate(all="ignore"):
        for start in range(0, len(rows), BLOCK):
            part = slice(start, start + BLOCK)
            result[part] = values_of(graph, [*rows[part].T, t[part], *held[part].T], len(t[part])).T
    return result.reshape(*shape, len(graph.outputs))


def unreached_momenta(
    problem: Problem,
    times: Array,
    rows: Array,
    parameters: ArrayLike = 0.0,
    *,
    start: tuple[float, Array, Array],
) -> list[str]:
    """Doubts of rows (T, m) of a problem in momenta, a sentence each.

    parameters: further inputs of the graph, (k,); without them 0, of forces that velocities do not depend on.
    start: the instant, q and qd, and the state (m,) that they make.
    """
    if problem.missing is None or not len(rows):
        return []
    said = _other_velocities(problem, *start, parameters)
    momenta, missing = rows[:, problem.nq :], row_values(problem.missing, times, rows, parameters)
    sizes = np.abs(momenta).max(axis=0, initial=0.0)
    bad = np.argwhere(~(np.abs(missing) <= LOOSE * np.maximum(sizes, OTHERS * sizes.max(initial=0.0))))
    if not len(bad):
        return said
    row, k = bad[0].tolist()
    name, left = problem.components[problem.nq + k], f"{missing[row, k]:.2g} of {momenta[row, k]:.2g}"
    text = f"at t = {times[row]:.6g} s the velocities do not have the momenta: the iteration leaves {left}, {name}"
    return [*said, f"{text}; take form='velocity'"]


def _other_velocities(problem: Problem, t: float, start: Array, x: Array, parameters: ArrayLike) -> list[str]:
    """Whether the state that a start makes has other velocities: of an L that is not convex there are several."""
    nq = problem.nq
    qd, back = start[nq:], converted(problem.velocities, t, x, parameters)[nq:]
    bad = np.flatnonzero(np.abs(back - qd) > LOOSE * np.maximum(np.abs(qd), SLOW * np.abs(qd).max(initial=0.0)))
    if not len(bad) or not qd.any():
        return []
    k = int(bad[0])
    other = f"of the {problem.components[nq + k]} it is {back[k]:.6g} in place of {qd[k]:.6g}"
    return [f"the momenta of the start belong to other velocities too: {other}; take form='velocity'"]


def origin(
    rate: Graph, times: Array, states: Array, held: ArrayLike, names: Mapping[str, str], beyond: float
) -> _shared.WhyNan:
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
    return _shared.WhyNan(rate)
