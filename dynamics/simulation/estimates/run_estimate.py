"""RunEstimate: the estimated error of one run, from its blocks as they come and runs beside it."""

from __future__ import annotations

import math
import time

import numpy as np

from cgraph._shared import Array

from ..run_options import RunOptions
from ..stepper import EqualStepper, Stepper
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import SAME_INSTANT, EqualSteps, equal_steps
from ..steps.state_sizes import Flags
from .error_estimate import ASIDE, error_estimates, law_of_halves, runs_beside
from .unresolved import Watch

LATE, SHARE = 2.0, 0.1  # steps, or of the time between resets: runs parted for longer take other courses


class RunEstimate:
    """Estimate of a run's error from its blocks as they come; of a run whose error is not estimated it forgets them."""

    def __init__(self, run: Stepper, x: Array, options: RunOptions) -> None:
        self._run, self._x, self._options = run, x, options
        self._compared: _Whole | _Periods | None = None
        self.seconds = 0.0  # spent here

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if not self._options.estimated or not len(block.t):
            return
        begin = time.perf_counter()
        if self._compared is None:
            assert isinstance(self._run, EqualStepper)
            kind = _Whole if self._run.control is None else _Periods
            self._compared = kind(self._run, self._x, self._options)
        self._compared.add(block)
        self.seconds += time.perf_counter() - begin

    def result(self) -> tuple[float | None, float | None, tuple[str, ...]]:
        """After the last step: the largest error and that at the end, None if unknown, and what to say of them."""
        if self._compared is None:
            return None, None, ()
        begin = time.perf_counter()
        error, last, said = [column[0] for column in self._compared.columns().values()]
        self.seconds += time.perf_counter() - begin
        return (None, None, ()) if math.isnan(error) else (float(error), float(last), said)


def _watch(run: EqualStepper, t0: float, x: Array) -> Watch:
    return Watch(run.program.rate, run.program.order, np.array([run.parameters]), t0, x[None])


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

    def __init__(self, run: EqualStepper, x: Array, options: RunOptions) -> None:
        stretches = equal_steps(options.instants, options.step)
        self._resets = run.log is not None and any([event.reset for event in run.log.program.events])
        if self._resets:
            stretches = equal_steps([options.t0, options.t_end], max([abs(part.h) for part in stretches]))
        self._run, self._x, self._options = run, x, options
        self._beside, self._watch = runs_beside(stretches, run.program.order), _watch(run, options.t0, x)
        self._rows = _Rows(self._beside.t, x)

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if block.h[0] == 0.0:
            self._watch.restart(float(block.t[0]), block.x)
        else:
            self._watch.add(block.t, block.x[None])
            self._rows.add(block, self._run.resets)

    def columns(self) -> dict[str, Array]:
        """The estimates, after the last step."""
        first, one = self._run, self._rows
        t = one.t[: one.count]
        rows, alike = [one.x[None, : len(t)]], list[Flags]()
        for stretches, _ in self._beside.runs if len(t) > 1 else ():
            longest = max([abs(part.h) for part in stretches])
            run = first.again(longest) if self._resets else first.beside(stretches, first.parameters)
            other = _Rows(t, self._x)
            for block in run.blocks(self._x * ASIDE):
                if block.h[0] != 0.0:
                    other.add(block, run.resets)
                if other.count == len(t):
                    break
            if run.event:  # which has ended it before the other
                other.resets[other.count :] = math.inf
            rows.append(other.x[None])
            alike.append(one.resets[: len(t)] == other.resets)
            one = other
        lost = _parted(t, alike[0], self._beside.law.longest, self._run.resets) if alike else math.nan
        what = first.program, self._options, self._beside.law, self._watch, self._run.steps
        return error_estimates(*what, t, rows, alike, lost)


def _parted(t: Array, alike: Flags, longest: float, resets: int) -> float:
    """When runs with so many resets have other ones for longer than their steps explain; NaN if they have not."""
    begins, ends = np.flatnonzero(np.diff(~alike, prepend=False, append=False)).reshape(-1, 2).T
    late = max(LATE * longest, SHARE * abs(t[-1] - t[0]) / (1 + resets))
    apart = np.flatnonzero((np.abs(t[ends - 1] - t[begins]) > late) | (2 * alike.sum() < len(t)))
    return float(t[begins[apart[0]]]) if len(apart) else math.nan


class _Periods:
    """Differences of a run's stretches of steps under the same forces of a controller, each compared by itself.

    These forces answer the states of the run, and would be others beside it: from where the run is, steps of half the
    length are made under the same. The differences add up.
    """

    def __init__(self, run: EqualStepper, x: Array, options: RunOptions) -> None:
        self._run, self._options = run, options
        self._watch, self._stretch = _watch(run, options.t0, x), run.stretch
        self._start = self._end = x
        self._size, self._sum, self._t, self._steps, self._since = np.abs(x), np.zeros(len(x)), options.t0, 0, math.inf

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if block.h[0] == 0.0:
            self._watch.restart(float(block.t[0]), block.x)
            return
        if not self._steps or self._run.stretch is not self._stretch:
            self._compare()
            self._stretch, self._forces = self._run.stretch, self._run.parameters
            self._start, self._steps = block.x_old[0], 0
            self._watch.restart(float(block.t_old[0]), block.x_old[:1], np.array([self._forces]))
        self._watch.add(block.t, block.x[None])
        self._size = np.maximum(self._size, np.abs(block.x).max(axis=0))
        self._steps, self._t, self._end = self._steps + len(block.t), float(block.t[-1]), block.x[-1]

    def _compare(self) -> None:
        """Add the difference of the stretch, as far as it went."""
        if not self._steps:
            return
        begin, steps = self._stretch.begin, 2 * self._steps
        run = self._run.beside([EqualSteps(begin, (self._t - begin) / steps, steps, self._t)], self._forces)
        end = self._start
        for block in run.blocks(self._start):
            end = block.x[-1]
        self._sum = self._sum + (math.nan if run.status else np.abs(end - self._end))
        if not np.isfinite(self._sum).all():
            self._since = min(self._since, self._t)

    def columns(self) -> dict[str, Array]:
        """The estimates, after the last step."""
        self._compare()
        program, size = self._run.program, np.array([[self._size] * 2])
        rows, t = [size, size + [np.zeros(len(self._sum)), self._sum]], np.array([self._options.t0, self._since])
        law = law_of_halves(self._run.largest, program.order)
        return error_estimates(program, self._options, law, self._watch, self._run.steps, t, rows)
