"""RunEstimate: the estimated error of one run, from its blocks as they come and runs beside it."""

from __future__ import annotations

import itertools
import math
import time
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from cgraph._shared import Array

from ..run_options import RunOptions
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps, Numbers, equal_steps
from ..steps.stepping import FixedStepIntegration, Integration
from .error_estimate import (
    ASIDE,
    LOOKS,
    Changes,
    Law,
    changes,
    error_estimates,
    law_of_halves,
    runs_beside,
)
from .unresolved import Watch

if TYPE_CHECKING:
    from ..events.event_log import WatchedIntegration

LATE, SHARE = 2.0, 0.1  # steps, or of the time since the last reset: a run so much later resets takes another course


class RunEstimate:
    """Estimate of a run's error from its blocks as they come; of a run whose error is not estimated it forgets them."""

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        self._run, self._x, self._options = run, x, options
        self._compared: _Compared | None = None
        self.seconds = 0.0  # spent here

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if not self._options.estimated or not len(block.t):
            return
        begin = time.perf_counter()
        if self._compared is None:
            self._compared = _kind(self._run)(self._run, self._x, self._options)
        self._compared.add(block)
        self.seconds += time.perf_counter() - begin

    def result(self) -> tuple[float | None, float | None, tuple[str, ...]]:
        """After the last step: the largest error and that at the end, None if unknown, and what to say of them."""
        if self._compared is None:
            return None, None, ()
        begin = time.perf_counter()
        error, last, said = [column[0] for column in self._compared.estimates().values()]
        self.seconds += time.perf_counter() - begin
        return (None, None, ()) if math.isnan(error) else (float(error), float(last), said)


def _kind(run: Integration) -> type[_Compared]:
    if _segment(run).control is not None:
        return _Periods
    return _Resets if run is not run.segment and cast("WatchedIntegration", run).resetting else _Steps


class _Compared(ABC):
    """What is kept of a run, to compare it with others."""

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        self.run, self.x, self.options, self.first = run, x, options, _segment(run)
        self.program = self.first.program
        p = np.array([self.first.parameters])
        self.watch = Watch(self.program.rate, self.program.order, p, options.t0, x[None])

    @abstractmethod
    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""

    @abstractmethod
    def estimates(self) -> dict[str, Array]:
        """The estimates, after the last step."""

    def judged(self, law: Law, found: Changes) -> dict[str, Array]:
        """The estimates by what has been found."""
        return error_estimates(self.program, self.options, law, self.watch, self.run.steps, found)


class _Rows:
    """States of a run that starts with x after some of its steps, numbers (T,).

    x: (T, m), NaN from where it has not come to.  done: steps.
    """

    def __init__(self, numbers: Numbers, x: Array) -> None:
        self.numbers, self.done, self.x = numbers, 0, np.full((len(numbers), len(x)), math.nan)
        self.x[0] = x

    def add(self, block: StepBlock) -> None:
        """The next steps."""
        first, last = np.searchsorted(self.numbers, [self.done + 1, self.done + len(block.t) + 1])
        self.x[first:last] = block.x[self.numbers[first:last] - self.done - 1]
        self.done += len(block.t)


class _Steps(_Compared):
    """States of a run without resets after steps at whose ends those of runs beside end, too."""

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        super().__init__(run, x, options)
        self._runs = runs_beside(self.first.stretches, self.program.order)
        self._rows = _Rows(self._runs.numbers, x)

    def add(self, block: StepBlock) -> None:
        self.watch.add(block.t, block.x[None])
        self._rows.add(block)

    def estimates(self) -> dict[str, Array]:
        whole = self._rows.done - bool(self.run.event)  # steps: an event may have ended the run inside one
        count = int(np.searchsorted(self._rows.numbers, whole, side="right"))
        rows = [self._rows]
        for beside in self._runs.runs if count > 1 else ():
            rows.append(_Rows(beside.numbers[:count], self.x))
            for block in self.first.beside(beside.stretches, self.first.parameters).blocks(self.x * ASIDE):
                rows[-1].add(block)
                if rows[-1].done >= rows[-1].numbers[-1]:
                    break
        return self.judged(self._runs.law, changes(self._runs.t[:count], [each.x[None, :count] for each in rows]))


