"""Errors of a C function in float: bounds at random points of a box of inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...core.checks import GraphError
from ...core.graph import Graph
from ...simplification.rounding_growth import error_bounds
from ...util.inputs import box_interval
from ...util.require import require_mapping
from .c_numbers import CNumbers

POINTS = 1000
_ROOM = 4_000_000  # numbers that are kept at once

Box = Mapping[str, float | tuple[float, float]]


def checked_box(graph: Graph, box: object) -> dict[str, tuple[float, float]]:
    """{input: (low, high)} of all inputs, -1 .. 1 for those left out. Raises GraphError, ValueError."""
    given = {} if box is None else require_mapping("box", box, "input: interval")
    names = graph.input_names
    if unknown := [name for name in given if name not in names]:
        raise GraphError(f"box: the graph has no input {unknown[0]} (it has {', '.join(names) or 'none'})")
    found = {name: box_interval(name, given.get(name, (-1.0, 1.0))) for name in names}
    if unbounded := [name for name, ends in found.items() if not np.all(np.isfinite(ends))]:
        raise ValueError(f"box: input {unbounded[0]!r} needs finite numbers, got {found[unbounded[0]]!r}")
    return found


def largest_errors(graph: Graph, box: Mapping[str, tuple[float, float]], numbers: CNumbers) -> dict[str, float]:
    """{output: the largest bound of its error} at POINTS points, to first order, NaN where there is no bound.

    Half of the points are uniform in the box, half are corners of it, where bounds often are largest. Inputs and
    constants are rounded to the numbers of the program, too.
    """
    rng = np.random.default_rng(0)
    ends = np.array([*box.values()], dtype=float).reshape(-1, 2)
    share = rng.uniform(size=(len(ends), POINTS))
    share[:, POINTS // 2 :] = share[:, POINTS // 2 :].round()
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share
    worst = dict.fromkeys(graph.outputs, 0.0)
    at_once = max(1, _ROOM // max(1, len(graph.nodes)))
    for start in range(0, POINTS, at_once):
        here = dict(zip(box, points[:, start : start + at_once], strict=True))
        values, errors = error_bounds(graph.nodes, here, numbers.unit, numbers.unit, numbers.stored)
        for name, node in graph.outputs.items():
            bound = np.where(np.isfinite(values[node]), errors[node], np.nan)
            worst[name] = float(np.maximum(worst[name], np.max(bound)))
    return {name: bound if np.isfinite(bound) else float("nan") for name, bound in worst.items()}
