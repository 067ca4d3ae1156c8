"""Errors of a C function in float: bounds at random points of a box of inputs."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...core.checks import GraphError
from ...core.evaluation import Array, Value, box_interval
from ...core.graph import Graph
from ...core.node import VARIABLE, Node
from ...simplification.rounding_growth import output_bounds
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


class Errors(NamedTuple):
    """Of an output in float: the largest bound of its error, NaN where there is none, and the largest error seen."""

    bound: float
    seen: float


def largest_errors(graph: Graph, box: Mapping[str, tuple[float, float]], numbers: CNumbers) -> dict[str, Errors]:
    """{output: bound of its error to first order, and error of the same operations each rounded}, at POINTS points.

    Half of the points are uniform in the box, half are corners of it, where bounds often are largest. Inputs and
    constants are rounded to the numbers of the program, too.
    """
    rng = np.random.default_rng(0)
    ends = np.array([*box.values()], dtype=float).reshape(-1, 2)
    share = rng.uniform(size=(len(ends), POINTS))
    share[:, POINTS // 2 :] = share[:, POINTS // 2 :].round()
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share
    worst = np.zeros((len(graph.outputs), 2))
    at_once = max(1, _ROOM // max(1, len(graph.nodes)))
    for start in range(0, POINTS, at_once):
        here = dict(zip(box, points[:, start : start + at_once], strict=True))
        outputs = [*graph.outputs.values()]
        values, bounds = output_bounds(graph.nodes, outputs, here, numbers.unit, numbers.unit, numbers.stored)
        rounded = _rounded(graph, here, numbers)
        for k, node in enumerate(outputs):
            bound = np.where(np.isfinite(values[node]), bounds[k], np.nan)
            with np.errstate(invalid="ignore"):
                seen = np.abs(rounded[node] - values[node])
            worst[k] = np.maximum(worst[k], (np.max(bound), np.max(seen)))  # NaN stays
    worst[~np.isfinite(worst)] = np.nan
    return {name: Errors(*map(float, row)) for name, row in zip(graph.outputs, worst, strict=True)}


def _rounded(graph: Graph, points: Mapping[str, Array], numbers: CNumbers) -> dict[Node, Array]:
    """Values of all nodes, every operation rounded to the numbers of the program; of + - * / and sqrt exactly so."""
    found: dict[Node, Array] = {}
    with np.errstate(all="ignore"):
        for node in graph.nodes:
            if node.op is VARIABLE:
                value: Value = points[str(node.name)]
            else:
                value = node.value if node.value is not None else node.op.array(*[found[arg] for arg in node.args])
            found[node] = np.asarray(value).astype(numbers.dtype).astype(float)
    return found
