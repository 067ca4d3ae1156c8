"""Pushed legs: tangents of a motion, pushed on through its legs, and through events and resets between them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array

from .legs import Bars, Legs, leg_slopes, pulled_at
from .motion import MotionRequest
from .motion_equations import PARAMETERS


class Rows(NamedTuple):
    """Rows of a motion: times (T,), states (T, m), and the tangents of both, (T, k) and (T, m, k)."""

    t: Array
    x: Array
    t_dot: Array
    x_dot: Array


def pushed_legs(legs: Legs, directions: Mapping[str, Array]) -> Rows:
    """The rows of all legs, along k directions of the registers x and `PARAMETERS`."""
    motion, watched = legs.motion, len(legs.events) > 0
    inputs = np.concatenate([directions[name] for name in PARAMETERS])
    begin, t_dot = float(motion.legs[0].t[0]), np.zeros(inputs.shape[1])
    x_dot = _through(motion.equations.start, motion, motion.x, begin, directions["x"], t_dot, inputs)
    parts: list[Rows] = []
    for run, leg in zip(legs.runs, motion.legs, strict=True):
        by_t, by_h = leg_slopes(leg)
        given, steps = {**directions, "x": x_dot}, np.empty((0, len(t_dot)))
        if watched:
            given["t"], steps = t_dot[None], by_h[:, None] * t_dot
        if leg.event:  # the last column: the length of the last step alone
            steps[-1] = 0.0
            given = {name: np.pad(rows, ((0, 0), (0, 1))) for name, rows in given.items()}
            steps = np.pad(steps, ((0, 0), (0, 1)))
            steps[-1, -1] = 1.0
        states, tangents = run.pushed(given, steps)
        times = np.append(by_t, 0.0)[:, None] * t_dot
        if leg.event:
            g = pulled_at(legs.events[leg.event].values, run.motion, run.x, float(run.motion.t[-1]), [1.0])
            tangents, slope = tangents[:, :, :-1], tangents[-1, :, -1]
            at_event = g.x @ tangents[-1] + g.t * times[-2] + g.inputs @ inputs
            length = -at_event / (g.x @ slope + g.t)
            tangents[-1] += slope[:, None] * length
            times[-1] = times[-2] + length
        parts.append(Rows(run.motion.t, states, times, tangents))
        x_dot, t_dot = tangents[-1], times[-1]
        if leg.event and (reset := legs.events[leg.event].reset) is not None:
            x_dot = _through(reset, run.motion, run.x, float(run.motion.t[-1]), x_dot, t_dot, inputs)
    last = motion.legs[-1].event
    if last and legs.events[last].reset is not None:
        parts.append(Rows(legs.t[-1:], legs.x[None], t_dot[None], x_dot[None]))
    return _observed(motion, Rows(*[np.concatenate(column) for column in zip(*parts, strict=True)]), inputs)


def _through(
    graph: Graph | None, motion: MotionRequest, x: Array, t: float, x_dot: Array, t_dot: Array, inputs: Array
) -> Array:
    """Tangents of the state that a graph makes of one; the same without a graph."""
    if graph is None:
        return x_dot
    rows: list[Bars] = [pulled_at(graph, motion, x, t, unit.tolist()) for unit in np.eye(len(x))]
    return np.stack([row.x @ x_dot + row.t * t_dot + row.inputs @ inputs for row in rows])


def _observed(motion: MotionRequest, rows: Rows, inputs: Array) -> Rows:
    """Rows of states (q, qd), of those of the steps."""
    graph = motion.equations.end
    if graph is None:
        return rows
    moved = cg.jvp(graph)
    values = [*rows.x.T, rows.t, *motion.force_at_end, *motion.values]
    tangents = [*rows.x_dot.swapaxes(0, 1), rows.t_dot, *inputs]
    points = dict(zip(graph.input_names, [np.reshape(each, (-1, 1)) for each in values], strict=True))
    along = points | dict(zip(moved.input_names[len(values) :], tangents, strict=True))
    x, x_dot = (
        np.stack([np.broadcast_to(each, (len(rows.t), count)) for each in values.values()], axis=1)
        for values, count in ((graph.evaluate(points), 1), (moved.evaluate(along), len(inputs.T)))
    )
    return rows._replace(x=x[:, :, 0], x_dot=x_dot)
