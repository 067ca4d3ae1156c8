"""Integrations: from a start to an end, a block of steps at a time, by equal steps or by steps chosen by error."""

from __future__ import annotations

import itertools
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from cgraph.extend import Array

from ..integrators.step_control import DONE, TOO_SMALL
from .dense_output import StepBlock
from .run_options import RunOptions, step_count
from .step_program import CompiledSteps

BLOCK_TIME = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
FIRST_PASSES = 32  # of the first block, before it is known how long one takes
LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60  # of a first step
HUGE = 1e300  # a tolerance that anything meets


class StoppedError(Exception):
    """Nobody waits for the rest of the run any more."""


class Clock:
    """A stopwatch for work that is done at most once in a while."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def passed(self, seconds: float) -> bool:
        """True at most once in `seconds` of wall time."""
        now = time.perf_counter()
        if now - self._last < seconds:
            return False
        self._last = now
        return True


class Integration(ABC):
    """One run. `blocks` makes the steps; the attributes say how far it has come.

    status: empty while all is well, else why it stopped before the end.  largest: step [s].
    """

    def __init__(self, components: Sequence[str]) -> None:
        self.components = components
        self.steps = self.rejected = self.evaluations = 0
        self.largest = 0.0
        self.status = ""

    @abstractmethod
    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""

    def nonfinite(self, state: Array) -> str:
        """The first component that is not finite, in words; empty if all are."""
        bad = np.flatnonzero(~np.isfinite(state))
        return f"{self.components[bad[0]]} is {state[bad[0]]} after the step" if len(bad) else ""

    def too_many(self, t: float, most: float) -> str:
        """The status of a run that may not go on."""
        return f"stopped at t = {t:.6g} s after max_steps = {most:g} steps"


class NativeIntegration(Integration):
    """A run of one of our methods.

    parameters: values of the program's inputs that are not built in.
    stopped: asked before every block; a run that is stopped raises StoppedError.
    """

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(compiled.program.components)
        self.program, self.runner, self.options = compiled.program, compiled.runner, options
        self.parameters, self._stopped = list(parameters), stopped
        self._passes = FIRST_PASSES

    def _run(self, memory: Array, passes: int, every: int = 1) -> tuple[Array, int]:
        if self._stopped():
            raise StoppedError
        return self.runner.run(memory, passes, every)

    def _advance(self, memory: Array, most: int, whole: bool) -> tuple[Array, int]:
        """Some passes, at most so many: their rows (the last alone, with `whole`), and how many."""
        passes = min(self._passes, most)
        begin = time.perf_counter()
        rows, done = self._run(memory, passes, passes if whole else 1)
        spent = time.perf_counter() - begin
        if passes == self._passes:
            self._passes = max(1, int(passes * min(4.0, BLOCK_TIME / max(spent, 1e-9))))
        return rows, done

    def _number(self, memory: Array, name: str) -> float:
        return float(self.runner.read(memory, name)[0])


class FixedStepIntegration(NativeIntegration):
    """Equal steps between the instants, at most dt. Every step is in a block, or only those at instants."""

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        stopped: Callable[[], bool] = lambda: False,
        *,
        every_step: bool,
    ) -> None:
        super().__init__(compiled, options, parameters, stopped)
        self.every_step = every_step

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        start: dict[str, float | Array | list[float]] = {"x": x, "p": self.parameters}
        if "fresh" in self.runner.program.registers:
            start["fresh"] = 1.0
        memory = self.runner.memory(start)
        for begin, end in itertools.pairwise(self.options.instants):
            steps = step_count(end - begin, self.options.step)
            h = (end - begin) / steps
            for name, value in (("start", begin), ("t", begin), ("count", 0.0), ("h", h)):
                self.runner.write(memory, name, value)
            yield from self._equal_steps(memory, steps, h, end)
            if self.status:
                return

    def _equal_steps(self, memory: Array, steps: int, h: float, end: float) -> Iterator[StepBlock]:
        """So many steps of h from a memory on, the last of which ends at an instant."""
        m, most, left = self.program.size, self.options.max_steps, steps
        while left:
            if self.steps >= most:
                self.status = self.too_many(self._number(memory, "t"), most)
                return
            x_old = self.runner.read(memory, "x").copy()
            rows, done = self._advance(memory, int(min(left, most - self.steps)), whole=not self.every_step)
            left -= done
            failed = self._number(memory, "nonfinite") != 0.0
            self.steps += done - failed
            self.evaluations = int(self._number(memory, "evaluations"))
            if self.every_step:
                rows = rows[: len(rows) - failed]
            elif left or failed:
                rows = rows[:0]
            if len(rows):
                self.largest = max(self.largest, min(h, self.options.step))
                if not left and not failed:
                    rows[-1, 0] = end
                t, states = rows[:, 0], rows[:, 1 : 1 + m]
                before = np.concatenate([x_old[None], states[:-1]])
                yield StepBlock(t, states, t - h, np.full(len(t), h), before, None)
            if failed:
                self.status = self._failure(memory)
                return

    def _failure(self, memory: Array) -> str:
        t = self._number(memory, "t")
        if "singular" in self.runner.program.registers and (index := int(self._number(memory, "singular"))):
            return f"stopped at t = {t:.6g} s: {self.components[index - 1]} has an inertia that is not positive"
        if reason := self.nonfinite(self.runner.read(memory, "x")):
            return f"stopped at t = {t:.6g} s: {reason}"
        return f"stopped at t = {t:.6g} s: the equations of the step did not converge; the step is too long"


class AdaptiveIntegration(NativeIntegration):
    """Steps chosen by the method."""

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        options = self.options
        start: Mapping[str, float | Array | list[float]] = {
            "x": x,
            "p": self.parameters,
            "end": options.t_end,
            "rtol": options.rtol,
            "atol": options.absolute,
            "next": self._first_step(x) if options.first_step is None else options.first_step,
            "max_step": options.longest_step,
            "fresh": 1.0,
            "error_old": 1e-4,
            "accepted": 1.0,
        }
        memory = self.runner.memory(start)
        while True:
            left = options.max_steps - self.steps - self.rejected
            if left <= 0:
                self.status = self.too_many(self._number(memory, "t"), options.max_steps)
                return
            rows, _ = self._advance(memory, int(min(left, 2**31)), whole=False)
            status = self._number(memory, "status")
            self.steps += len(rows)
            self.rejected = int(self._number(memory, "rejected"))
            self.evaluations = int(self._number(memory, "evaluations"))
            if len(rows):
                yield self._block(rows)
            if status == TOO_SMALL:
                self.status = self._too_small(memory)
            if status in (TOO_SMALL, DONE):
                return

    def _block(self, rows: Array) -> StepBlock:
        m = self.program.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        self.largest = max(self.largest, float(h.max()))
        if not self.program.dense:
            return StepBlock(t, x, t - h, h, np.full_like(x, math.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m))

    def _too_small(self, memory: Array) -> str:
        t, h = self._number(memory, "t"), self._number(memory, "h")
        if t == 0.0 and not np.isfinite(rate := self._rate(t, self.runner.read(memory, "x"))).all():
            first = self.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"stopped at t = 0 s: the rate of {first} is not finite at the start"
        text = f"stopped at t = {t:.6g} s: the step, {h:.3g} s, is below the resolution of the time"
        if reason := self.nonfinite(self.runner.read(memory, "x_new")):
            return f"stopped at t = {t:.6g} s: {reason}, however small"
        x = self.runner.read(memory, "x")
        speed = np.abs(self._rate(t, x)) / self._scale(x)
        return f"{text}; fastest is {self.components[int(np.nanargmax(speed))]}"

    def _rate(self, t: float, x: Array) -> Array:
        rate = self.program.rate
        assert rate is not None
        values = dict(zip(rate.input_names, [*x.tolist(), t, *self.parameters], strict=True))
        return np.array(list(rate.evaluate(values).values()), dtype=np.float64)

    def _scale(self, x: Array) -> Array:
        """What an error is measured by."""
        size: Array = self.options.absolute + self.options.rtol * np.abs(x)
        return size

    def _first_step(self, x: Array) -> float:
        """A step that two half steps confirm: their difference is within the tolerance.

        The estimate of an embedded method can vanish by symmetry, such as at a start from rest, and a guess from the
        first derivatives can be far off; halving cannot be fooled by either.
        """
        order, scale = self.program.order, self._scale(x)
        anything = {"rtol": HUGE, "atol": HUGE, "max_step": math.inf, "end": math.inf, "fresh": 1.0, "accepted": 1.0}
        memory = self.runner.memory({"x": x, "p": self.parameters, "error_old": 1.0, **anything})
        h = min(self.options.t_end, self.options.longest_step) * LEAP
        for _ in range(TRIALS):
            with np.errstate(all="ignore"):
                change = (self._forced(memory, [h]) - self._forced(memory, [0.5 * h, 0.5 * h])) / scale
                difference = float(np.sqrt(np.mean(change * change)))
            if difference <= 1.0:
                break
            factor = 0.9 * difference ** (-1.0 / (order + 1)) if math.isfinite(difference) else 0.0
            h *= min(0.5, max(1e-3, factor))
        return h

    def _forced(self, memory: Array, steps: Sequence[float]) -> Array:
        """The state after these steps from a memory, which is left as it is."""
        memory = memory.copy()
        for h in steps:
            self.runner.write(memory, "next", h)
            self._run(memory, 1)
        return self.runner.read(memory, "x")


def integration(
    compiled: CompiledSteps,
    options: RunOptions,
    parameters: Sequence[float] = (),
    stopped: Callable[[], bool] = lambda: False,
    *,
    every_step: bool = False,
) -> NativeIntegration:
    """A run, before its first step.  every_step: of equal steps, keep those between times of t_eval too."""
    if compiled.program.adaptive:
        return AdaptiveIntegration(compiled, options, parameters, stopped)
    every_step = every_step or options.times is None
    return FixedStepIntegration(compiled, options, parameters, stopped, every_step=every_step)
