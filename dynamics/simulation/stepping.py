"""Integrations: from a start to an end, a block of steps at a time, by equal steps or by steps chosen by error."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array

from ..integrators.step_control import COLLAPSE, DONE, ROUNDING, SMALLEST_ATOL, TOO_SMALL
from .dense_output import StepBlock
from .equal_steps import EqualSteps, equal_steps
from .first_step import LEAP, first_step
from .run_options import RunOptions
from .state_sizes import StateSizes
from .step_program import CompiledSteps

BLOCK_TIME = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
FIRST_PASSES = 32  # of the first block, before it is known how long one takes
ROUNDS = 4  # of a first step, by which the sizes of the states are known
HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff


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
    warnings: what speaks against the result, a sentence each.  event: the one that has ended it, in words.
    """

    def __init__(self, components: Sequence[str]) -> None:
        self.components = components
        self.steps = self.rejected = self.evaluations = 0
        self.largest = 0.0
        self.status = ""
        self.warnings: list[str] = []
        self.event = ""

    @property
    def plain(self) -> Integration | None:
        """The run without its events; None where they have changed its course."""
        return self

    @property
    @abstractmethod
    def jacobians(self) -> int:
        """Evaluations of the Jacobian of the rate."""

    @property
    @abstractmethod
    def factorizations(self) -> int:
        """LU factorizations of matrices."""

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
        self._accepted = True

    @property
    def jacobians(self) -> int:
        """Evaluations of the Jacobian of the rate: one for every state that steps were tried from."""
        return self.steps + (not self._accepted) if self.program.factorizations else 0

    @property
    def factorizations(self) -> int:
        """LU factorizations of matrices: in every trial of a step of an implicit method."""
        return self.program.factorizations * (self.steps + self.rejected)

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
        if self.program.adaptive:
            self._accepted = self._number(memory, "accepted") != 0.0
        if passes == self._passes:
            self._passes = max(1, int(passes * min(4.0, BLOCK_TIME / max(spent, 1e-9))))
        return rows, done

    def _number(self, memory: Array, name: str) -> float:
        return float(self.runner.read(memory, name)[0])


class FixedStepIntegration(NativeIntegration):
    """Equal steps between the instants, at most dt. Every step is in a block, or of a block the last alone.

    stretches: other steps than those of the options.
    """

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        stopped: Callable[[], bool] = lambda: False,
        *,
        every_step: bool,
        stretches: Sequence[EqualSteps] | None = None,
    ) -> None:
        super().__init__(compiled, options, parameters, stopped)
        self.every_step = every_step
        self.stretches = equal_steps(options.instants, options.step) if stretches is None else stretches

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        start: dict[str, float | Array | list[float]] = {"x": x, "p": self.parameters}
        if "fresh" in self.runner.program.registers:
            start["fresh"] = 1.0
        memory = self.runner.memory(start)
        for stretch in self.stretches:
            for name, value in (("start", stretch.begin), ("t", stretch.begin), ("count", 0.0), ("h", stretch.h)):
                self.runner.write(memory, name, value)
            yield from self._equal_steps(memory, stretch)
            if self.status:
                return

    def _equal_steps(self, memory: Array, stretch: EqualSteps) -> Iterator[StepBlock]:
        """The steps of a stretch from a memory on."""
        m, most, left = self.program.size, self.options.max_steps, stretch.steps
        while left:
            if self.steps >= most:
                self.status = self.too_many(self._number(memory, "t"), most)
                return
            before = memory.copy()
            rows, done = self._advance(memory, int(min(left, most - self.steps)), whole=not self.every_step)
            left -= done
            failed = self._number(memory, "nonfinite") != 0.0
            self.steps += done - failed
            self.evaluations = int(self._number(memory, "evaluations"))
            t_old, x_old = self._number(before, "t"), self.runner.read(before, "x").copy()
            if failed:
                rows = rows[:-1] if self.every_step else self._run(before, done - 1, max(1, done - 1))[0]
            if len(rows):
                self.largest = max(self.largest, min(abs(stretch.h), self.options.step))
                if not left and not failed:
                    rows[-1, 0] = stretch.end
                yield _block(rows[:, 0], rows[:, 1 : 1 + m], t_old, x_old)
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


def _block(t: Array, states: Array, t_old: float, x_old: Array) -> StepBlock:
    """The steps that end at the times t (T,), from x_old at t_old on."""
    times, before = np.append(t_old, t[:-1]), np.concatenate([x_old[None], states[:-1]])
    return StepBlock(t, states, times, t - times, before, None)


