"""Doubts: what speaks against motions that are differentiated: their steps, their momenta, and their losses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cgraph.extend import Array

from ..estimates.state_sizes import StateSizes
from ..row_values import missed_momenta
from ..steps.step_program import state_kinds
from .motion import Leg, MotionError
from .motion_run import MotionRun
from .segments import Legs

ROUNDING = 1e-10  # of the largest component of its kind: where one is that small, rounding is no error of it
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step
LOOKS = 64  # at least, if there are so many steps, at which two motions are compared
LOOSE = 1e-3  # a relative tolerance above it tells of a motion's growth no more than this
ASIDE = 1.0 + 2.0**-52  # by which the other motion starts aside: what a rounding grows to is part of the error


def doubts(
    legs: Legs, value: Any, gradients: Mapping[str, Any], slopes: tuple[Array, Array] | None = None
) -> list[list[str]]:
    """A sentence each, of every motion, which has an end.  value, gradients: of the loss.

    slopes: of the loss by the start of the motion and by its end.
    """
    many = legs.motion.many
    count = max(many, 1)
    said = [[*legs.motion.said] for _ in range(count)]
    for sentences in (_missed(legs), _half_steps(legs), [] if slopes is None else _grown(legs, *slopes)):
        for texts, more in zip(said, sentences, strict=False):  # no sentences: of no motion
            texts += more
    if all([_finite(number) for number in (value, *gradients.values())]):
        return said
    values = np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
    for k, texts in enumerate(said):
        if not np.isfinite(values[k]):
            texts.append(f"the loss is {values[k]} of a motion that is finite")
        else:
            bad = [name for name, each in gradients.items() if not _finite(each[..., k] if many else each)]
            texts += [f"the loss is {values[k]:.6g}, and its gradient by {name!r} is not finite" for name in bad]
    return said


def _finite(numbers: Any) -> bool:
    return math.isfinite(numbers) if isinstance(numbers, float) else bool(np.isfinite(numbers).all())


def _missed(legs: Legs) -> list[list[str]]:
    """Of the velocities of motions in momenta. Of accepted steps `accepted_steps` has said it."""
    motion, problem = legs.motion, legs.motion.problem
    if problem.missing is None or legs.events or not motion.legs[0].equal:
        return []
    (run,) = legs.runs
    inputs = len(problem.missing.inputs) - problem.size - 1
    held = np.concatenate([motion.force_at_end, motion.values])[:inputs]
    steps, rows = run.states()
    t = run.motion.t[steps]
    result = []
    for k in range(max(motion.many, 1)):
        start, x, each = (array[..., k] if motion.many else array for array in (motion.x, rows, held))
        result.append(missed_momenta(problem, t, x, each, start=(float(t[0]), start, x[0])))
    return result


def _grown(legs: Legs, start: Array, end: Array) -> list[list[str]]:
    """Of every motion: whether what steps leave at its start may change the loss by more than the motion's size does.

    start, end: slopes of the loss by the state there. Of a loss along the way alone, its value is compared.
    """
    motion, options = legs.motion, legs.motion.options
    left = min(options.relative, LOOSE) if motion.method.adaptive else ASIDE - 1.0
    with np.errstate(all="ignore"):
        change = left * (np.abs(start) * np.maximum(np.abs(motion.x), np.abs(legs.end))).sum(axis=0)
        slope, loss = np.abs(end), np.abs(legs.loss)
        if not (change > (slope * np.abs(legs.x)).sum(axis=0) + loss).any():  # the end is enough
            return []
        at_end = np.max([np.abs(run.states()[1]).max(axis=0) for run in legs.runs], axis=0)
        whole = (slope * at_end).sum(axis=0) + loss
        ratios = np.atleast_1d(np.where(whole > 0.0, change / whole, 0.0))
    what = f"rtol = {left:g}" if motion.method.adaptive else "rounding"
    text = (
        f"the motion is chaotic, or nearly so: by its end {what} at its start has grown to {{:.2g}} times its size, "
        "and the gradient is that of the numbers computed, not of the motion"
    )
    return [[text.format(ratio)] if ratio > 1.0 else [] for ratio in ratios.tolist()]


def _half_steps(legs: Legs) -> list[list[str]]:
    """Of equal steps, of every motion: by how much it is off, if by too much, beside one in steps of half the length.

    Half of a step has the force of the step. With an error C h^p the two differ by (1 - 2^-p) of it.
    """
    motion, options = legs.motion, legs.motion.options
    if not options.estimated:
        return []
    count = max(motion.many, 1)
    tau = np.repeat(motion.tau, 2, axis=0) if motion.each_step else motion.tau
    parts = tuple([_halved(leg, run) for leg, run in zip(motion.legs, legs.runs, strict=True)])
    beside = replace(motion, x=motion.x * ASIDE, legs=parts, tau=tau)
    try:
        every = [2 * (run.tape.checkpoints or max(1, len(run.motion.h) // LOOKS)) for run in legs.runs]
        other = Legs(beside, legs.programs, legs.events, every)
    except MotionError as stopped:
        return [[f"its error is unknown: in steps of half the length {stopped}"]]
    size, difference = np.zeros((2, count, motion.problem.size))
    for run, half in zip(legs.runs, other.runs, strict=True):
        (steps, rows), (halves, others) = run.states(), half.states()
        steps = 2 * steps
        steps[-1] = halves[-1]
        here, there = np.intersect1d(steps, halves, assume_unique=True, return_indices=True)[1:]
        rows, others = (x.reshape(*x.shape[:2], count) for x in (rows, others))
        size = np.maximum(size, np.abs(rows).max(axis=0).T)
        difference = np.maximum(difference, np.abs(others[there] - rows[here]).max(axis=0).T)
    (kinds, groups), lengths = state_kinds(motion.problem), [length or 1.0 for length in motion.problem.lengths]
    kinds = kinds if motion.problem.system is not None else (0,) * len(kinds)
    scale = size + ROUNDING * StateSizes(0.0, kinds, groups, 0.0, lengths).largest_of_kind(size)
    relative = np.divide(difference, scale, out=np.zeros_like(scale), where=difference != 0.0)
    error = np.where(relative > LAWLESS, relative, relative / (1.0 - 0.5**motion.method.order))
    beyond = ~(error * scale <= options.absolute + options.relative * scale)
    said: list[list[str]] = [[] for _ in range(count)]
    for k in np.flatnonzero(np.isfinite(size).all(axis=1)).tolist():  # of the motions that have an end
        if not np.isfinite(difference[k]).all():
            said[k].append(f"its error is unknown: in steps of half the length the motion {other.runs[-1].stopped(k)}")
        elif beyond[k].any():
            worst = int(np.argmax(np.where(beyond[k], error[k], -1.0)))
            off = f"{error[k, worst]:.2g} of the size of {motion.problem.components[worst]}"
            longest = float(np.abs(legs.runs[0].motion.h[0]))
            text = f"the state is off by an estimated {off}; rtol = {options.relative:g} allows less, "
            said[k].append(f"{text}and steps of {longest:.6g} s are too long for that")
    return said


def _halved(leg: Leg, run: MotionRun) -> Leg:
    """The same in equal steps of half the length, but for the last one, which an event cuts."""
    t, steps = run.motion.t, 2 * len(run.motion.h)
    if not leg.event:
        return Leg(np.append(t[0] + (leg.end - t[0]) / steps * np.arange(steps), leg.end), "", steps, leg.end)
    h = (leg.end - t[0]) / (2 * leg.equal)
    steps -= abs(t[-1] - t[-2]) <= abs(h)
    return Leg(np.append(t[0] + h * np.arange(steps), t[-1]), leg.event, 2 * leg.equal, leg.end)
