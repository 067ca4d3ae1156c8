"""Doubts: what speaks against motions that are differentiated: their steps, their momenta, and their losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cgraph._shared import Array

from ..estimates.error_estimate import LAWLESS
from ..outcome import MotionError
from ..steps.state_sizes import off_by
from ..steps.step_program import state_kinds
from ..unreached_momenta import unreached_momenta
from .motion import Segment
from .motion_run import MotionRun
from .segments import MotionSegments

LOOKS = 64  # at least, if there are so many steps, at which two motions are compared
LOOSE_TOLERANCE = 1e-3  # a relative tolerance above it tells of a motion's growth no more than this
ASIDE = 1.0 + 2.0**-52  # by which the other motion starts aside: what a rounding grows to is part of the error


def doubts(
    segments: MotionSegments,
    values: Array,
    gradients: Mapping[str, Array],
    slopes: tuple[Array, Array] | None = None,
) -> list[list[str]]:
    """A sentence each, of every motion, which has an end.  values (N,), gradients (.., N): of the losses.

    slopes: of the losses by the starts of the motions and by their ends, (m, N).
    """
    said = [[*segments.motion.said] for _ in values]
    for sentences in (_unreached(segments), _half_steps(segments), [] if slopes is None else _grown(segments, *slopes)):
        for texts, more in zip(said, sentences, strict=False):  # no sentences: of no motion
            texts += more
    whole = [each.reshape(-1, len(said)) for each in gradients.values()]
    suspects = [] if not whole or np.isfinite(np.concatenate(whole)).all() else [*gradients]
    for k, texts in enumerate(said):
        if not np.isfinite(values[k]):
            texts.append(f"the loss is {values[k]} of a motion that is finite")
        else:
            bad = [name for name in suspects if not np.isfinite(gradients[name][..., k]).all()]
            texts += [f"the loss is {values[k]:.6g}, and its gradient by {name!r} is not finite" for name in bad]
    return said


def _unreached(segments: MotionSegments) -> list[list[str]]:
    """Doubts about velocities of motions in momenta; `MotionRequest.with_segments` has those of accepted steps."""
    motion, problem = segments.motion, segments.motion.problem
    if problem.missing is None or segments.events or not motion.segments[0].equal:
        return []
    (run,) = segments.runs
    inputs = len(problem.missing.inputs) - problem.size - 1
    held = np.concatenate([motion.force_at_end, motion.values])[:inputs].T
    steps, rows = run.states()
    t = run.motion.t[steps]
    starts = zip(motion.x.T, np.moveaxis(rows, -1, 0), held, strict=True)
    return [unreached_momenta(problem, t, x, p, start=(float(t[0]), start, x[0])) for start, x, p in starts]


def _grown(segments: MotionSegments, start: Array, end: Array) -> list[list[str]]:
    """Flag of every motion: whether the error at its start may change the loss by more than its own size does.

    start, end: slopes of the loss by the state there. Of a loss along the way alone, its value is compared.
    """
    motion, options = segments.motion, segments.motion.options
    left = min(options.relative, LOOSE_TOLERANCE) if motion.method.adaptive else ASIDE - 1.0
    with np.errstate(all="ignore"):
        change = left * (np.abs(start) * np.maximum(np.abs(motion.x), np.abs(segments.end))).sum(axis=0)
        slope, loss = np.abs(end), np.abs(segments.loss)
        if not (change > (slope * np.abs(segments.x)).sum(axis=0) + loss).any():  # the end is enough
            return []
        at_end = np.max([np.abs(run.states()[1]).max(axis=0) for run in segments.runs], axis=0)
        whole = (slope * at_end).sum(axis=0) + loss
        ratios = np.where(whole > 0.0, change / whole, 0.0)
    what = f"rtol = {left:g}" if motion.method.adaptive else "rounding"
    text = (
        f"the motion is chaotic, or nearly so: by its end {what} at its start has grown to {{:.2g}} times its size, "
        "and the gradient is that of the numbers computed, not of the motion"
    )
    return [[text.format(ratio)] if ratio > 1.0 else [] for ratio in ratios.tolist()]


def _half_steps(segments: MotionSegments) -> list[list[str]]:
    """Error of every motion by equal steps, beside the motion by steps of half the length, where it is too large.

    Half of a step has the force of the step.
    """
    motion, options = segments.motion, segments.motion.options
    if not options.estimated:
        return []
    tau = np.repeat(motion.tau, 2, axis=0) if motion.each_step else motion.tau
    parts = tuple([_halved(segment, run) for segment, run in zip(motion.segments, segments.runs, strict=True)])
    beside = replace(motion, x=motion.x * ASIDE, segments=parts, tau=tau)
    try:
        every = [2 * (run.tape.checkpoints or max(1, len(run.motion.h) // LOOKS)) for run in segments.runs]
        other = MotionSegments(beside, segments.programs, segments.events, every)
    except MotionError as stopped:
        return [[f"its error is unknown: in steps of half the length {stopped}"]]
    size, difference = np.zeros((2, motion.many, motion.problem.size))
    for run, half in zip(segments.runs, other.runs, strict=True):
        (steps, rows), (halves, others) = run.states(), half.states()
        steps = 2 * steps
        steps[-1] = halves[-1]
        here, there = np.intersect1d(steps, halves, assume_unique=True, return_indices=True)[1:]
        size = np.maximum(size, np.abs(rows).max(axis=0).T)
        difference = np.maximum(difference, np.abs(others[there] - rows[here]).max(axis=0).T)
    scale = state_kinds(motion.problem).scale(size)
    allowed = options.absolute + options.relative * scale
    relative = np.divide(difference, scale, out=np.zeros_like(scale), where=difference != 0.0)
    # with an error C h^p the two differ by (1 - 2^-p) of it
    error = np.where(relative > LAWLESS, relative, relative / (1.0 - 0.5**motion.method.order))
    longest = float(np.abs(segments.runs[0].motion.h[0]))
    said: list[list[str]] = [[] for _ in size]
    for k in np.flatnonzero(np.isfinite(size).all(axis=1)).tolist():  # of the motions that have an end
        if not np.isfinite(difference[k]).all():
            said[k].append(f"its error is unknown: in steps of half the length the motion {other.runs[-1].stopped(k)}")
        elif off := off_by(error[k], scale[k], allowed[k], motion.problem.components):
            bound = f"rtol = {options.relative:g} allows less, and steps of {longest:.6g} s are too long for that"
            said[k].append(f"{off}; {bound}")
    return said


def _halved(segment: Segment, run: MotionRun) -> Segment:
    """Segments in equal steps of half the length, but for the last step, which an event cuts."""
    t, steps = run.motion.t, 2 * len(run.motion.h)
    if not segment.event:
        return Segment(
            np.append(t[0] + (segment.end - t[0]) / steps * np.arange(steps), segment.end), "", steps, segment.end
        )
    h = (segment.end - t[0]) / (2 * segment.equal)
    steps -= abs(t[-1] - t[-2]) <= abs(h)
    return Segment(np.append(t[0] + h * np.arange(steps), t[-1]), segment.event, 2 * segment.equal, segment.end)
