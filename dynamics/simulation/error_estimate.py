"""Error estimate of runs of equal steps: how far they are from runs beside them, of longer steps (Richardson).

With an error that is e = C h^p along the run, x(2h) - x(h) = (2^p - 1) e, and x(4h) - x(2h) is 2^p times as large; how
much larger it is tells the order that the run has. Of steps that are not all equal, 2^p is the ratio of the sums of
h^(p + 1).
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph import Graph
from cgraph._shared import Array, kept_by_first

from ..systems.arguments import TIME
from ..systems.evaluation import evaluation_of
from .run_options import Span, Steps
from .stepper import EqualStepper, Stepper
from .steps.dense_output import StepBlock
from .steps.equal_steps import (
    ALIKE,
    SAME_INSTANT,
    EqualSteps,
    Numbers,
    equal_steps,
    instants_of,
    longer_steps,
    sampled_numbers,
)
from .steps.row_values import values_of
from .steps.state_sizes import off_by
from .steps.step_program import StepProgram

APART_RATIO = 1.5  # the ratio of errors from which a difference of two runs tells them
LEAST_RATIO = 2.0  # times a difference that of steps twice as long is, at least, where the error has a law
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step
UNIT = 2.0**-52  # the last bit of a number near 1
ASIDE = 1.0 + 8.0 * UNIT  # times each component, runs beside start: what roundings grow to is part of the error
FOUR = 4  # steps, at whose ends those of all runs end
LOOKS = 1024  # instants at which runs are compared, at most
UNKNOWN = "the error is unknown"
TOGETHER = 512  # states that are looked at once
WAVES = ("sin", "cos", "tan")


class RunsBeside(NamedTuple):
    """Runs beside one of equal steps, the longest of which is so long [s], and how differences tell its error."""

    longest: float
    share: float  # of the first difference that is error, if the error is a power of the step
    ratio: float  # of the second difference to the first then; 1 without a second
    runs: list[tuple[list[EqualSteps], Numbers]]  # the steps of each, and how many are done when they are compared
    numbers: Numbers  # of its own steps that are done then, (T,)
    t: Array  # (T,)


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
        return RunsBeside(longest, one / (two - one), (four - two) / (two - one), runs, numbers, t)
    numbers, share = sampled_numbers(steps, 1, LOOKS), 1.0 / (1.0 - 0.5**order)
    half = [part._replace(h=0.5 * part.h, steps=2 * part.steps) for part in stretches]
    return RunsBeside(longest, share, 1.0, [(half, 2 * numbers)], numbers, instants_of(stretches, numbers))


@kept_by_first
def phases(rate: Graph) -> Graph | None:
    """Phases of waves in time, over the inputs of a rate; None if it has none."""
    rate = evaluation_of(rate).called
    timed = {node for node in rate.inputs if node.name == TIME}
    for node in rate.nodes:
        if not timed.isdisjoint(node.args):
            timed |= {node}
    found = dict.fromkeys(node.args[0] for node in rate.nodes if node.op.name in WAVES and node.args[0] in timed)
    return Graph(rate.inputs, {f"y{k}": node for k, node in enumerate(found)}) if found else None


class Watch:
    """How fast the waves in time turn along k runs side by side, from x (k, m) at t with parameters p (k, ..)."""

    def __init__(self, rate: Graph, p: Array, t: float, x: Array) -> None:
        self._graph = phases(rate)
        self.turning = np.zeros(len(x))  # of the fastest sines and cosines [rad/s]
        self._p, self._seen = p, [(np.array([t]), x[:, None])]

    def see(self, t: Array, x: Array) -> None:
        """The next states, (k, r, m), at times t (r,)."""
        if self._graph is not None:
            self._seen.append((t, x))
            if sum([len(times) for times, _ in self._seen]) > TOGETHER:
                self.look()

    def look(self) -> None:
        """Look at what has come."""
        if self._graph is None or len(self._seen) == 1:
            return
        t, x = np.concatenate([t for t, _ in self._seen]), np.concatenate([x for _, x in self._seen], axis=1)
        self._seen = [(t[-1:], x[:, -1:])]
        columns = [*np.moveaxis(x, -1, 0), t, *np.moveaxis(self._p[:, None], -1, 0)]
        speeds = np.abs(np.diff(values_of(self._graph, columns, *x.shape[:-1]))) / np.abs(np.diff(t))
        self.turning = np.maximum(self.turning, speeds.max(axis=(0, 2), initial=0.0))


def error_estimates(
    program: StepProgram, options: Steps, beside: RunsBeside, watch: Watch, steps: int, rows: Sequence[Array]
) -> dict[str, Array]:
    """Columns of the statistics of k runs of so many steps: "error", "error_at_end", "warnings" of too large ones.

    rows: states of the runs, and of those beside, (k, T, m) each; not finite where a run has stopped.
    """
    watch.look()
    apart = [other - one for one, other in itertools.pairwise(rows)]
    for each in apart:
        np.abs(each, out=each)
    scale = program.kinds.scale(np.maximum(rows[0].max(axis=1), -rows[0].min(axis=1)))
    peaks = [np.where(np.isfinite(peak), peak, math.inf) for peak in [each.max(axis=1) for each in apart]]
    since, warnings = np.full(len(scale), math.nan), np.empty(len(scale), dtype=np.object_)
    warnings.fill(())
    for k in np.flatnonzero(np.isinf(peaks[0]).any(axis=1)).tolist():
        since[k] = beside.t[np.argmin(np.isfinite(apart[0][k]).all(axis=1))]
    with np.errstate(all="ignore"):
        measured = peaks[-1] / peaks[0]
        shares = [np.where(each > 0.0, each / scale, 0.0) for each in (peaks[0], apart[0][:, -1])]
    largest, last = [np.maximum(UNIT * math.sqrt(steps), _errors(each, measured, beside)) for each in shares]
    largest = np.maximum(largest, last)  # where the law that holds for one does not for the other
    resolved = math.pi * max(1.0, 0.5 * program.order) / beside.longest  # rad/s: two evaluations in a turn
    unknown = (watch.turning > resolved) | ~np.isnan(since)
    largest[unknown] = last[unknown] = math.inf
    allowed = options.absolute + options.relative * scale
    for k in np.flatnonzero(~(largest * scale <= allowed).all(axis=1)).tolist():
        how = f"a dt shorter than {options.step:g} s, or method='dop853', which chooses its steps"
        how = f"; rtol = {options.relative:g} allows less: take {how}"
        if watch.turning[k] > resolved:
            said = f"{UNKNOWN}: a sine or cosine of the equations turns at {watch.turning[k]:.3g} rad/s, and steps of "
            said += f"{beside.longest:.3g} s by method {options.method!r} resolve {resolved:.3g} rad/s"
        elif not math.isnan(since[k]):
            said = f"{UNKNOWN}: beside it a run of other steps stops at t = {since[k]:.6g} s"
        else:
            said = off_by(largest[k], scale[k], allowed[k], program.components)
        warnings[k] = (f"{said}{how}",)
    return {"error": largest.max(axis=1), "error_at_end": last.max(axis=1), "warnings": warnings}


def _errors(first: Array, measured: Array, beside: RunsBeside) -> Array:
    """Errors of components, (k, m), from the first difference and how much the second is larger: the order it has."""
    if beside.ratio == 1.0:
        return first * beside.share
    least = min(LEAST_RATIO, beside.ratio)
    clipped = np.where(np.isfinite(measured), np.clip(measured, least, beside.ratio), least)
    by_law = first * beside.share * (beside.ratio - 1.0) / (clipped - 1.0)
    return np.where(first <= LAWLESS, by_law, first)


class _Rows:
    """States (T, m) of a run that starts with x, at instants t (T,) after t0, with steps of at least `shortest` [s]."""

    def __init__(self, t: Array, x: Array, shortest: float, t0: float = 0.0) -> None:
        self.x, self._forth, self._t0 = np.full((len(t), len(x)), math.nan), np.sign(t[-1] - t[0]), t0
        self.x[0], self.count = x, 1  # of the instants that it has come to
        near = SAME_INSTANT * np.spacing(np.abs(t + t0).max()) + ALIKE * np.abs(np.diff(t)).min()
        self._times = self._forth * t - min(near, 0.5 * shortest)  # for those at which steps end

    def keep(self, block: StepBlock) -> None:
        """The next steps."""
        ends = self._forth * (block.t - self._t0)
        here = slice(self.count, int(np.searchsorted(self._times, ends[-1], side="right")))
        self.x[here] = block.x[np.searchsorted(ends, self._times[here])]
        self.count = max(self.count, here.stop)


class RunEstimate:
    """Estimate of the error of a run from its blocks as they come, if it is to be estimated."""

    def __init__(self, run: Stepper, x: Array, span: Span) -> None:
        self._run, self._x, self._span, self.seconds = run, x, span, 0.0  # spent here
        self._rows: _Rows | None = None
        resetting = run.events is not None and any([event.reset is not None for event in run.events.events])
        if isinstance(run, EqualStepper) and run.options.estimated and run.control is None and not resetting:
            begin = time.perf_counter()
            t0 = 0.0
            if not run.program.timed:  # the clock, which rounds, is no part
                t0, times = span.t0, None if span.times is None else span.times - span.t0
                self._span = Span(span.t_end - t0, t_eval=times)
            self._beside = runs_beside(equal_steps(self._span.instants, run.options.step), run.program.order)
            self._shortest = 0.5 * self._beside.longest
            self._rows = _Rows(self._beside.t, x, self._shortest, t0)
            self._watch = Watch(run.program.rate, np.array([run.parameters]), span.t0, x[None])
            self.seconds = time.perf_counter() - begin

    def note(self, block: StepBlock) -> None:
        """The next steps of the run."""
        if self._rows is not None and len(block.t):
            begin = time.perf_counter()
            self._rows.keep(block)
            self._watch.see(block.t, block.x[None])
            self.seconds += time.perf_counter() - begin

    def result(self) -> tuple[float | None, float | None, tuple[str, ...]]:
        """After the last step: the largest error and that at the end, None if not estimated, and a warning of it."""
        if self._rows is None or self._rows.count == 1:
            return None, None, ()
        begin, run, beside, count = time.perf_counter(), self._run, self._beside, self._rows.count
        assert isinstance(run, EqualStepper)
        rows = [self._rows.x[None, :count]]
        for stretches, _ in beside.runs:
            other = _Rows(beside.t[:count], self._x, self._shortest)
            for block in run.beside(stretches).blocks(self._x * ASIDE, self._span):
                other.keep(block)
                if other.count == count:
                    break
            rows.append(other.x[None])
        columns = error_estimates(run.program, run.options, beside, self._watch, run.steps, rows)
        error, last, said = [column[0] for column in columns.values()]
        self.seconds += time.perf_counter() - begin
        return float(error), float(last), said
