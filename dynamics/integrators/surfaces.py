"""Surfaces of a model, on which its rate jumps or kinks, and by how much it does so near a state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph._shared import Array

from ..systems.model import Model
from .problem import derive, in_form
from .rate_in_modes import switched

NEAREST = 8  # steps to a surface by its slope
SMALL = 1e-7  # of the rate, or its slope, there and at the state, below which a difference is rounding


class Surface(NamedTuple):
    """A surface, as `Switches.words`, its tags, and by how much the rate jumps there, or its slope by the formula."""

    formula: str
    tags: tuple[str, ...]
    kind: str  # "jump", "kink", or "smooth" where neither changes
    by: Mapping[str, float]  # {output of the rate: change}


def surfaces(model: Model, at: Mapping[str, float], form: str = "velocity") -> list[Surface]:
    """The surfaces of a model's rate, each at its point near a state.  at: values of its inputs, else 0."""
    problem = switched(in_form(derive(model, {}), form))
    if (switches := problem.switches) is None:
        return []
    rate, n, m = problem.rate, len(switches.modes), problem.size
    start, floors = np.array([at.get(name, 0.0) for name in rate.input_names[:-n]]), np.array(switches.spacing) == 1.0
    slopes = [cg.jacobian(graph, list(rate.inputs[: m + 1])) for graph in (switches.gaps, rate)]

    def values(graph: cg.Graph, *point: Array) -> Array:
        return np.array(list(graph.evaluate(dict(zip(rate.input_names, np.concatenate(point), strict=True))).values()))

    found, names, modes = list[Surface](), list(rate.outputs), np.where(floors, 0.0, 1.0)
    with np.errstate(all="ignore"):
        for _ in range(n):
            gaps = values(switches.gaps, start, modes)
            modes = np.where(floors, modes + np.floor(gaps), np.where(gaps < 0.0, -1.0, 1.0))
        for k, (formula, g) in enumerate(zip(switches.words, switches.surfaces.outputs.values(), strict=True)):
            point, upper = start.copy(), modes[k] if floors[k] else 1.0
            for _ in range(NEAREST):
                normal = values(slopes[0], point, modes).reshape(n, m + 1)[k]
                normal /= normal @ normal
                point[: m + 1] -= np.nan_to_num(values(switches.gaps, point, modes)[k] * normal)
            sides = [np.where(np.arange(n) == k, side, modes) for side in (upper - switches.spacing[k], upper)]
            points = [(each, side) for each in (point, start) for side in sides]  # below and above, there and here
            jump = [values(rate, *each) for each in points]
            kink = [values(slopes[1], *each).reshape(m, m + 1) @ normal for each in points]
            for kind, parts in (("jump", jump), ("kink", kink), ("smooth", [np.zeros(m)] * 4)):
                change, most = parts[1] - parts[0], SMALL * np.abs(parts).max(axis=0)
                by = {names[i]: float(change[i]) for i in np.flatnonzero(np.abs(change) > most).tolist()}
                if by or kind == "smooth":
                    found.append(Surface(formula, tuple(sorted(g.tags)), kind, by))
                    break
    return found
