"""Missed legs: what speaks against the velocities of a motion in momenta that is differentiated."""

from __future__ import annotations

import numpy as np

from ..missed_momenta import missed_momenta
from .legs import Legs


def missed_legs(legs: Legs, first: int | None = None) -> str:
    """What speaks against the first of the motions that something speaks against, or nothing.

    Of steps that are those of a run of `simulate`, chosen or with events, that run has said it.
    first: the number of the first of several motions.
    """
    motion, problem = legs.motion, legs.motion.problem
    if problem.missing is None or legs.events or not motion.legs[0].equal:
        return ""
    (run,) = legs.runs
    count = len(problem.missing.inputs) - problem.size - 1
    held = np.concatenate([motion.force_at_end, motion.values])[:count]
    t, rows = run.states()
    for k in range(max(motion.many, 1)):
        start, x, inputs = (array[..., k] if motion.many else array for array in (motion.x, rows, held))
        texts = missed_momenta(problem, t, x, inputs, start=(float(t[0]), start, x[0]))
        if texts:
            return texts[0] if first is None else f"motion {first + k}: {texts[0]}"
    return ""
