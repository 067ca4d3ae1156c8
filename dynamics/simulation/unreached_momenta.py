"""Unreached momenta: where the velocities of rows do not belong to their momenta, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..integrators import Problem
from .steps.row_values import converted, row_values
from .steps.state_sizes import OTHERS

LOOSE = 1e-6  # of a momentum, or so much of the largest: what an iteration may leave of it; of a velocity the same
SLOW = 1e-2  # of the largest velocity: below, one counts as no smaller


def unreached_momenta(
    problem: Problem,
    times: Array,
    rows: Array,
    parameters: ArrayLike = 0.0,
    *,
    start: tuple[float, Array, Array],
) -> list[str]:
    """Doubts of rows (T, m) of a problem in momenta; start: the instant, q and qd, and the state (m,) they make."""
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
