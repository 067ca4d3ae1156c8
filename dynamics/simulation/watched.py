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

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset is a step of no length."""
        options, log = self.options, self.log
        while True:
            yield from self._leg(options, x)
            if self.status or log.restart is None:
                return
            (t, x_new), log.restart = log.restart, None
            before = np.array(log.happened[-1][2])
            instant = np.array([t])
            yield StepBlock(instant, x_new[None], instant, np.zeros(1), before[None], np.zeros((1, 1, len(x))))
            if t == options.t_end:
                return
            options, x = _from(options, t), x_new

    def _leg(self, options: RunOptions, x: Array) -> Iterator[StepBlock]:
        """The steps up to an event after which the run does not go on as it did, or to the end."""
        run, log = self.leg(options), self.log
        rejected, evaluations, accepted = self.rejected, self.evaluations, self.steps
        run.steps = accepted + rejected  # of max_steps
        for block in run.blocks(x):
            kept = log(block)
            self.steps += len(kept.t)
            self._count(run, rejected, evaluations)
            if len(kept.t):
                yield kept
            if log.status or log.restart is not None:
                break
        else:
            self._count(run, rejected, evaluations)
            self.status = run.status
            if not run.status:
                log.finish()
        self.status = log.status or self.status

    def _count(self, run: Integration, rejected: int, evaluations: int) -> None:
        self.rejected, self.evaluations = rejected + run.rejected, evaluations + run.evaluations
        self.largest = max(self.largest, run.largest)
        self.warnings = list(dict.fromkeys([*self.warnings, *run.warnings, *self.log.warnings]))


def _from(options: RunOptions, t: float) -> RunOptions:
    """The options of the rest of a run, whose first step is chosen anew."""
    times = options.times
    if times is not None:
        ahead = times[(times - t) * options.direction > 0.0]
        times = ahead if len(ahead) else np.array([options.t_end])
    return replace(options, t0=t, t_eval=times, first_step=None)
