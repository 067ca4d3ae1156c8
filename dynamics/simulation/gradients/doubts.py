"""Doubts: what speaks against motions that are differentiated: their steps, their momenta, and their losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cgraph._shared import Array

from ..error_estimate import LAWLESS
from ..outcome import MotionError, unreached_momenta
from ..steps.state_sizes import off_by, state_kinds
from .differentiated_run import DifferentiatedRun

LOOKS = 64  # at least, if there are so many steps, at which two motions are compared
LOOSE_TOLERANCE = 1e-3  # a relative tolerance above it tells of a motion's growth no more than this
ASIDE = 1.0 + 2.0**-52  # by which the other motion starts aside: what a rounding grows to is part of the error


def doubts(run: DifferentiatedRun) -> list[list[str]]:
    """A sentence each, of every motion, which has an end."""
    said = [[*run.motions.said] for _ in range(run.motions.many)]
    for sentences in (_other_momenta(run), _half_steps(run)):
        for texts, more in zip(said, sentences, strict=False):  # no sentences: of no motion
            texts += more
    return said


def loss_doubts(
    run: DifferentiatedRun, values: Array, gradients: Mapping[str, Array], start: Array, end: Array
) -> list[list[str]]:
    """Doubts of motions and of their losses, whose slopes by the states at start and end are (m, N)."""
    said = doubts(run)
    for texts, more in zip(said, _chaos(run, start, end), strict=False):
        texts += more
    finite = np.isfinite(np.concatenate([each.reshape(-1, len(said)) for each in gradients.values()])).all()
    for k, (texts, value) in enumerate(zip(said, values, strict=True)):
        if not np.isfinite(value):
            texts.append(f"the loss is {value} of a motion that is finite")
        else:
            bad = [name for name in gradients if not (finite or np.isfinite(gradients[name][..., k]).all())]
            texts += [f"the loss is {value:.6g}, and its gradient by {name!r} is not finite" for name in bad]
    return said


def _other_momenta(run: DifferentiatedRun) -> list[list[str]]:
    """Doubts about velocities of motions in momenta."""
    motions, problem = run.motions, run.motions.problem
    if problem.missing is None:
        return []
    times, rows = [each.steps.t for each in run.segments], np.concatenate([run.states(each) for each in run.segments])
    for k, tape in enumerate([each.tape for each in run.segments]):
        if tape.checkpoints:
            times[k] = times[k][[*[first for first, *_ in tape.blocks], -1]]
    t = np.concatenate(times)
    starts = zip(motions.x.T, np.moveaxis(rows, -1, 0), motions.inputs.T, strict=True)
    return [unreached_momenta(problem, t, x, p, start=(float(t[0]), start, x[0])) for start, x, p in starts]


def _chaos(run: DifferentiatedRun, start: Array, end: Array) -> list[list[str]]:
    """Whether the error at the start of a motion may change the loss by more than its own size does."""
    motions, options = run.motions, run.motions.options
    error = min(options.relative, LOOSE_TOLERANCE) if options.adaptive else ASIDE - 1.0
    with np.errstate(all="ignore"):
        change = error * (np.abs(start) * np.maximum(np.abs(motions.x), np.abs(run.end))).sum(axis=0)
        slope, loss = np.abs(end), np.abs(run.loss)
        if not (change > (slope * np.abs(run.x)).sum(axis=0) + loss).any():  # the end is enough
            return []
        largest = np.max([np.abs(run.states(each)).max(axis=0) for each in run.segments], axis=0)
        whole = (slope * largest).sum(axis=0) + loss
        ratios = np.where(whole > 0.0, change / whole, 0.0)
    what = f"rtol = {error:g}" if options.adaptive else "rounding"
    text = (
        f"the motion is chaotic, or nearly so: by its end {what} at its start has grown to {{:.2g}} times its size, "
        "and the gradient is that of the numbers computed, not of the motion"
    )
    return [[text.format(ratio)] if ratio > 1.0 else [] for ratio in ratios.tolist()]


def _half_steps(run: DifferentiatedRun) -> list[list[str]]:
    """Errors of motions by equal steps, beside steps of half the length with the same forces, that are too large."""
    motions, options = run.motions, run.motions.options
    if not options.estimated:
        return []
    halves = tuple([each.steps.half_steps() for each in run.segments])
    tau = np.repeat(motions.tau, 2, axis=0) if motions.each_step and halves[0].rows is None else motions.tau
    every = [each.tape.checkpoints or max(1, len(each.steps.h) // LOOKS) for each in run.segments]
    text = "its error is unknown: in steps of half the length "
    try:
        beside = replace(motions, x=motions.x * ASIDE, steps=halves, tau=tau)
        other = DifferentiatedRun(beside, forwards=run.forwards, every=[2 * each for each in every])
    except MotionError as stopped:
        return [[f"{text}{stopped}"]]
    size, difference = np.zeros((2, motions.many, motions.problem.size))
    for whole, half, steps in zip(run.segments, other.segments, every, strict=True):
        rows, others = run.states(whole), other.states(half)
        same = np.append(rows[: -1 : 1 if whole.tape.checkpoints else steps], rows[-1:], axis=0)
        size = np.maximum(size, np.abs(rows).max(axis=0).T)
        difference = np.maximum(difference, np.abs(others - same).max(axis=0).T)
    scale = state_kinds(motions.problem).scale(size)
    allowed = options.absolute + options.relative * scale
    relative = np.divide(difference, scale, out=np.zeros_like(scale), where=difference != 0.0)
    # with an error C h^p the two differ by (1 - 2^-p) of it
    error = np.where(relative > LAWLESS, relative, relative / (1.0 - 0.5**options.integrator.order))
    longest = float(np.abs(run.segments[0].steps.h[0]))
    said: list[list[str]] = [[] for _ in size]
    for k in np.flatnonzero(np.isfinite(size).all(axis=1)).tolist():  # of the motions that have an end
        if not np.isfinite(difference[k]).all():
            said[k].append(f"{text}the motion {other.stopped(k, other.segments[-1])}")
        elif off := off_by(error[k], scale[k], allowed[k], motions.problem.components):
            bound = f"rtol = {options.relative:g} allows less, and steps of {longest:.6g} s are too long for that"
            said[k].append(f"{off}; {bound}")
    return said
