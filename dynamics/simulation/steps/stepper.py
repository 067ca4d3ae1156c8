"""Steppers: runs on one memory that is kept, entered as often as somebody asks for a step or an end."""

from __future__ import annotations

import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array

from ...integrators.step_control import RUNNING, TOO_SMALL
from ..run_options import RunOptions
from ..trajectory import SimulationWarning
from .chosen_steps import AdaptiveIntegration
from .equal_steps import EqualSteps, equal_steps
from .first_step import given, instant
from .flat_position import FlatPosition
from .step_program import CompiledSteps
from .stepping import BLOCK_TIME, FIRST_PASSES, FixedStepIntegration, NativeIntegration, NativeRun


class Stepper(ABC):
    """One run after another by one of our methods; one thread at a time.

    state: that of the run, (m,).  failed: why it stopped, in words, else empty.
    """

    def __init__(self, run: NativeIntegration) -> None:
        self.failed, self._run, runner = "", run, run.runner
        self._start = run.memory(np.zeros(run.program.size))
        self._memory = self._start.copy()
        self._numbers: Any = self._memory.data  # whose items are read and written faster
        self._x, self._advance = runner.read(self._memory, "x"), runner.advancing(self._memory)
        self._q, self._qd = self._x[: run.program.nq], self._x[run.program.nq :]
        places = np.arange(float(runner.size))
        self._at = {name: int(runner.read(places, name)[0]) for name in self.registers}

    registers: tuple[str, ...]  # that it reads and writes, of one number each
    stop: str  # the register by which passes end

    def set_parameters(self, p: Sequence[float]) -> None:
        """Values of the parameters in the runs that begin from here on."""
        self._run.parameters = list(p)
        self._run.runner.write(self._start, "p", self._run.parameters)

    @property
    def t(self) -> float:
        """Time that the run has reached [s]."""
        return float(self._numbers[self._at["t"]])

    @property
    def state(self) -> Array:
        """The state of the run, (m,)."""
        return self._x.copy()

    def begin(self, x: Array, t0: float, t_end: float) -> None:
        """Start anew, from x (m,) at t0, on the way to t_end."""
        self._memory[:] = self._start
        self._x[:] = x
        self._begin(t0, t_end)

    def begin_from(self, q: ArrayLike, qd: ArrayLike | None, t0: float, t_end: float) -> bool:
        """Begin from q and qd, of the right shapes; whether they are finite."""
        self._memory[:] = self._start
        self._q[:] = q
        if qd is not None:
            self._qd[:] = qd
        self._begin(t0, t_end)
        return isfinite(self._x.dot(self._x))

    @abstractmethod
    def _begin(self, t0: float, t_end: float) -> None: ...

    @abstractmethod
    def to_end(self) -> None:
        """Take all steps after `begin`; `failed` where they do not come to t_end."""

    @abstractmethod
    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there; `failed` where they do not come there."""

    @abstractmethod
    def step(self) -> None:
        """Take one step on the way to t_end."""

    def _passes(self, most: int = 2**62) -> None:
        """Make so many passes, or until the program stops, in pieces of bounded time: Ctrl-C ends them in between."""
        passes, numbers, stop = FIRST_PASSES, self._numbers, self._at[self.stop]
        self._advance(min(most, passes))
        most -= passes
        while most > 0 and numbers[stop] == RUNNING:
            begin = time.perf_counter()
            self._advance(min(passes, most))
            most -= passes
            spent = time.perf_counter() - begin
            passes = max(1, int(passes * min(4.0, BLOCK_TIME / max(spent, 1e-9))))


class ChosenStepper(Stepper):
    """Steps chosen by error; a run that goes on after an end has steps as if that had been none, but for the last."""

    registers = ("t", "h", "end", "status", "anew", "row", *given({"t_end": 0, "goal": 0, "instant": 0}))
    stop = "status"
    _run: AdaptiveIntegration

    def _begin(self, t0: float, t_end: float) -> None:
        numbers, at = self._numbers, self._at
        numbers[at["t"]], numbers[at["start.t_end"]], numbers[at["start.goal"]] = t0, t_end, t_end
        if self._run.program.timed:
            numbers[at["start.instant"]] = instant(t0, t_end)
        if self._run.flat.rows is not None:
            self._run.flat = FlatPosition(self._run.program)
            self._run.flat.begin(t0, self._x, self._run.parameters)
        self.failed = ""

    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there."""
        self._towards(t)
        self.to_end()

    def to_end(self) -> None:
        """Take all steps."""
        self._passes()
        self._look()

    def step(self) -> None:
        """Take one step on the way to t_end."""
        numbers, row, status = self._numbers, self._at["row"], self._at["status"]
        self._towards(numbers[self._at["start.t_end"]])
        self._advance(1)
        while numbers[row] <= 0.0 and numbers[status] == RUNNING:
            self._advance(1)
        self._look()

    def _look(self) -> None:
        """Note whether the run failed, and warn of constraints."""
        flat, p = self._run.flat, self._run.parameters
        if flat.rows is not None:
            row = np.array([[self.t, self._numbers[self._at["h"]], *self._x]])
            for text in flat.look(row, self._run.runner.read(self._memory, "farthest")[0], p):
                warnings.warn(text, SimulationWarning, stacklevel=5)
        if self._numbers[self._at["status"]] == TOO_SMALL:
            self.failed = self._run.too_small(self._memory) + flat.near(p)

    def _towards(self, t: float) -> None:
        numbers, at = self._numbers, self._at
        numbers[at["start.goal" if numbers[at["anew"]] else "end"]] = t
        numbers[at["status"]] = RUNNING


