"""Surfaces at once: how a motion depends on where it begins where several switching surfaces are crossed at an instant.

Nearby motions cross them one after another. Where none hastens another, the second is crossed dt = -g / g' later, so
that the state after it is x + (f_between - f_after) dt; else motions nearby part, and there is no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array

from ...integrators import Problem
from ..events.modes import Modes, Turn
from ..steps.row_values import values_of

ALIKE = 1e-7  # relative: slopes and rates that are the same but for the error of steps


def entries(modes: Modes, before: Turn, after: Turn, point: Array) -> tuple[Graph, ...]:
    """Graphs of the state by which others than the first surface are crossed; point: of the inputs of the rate.

    Raises ValueError where motions nearby part.
    """
    first, *others = modes.crossed(before, after)
    between = list(before.modes)
    between[first[0]] = after.modes[first[0]]
    result = list[Graph]()
    for k, number in others:
        margin, own = modes.margin(before, number), modes.margin(before, first[1])
        if _is_same(margin, own, point):
            between[k] = after.modes[k]
            continue
        following = [*between]
        following[k] = after.modes[k]
        alone = [*before.modes]
        alone[k] = after.modes[k]
        rates = [_rate(modes, each) for each in (before.modes, between, alone, following)]
        f, f_between, f_alone, _ = [values_of(rate, point, 1)[:, 0] for rate in rates]
        if not (_moves_alike(margin, point, f, f_between) and _moves_alike(own, point, f, f_alone)):
            names = " and ".join([repr(modes.words[j]) for j in (first[0], k)])
            when = f"cross zero at one instant, t = {after.t:.6g} s, and one hastens the other"
            raise ValueError(f"{names} {when}: motions nearby part there, which has no derivative")
        result.append(_later(modes.plain, margin, rates[1], rates[3], before.modes))
        between = following
    return tuple(result)


def _rate(modes: Modes, values: Sequence[float]) -> Graph:
    """The rate in these modes, over all inputs."""
    problem = modes.problem_in(values)
    switches = problem.switches
    assert switches is not None
    return Graph(
        problem.rate.inputs, cg.specialize(problem.rate, dict(zip(switches.modes, values, strict=True))).outputs
    )


def _slopes(margin: Graph, point: Array, m: int) -> Array:
    """Slopes of a margin by states and t."""
    slopes = cg.gradient(margin, list(margin.input_names[: m + 1]))
    return values_of(slopes, point, 1)[:, 0]


def _is_same(a: Graph, b: Graph, point: Array) -> bool:
    """Whether both are zero on the same surface nearby: their slopes are parallel."""
    first, second = [values_of(cg.gradient(each), point, 1)[:, 0] for each in (a, b)]
    product = float(first @ second)
    return abs(abs(product) - float(np.linalg.norm(first) * np.linalg.norm(second))) <= ALIKE**2 * abs(product)


def _moves_alike(margin: Graph, point: Array, f: Array, other: Array) -> bool:
    """Whether a margin moves the same by two rates."""
    slopes = _slopes(margin, point, len(f))
    one, two = [slopes @ np.append(rate, 1.0) for rate in (f, other)]
    return bool(abs(one - two) <= ALIKE * max(abs(one), abs(two)))


def _later(problem: Problem, margin: Graph, between: Graph, after: Graph, modes: Sequence[float]) -> Graph:
    """x + (f_between - f_after) dt, with dt = -g / g'."""
    m, inputs = problem.size, problem.rate.inputs
    known = dict(zip(problem.switches.modes, modes, strict=True))  # type: ignore[union-attr]
    g = cg.specialize(margin, known).only_output()
    slopes = [*cg.gradient(Graph(inputs, {"g": g}), list(problem.rate.input_names[: m + 1])).outputs.values()]
    one, two = list(between.outputs.values()), list(after.outputs.values())
    rate = slopes[m]
    for slope, each in zip(slopes, one, strict=False):
        rate = rate + slope * each
    dt = -g / rate
    moved = [x + (a - b) * dt for x, a, b in zip(inputs, one, two, strict=False)]
    return cg.simplify(Graph(inputs, {f"{k}": node for k, node in enumerate(moved)}))
