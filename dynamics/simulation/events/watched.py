"""WatchedIntegration: a run with events, which ends at one or restarts from the state that one leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array

from ..run_options import RunOptions
from ..steps.dense_output import StepBlock
from ..steps.equal_steps import EqualSteps
from ..steps.stepping import FixedStepIntegration, Integration
from ..trajectory import Crossings
from .event_log import EventLog, split_crossings


class WatchedIntegration(Integration):
    """A run with events, in legs: each starts where the options say, or from the state that a reset leaves.

    leg: makes the integration of a leg from its options.
    """

    def __init__(self, leg: Callable[[RunOptions], Integration], options: RunOptions, log: EventLog) -> None:
        super().__init__(log.program.components)
        self._make, self.options, self.log = leg, options, log
        self._legs: list[Integration] = []

    @property
    def leg(self) -> Integration:
        """The part of the run that it is in: what makes its steps since the last reset."""
        return self._legs[-1]

    @property
    def resetting(self) -> bool:
        """Whether there are events that reset the state."""
        return any(event.reset is not None for event in self.log.program.events)

    def beside(self, steps: Callable[[float], Sequence[EqualSteps]]) -> WatchedIntegration:
        """The same run with other equal steps: those of a leg from the time on at which it begins."""
        first, options = self._legs[0], replace(self.options, max_steps=math.inf)
        assert isinstance(first, FixedStepIntegration)
        return WatchedIntegration(
            lambda leg: first.beside(steps(leg.t0), first.parameters), options, EventLog(self.log.program)
        )

    def crossings(self, nq: int, parameters: ArrayLike = 0.0) -> dict[str, Crossings]:
        """Of each event by name, where it happened, with states split after nq numbers; parameters: of the problem."""
        return split_crossings(self.log.program, self.log.happened, nq, parameters)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset is a step of no length."""
        options, log = self.options, self.log
        while True:
            yield from self._leg(options, x)
            if self.status or log.restart is None:
                return
            (t, before, x_new), log.restart = log.restart, None
            self.resets = sum(log.program.events[number].reset is not None for number, _, _ in log.happened)
            instant = np.array([t])
            yield StepBlock(instant, x_new[None], instant, np.zeros(1), before[None], np.zeros((1, 1, len(x))))
            if self.event or t == options.t_end:
                return
            options, x = self._rest(t), x_new

    def _leg(self, options: RunOptions, x: Array) -> Iterator[StepBlock]:
        """The steps up to an event after which the run does not go on as it did, or to the end."""
        run, log, last = self._make(options), self.log, options.t0
        self._legs.append(run)
        rejected, evaluations = self.rejected, self.evaluations
        for block in run.blocks(x):
            log.parameters = run.parameters
            kept = log(run.with_dense(block))
            self.steps += len(kept.t)
            self._count(run, rejected, evaluations)
            if len(kept.t):
                last = float(kept.t[-1])
                yield kept
            if log.ended or log.restart is not None:
                break
        else:
            self._count(run, rejected, evaluations)
            self.status = run.status
            if run.status and self.steps + self.rejected >= self.options.max_steps:
                self.status = self.too_many(last, self.options.max_steps)
            if not run.status:
                log.finish()
        self.status, self.event = log.status or self.status, log.ended

    def _count(self, run: Integration, rejected: int, evaluations: int) -> None:
        self.rejected, self.evaluations = rejected + run.rejected, evaluations + run.evaluations
        self.jacobians = sum(leg.jacobians for leg in self._legs)
        self.factorizations = sum(leg.factorizations for leg in self._legs)
        self.largest, self.stiff = max(self.largest, run.largest), self.stiff or run.stiff
        self.slope = run.slope
        self.warnings = list(dict.fromkeys([*self.warnings, *run.warnings, *self.log.warnings]))

    def _rest(self, t: float) -> RunOptions:
        """The options of the rest of the run from t on, whose first step is chosen anew."""
        options, times = self.options, self.options.times
        if times is not None:
            ahead = times[(times - t) * options.direction > 0.0]
            times = ahead if len(ahead) else np.array([options.t_end])
        left = max(1.0, options.max_steps - self.steps - self.rejected)
        return replace(options, t0=t, t_eval=times, first_step=None, max_steps=left)
