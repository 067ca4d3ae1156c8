"""RunEstimate: the error estimate of one run of equal steps, along its events and its controller."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from cgraph.extend import Array

from ..run_options import RunOptions
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps, equal_steps
from ..steps.stepping import FixedStepIntegration, Integration
from .courses import Course
from .error_estimate import ErrorEstimate, Estimator
from .state_difference import States


class RunEstimate:
    """Is told the blocks of a run from x as they come; of a run whose error is not estimated it forgets them.

    Runs beside have resets of their own. The forces of a controller answer the states of the run, and would be others
    beside it: there each stretch of steps under the same forces is compared by itself, from where the run is.
    """

    def __init__(self, run: Integration, x: Array, options: RunOptions) -> None:
        self._run, self._x, self._options = run, x[None], options
        self._estimator: Estimator | None = None
        self._leg: FixedStepIntegration | None = None
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
        leg = self._run.leg
        assert isinstance(leg, FixedStepIntegration)
        controlled = leg.control is not None
        if not len(block.t) or (controlled and block.h[0] == 0.0):
            return
        if self._estimator is None:
            sparse = leg is self._run
            p = np.array([leg.parameters])
            self._estimator = Estimator(leg.program, self._options, p, self._beside, sparse=sparse)
            self._estimator.begin(self._x, leg.stretches, shorter=controlled)
        elif leg is not self._leg and not controlled:
            self._estimator.leg(leg.stretches)
        self._leg = leg
        if controlled and leg.stretch is not self._stretch:
            self._stretch = leg.stretch
            self._estimator.restart(block.x_old[:1], leg.stretch, np.array([leg.parameters]))
        self._estimator.add(States(block.t, block.x[None], 0 if controlled else self._run.resets))

    def result(self) -> ErrorEstimate | None:
        """After the last step; None where there was none."""
        begin = time.perf_counter()
        error = None if self._estimator is None else self._estimator.estimates()[0]
        self.seconds += time.perf_counter() - begin
        return error

    def _beside(self, course: Course, x: Array, p: Array) -> Iterator[States]:
        """The states of a run on another course."""
        run, leg = self._run, self._run.leg
        assert isinstance(leg, FixedStepIntegration)
        other: Integration = leg.beside(course.stretches, p[0].tolist())
        if leg.control is None and run is not leg:  # with events
            from ..events.watched import WatchedIntegration

            assert isinstance(run, WatchedIntegration)
            other = run.beside(course.steps) if run.resetting else other
        for block in other.blocks(x[0]):
            yield States(block.t, block.x[None], other.resets)
            at, t = course.stretches[0].begin, float(block.t[-1])
            if block.h[0] == 0.0 and abs(at - t) <= course.late:  # a reset, which the run had at another time
                aside = leg.beside(equal_steps([t, at], course.longest), p[0].tolist()).blocks(block.x[-1])
                for one in [block] if at == t else aside:
                    if one.t[-1] == at:
                        yield States(one.t[-1:], one.x[None, -1:], other.resets)
