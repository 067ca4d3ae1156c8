"""Error estimate of runs of equal steps: their differences from runs beside them, of longer steps (Richardson).

With an error that is e = C h^p along the run, x(2h) - x(h) = (2^p - 1) e, and x(4h) - x(2h) is 2^p times as large; how
much larger it is tells the order that the run has. Across a jump or a kink of the rate these runs may be off alike, and
what a step can miss there is the least that is said. Of steps that are not all equal, 2^p is the ratio of the sums of
h^(p + 1). This is the error of the state, phase included, not that of the energy.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from cgraph._shared import Array

from ..run_options import RunOptions
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import SAME_INSTANT, EqualSteps, equal_steps
from ..steps.step_program import StepProgram
from ..steps.stepping import FixedStepIntegration, Integration
from .runs_beside import LATE, SHARE, Course, Difference, Law, States, courses, even, together
from .state_sizes import off_by
from .unresolved import missed, turning, unresolved

if TYPE_CHECKING:
    from ..events.event_log import WatchedIntegration

LEAST_RATIO = 2.0  # times a difference that of steps twice as long is, at least, where the error has a law
LAWLESS = 0.1  # of the size of a component: a difference above it follows no power of the step
UNIT = 2.0**-52  # the last bit of a number near 1
NUDGE = 8.0 * UNIT  # of each component, by which runs beside start aside: what roundings grow to is part of the error
TOGETHER = 512  # states that are compared at once
UNKNOWN = "the error is unknown"


class ErrorEstimates(NamedTuple):
    """Of k runs: the largest errors and those at the end, relative to the sizes of components, (k,); NaN if unknown.

    warnings: where more was asked for, a sentence each, else empty.
    """

    largest: Array
    last: Array
    warnings: list[str]


@dataclass
class _Beside:
    """A run beside: its course, its states as they come, and how far they have."""

    course: Course
    states: Iterator[States]
    t: float
    resets: int = 0
    lost: bool = False


Follow = Callable[[Course, Array, Array], Iterator[States]]


@dataclass
class Estimator:
    """The errors of k runs side by side, which are told their states as they come to them.

    p: values of the parameters, (k, ..).  follow: runs of a course from states x (k, m) with parameters p; they stop
    after a reset, which is not compared, until the first run has had its own.
    sparse: whether to look only where the longest steps end, which is where all do.
    """

    program: StepProgram
    options: RunOptions
    p: Array
    follow: Follow
    sparse: bool
    _beside: list[_Beside] = field(default_factory=list, init=False)
    _differences: list[Difference] = field(default_factory=list, init=False)
    _pending: list[States] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        k, m = len(self.p), self.program.size
        self._size, self._steps, self._law = np.zeros((k, m)), 0, Law(1.0, 1.0)
        self._turning, self._longest = np.zeros(k), 0.0  # rad/s, of sines and cosines; s, of steps
        self._bent = np.zeros(k, dtype=bool)  # whether a jump or a kink was passed
        self._missed = np.zeros((k, m))  # by how much steps across jumps and kinks are off
        self._unresolved = unresolved(self.program.rate)
        self._end: States | None = None  # of what was compared
        self._begun = self.options.t0  # the segment [s]

    def begin(self, x: Array, stretches: Sequence[EqualSteps], *, shorter: bool = False) -> None:
        """The runs start from x (k, m), on these steps."""
        made, self._law = courses(stretches, self.program.order, shorter=shorter)
        self._size, self._end = np.abs(x), States(np.array([self.options.t0]), x[:, None])
        self._longest = max(abs(part.h) for part in stretches)
        self._differences = [Difference(len(x), self.program.size, self.options.direction) for _ in made]
        for course in made:
            course.follow(stretches)
            self._beside.append(_Beside(course, self.follow(course, x * (1.0 + NUDGE), self.p), self.options.t0))

    @property
    def longer(self) -> bool:
        """Whether the runs beside have longer steps."""
        return len(self._beside) > 1

    @property
    def every(self) -> bool:
        """Whether all steps are looked at, for one may pass a jump or a kink."""
        return not self.longer or self._unresolved.branches is not None

    def segment(self, stretches: Sequence[EqualSteps]) -> None:
        """Go on with these steps after a reset."""
        lasted, self._begun = abs(stretches[0].begin - self._begun), stretches[0].begin
        for beside in self._beside:
            beside.course.follow(stretches, lasted)

    def restart(self, x: Array, stretch: EqualSteps, p: Array) -> None:
        """The runs are at x (k, m), at the start of a stretch with parameters p: errors of stretches add up."""
        self._compare()
        self.p = p
        for beside, difference in zip(self._beside, self._differences, strict=True):
            difference.restart()
            beside.course.follow([stretch])
            beside.states, beside.t = self.follow(beside.course, x, p), stretch.begin

    def add(self, states: States) -> None:
        """The next states of the runs."""
        if self._pending and states.resets != self._pending[-1].resets:
            self._compare()
        self._pending.append(states)
        self._steps += len(states.t)
        if sum(len(each.t) for each in self._pending) >= TOGETHER:
            self._compare()

    def _compare(self) -> None:
        """Bring the runs beside to where the first are, and note by how much they differ."""
        states = together(self._pending, self._pending[0].resets) if self._pending else None
        if states is None:
            return
        self._pending.clear()
        end = float(states.t[-1])
        self._look(states)
        if self.sparse and self.longer:
            met = np.flatnonzero(self._beside[-1].course.meets(states.t))
            states = States(states.t[met], states.x[:, even(met)], states.resets)
        if len(states.t):
            size = np.maximum(states.x.max(axis=1), -states.x.min(axis=1))
            self._size = np.maximum(self._size, np.where(np.isfinite(size), size, 0.0))
            self._differences[0].add(0, states)
        for number, beside in enumerate(self._beside):
            for each in self._until(beside, end, states.resets):
                self._differences[number].add(1, each)
                if number + 1 < len(self._differences):
                    self._differences[number + 1].add(0, each)
        for difference in self._differences:
            difference.compare(states.resets)

    def _look(self, states: States) -> None:
        """Note how fast sines and cosines turn, and what steps across jumps and kinks miss."""
        t, x, what = states.t, states.x, self._unresolved
        if self._end is not None and self._end.resets == states.resets:
            t, x = np.append(self._end.t, t), np.concatenate([self._end.x, x], axis=1)
        if len(t) > 1 and what.waves is not None:
            self._turning = np.maximum(self._turning, turning(what.waves, t, x, self.p))
        if len(t) > 1 and what.branches is not None:
            bent, error = missed(what, self.program.order, t, x, self.p)
            self._bent |= bent
            self._missed += error
        self._end = States(t[-1:], x[:, -1:], states.resets)

    def _until(self, beside: _Beside, end: float, resets: int) -> Iterator[States]:
        """States of a run beside until it is at `end` after so many resets, unless it takes another course."""
        direction, rounding, course = self.options.direction, SAME_INSTANT * np.spacing(abs(end)), beside.course
        while not beside.lost and beside.resets <= resets:
            ahead = direction * (beside.t - end)
            if ahead >= -rounding if beside.resets == resets else ahead > course.late:
                beside.lost = beside.resets < resets
                break
            following = next(beside.states, None)
            if following is None:
                beside.lost = True
                break
            new, beside.t, beside.resets = following.resets > beside.resets, float(following.t[-1]), following.resets
            if not new:
                yield following
        if beside.resets > resets:
            late = max(LATE * course.longest, SHARE * abs(beside.t - self._begun))
            beside.lost = beside.lost or direction * (end - beside.t) > late
        if beside.lost:
            for difference in self._differences[self._beside.index(beside) :]:
                difference.lose(beside.t)

    def estimates(self) -> ErrorEstimates:
        """Estimate of each run, and whether the run is as good as asked; NaN where nothing could be compared."""
        self._compare()
        first, count = self._differences[0], len(self._size)
        if not first.compared and np.isnan(first.lost).all():
            return ErrorEstimates(np.full(count, math.nan), np.full(count, math.nan), [""] * count)
        scale = self.program.kinds.scale(self._size)
        least = UNIT * math.sqrt(self._steps)
        largest, last = (
            np.maximum(least, self._errors([np.where(change > 0.0, change / scale, 0.0) for change in changes]))
            for changes in zip(*[(each.largest, each.last) for each in self._differences], strict=True)
        )
        across = np.where(self._missed > 0.0, self._missed / scale, 0.0)
        largest, last = np.maximum(largest, across), np.maximum(last, across)
        largest = np.maximum(largest, last)  # where the law that holds for one does not for the other
        resolved = math.pi * max(1.0, 0.5 * self.program.order) / self._longest  # rad/s: two evaluations in a turn
        largest[self._turning > resolved] = last[self._turning > resolved] = math.inf
        options = self.options
        allowed = options.absolute + options.relative * scale
        warnings = [""] * count
        for k in np.flatnonzero(~(largest * scale <= allowed).all(axis=1) | ~np.isnan(first.lost)).tolist():
            if self._turning[k] > resolved:
                said = (
                    f"{UNKNOWN}: a sine or cosine of the equations turns at {self._turning[k]:.3g} rad/s, and steps of "
                    f"{self._longest:.3g} s by method {options.method!r} resolve {resolved:.3g} rad/s"
                )
            elif not math.isnan(first.lost[k]):
                at = f"t = {first.lost[k]:.6g} s"
                said = f"{UNKNOWN}: beside it a run of other steps stops, or takes another course, at {at}"
            else:
                said = off_by(largest[k], scale[k], allowed[k], self.program.components)
            warnings[k] = (
                f"{said}; rtol = {options.relative:g} allows less: take a dt shorter than {options.step:g} s, or "
                "method='dop853', which chooses its steps"
            )
        return ErrorEstimates(largest.max(axis=1), last.max(axis=1), warnings)

    def _errors(self, changes: Sequence[Array]) -> Array:
        """Errors of components, (k, m), from differences between the first run and the second, and that and the third.

        The law of the method holds where these, in the largest, have the ratio that goes with it, and where they have a
        lower one as of another order. Across a kink it depends on where in a step that is: no ratio tells.
        """
        first = changes[0]
        if len(changes) == 1:
            return first * self._law.share
        (ratio, share), least = self._law, min(LEAST_RATIO, self._law.ratio)
        with np.errstate(all="ignore"):
            measured = self._differences[1].largest / self._differences[0].largest
        measured = np.where(np.isfinite(measured), np.clip(measured, least, ratio), least)
        errors = np.where(first <= LAWLESS, first * share * (ratio - 1.0) / (measured - 1.0), first)
        return np.where(self._bent[:, None], first, errors)


class RunEstimate:
    """Estimate of a run's error from its blocks as they come; of a run whose error is not estimated it forgets them.

    Runs beside have resets of their own. The forces of a controller answer the states of the run, and would be others
    beside it: there each stretch of steps under the same forces is compared by itself, from where the run is.
    """

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        self._run, self._x, self._options = run, x[None], options
        self._estimator: Estimator | None = None
        self._segment: FixedStepIntegration | None = None
        self._stretch: EqualSteps | None = None
        self.seconds = 0.0  # spent here

    def add(self, block: StepBlock) -> None:
        """The next steps of the run, or a reset."""
        if not self._options.estimated:
            return
        begin = time.perf_counter()
        self._add(block)
        self.seconds += time.perf_counter() - begin

    def _add(self, block: StepBlock) -> None:
        segment = self._run.segment
        assert isinstance(segment, FixedStepIntegration)
        controlled = segment.control is not None
        if not len(block.t) or (controlled and block.h[0] == 0.0):
            return
        if self._estimator is None:
            sparse = segment is self._run
            p = np.array([segment.parameters])
            self._estimator = Estimator(segment.program, self._options, p, self._beside, sparse=sparse)
            self._estimator.begin(self._x, segment.stretches, shorter=controlled)
        elif segment is not self._segment and not controlled:
            self._estimator.segment(segment.stretches)
        self._segment = segment
        if controlled and segment.stretch is not self._stretch:
            self._stretch = segment.stretch
            self._estimator.restart(block.x_old[:1], segment.stretch, np.array([segment.parameters]))
        self._estimator.add(States(block.t, block.x[None], 0 if controlled else self._run.resets))

    def result(self) -> tuple[float | None, float | None, tuple[str, ...]]:
        """After the last step: the largest error and that at the end, None if unknown, and what to say of them."""
        if self._estimator is None:
            return None, None, ()
        begin = time.perf_counter()
        (largest,), (last,), (warning,) = self._estimator.estimates()
        self.seconds += time.perf_counter() - begin
        if math.isnan(largest):  # nothing could be compared
            return None, None, ()
        return float(largest), float(last), (warning,) if warning else ()

    def _beside(self, course: Course, x: Array, p: Array) -> Iterator[States]:
        """The states of a run on another course."""
        run, segment = self._run, self._run.segment
        assert isinstance(segment, FixedStepIntegration)
        other: Integration = segment.beside(course.stretches, p[0].tolist())
        if segment.control is None and run is not segment:  # with events
            watched = cast("WatchedIntegration", run)
            other = watched.beside(course.steps) if watched.resetting else other
        for block in other.blocks(x[0]):
            yield States(block.t, block.x[None], other.resets)
            at, t = course.stretches[0].begin, float(block.t[-1])
            if block.h[0] == 0.0 and abs(at - t) <= course.late:  # a reset, which the run had at another time
                aside = segment.beside(equal_steps([t, at], course.longest), p[0].tolist()).blocks(block.x[-1])
                for one in [block] if at == t else aside:
                    if one.t[-1] == at:
                        yield States(one.t[-1:], one.x[None, -1:], other.resets)