class AdaptiveIntegration(NativeIntegration):
    """Steps chosen by the method."""

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(compiled, options, parameters, stopped)
        self.relative = max(options.relative, ROUNDING)
        self.absolute = np.broadcast_to(np.maximum(options.absolute, SMALLEST_ATOL), self.program.size)
        self.sizes = StateSizes(self.relative, self.program.kinds, SMALLEST_ATOL) if options.atol is None else None
        self._stiff = self._below_rounding = False

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        options, wanted = self.options, self._first_step(x)
        start: Mapping[str, float | Array | list[float]] = {
            "x": x,
            "p": self.parameters,
            "t": options.t0,
            "end": options.t_end,
            "rtol": self.relative,
            "atol": self.absolute,
            "next": wanted,
            "max_step": options.longest_step,
            "min_step": COLLAPSE * abs(options.t_end - options.t0),
            "fresh": 1.0,
            "error_old": 1e-4,
            "accepted": 1.0,
        }
        memory = self.runner.memory(start)
        seen = FIRST_PASSES  # so many trials, and then twice as many as before, between two looks at the sizes
        while True:
            done = self.steps + self.rejected
            left = options.max_steps - done
            if left <= 0:
                self.status = self.too_many(self._number(memory, "t"), options.max_steps)
                return
            rows, _ = self._advance(memory, int(min(left, seen - done if self.sizes else 2**31)), whole=False)
            status = self._number(memory, "status")
            self.steps += len(rows)
            self.rejected = int(self._number(memory, "rejected"))
            self.evaluations = int(self._number(memory, "evaluations"))
            if len(rows):
                self._look(memory, rows)
                yield self._block(rows)
                self._see(rows)
            if self.sizes and self.steps + self.rejected >= seen:
                seen *= 2
                self.runner.write(memory, "atol", self.absolute)
            if status == TOO_SMALL:
                self.status = self._too_small(memory)
            if status in (TOO_SMALL, DONE):
                return

    def _block(self, rows: Array) -> StepBlock:
        m = self.program.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        self.largest = max(self.largest, min(float(np.abs(h).max()), self.options.longest_step))
        if not self.program.dense:
            return StepBlock(t, x, t - h, h, np.full_like(x, math.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m))

    def _look(self, memory: Array, rows: Array) -> None:
        """Note once what a user should know of these steps: stiffness, and tolerances below rounding."""
        options, held = self.options, int(self._number(memory, "held"))
        if held >= HELD and held >= SHARE * self.steps and not self._stiff:
            self._stiff = True
            t, h = rows[-1, :2]
            self.warnings.append(
                f"the system is stiff: at t = {t:.6g} s the step, {abs(h):.3g} s, is held at the stability limit of "
                f"method {options.method!r}, not by its tolerance; try method='radau'"
            )
        if options.relative < self.relative and not self._below_rounding:
            size = np.abs(rows[:, 2 : 2 + self.program.size])
            short = (self.absolute + options.relative * size < self.relative * size).any(axis=0)
            if short.any():
                self._below_rounding = True
                self.warnings.append(
                    f"rtol = {options.relative:g} with the atol of {self.components[int(np.argmax(short))]} is below "
                    f"the rounding of a step: raised to {self.relative:.3g}"
                )

    def _too_small(self, memory: Array) -> str:
        t, x = self._number(memory, "t"), self.runner.read(memory, "x")
        where, rate = f"stopped at t = {t:.6g} s: ", self._rate(t, x)
        if not np.isfinite(rate).all():
            first = self.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"{where}the rate of {first} is not finite{' at the start' if t == self.options.t0 else ''}"
        if reason := self.nonfinite(self.runner.read(memory, "x_new")):
            return f"{where}{reason}, however small"
        fastest = self.components[int(np.argmax(np.abs(rate) / self._scale(x)))]
        h = self._number(memory, "tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"

    def _rate(self, t: float, x: Array) -> Array:
        rate = self.program.rate
        assert rate is not None
        values = dict(zip(rate.input_names, [*x.tolist(), t, *self.parameters], strict=True))
        return np.array(list(rate.evaluate(values).values()), dtype=np.float64)

    def _see(self, rows: Array) -> None:
        if self.sizes:
            self.absolute = self.sizes.see(rows[:, 2 : 2 + self.program.size])

    def _first_step(self, x: Array) -> float:
        """The first step; where atol is chosen by the sizes of the states, those that it leads to."""
        options, rate = self.options, self._rate(self.options.t0, x)
        start: dict[str, ArrayLike] = {"x": x, "p": self.parameters}
        if self.sizes is None:
            if options.first_step is not None:
                return options.first_step
            return first_step(self.runner, self.program.order, options, start, rate, self._scale(x))
        h = min(options.length, options.longest_step) * LEAP if options.first_step is None else options.first_step
        for _ in range(ROUNDS):
            self.absolute = self.sizes.see(self._ahead(x, rate, h), anew=True)
            if options.first_step is not None:
                break
            before, h = h, first_step(self.runner, self.program.order, options, start, rate, self._scale(x))
            if h >= 0.5 * before:
                break
        return h

    def _ahead(self, x: Array, rate: Array, h: float) -> Array:
        """x, and where two of Euler's steps lead to, (3, m)."""
        options = self.options
        signed = math.copysign(h, options.t_end - options.t0)
        with np.errstate(all="ignore"):
            first = x + signed * rate
            return np.stack([x, first, first + signed * self._rate(options.t0 + signed, first)])

    def _scale(self, x: Array) -> Array:
        """What an error is measured by."""
        size: Array = self.absolute + self.relative * np.abs(x)
        return size


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
