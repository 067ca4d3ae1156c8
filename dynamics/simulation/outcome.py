"""Outcome: one run made to its end, which the recorder is told, and what is to be said of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from cgraph.extend import Array

from .estimates.advice import advise
from .estimates.error_estimate import ErrorEstimate
from .estimates.run_estimate import RunEstimate
from .recorder import Recorder
from .run_options import RunOptions
from .steps.dense_output import StepBlock
from .steps.stepping import Integration, StoppedError
from .trajectory import Stats

REACHED = "reached t_end"
INTERRUPTED = "interrupted"  # what the message of a run that Ctrl-C ended begins with


def outcome(
    run: Integration,
    x: Array,
    recorder: Recorder,
    options: RunOptions,
    blocks: Iterable[StepBlock] | None = None,
    again: Callable[[RunOptions], Integration] | None = None,
) -> Stats:
    """The statistics of a run from x (m,) to t_end, an event, a failure or Ctrl-C, with its rows in the recorder.

    blocks: those of the run, if somebody else is to see them.  again: the same run by other options, see `advise`.
    """
    begin, error, estimate = time.perf_counter(), None, RunEstimate(run, x, options)
    try:
        with np.errstate(all="ignore"):
            for block in run.blocks(x) if blocks is None else blocks:
                recorder.add(block)
                estimate.add(block)
            error = None if run.status else estimate.result()
    except (KeyboardInterrupt, StoppedError):
        run.status = f"{INTERRUPTED} after t = {recorder.last:.6g} s"
    seconds = time.perf_counter() - begin - estimate.seconds
    advise(run, recorder.last, options, x, again)
    counts = (run.steps, run.rejected, run.evaluations, run.largest, seconds)
    stats = ended(options.method, counts, run.status, run.event, run.jacobians, run.factorizations, tuple(run.warnings))
    return stats if error is None else estimated(stats, error)


def ended(
    method: str,
    counts: tuple[int, int, int, float, float],
    status: str,
    event: str = "",
    jacobians: int = 0,
    factorizations: int = 0,
    said: tuple[str, ...] = (),
) -> Stats:
    """How a run went.  counts: steps to seconds of `Stats`.  status, event: why it stopped early, or what ended it."""
    message, number = status or event or REACHED, -1 if status else int(bool(event))
    return Stats(method, *counts, not status, message, number, jacobians, factorizations, warnings=said)


def estimated(stats: Stats, error: ErrorEstimate) -> Stats:
    """With the error of the run, unless nothing could be compared."""
    if math.isnan(error.largest):
        return stats
    said = (*stats.warnings, error.warning) if error.warning else stats.warnings
    return replace(stats, error=error.largest, error_at_end=error.last, warnings=said)
