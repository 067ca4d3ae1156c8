"""Advice: the method for a run that is stiff, or stops for want of a derivative, tried before it is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cgraph.extend import Array, counted

from ..run_options import RunOptions
from ..steps.stepping import Integration

IMPLICIT = ("radau", "rodas")
OTHERS = ("radau", "dop853")  # of the rate the first takes no derivative by the time, and the second none at all
TRIED = 1000  # trials of steps of a method, at most
LONGER = 4.0  # times as long as those of the run are steps that are worth a word


def advise(
    run: Integration, reached: float, options: RunOptions, x: Array, again: Callable[[RunOptions], Integration] | None
) -> None:
    """Name the method in the warning of a run that is stiff, or in the status of one that lacks a derivative.

    None where all of them stop, or take steps as short, or come no farther.

    reached: how far the run has come [s].  x: where it started, (m,).  again: the same run by other options;
    None where a controller decides, which may remember what it has seen.
    """
    if not (run.stiff or run.slope) or again is None:
        return
    length = LONGER * abs(reached - options.t0) / max(run.steps, 1)
    for name in OTHERS if run.slope else IMPLICIT:
        trial, t = again(replace(options, method=name, t_eval=None, max_steps=TRIED)), options.t0
        try:
            with np.errstate(all="ignore"):
                for block in trial.blocks(x):
                    t = float(block.t[-1]) if len(block.t) else t
        except KeyboardInterrupt:  # of a run that is done
            return
        text = f"; try method={name!r}, which comes to t = {t:.6g} s in {counted(trial.steps, 'step')}"
        if run.slope and not trial.status:
            run.status += text
            return
        whole = trial.steps + trial.rejected < TRIED
        if not run.slope and not (trial.status and whole) and abs(t - options.t0) >= length * trial.steps > 0.0:
            run.warnings[run.warnings.index(run.stiff)] += text
            return
