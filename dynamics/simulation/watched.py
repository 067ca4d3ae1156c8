"""WatchedIntegration: a run with events, which ends at one or restarts from the state that one leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from cgraph.extend import Array

from .dense_output import StepBlock
from .event_log import EventLog
from .run_options import RunOptions
from .stepping import Integration


class WatchedIntegration(Integration):
    """A run with events, in legs: each starts where the options say, or from the state that a reset leaves.

    leg: makes the integration of a leg from its options.
    """

    def __init__(self, leg: Callable[[RunOptions], Integration], options: RunOptions, log: EventLog) -> None:
        super().__init__(log.program.components)
        self.leg, self.options, self.log = leg, options, log
        self._legs: list[Integration] = []

    @property
    def plain(self) -> Integration | None:
        """The run without its events; None where a reset has changed its course."""
        return self._legs[0] if len(self._legs) == 1 else None

    @property
    def jacobians(self) -> int:
        """Evaluations of the Jacobian of the rate."""
        return sum(run.jacobians for run in self._legs)

    @property
    def factorizations(self) -> int:
        """LU factorizations of matrices."""
        return sum(run.factorizations for run in self._legs)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset is a step of no length."""
        options, log = self.options, self.log
        while True:
            yield from self._leg(options, x)
            if self.status or log.restart is None:
                return
            (t, before, x_new), log.restart = log.restart, None
            instant = np.array([t])
            yield StepBlock(instant, x_new[None], instant, np.zeros(1), before[None], np.zeros((1, 1, len(x))))
            if self.event or t == options.t_end:
                return
            options, x = self._rest(t), x_new

    def _leg(self, options: RunOptions, x: Array) -> Iterator[StepBlock]:
        """The steps up to an event after which the run does not go on as it did, or to the end."""
        run, log, last = self.leg(options), self.log, options.t0
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
        self.largest = max(self.largest, run.largest)
        self.warnings = list(dict.fromkeys([*self.warnings, *run.warnings, *self.log.warnings]))

    def _rest(self, t: float) -> RunOptions:
        """The options of the rest of the run from t on, whose first step is chosen anew."""
        options, times = self.options, self.options.times
        if times is not None:
            ahead = times[(times - t) * options.direction > 0.0]
            times = ahead if len(ahead) else np.array([options.t_end])
        left = max(1.0, options.max_steps - self.steps - self.rejected)
        return replace(options, t0=t, t_eval=times, first_step=None, max_steps=left)
