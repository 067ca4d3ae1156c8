"""Error estimate of runs of equal steps: how far they are from runs beside them, of longer steps (Richardson).

With an error that is e = C h^p along the run, x(2h) - x(h) = (2^p - 1) e, and x(4h) - x(2h) is 2^p times as large; how
much larger it is tells the order that the run has. Of steps that are not all equal, 2^p is the ratio of the sums of
h^(p + 1). Across a jump or a kink of the rate these runs may be off alike, and what a step can miss there is the least
that is said. This is the error of the state, phase included, not that of the energy.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ..run_options import Span, Steps
from ..stepper import EqualStepper, Stepper
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import (
    SAME_INSTANT,
    EqualSteps,
    Numbers,
    equal_steps,
    instants_of,
    longer_steps,
    sampled_numbers,
)
from ..steps.state_sizes import Flags, off_by
from ..steps.step_program import StepProgram
from .unresolved import Watch

APART_RATIO = 1.5  # the ratio of errors from which a difference of two runs tells them
LEAST_RATIO = 2.0  # times a difference that of steps twice as long is, at least, where the error has a law
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step
UNIT = 2.0**-52  # the last bit of a number near 1
ASIDE = 1.0 + 8.0 * UNIT  # times each component, runs beside start: what roundings grow to is part of the error
FOUR = 4  # steps, at whose ends those of all runs end
LOOKS = 1024  # instants at which runs are compared, at most
LATE, SHARE = 2.0, 0.1  # steps, or of the time between resets: runs parted for longer take other courses
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
    numbers = sampled_numbers(steps, FOUR, LOOKS)
    t = instants_of(stretches, numbers)
    runs = [longer_steps(t, numbers, times) for times in (2, 4)]
    one, two, four = [
        sum([part.steps * (abs(part.h) / longest) ** (order + 1) for part in each])
        for each in (stretches, runs[0][0], runs[1][0])
    ]
    if two >= APART_RATIO * one and four - two >= APART_RATIO * (two - one):
        return RunsBeside(Law(longest, one / (two - one), (four - two) / (two - one)), runs, numbers, t)
    half = [part._replace(h=0.5 * part.h, steps=2 * part.steps) for part in stretches]
    numbers = sampled_numbers(steps, 1, LOOKS)
    return RunsBeside(law_of_halves(longest, order), [(half, 2 * numbers)], numbers, instants_of(stretches, numbers))


class Comparison(NamedTuple):
    """States of k runs, and of those beside them, at instants t (T,).

    rows: (k, T, m) each, not finite where a run has stopped.  alike: of each and the next, which rows can be compared;
    all by default.  lost: when one takes another course.
    """

    t: Array
    rows: Sequence[Array]
    alike: Sequence[Flags] = ()
    lost: float = math.nan


def error_estimates(
    program: StepProgram, options: Steps, law: Law, watch: Watch, steps: int, compared: Comparison
) -> dict[str, Array]:
    """Columns of the statistics of k runs of so many steps: "error", "error_at_end", "warnings" of too large ones.

    The errors are relative to the sizes of components, NaN if nothing was compared, and infinite if unknown.
    """
    t, rows, alike, lost = compared
    many, warnings = len(rows[0]), np.zeros(len(rows[0]), dtype=np.object_)
    warnings.fill(())
    if len(rows) == 1:
        return {"error": np.full(many, math.nan), "error_at_end": np.full(many, math.nan), "warnings": warnings}
    watch.look()
    between = [other - one for one, other in itertools.pairwise(rows)]
    for k, each in enumerate(between):
        np.abs(each, out=each)
        if alike:
            each[:, ~alike[k]] = 0.0
    at_end = int(np.flatnonzero(alike[0])[-1]) if alike else -1
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


class RunEstimate:
    """Estimate of a run's error from its blocks as they come; of a run whose error is not estimated it forgets them."""

    def __init__(self, run: Stepper, x: Array, span: Span) -> None:
        self._run, self._x, self._span, self._options = run, x, span, run.options
        self._compared: _Whole | None = None
        self.seconds = 0.0  # spent here

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if not self._options.estimated or self._run.control is not None or not len(block.t):
            return
        begin, run = time.perf_counter(), self._run
        assert isinstance(run, EqualStepper)
        if self._compared is None:
            p, program = np.array([run.parameters]), run.program
            self._watch = Watch(program.rate, program.order, p, self._span.t0, self._x[None])
            self._compared = _Whole(run, self._x, self._span)
        if block.h[0] == 0.0:
            self._watch.restart(float(block.t[0]), block.x)
        else:
            self._compared.add(block)
            self._watch.add(block.t, block.x[None])
        self.seconds += time.perf_counter() - begin

    def result(self) -> tuple[float | None, float | None, tuple[str, ...]]:
        """After the last step: the largest error and that at the end, None if unknown, and what to say of them."""
        if self._compared is None:
            return None, None, ()
        begin, program = time.perf_counter(), self._run.program
        law, compared = self._compared.comparison(self._run.largest, program.order)
        columns = error_estimates(program, self._options, law, self._watch, self._run.steps, compared)
        error, last, said = [column[0] for column in columns.values()]
        self.seconds += time.perf_counter() - begin
        return (None, None, ()) if math.isnan(error) else (float(error), float(last), said)


