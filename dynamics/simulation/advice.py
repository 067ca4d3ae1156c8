"""Advice: the implicit method for a run whose steps are held at a stability limit, tried before it is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cgraph.extend import Array, many

from .run_options import RunOptions
from .stepping import Integration

IMPLICIT = ("radau", "rodas")
TRIED = 1000  # trials of steps of a method, at most
LONGER = 4.0  # times as long as those of the run are steps that are worth a word


def advise(
    run: Integration, reached: float, options: RunOptions, x: Array, again: Callable[[RunOptions], Integration] | None
) -> None:
    """Name the method in the warning of a run that is stiff; none where all of them stop, or take steps as short.

    reached: how far the run has come [s].  x: where it started, (m,).  again: the same run by other options;
    None where a controller decides, which may remember what it has seen.
    """
    if not run.stiff or again is None:
        return
    length = LONGER * abs(reached - options.t0) / run.steps
    for name in IMPLICIT:
        trial, t = again(replace(options, method=name, t_eval=None, max_steps=TRIED)), options.t0
        try:
            with np.errstate(all="ignore"):
                for block in trial.blocks(x):
                    t = float(block.t[-1]) if len(block.t) else t
        except KeyboardInterrupt:  # of a run that is done
            return
        whole = trial.steps + trial.rejected < TRIED
        if not (trial.status and whole) and abs(t - options.t0) >= length * trial.steps > 0.0:
            at = run.warnings.index(run.stiff)
            run.warnings[at] += f"; try method={name!r}, which comes to t = {t:.6g} s in {many(trial.steps, 'step')}"
            return