class _Resets(_Compared):
    """States of a run with resets, at some of its steps: runs beside, whose resets come at other times, are whole ones.

    They are compared by their dense output, but not between a reset, or the end, of one and of the other.
    """

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        super().__init__(run, x, options)
        self._rows, self._every, self._steps = np.array([[options.t0, *x]]), 1, 0
        self._last, self._resets = self._rows, list[float]()

    def add(self, block: StepBlock) -> None:
        if block.h[0] == 0.0:
            self._resets += [float(block.t[0])] * (self.run.resets - len(self._resets))
            self.watch.restart(float(block.t[0]), block.x)
            return
        self.watch.add(block.t, block.x[None])
        rows = np.column_stack([block.t, block.x])
        self._rows = np.concatenate([self._rows, rows[-(self._steps + 1) % self._every :: self._every]])
        self._steps, self._last = self._steps + len(rows), rows[-1:]
        while len(self._rows) > LOOKS:
            self._rows, self._every = self._rows[::2], 2 * self._every

    def estimates(self) -> dict[str, Array]:
        rows = np.concatenate([self._rows, self._last[self._last[:, 0] != self._rows[-1, 0]]])
        t, longest, forth = rows[:, 0], self.run.largest, self.options.direction
        law, beside, *_ = runs_beside(equal_steps([self.options.t0, self.options.t_end], longest), self.program.order)
        courses = [_Course(rows[:, 1:], [*self._resets, *_end(self.run, float(t[-1]))])]
        courses += [self._beside(each.times * longest, t) for each in beside]
        counts = [np.searchsorted(forth * np.array(each.turns), forth * t) for each in courses]
        alike = [one == other for one, other in itertools.pairwise(counts)]
        pairs = zip(itertools.pairwise(courses), alike, strict=True)
        between = [np.abs(other.x - one.x)[same][None] for (one, other), same in pairs]
        lost = _lost(courses[0].turns, courses[1].turns, t, beside[0].times * longest)
        if 2 * alike[0].sum() < len(t):  # too few to tell
            lost = float(t[~alike[0]][0])
        return self.judged(law, Changes(t[alike[0]], np.abs(rows[:, 1:]).max(axis=0)[None], between, lost))

    def _beside(self, dt: float, t: Array) -> _Course:
        """Run by steps of at most dt, at the instants t."""
        run, x = cast("WatchedIntegration", self.run).beside(dt), np.full((len(t), len(self.x)), math.nan)
        x[0], resets, direction, at = self.x, list[float](), self.options.direction, float(t[0])
        for block in run.blocks(self.x * ASIDE):
            at = float(block.t[-1])
            if block.h[0] == 0.0:
                resets += [at] * (run.resets - len(resets))
                continue
            here = slice(*np.searchsorted(direction * t, direction * np.array([block.t_old[0], at]), side="right"))
            x[here] = block.at(t[here])
            if here.stop == len(t):
                break
        return _Course(x, [*resets, *_end(run, at)])


class _Course(NamedTuple):
    """States of a run with resets, (T, m), and when it was reset, or ended by an event."""

    x: Array
    turns: list[float]


def _end(run: Integration, t: float) -> list[float]:
    return [t] if run.event else []


def _lost(turns: list[float], others: list[float], t: Array, longest: float) -> float:
    """When a run with other turns, in steps of at most so long, takes another course; NaN if it does not."""
    count = max(len(turns), len(others))
    one, other = (np.array([*each, *[t[-1]] * (count - len(each))]) for each in (turns, others))
    late = np.maximum(LATE * longest, SHARE * np.abs(np.diff(one, prepend=t[0])))
    apart = np.flatnonzero(np.abs(one - other) > late)
    return float(min(one[apart[0]], other[apart[0]], key=lambda at: abs(at - t[0]))) if len(apart) else math.nan


class _Periods(_Compared):
    """Differences of a run's stretches of steps under the same forces of a controller, each compared by itself.

    These forces answer the states of the run, and would be others beside it: from where the run is, steps of half the
    length are made under the same. The differences add up.
    """

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        super().__init__(run, x, options)
        self._stretch, self._steps, self._start = self.first.stretch, 0, x
        self._t, self._end, self._size, self._sum = options.t0, x, np.abs(x), np.zeros(len(x))
        self._lost = math.nan

    def add(self, block: StepBlock) -> None:
        segment = _segment(self.run)
        if block.h[0] == 0.0:
            self.watch.restart(float(block.t[0]), block.x)
            return
        if not self._steps or segment.stretch is not self._stretch:
            self._compare()
            self.first, self._forces, self._stretch = segment, segment.parameters, segment.stretch
            self._start, self._steps = block.x_old[0], 0
            self.watch.restart(float(block.t_old[0]), block.x_old[:1], np.array([self._forces]))
        self.watch.add(block.t, block.x[None])
        self._size = np.maximum(self._size, np.abs(block.x).max(axis=0))
        self._steps, self._t, self._end = self._steps + len(block.t), float(block.t[-1]), block.x[-1]

    def _compare(self) -> None:
        """Add the difference of the stretch, as far as it was gone."""
        if not self._steps:
            return
        begin = self._stretch.begin
        half = EqualSteps(begin, (self._t - begin) / (2 * self._steps), 2 * self._steps, self._t)
        run, end = self.first.beside([half], self._forces), self._start
        for block in run.blocks(self._start):
            end = block.x[-1]
        self._sum = self._sum + np.abs(end - self._end)
        if math.isnan(self._lost) and (run.status or not np.isfinite(self._sum).all()):
            self._lost = self._t

    def estimates(self) -> dict[str, Array]:
        self._compare()
        between = np.stack([0.0 * self._sum, self._sum])[None]
        found = Changes(np.array([self.options.t0, self._t]), self._size[None], [between], self._lost)
        return self.judged(law_of_halves(self.run.largest, self.program.order), found)


def _segment(run: Integration) -> FixedStepIntegration:
    """The part of a run of equal steps that it is in."""
    segment = run.segment
    assert isinstance(segment, FixedStepIntegration)
    return segment
