"""First step: the step that a method which chooses its steps begins with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, Runner

from ...integrators.step_control import RESOLUTION
from ..run_options import RunOptions

LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60  # of a first step
AHEAD = 3.0  # times the change of a first step: how far its first rate may point
HUGE = 1e300  # a tolerance that anything meets


def first_step(
    runner: Runner,
    order: int,
    options: RunOptions,
    start: Mapping[str, ArrayLike],
    rate: Array,
    scale: Callable[[Array, Array], Array],
) -> float:
    """A step that two half steps confirm, their difference is within the tolerance, and the first rate, too.

    The estimate of an embedded method can vanish by symmetry, such as at a start from rest, and a guess from the first
    derivatives can be far off; halving cannot be fooled by either. Of an initial layer that a method damps, both the
    whole and the half steps keep nothing: there the first rate points much farther than the step goes.

    start: registers x and p.  rate: (m,), of the state at the start.  scale: what errors from x to x_new are measured
    by, (m,).
    """
    span, x = options.t_end - options.t0, np.asarray(start["x"])
    anything = {"rtol": HUGE, "atol": HUGE, "max_step": math.inf, "fresh": 1.0, "accepted": 1.0}
    anything |= {"t": options.t0, "end": math.copysign(math.inf, span), "error_old": 1.0}
    memory = runner.memory({**start, **anything})
    least = min(abs(span), max(2.0 * RESOLUTION * abs(options.t0), math.ulp(0.0)))
    h = max(min(abs(span), options.longest_step) * LEAP, least)
    for _ in range(TRIALS):
        with np.errstate(all="ignore"):
            whole = _forced(runner, memory, [h])
            size = scale(x, whole)
            change = (whole - _forced(runner, memory, [0.5 * h, 0.5 * h])) / size
            difference = float(np.sqrt(np.mean(change * change)))
            ahead = float(np.max(h * np.abs(rate) / np.maximum(np.abs(whole - x), size)))
        if (difference <= 1.0 and ahead <= AHEAD) or h <= least:
            break
        # of tolerances; below a rounding, as of a state that moves evenly, it does not limit the step
        factor = 0.9 * max(difference, 1e-16) ** (-1.0 / (order + 1)) if math.isfinite(difference) else 0.0
        h = max(h * min(0.5, max(1e-3, min(factor, AHEAD / max(ahead, AHEAD)))), least)
    return h


def _forced(runner: Runner, memory: Array, steps: Sequence[float]) -> Array:
    """The state after these steps from a memory, which is left as it is; NaN where one could not be made."""
    memory = memory.copy()
    for h in steps:
        runner.write(memory, "next", h)
        runner.run(memory, 1)
        if not runner.read(memory, "accepted")[0]:
            return np.full(len(runner.read(memory, "x")), math.nan)
    return runner.read(memory, "x")