class _Rows:
    """States (T, m) of a run that starts with x, at instants t (T,), and how many resets it has had.

    count: of the instants that it has come to; beyond the states are NaN.
    """

    def __init__(self, t: Array, x: Array) -> None:
        self.t, self.x, self.resets, self.count = t, np.full((len(t), len(x)), math.nan), np.zeros(len(t)), 1
        self.x[0], self._forth = x, np.sign(t[-1] - t[0])
        self._times = self._forth * t - SAME_INSTANT * np.spacing(np.abs(t).max())  # for those at which steps end

    def add(self, block: StepBlock, resets: int) -> None:
        """The next steps, before which it had so many resets."""
        ends = self._forth * block.t
        here = slice(self.count, int(np.searchsorted(self._times, ends[-1], side="right")))
        if block.dense is None:
            self.x[here] = block.x[np.searchsorted(ends, self._times[here])]
        else:
            self.x[here] = block.at(self._forth * np.minimum(self._forth * self.t[here], ends[-1]))
        self.resets[here], self.count = resets, max(self.count, here.stop)


class _Whole:
    """A run and runs beside it that go all the way, at instants at which steps of all end.

    Runs with resets have these at other times, and are compared by their dense output where both have had as many.
    """

    def __init__(self, run: EqualStepper, x: Array, span: Span) -> None:
        self._run, self._x, self._span, stretches = run, x, span, equal_steps(span.instants, run.options.step)
        self._resetting = run.log is not None and run.log.resetting
        if self._resetting:
            stretches = equal_steps([span.t0, span.t_end], max([abs(part.h) for part in stretches]))
        self._beside = runs_beside(stretches, run.program.order)
        self._rows = _Rows(self._beside.t, x)

    def add(self, block: StepBlock) -> None:
        """The next steps of the run."""
        self._rows.add(block, self._run.resets)

    def comparison(self, longest: float, order: int) -> tuple[Law, Comparison]:
        """What the runs beside tell, after the last step."""
        one, law = self._rows, self._beside.law
        t = one.t[: one.count]
        rows, alike = [one.x[None, : len(t)]], list[Flags]()
        for stretches, _ in self._beside.runs if len(t) > 1 else ():
            dt = max([abs(part.h) for part in stretches])
            run = self._run.beside(dt, () if self._resetting else stretches)
            other = _Rows(t, self._x)
            for block in run.blocks(self._x * ASIDE, Span(self._span.t_end, t0=self._span.t0)):
                if block.h[0] != 0.0:
                    other.add(block, run.resets)
                if other.count == len(t):
                    break
            if run.event:  # which has ended it before the other
                other.resets[other.count :] = math.inf
            rows.append(other.x[None])
            alike.append(one.resets[: len(t)] == other.resets)
            one = other
        lost = _parting_time(t, alike[0], law.longest, self._run.resets) if alike else math.nan
        return law, Comparison(t, rows, alike, lost)


def _parting_time(t: Array, alike: Flags, longest: float, resets: int) -> float:
    """When runs with so many resets have other ones for longer than their steps explain; NaN if they have not."""
    begins, ends = np.flatnonzero(np.diff(~alike, prepend=False, append=False)).reshape(-1, 2).T
    late = max(LATE * longest, SHARE * abs(t[-1] - t[0]) / (1 + resets))
    apart = np.flatnonzero((np.abs(t[ends - 1] - t[begins]) > late) | (2 * alike.sum() < len(t)))
    return float(t[begins[apart[0]]]) if len(apart) else math.nan
