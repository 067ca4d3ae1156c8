"""Limits left: where a motion lies beyond the limits of its joints, at its rows or, by dense output, between them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cgraph._shared import Array

from ..simulation.trajectory import Trajectory

Pair = tuple[float, float]
ROUNDING = 2.0**-40  # of a coordinate: by less it is not beyond
SHARES = np.arange(1, 8) / 8  # of a step, at which it is looked at besides its end
CUTS = 60  # of the time between two looks


def limits_left(run: Trajectory, limits: Mapping[str, Mapping[str, Pair]], units: Mapping[str, str]) -> list[str]:
    """A sentence on every limit of position or velocity that a motion has left: when first, and how far it went."""
    said, t, states = list[str](), run.t, (run.q, run.qd)
    if run.dense is not None and run.dense.steps:
        t_old, end = (np.concatenate([getattr(block, name) for block in run.dense.steps]) for name in ("t_old", "t"))
        t = np.append(run.dense.t0, np.column_stack([t_old[:, None] + SHARES * (end - t_old)[:, None], end]))
        states = run.solution(t)
    for part, (what, names, per) in enumerate((("position", run.coordinates, ""), ("velocity", run.velocities, "/s"))):
        for name, (lower, upper) in limits.get(what, {}).items():
            k, unit = names.index(name), units[name] + per
            alike = [i for i, other in enumerate(names) if units.get(other) == units[name]]
            sizes = np.abs([*states[part][:, alike].ravel(), *[x for x in (lower, upper) if np.isfinite(x)]])
            rounding = ROUNDING * sizes.max()
            if (left := _left(run, part, k, (lower, upper), t, states[part][:, k], rounding)) is not None:
                first, value, at = left
                bounds = f"{what} of {name} leaves {lower:.6g} to {upper:.6g} {unit} at {first:.4g} s"
                said.append(f"{bounds}, and is {value:.6g} {unit} at {at:.4g} s")
    return said


def _left(
    run: Trajectory, part: int, k: int, ends: Pair, t: Array, x: Array, rounding: float
) -> tuple[float, float, float] | None:
    """When a coordinate with values x at instants t is beyond its limit first, where it is farthest, and when."""

    def beyond(x: Array) -> Array:
        return np.asarray(np.maximum(ends[0] - x, x - ends[1]) - rounding)

    def values(t: Array) -> Array:
        return run.solution(t)[part][:, k]

    over = beyond(x)
    if run.dense is not None:  # look for the turns between the instants
        before, after = np.append(over[:1], over[:-1]), np.append(over[1:], over[-1:])
        turns = (over >= np.maximum(before, after)) & (2.0 * over > np.minimum(before, after))
        begin, end = np.append(t[:1], t[:-1])[turns], np.append(t[1:], t[-1:])[turns]
        for _ in range(CUTS if len(begin) else 0):
            left, right = begin + (end - begin) / 3.0, end - (end - begin) / 3.0
            rises = beyond(values(left)) < beyond(values(right))
            begin, end = np.where(rises, left, begin), np.where(rises, end, right)
        t, x = np.append(t, begin), np.append(x, values(begin))
        order = np.argsort(np.abs(t - t[0]), kind="stable")
        t, x, over = t[order], x[order], beyond(x[order])
    one, most = int(np.argmax(over > 0.0)), int(np.argmax(over))
    if not over[most] > 0.0:
        return None
    inside, first = float(t[max(one - 1, 0)]), float(t[one])
    for _ in range(CUTS if run.dense is not None else 0):
        middle = 0.5 * (inside + first)
        inside, first = (inside, middle) if beyond(values(np.array([middle])))[0] > 0.0 else (middle, first)
    return first, float(x[most]), float(t[most])
