"""Error estimate of a run of equal steps: its difference from a second run, of steps twice as long (Richardson).

With an error that is e = C h^p along the run, x(2h) - x(h) = (2^p - 1) e; of steps that are not all equal, 2^p is the
ratio of the sums of h^(p + 1). This is the error of the state, phase included, not that of the energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from .dense_output import Indices
from .equal_steps import SAME, EqualSteps
from .run_options import RunOptions
from .state_sizes import StateSizes
from .step_program import CompiledSteps, StepProgram
from .stepping import FixedStepIntegration

ENOUGH = 1.5  # times the longest of the steps that make up one of the second run
APART = 1.5  # the ratio of errors from which a difference of two runs tells them
ROUNDING = 1e-10  # of the largest component of its kind: where one is that small, rounding is no error of it
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step


class SecondRun(NamedTuple):
    """The steps of a second run, and by how much its error is larger than that of the first, or smaller."""

    stretches: list[EqualSteps]
    ratio: float


def second_run(stretches: Sequence[EqualSteps], order: int, *, shorter: bool = False) -> SecondRun:
    """Steps of about twice the length; where there are too few for that, of half.

    shorter: of half, for every stretch has to end where it does.
    """
    if not shorter:
        first = sum(part.steps * abs(part.h) ** (order + 1) for part in stretches)
        longer = _merged(_doubled(stretches))
        ratio = sum(part.steps * abs(part.h) ** (order + 1) for part in longer) / first
        if ratio >= APART:
            return SecondRun(longer, ratio)
    halves = [part._replace(h=0.5 * part.h, steps=2 * part.steps) for part in stretches]
    return SecondRun(halves, 0.5**order)


def _doubled(stretches: Sequence[EqualSteps]) -> Iterable[EqualSteps]:
    """Two steps become one; of shorter ones between close instants, as many as it takes."""
    at = begin = stretches[0].begin
    longest = 0.0  # of the steps since `begin`, which are not one yet
    for part in stretches:
        done = 0
        while done < part.steps:
            pairs = (part.steps - done) // 2 if at == begin else 0
            done += 2 * pairs or 1
            at = part.end if done == part.steps else part.begin + done * part.h
            longest = max(longest, abs(part.h))
            if pairs:
                yield EqualSteps(begin, 2.0 * part.h, pairs, at)
            elif abs(at - begin) >= ENOUGH * longest:
                yield EqualSteps(begin, at - begin, 1, at)
            else:
                continue
            begin, longest = at, 0.0
    if at != begin:
        yield EqualSteps(begin, at - begin, 1, at)


def _merged(stretches: Iterable[EqualSteps]) -> list[EqualSteps]:
    """Stretches of the same step, but for rounding of the times, as one."""
    result: list[EqualSteps] = []
    for part in stretches:
        if result and abs(part.h - result[-1].h) <= SAME * np.spacing(max(abs(part.begin), abs(part.end))):
            before = result.pop()
            steps = before.steps + part.steps
            part = EqualSteps(before.begin, (part.end - before.begin) / steps, steps, part.end)
        result.append(part)
    return result


def matches(times: Array, others: Array) -> tuple[Indices, Indices]:
    """Where two courses of time have the same instants but for rounding: indices into both. Both go the same way."""
    direction = 1.0 if len(times) < 2 or times[-1] > times[0] else -1.0
    near = np.searchsorted(direction * times, direction * others)
    near = np.clip(near, 0, len(times) - 1)
    before = np.maximum(near - 1, 0)
    near = np.where(np.abs(times[before] - others) < np.abs(times[near] - others), before, near)
    same = np.flatnonzero(np.abs(times[near] - others) <= SAME * np.spacing(np.abs(others)))
    return near[same], same


class Differences:
    """Between the rows of k runs and their second runs, by component, as the second runs go on."""

    def __init__(self, rows: Array, program: StepProgram) -> None:
        """rows: (k, T, m) of the first runs."""
        kinds = [0] * program.size if program.ordinary else program.kinds
        self._kinds = StateSizes(0.0, kinds, program.groups, 0.0, program.lengths)
        self.size = np.abs(rows).max(axis=1, initial=0.0)  # (k, m) of each component over the run
        self.largest, self.last = np.zeros_like(self.size), np.zeros_like(self.size)
        self.compared = 0  # instants

    def seen(self, states: Array) -> None:
        """States (k, r, m) that the second runs passed through between the rows: they tell the size."""
        if states.shape[1]:
            size = np.abs(states).max(axis=1)
            self.size = np.where(np.isfinite(size), np.maximum(self.size, size), self.size)

    def add(self, rows: Array, others: Array) -> None:
        """The same instants of both, (k, r, m)."""
        if rows.shape[1]:
            self.compared += rows.shape[1]
            change = others - rows
            np.abs(change, out=change)
            self.last = _or_infinite(change[:, -1])
            self.largest = np.maximum(self.largest, _or_infinite(change.max(axis=1)))

    @property
    def scale(self) -> Array:
        """What an error of each component is measured by, (k, m)."""
        scale: Array = self.size + ROUNDING * self._kinds.largest_of_kind(self.size)
        return scale

    def errors(self, ratio: float) -> tuple[Array, Array]:
        """Of each component, relative to its size: the largest and the last, (k, m) both."""
        scale = self.scale
        largest, last = (np.where(change > 0.0, change / scale, 0.0) for change in (self.largest, self.last))
        return _by_law(largest, ratio), _by_law(last, ratio)


def _or_infinite(change: Array) -> Array:
    """The same, infinite in place of NaN."""
    return np.where(np.isnan(change), math.inf, change)


def _by_law(change: Array, ratio: float) -> Array:
    errors: Array = np.where(change > LAWLESS, change, change / abs(ratio - 1.0))
    return errors


class ErrorEstimate(NamedTuple):
    """Of one run: the largest error and that at the end, relative to the sizes of components."""

    largest: float
    last: float
    warning: str  # where more was asked for


def estimates(
    differences: Differences, ratio: float, components: Sequence[str], options: RunOptions
) -> list[ErrorEstimate]:
    """Of each run, whether it is as good as it was asked to be; NaN where nothing could be compared."""
    if not differences.compared:
        return [ErrorEstimate(math.nan, math.nan, "")] * len(differences.size)
    largest, last = differences.errors(ratio)
    scale = differences.scale
    beyond = ~(largest * scale <= options.absolute + options.relative * scale)
    result = []
    for k in range(len(scale)):
        warning = ""
        if beyond[k].any():
            worst = int(np.argmax(np.where(beyond[k], largest[k], -1.0)))
            off = f"{largest[k, worst]:.2g} of the size of {components[worst]}"
            warning = _sentence(f"the state is off by an estimated {off}", options)
        result.append(ErrorEstimate(float(largest[k].max()), float(last[k].max()), warning))
    return result


def unknown(status: str, options: RunOptions) -> ErrorEstimate:
    """Of a run whose second run did not get through."""
    what = f"with steps of another length the run {status}: its error is unknown"
    return ErrorEstimate(math.inf, math.inf, _sentence(what, options))


def _sentence(what: str, options: RunOptions) -> str:
    return (
        f"{what}; rtol = {options.relative:g} allows less: take a dt shorter than {options.step:g} s, or "
        "method='dop853', which chooses its steps"
    )


def estimate(
    run: FixedStepIntegration,
    x: Array,
    times: Array,
    states: Array,
    report: Callable[[float], None] = lambda t: None,
    stopped: Callable[[], bool] = lambda: False,
) -> ErrorEstimate:
    """Of a run from x that came to these states.

    report: is told the time [s] that the second run has come to.  stopped: see NativeIntegration.
    """
    options, program = run.options, run.program
    control = None if run.control is None else run.control.replay()
    second, ratio = second_run(run.stretches, program.order, shorter=control is not None)
    compiled = CompiledSteps(program, run.runner)
    other = FixedStepIntegration(compiled, options, run.parameters, stopped, control, every_step=True, stretches=second)
    differences = Differences(states[None], program)
    for block in other.blocks(x):
        beyond = options.direction * (block.t - times[-1]) > 0.0
        rows, same = matches(times, block.t)
        if len(same) < len(block.t):
            differences.seen(block.x[None, ~beyond])
        differences.add(states[None, rows], block.x[None, same])
        report(float(block.t[-1]))
        if beyond.any():
            break
    if other.status:
        return unknown(other.status, options)
    return estimates(differences, ratio, run.components, options)[0]
