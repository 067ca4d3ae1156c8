"""Error estimate of runs of equal steps: how far they are from runs beside them, of longer steps (Richardson).

With an error that is e = C h^p along the run, x(2h) - x(h) = (2^p - 1) e, and x(4h) - x(2h) is 2^p times as large; how
much larger it is tells the order that the run has. Of steps that are not all equal, 2^p is the ratio of the sums of
h^(p + 1). Across a jump or a kink of the rate these runs may be off alike, and what a step can miss there is the least
that is said. This is the error of the state, phase included, not that of the energy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..run_options import RunOptions
from ..steps.equal_steps import EqualSteps, Numbers, halved, instants_of, longer, some_of
from ..steps.step_program import StepProgram
from .state_sizes import Flags, off_by
from .unresolved import Watch

APART_RATIO = 1.5  # the ratio of errors from which a difference of two runs tells them
LEAST_RATIO = 2.0  # times a difference that of steps twice as long is, at least, where the error has a law
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step
UNIT = 2.0**-52  # the last bit of a number near 1
ASIDE = 1.0 + 8.0 * UNIT  # times each component, runs beside start: what roundings grow to is part of the error
FOUR = 4  # steps, at whose ends those of all runs end
LOOKS = 1024  # instants at which runs are compared, at most
UNKNOWN = "the error is unknown"


class Law(NamedTuple):
    """How differences tell the error of a run whose longest step is so long [s].

    share: of the first difference, that is error, if the error is a power of the step.  ratio: of the second difference
    to the first then.
    """

    longest: float
    share: float
    ratio: float = 1.0


def law_of_halves(longest: float, order: int) -> Law:
    """The law if the run beside has steps of half the length."""
    return Law(longest, 1.0 / (1.0 - 0.5**order))


class RunsBeside(NamedTuple):
    """Runs beside one of equal steps, which is looked at after so many of its steps, at instants t, (T,) each.

    runs: the steps of each, and how many are done then.
    """

    law: Law
    runs: list[tuple[list[EqualSteps], Numbers]]
    numbers: Numbers
    t: Array


def runs_beside(stretches: Sequence[EqualSteps], order: int) -> RunsBeside:
    """Runs of steps twice and four times as long; if there are too few of them, one of steps half as long."""
    steps, longest = sum([part.steps for part in stretches]), max([abs(part.h) for part in stretches])
    numbers = some_of(steps, FOUR, LOOKS)
    t = instants_of(stretches, numbers)
    runs = [longer(t, numbers, times) for times in (2, 4)]
    one, two, four = [
        sum([part.steps * (abs(part.h) / longest) ** (order + 1) for part in each])
        for each in (stretches, runs[0][0], runs[1][0])
    ]
    if two >= APART_RATIO * one and four - two >= APART_RATIO * (two - one):
        return RunsBeside(Law(longest, one / (two - one), (four - two) / (two - one)), runs, numbers, t)
    numbers = some_of(steps, 1, LOOKS)
    half = [(halved(stretches), 2 * numbers)]
    return RunsBeside(law_of_halves(longest, order), half, numbers, instants_of(stretches, numbers))


def error_estimates(
    program: StepProgram,
    options: RunOptions,
    law: Law,
    watch: Watch,
    steps: int,
    t: Array,
    rows: Sequence[Array],
    alike: Sequence[Flags] = (),
    lost: float = math.nan,
) -> dict[str, Array]:
    """Columns of the statistics of k runs of so many steps: "error", "error_at_end", "warnings" of too large ones.

    The errors are relative to the sizes of components, NaN if nothing was compared, and infinite if unknown.

    t: instants (T,).  rows: states (k, T, m) of the runs and of those beside, not finite where one has stopped.
    alike: of each run and the next, which rows can be compared; all by default.  lost: when one takes another course.
    """
    between = [other - one for one, other in itertools.pairwise(rows)]
    for k, each in enumerate(between):
        np.abs(each, out=each)
        if alike:
            each[:, ~alike[k]] = 0.0
    many, at_end = len(rows[0]), int(np.flatnonzero(alike[0])[-1]) if alike else -1
    warnings: Array = np.zeros(many, dtype=np.object_)
    warnings.fill(())
    if not between:
        return {"error": np.full(many, math.nan), "error_at_end": np.full(many, math.nan), "warnings": warnings}
    watch.look()
    scale = program.kinds.scale(np.maximum(rows[0].max(axis=1), -rows[0].min(axis=1)))
    peaks = [np.where(np.isfinite(peak), peak, math.inf) for peak in [each.max(axis=1) for each in between]]
    since = np.full(many, lost)
    for k in np.flatnonzero(np.isinf(peaks[0]).any(axis=1)).tolist():
        since[k] = t[np.argmin(np.isfinite(between[0][k]).all(axis=1))]
    with np.errstate(all="ignore"):
        measured = peaks[-1] / peaks[0]
        shares = [np.where(each > 0.0, each / scale, 0.0) for each in (peaks[0], between[0][:, at_end], watch.missed)]
    least = np.maximum(shares[2], UNIT * math.sqrt(steps))
    largest, last = [np.maximum(least, _errors(each, measured, law, watch.bent)) for each in shares[:2]]
    largest = np.maximum(largest, last)  # where the law that holds for one does not for the other
    resolved = math.pi * max(1.0, 0.5 * program.order) / law.longest  # rad/s: two evaluations in a turn
    for unseen in (watch.turning > resolved, ~np.isnan(since)):
        largest[unseen] = last[unseen] = math.inf
    allowed = options.absolute + options.relative * scale
    for k in np.flatnonzero(~(largest * scale <= allowed).all(axis=1)).tolist():
        if watch.turning[k] > resolved:
            said = (
                f"{UNKNOWN}: a sine or cosine of the equations turns at {watch.turning[k]:.3g} rad/s, and steps of "
                f"{law.longest:.3g} s by method {options.method!r} resolve {resolved:.3g} rad/s"
            )
        elif not math.isnan(since[k]):
            at = f"t = {since[k]:.6g} s"
            said = f"{UNKNOWN}: beside it a run of other steps stops, or takes another course, at {at}"
        else:
            said = off_by(largest[k], scale[k], allowed[k], program.components)
        how = f"a dt shorter than {options.step:g} s, or method='dop853', which chooses its steps"
        warnings[k] = (f"{said}; rtol = {options.relative:g} allows less: take {how}",)
    return {"error": largest.max(axis=1), "error_at_end": last.max(axis=1), "warnings": warnings}


def _errors(first: Array, measured: Array, law: Law, bent: Flags) -> Array:
    """Errors of components, (k, m), from the first difference and by how much the second is larger.

    The law of the method holds if these have the ratio that goes with it, and that of another order if it is lower.
    Across a kink it depends on where in a step that is: no ratio tells.
    """
    if law.ratio == 1.0:
        return first * law.share
    least = min(LEAST_RATIO, law.ratio)
    clipped = np.where(np.isfinite(measured), np.clip(measured, least, law.ratio), least)
    by_law = first * law.share * (law.ratio - 1.0) / (clipped - 1.0)
    return np.where((first <= LAWLESS) & ~bent[:, None], by_law, first)