class EqualStepper(Stepper):
    """Equal steps, of which those from a start or an end to the next end have one length."""

    registers = ("t", "start", "count", "h", "nonfinite")
    stop = "nonfinite"
    _run: FixedStepIntegration

    def _begin(self, t0: float, t_end: float) -> None:
        self._numbers[self._at["t"]] = t0
        self._t_end, self._left, self.failed = t_end, 0, ""

    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there."""
        stretch = self._stretch(t)
        self._steps(stretch, stretch.steps)
        self._left = 0

    def to_end(self) -> None:
        """Take all steps."""
        self.until(self._t_end)

    def step(self) -> None:
        """Take one step on the way to t_end."""
        if not self._left:
            self._way = self._stretch(self._t_end)
            self._left = self._way.steps
        self._left -= 1
        self._steps(self._way, 1)

    def _stretch(self, t: float) -> EqualSteps:
        """The steps to t, which are begun."""
        numbers, at = self._numbers, self._at
        stretch = equal_steps([self.t, t], self._run.options.step)[0]
        numbers[at["start"]], numbers[at["count"]], numbers[at["h"]] = stretch.begin, 0.0, stretch.h
        return stretch

    def _steps(self, stretch: EqualSteps, steps: int) -> None:
        memory, numbers, count = self._memory, self._numbers, self._at["count"]
        before = memory.copy()
        self._passes(steps)
        if numbers[self._at["nonfinite"]] != RUNNING:  # make all but the last again, for the state before it
            done = int(numbers[count] - before[count])
            memory[:] = before
            self._passes(done - 1)
            before[:] = memory
            self._advance(1)
            self.failed = self._run.failure(memory, self._run.runner.read(before, "x"))
            memory[:] = before
        elif numbers[count] == stretch.steps:
            numbers[self._at["t"]] = stretch.end


def stepper(compiled: CompiledSteps, options: RunOptions, parameters: Sequence[float]) -> Stepper:
    """A stepper of runs by these steps."""
    run = NativeRun(compiled, options, parameters)
    if compiled.program.adaptive:
        return ChosenStepper(AdaptiveIntegration(run))
    return EqualStepper(FixedStepIntegration(run))
