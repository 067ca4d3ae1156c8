"""Unseen runs: a trajectory by steps alone, where its end is its only row that a step makes."""

from __future__ import annotations

import numpy as np

from cgraph.extend import Array

from ..outcome import INTERRUPTED, REACHED
from ..steps.integration import AdaptiveIntegration
from ..steps.stepping import StoppedError
from .ensemble import RunTable


def run_unseen(run: AdaptiveIntegration, x: Array, runs: RunTable, k: int, rows: Array) -> bool:
    """Whether trajectory k could be run so from x (m,), to its end or to Ctrl-C; else it is to be run anew.

    rows: (T, m), receives x before the end.
    """
    try:
        done, status = run.unseen(x), REACHED
    except (KeyboardInterrupt, StoppedError):
        done, status = True, f"{INTERRUPTED} after t = {run.t:.6g} s"
    if done:
        reached = status is REACHED
        runs.stopped(k, status, **run.counts, success=reached, status=reached - 1)
        rows[:-1], rows[-1] = x, run.x if reached else np.nan
    return done
