"""Answers: where the random motions end, to thirty digits, and how much a small error grows on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import cgraph as cg
from cgraph.extend import Array

from ...multiprecision import Reference, ReferenceFailedError
from ...multiprecision.solution import from_text
from ...simulation.steps.scipy_solvers import solve_ivp
from ..accuracy_task import AccuracyTask
from ..work_precision.trajectory_runs import problem_of
from .random_motions import EACH, LAGRANGIANS, STARTS, random_motion

FILE = Path(__file__).with_name("answers.json")
COUNT = LAGRANGIANS + EACH * len(STARTS)
DIGITS = 30
PARTS = 8  # of the motion: an error may be made at the start of any
RTOL, NUDGE = 1e-7, 2.0**-12  # of motions beside the motion: their errors, and how far they start aside, in sizes
REGULAR = 1e8  # condition of a flow that is inverted


@dataclass(frozen=True)
class Answer:
    """The end of a motion, or why it has none.

    end: at t_end; None where the motion runs into a singularity before.  size: the largest value of each state on the
    way, (m,).
    growth: the largest factor by which a small relative error at any time, in the sizes of the states, has grown at
    t_end, at least 1.
    """

    end: Reference | None
    size: tuple[float, ...]
    growth: float
    how: str


def answer(number: int) -> Answer:
    """The answer to the random motion of this number, from the file beside this one or computed."""
    task = random_motion(number)
    kept = task.kept(FILE, str(number))
    if kept is None:
        return compute(task)
    end = from_text([task.t_end], [kept["x"]], kept["error"], kept["how"]) if "x" in kept else None
    return Answer(end, tuple(kept["size"]), kept["growth"], kept["how"])


def compute(task: AccuracyTask) -> Answer:
    """The answer to a task, by `reference`; the growth by SciPy."""
    times = [task.t_end * k / PARTS for k in range(PARTS + 1)]
    try:
        motion = task.solution(times, digits=DIGITS)
    except ReferenceFailedError as error:
        return Answer(None, (), 1.0, str(error))
    assert motion is not None
    end = Reference(motion.t[-1:], motion.decimal[-1:], motion.error, motion.how)
    size, growth = size_and_growth(task, times, np.max(np.abs(motion.x), axis=0))
    return Answer(end, tuple(size.tolist()), growth, motion.how)


def size_and_growth(task: AccuracyTask, times: Sequence[float], size: Array) -> tuple[Array, float]:
    """The largest value of each state, (m,), and the largest row sum of the flow from any of these times to the last.

    The flow is measured in units of the sizes, by differences of motions of SciPy's solvers; `size` is a first guess.
    """
    rate = cg.compile(problem_of(task).rate)
    unit = np.where(size > 0.0, size, 1.0)

    def motion(x: Array, at: Sequence[float] | None = times) -> Array:
        options = {"rtol": RTOL, "atol": RTOL * unit, "method": "Radau" if task.stiff else "DOP853", "t_eval": at}
        return np.asarray(solve_ivp()(lambda t, x: rate([*x, t]), (0.0, task.t_end), x, **options).y.T)

    start = np.array(task.start)
    size = np.maximum(size, np.abs(motion(start, None)).max(axis=0))  # of all its steps, layers included
    unit = np.where(size > 0.0, size, 1.0)
    columns = []
    for j in range(len(start)):
        aside = unit * (np.arange(len(start)) == j) * NUDGE
        columns.append((motion(start + aside) - motion(start - aside)) / (2.0 * NUDGE * unit))
    flows = np.stack(columns, axis=2)  # (T, m, m), from the start
    usable = [flow for flow in flows[:-1] if np.linalg.cond(flow) < REGULAR]
    return size, max([1.0, *[float(np.abs(flows[-1] @ np.linalg.inv(flow)).sum(axis=1).max()) for flow in usable]])
