"""Solvers: ways to integrate a task, timed from its start to t_end; ours are the methods of `simulate`."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cgraph._shared import Array

from ...equations.state_equation import state_inputs
from ...integrators import METHODS, Problem, derive
from ...simulation.outcome import Recorder
from ...simulation.run_options import Span, Steps
from ...simulation.stepper import Stepper, stepper
from ...simulation.steps.step_program import CompiledSteps, compile_steps, step_program
from ..accuracy_task import AccuracyTask
from ..timing import Timed

EQUAL, CHOSEN = "equal steps", "chosen steps"
TRIAL = 4096  # steps that tell how long many more take
LONGEST_RUN = 3.0  # s; a run that takes longer is given up


class Outcome(NamedTuple):
    """A run to t_end.  status: empty, or why it did not get there.  None: a count that is not told."""

    x: Array  # (m,)
    steps: int | None = None
    rejected: int | None = None
    evaluations: int | None = None
    status: str = ""


@dataclass
class Run(Timed):
    """A run made ready, and timed; `read` tells its outcome."""

    read: Callable[[Any], Outcome] = lambda outcome: outcome

    def __call__(self) -> Outcome:
        """Outcome of the run."""
        self.rewind()
        return self.read(self.run())


class Solver(ABC):
    """A way to integrate one task.

    kind: `EQUAL`, where the knob is the number of steps, or `CHOSEN`, where it is the relative tolerance.
    order: of its error, as declared; None where that is no fixed number.
    """

    order: int | None = None
    kind = CHOSEN
    tolerances: Sequence[float] = tuple([10.0**-k for k in range(3, 16)])

    def __init__(self, name: str, task: AccuracyTask, smallest: float) -> None:
        self.name, self.task, self.smallest = name, task, smallest
        self.start = np.array(task.start)

    @abstractmethod
    def ready(self, knob: float) -> Run:
        """Run with that knob, everything before it done. Raises for a knob that cannot be had."""

    def absolute(self, knob: float) -> float:
        """The absolute tolerance that goes with a relative one: as small a part of the smallest state."""
        return knob * self.smallest


def problem_of(task: AccuracyTask) -> Problem:
    """The task's equations, with parameters bound and no force applied."""
    inputs = state_inputs(task.model)
    return derive(task.model, dict(inputs.parameters) | dict.fromkeys(inputs.applied, 0.0))


def finished(run: Stepper, start: Array, span: Span) -> Outcome:
    """The run, to its end or until it has taken too long."""
    begin, last, status = time.perf_counter(), start, ""
    with np.errstate(all="ignore"):
        for block in run.blocks(start, span):
            if len(block.x):
                last = block.x[-1]
            if time.perf_counter() - begin > LONGEST_RUN:
                status = f"took longer than {LONGEST_RUN:g} s"
                break
    return Outcome(np.array(last), run.steps, run.rejected, run.evaluations, run.status or status)


def recorded(run: Stepper, start: Array, span: Span) -> Array:
    """The states of a run at the times of a span, (T, m)."""
    recorder, times = Recorder(start, span), span.times
    assert times is not None
    begin = time.perf_counter()
    with np.errstate(all="ignore"):
        for block in run.blocks(start, span):
            recorder.record(block)
            if time.perf_counter() - begin > 2 * LONGEST_RUN:
                break
    states = recorder.table()[1]
    result = np.full((len(times), len(start)), math.nan)
    result[: len(states)] = states
    return result


class Ours(Solver):
    """One of our methods in its native loop; the program is made once."""

    def __init__(self, name: str, task: AccuracyTask, smallest: float, problem: Problem) -> None:
        super().__init__(name, task, smallest)
        self.problem, self.method = problem, METHODS[name]
        self.order = self.method.order
        self.kind = CHOSEN if self.method.adaptive else EQUAL

    def _compiled(self, dense: bool) -> CompiledSteps:
        return compile_steps(step_program(self.problem, self.method, dense=dense), "auto", True)

    def _options(self, knob: float, times: Sequence[float], max_steps: float = math.inf) -> tuple[Steps, Span]:
        t_end = self.task.t_end
        if self.method.adaptive:
            return Steps(self.name, rtol=knob, atol=self.absolute(knob)), Span(t_end, t_eval=times)
        return Steps(self.name, dt=t_end / knob, max_steps=max_steps), Span(t_end, t_eval=times)

    def ready(self, knob: float) -> Run:
        """The run to t_end, without dense output."""
        if self.kind == EQUAL and self._at_least(knob) > LONGEST_RUN:  # one that does not look at the clock on its way
            return Run(lambda: Outcome(self.start, status=f"would take longer than {LONGEST_RUN:g} s"))
        compiled, (steps, span) = self._compiled(False), self._options(knob, [self.task.t_end])
        return Run(lambda: finished(stepper(compiled, steps), self.start, span))

    def _at_least(self, knob: float) -> float:
        """Seconds that so many equal steps take, by the first few of them."""
        steps, span = self._options(knob, [self.task.t_end], TRIAL)
        run, begin = stepper(self._compiled(False), steps), time.perf_counter()
        finished(run, self.start, span)
        return (time.perf_counter() - begin) * knob / min(knob, TRIAL)

    def rows(self, knob: float) -> Array:
        """The states at the task's times, (T, m); NaN from where it stopped."""
        steps, span = self._options(knob, self.task.times)
        dense = self.method.adaptive and span.has_inner_times
        return recorded(stepper(self._compiled(dense), steps), self.start, span)
