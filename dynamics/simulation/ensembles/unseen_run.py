"""Unseen runs: a trajectory by steps alone, where its end is its only row that a step makes."""

from __future__ import annotations

from cgraph._shared import Array

from ..outcome import REACHED
from ..steps.integration import AdaptiveIntegration
from .ensemble import RunTable


def run_unseen(run: AdaptiveIntegration, x: Array, runs: RunTable, k: int, rows: Array) -> bool:
    """Whether trajectory k could be run so from x (m,), to its end; else it is to be run anew.

    rows: (T, m), receives x before the end.
    """
    done = run.unseen(x)
    if done:
        runs.stopped(k, REACHED, **run.counts, success=True, status=0)
        rows[:-1], rows[-1] = x, run.x
    return done
