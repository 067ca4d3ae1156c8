"""Surfaces of a model, on which its rate jumps or kinks, and by how much it does so near a state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph._shared import Array

from ..systems.model import Model
from .problem import derive, in_form
from .switches import switched

NEAREST = 8  # steps to a surface by its slope
SMALL = 1e-7  # of the rate, or its slope, there and at the state, below which a difference is rounding


class Surface(NamedTuple):
    """A surface: its formula, as `Switches.words`, its tags, and what is there, "jump", "kink" or "smooth".

    by: {output: what the rate jumps by, or its slope by the formula}, where it changes; smooth are both.
    """

    formula: str
    tags: tuple[str, ...]
    kind: str
    by: Mapping[str, float]


def surfaces(model: Model, at: Mapping[str, float], form: str = "velocity") -> list[Surface]:
    """The surfaces of a model's rate, each at its point near a state.  at: values of its inputs, else 0."""
    problem = switched(in_form(derive(model, {}), form))
    if (switches := problem.switches) is None:
        return []
    n, m, names = len(switches.modes), problem.size + 1, problem.rate.input_names
    start, floors = np.array([at.get(name, 0.0) for name in names[: len(names) - n]]), np.array(switches.spacing) == 1.0
    modes = np.where(floors, 0.0, 1.0)

    def values(graph: cg.Graph, *point: Array) -> Array:
        return np.array(list(graph.evaluate(dict(zip(names, np.concatenate(point), strict=True))).values()))

    slopes, rate_slopes = (cg.jacobian(graph, list(problem.rate.inputs[:m])) for graph in (switches.gaps, problem.rate))
    found = list[Surface]()
    with np.errstate(all="ignore"):
        for _ in modes:
            gaps = values(switches.gaps, start, modes)
            modes = np.where(floors, modes + np.floor(gaps), np.where(gaps < 0.0, -1.0, 1.0))
        for k, (formula, g) in enumerate(zip(switches.words, switches.surfaces, strict=True)):
            point = start.copy()
            for _ in range(NEAREST):
                normal = values(slopes, point, modes).reshape(n, m)[k]
                normal /= normal @ normal
                if np.isfinite(normal).all():
                    point[:m] -= values(switches.gaps, point, modes)[k] * normal
            sides = [np.where(np.arange(n) == k, side, modes) for side in (modes[k] - 1.0 if floors[k] else -1.0, 1.0)]
            sides[1][k] = modes[k] if floors[k] else 1.0
            kind, by = "smooth", dict[str, float]()
            for what, graph in (("jump", problem.rate), ("kink", rate_slopes)):
                below, above = (np.array([values(graph, each, side) for each in (point, start)]) for side in sides)
                if what == "kink":
                    below, above = (each.reshape(2, m - 1, m) @ normal for each in (below, above))
                size = np.abs([*below, *above]).max(axis=0)
                if len(changed := np.flatnonzero(np.abs(above[0] - below[0]) > SMALL * size)):
                    outputs = list(problem.rate.outputs)
                    kind, by = what, {outputs[i]: float(above[0, i] - below[0, i]) for i in changed}
                    break
            found.append(Surface(formula, tuple(sorted(g.tags)), kind, by))
    return found
