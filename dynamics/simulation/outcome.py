"""Outcome: one run made to its end, which the recorder is told, and what is to be said of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence

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
    of_matrices = (run.jacobians, run.factorizations)
    return ended(options.method, counts, run.status, run.event, of_matrices, run.warnings, error)


def ended(
    method: str,
    counts: tuple[int, int, int, float, float],
    status: str,
    event: str = "",
    of_matrices: tuple[int, int] = (0, 0),
    said: Sequence[str] = (),
    error: ErrorEstimate | None = None,
) -> Stats:
    """How a run went.  counts: steps to seconds of `Stats`.  of_matrices: njev and nlu.

    status, event: why it stopped early, or what ended it.  said: what speaks against it besides its error.
    """
    known = error if error is not None and not math.isnan(error.largest) else None  # else nothing could be compared
    return Stats(
        method,
        *counts,
        not status,
        status or event or REACHED,
        -1 if status else int(bool(event)),
        *of_matrices,
        known and known.largest,
        known and known.last,
        (*said, known.warning) if known and known.warning else tuple(said),
    )
