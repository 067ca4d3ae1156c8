"""Ends of many motions of one that is prepared: the states from which a loop of control goes on."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ...equations.states.initial_value import initial_values
from ..row_values import converted
from ..run import Run
from ..run_options import RunOptions
from ..steps.step_program import step_program
from ..steps.stepping import BLOCK_TIME
from ..trajectory import SimulationWarning
from .lanes import lanes_of
from .shares import chunk_width, doubts, run_chunks, side_by_side
from .task import Task
from .workers import Team, Workers, checked


def single_values(parameters: Mapping[str, Any], varied: Sequence[str]) -> dict[str, Any]:
    """The parameters that are the same for all motions. Raises ValueError for another that has many values."""
    if not isinstance(parameters, Mapping):
        raise TypeError(f"parameters must be a mapping of names to numbers, got {parameters!r:.60}")
    if several := [name for name, value in parameters.items() if np.ndim(value) and name not in varied]:
        raise ValueError(
            f"parameter {several[0]!r} has a value for each motion, and the motion was prepared with one for all: "
            f"prepare(.., varied=[{several[0]!r}]) keeps it open"
        )
    return {name: value for name, value in parameters.items() if not np.ndim(value)}


def ends_of(
    moving: Run,
    options: RunOptions,
    q: ArrayLike,
    qd: ArrayLike | None,
    parameters: Mapping[str, ArrayLike] | None,
    workers: Workers,
) -> tuple[Array, Array]:
    """The ends, (N, nq) and (N, n), of motions to the only row of the options.

    Raises as `simulate_many`, and for a sampled controller.
    """
    if moving.applied.controller is not None:
        one = "a SampledController may remember what it has seen, and so controls one motion"
        raise TypeError(f"{one}: ends of many are without")
    problem, t0 = moving.stepped, options.t0
    moving.require_given(parameters)
    start = initial_values(moving.model, q, qd, moving.applied.constant, parameters, t0)
    p = np.empty((len(start.x), len(problem.parameters)))
    for k, name in enumerate(problem.parameters):
        p[:, k] = start.varied[name] if name in start.varied else start.bound[name]
    x, team = converted(problem.momentum, t0, start.x, p), checked(workers)

    alike = len(x), t0, options.t_end, team if isinstance(team, int) else None
    shared = moving.kept(alike, lambda: _Shared(moving, options, len(x), team))
    rows = shared.by_lanes(x, p) if team == 1 else None
    if rows is None:
        rows = shared.by_chunks(x, p, team)
    states = converted(problem.velocities, options.t_end, rows, p)
    return states[:, : problem.nq], states[:, problem.nq :]


class _Shared:
    """So many motions to the only row of the options, shared out: what is done once for the calls that are alike."""

    def __init__(self, moving: Run, options: RunOptions, count: int, team: Team) -> None:
        options.check(moving.problem.states)
        program = step_program(moving.stepped, options.integrator, dense=False)
        grids, in_lanes = side_by_side(program, options, count)
        self._task = Task(program, options, 1, tuple(grids), None, in_lanes)
        self._width = chunk_width(count, None, team, program.steps.width if in_lanes else 0, grids)
        self._lanes = lanes_of(program, options.backend, options.fma) if in_lanes else None

    def by_lanes(self, x: Array, p: Array) -> Array | None:
        """The ends, (N, m), of motions in lanes alone; None where one needs more, or has a remark."""
        if self._lanes is None:
            return None
        rows = np.empty((len(x), 1, x.shape[1]))
        with np.errstate(all="ignore"):
            for k in range(0, len(x), self._width):
                here = slice(k, k + self._width)
                run = self._task.lane_run(self._lanes, x[here], p[here])
                while run.advance(BLOCK_TIME):
                    pass
                if not run.result(rows[here])[0].all():
                    return None
        return rows[:, 0]

    def by_chunks(self, x: Array, p: Array, team: Team) -> Array:
        """The ends, (N, m), NaN of motions that stop before, with a warning of how many and why."""
        whole = run_chunks(self._task, x, p, self._width, team, None)
        for text in doubts(whole.runs.stats(self._task.options.method, 0.0, {})):
            warnings.warn(text, SimulationWarning, stacklevel=4)
        return whole.rows[:, 0]
