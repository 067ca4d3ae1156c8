"""Integrations: from a start to an end, a block of steps at a time; by equal steps."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, Runner

from ..run_options import RunOptions
from ..sampled_controller import Hold
from ..trajectory import Crossings
from .dense_output import StepBlock, inside_nodes, with_hermite
from .equal_steps import EqualSteps, equal_steps
from .step_program import CompiledSteps

BLOCK_TIME = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
TINY = np.finfo(float).tiny
FIRST_PASSES = 32  # of the first block, before it is known how long one takes


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

    jacobians, factorizations: evaluations of the Jacobian of the rate, LU factorizations of matrices; prices: of one of
    each, in evaluations of the rate.
    status: empty while all is well, else why it stopped before the end.  largest: step [s].
    warnings: what speaks against the result, a sentence each.  event: the one that has ended it, in words.
    parameters: values of the rate's inputs that are not built in, as of the block that has come last.
    stiff: that one of `warnings` by which the steps are held at a stability limit.
    resets: of the state, by events, so far.
    slope: that of the rate, in words, which is not finite where the run stopped, and which the method needs.
    """

    def __init__(self, components: Sequence[str]) -> None:
        self.components = components
        self.steps = self.rejected = self.evaluations = self.jacobians = self.factorizations = self.resets = 0
        self.largest, self.prices = 0.0, (0.0, 0.0)
        self.status = ""
        self.warnings: list[str] = []
        self.event = self.stiff = self.slope = ""
        self.parameters: list[float] = []

    @property
    def segment(self) -> Integration:
        """The part of the run that it is in: what makes its steps since the last reset."""
        return self

    @abstractmethod
    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""

    def crossings(self, nq: int, parameters: ArrayLike = 0.0) -> dict[str, Crossings]:
        """Crossings by the event's name, with states split after nq numbers; parameters: of the problem."""
        return {}

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block that has come last, with dense output."""
        return block

    def too_many(self, t: float, most: float) -> str:
        """The status of a run that may not go on."""
        return f"stopped at t = {t:.6g} s after max_steps = {most:g} steps"


class NativeRun(NamedTuple):
    """Run of one of our methods: its program, memory and record.

    parameters: values of the program's inputs that are not built in.
    stopped: asked before every block; a run that is stopped raises StoppedError.
    control: the forces that are held over periods, which then are the parameters.
    """

    compiled: CompiledSteps
    options: RunOptions
    parameters: Sequence[float] = ()
    stopped: Callable[[], bool] = lambda: False
    control: Hold | None = None


class NativeIntegration(Integration):
    """A run of one of our methods."""

    def __init__(self, run: NativeRun) -> None:
        compiled = run.compiled
        super().__init__(compiled.program.components)
        self.run, self.program, self.runner, self.options = run, compiled.program, compiled.runner, run.options
        self.parameters, self.control = list(run.parameters), run.control
        self._passes, self._factored, self.prices = FIRST_PASSES, compiled.factorizations, compiled.prices
        self._accepted = True

    @abstractmethod
    def memory(self, x: Array) -> Array:
        """The memory before the first step from x (m,)."""

    def _count(self, steps: int, rejected: int = 0) -> None:
        """Count so many steps.  rejected: trials that were not accepted, in all.

        The Jacobian is evaluated for every state that steps are tried from, and factored in every trial.
        """
        self.steps, self.rejected = self.steps + steps, rejected
        if self._factored:
            self.jacobians = self.steps + (not self._accepted)
            self.factorizations = self._factored * (self.steps + self.rejected)

    def _run(self, memory: Array, passes: int, every: int = 1) -> tuple[Array, int]:
        if self.run.stopped():
            raise StoppedError
        return self.runner.run(memory, passes, every)

    def _advance(self, memory: Array, most: int, whole: bool) -> tuple[Array, int]:
        """Make passes, at most so many: their rows (the last alone, with `whole`), and how many."""
        passes = min(self._passes, most)
        begin = time.perf_counter()
        rows, done = self._run(memory, passes, passes if whole else 1)
        spent = time.perf_counter() - begin
        if self.program.adaptive:
            self._accepted = self._number(memory, "accepted") != 0.0
        if done == self._passes:
            self._passes = max(1, int(passes * min(4.0, BLOCK_TIME / max(spent, 1e-9))))
        return rows, done

    def _number(self, memory: Array, name: str) -> float:
        return float(self.runner.read(memory, name)[0])


class FixedStepIntegration(NativeIntegration):
    """Equal steps between the instants, at most dt. Every step is in a block, or of a block the last alone.

    stretches: its steps, those of the options unless others are given.  stretch: the one that it is in.
    """

    def __init__(
        self, run: NativeRun, *, every_step: bool = True, stretches: Sequence[EqualSteps] | None = None
    ) -> None:
        super().__init__(run)
        self.every_step, options = every_step, run.options
        if stretches is None:
            instants = options.instants if run.control is None else run.control.instants(options.instants)
            stretches = equal_steps(instants, options.step)
        self.stretches, self.stretch = stretches, stretches[0]

    def beside(self, stretches: Sequence[EqualSteps], parameters: Sequence[float]) -> FixedStepIntegration:
        """Run by other steps, with parameters in place of a controller."""
        options = replace(self.options, max_steps=math.inf)
        run = self.run._replace(options=options, parameters=parameters, control=None)
        return FixedStepIntegration(run, stretches=stretches)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        memory = self.memory(x)
        for stretch in self.stretches:
            self.stretch = stretch
            begin_equal(self.runner, memory, stretch.begin, stretch.h)
            if self.control is not None:
                self.parameters = self.control.at(stretch.begin, self.runner.read(memory, "x"))
                self.runner.write(memory, "p", self.parameters)
            yield from self._equal_steps(memory, stretch)
            if self.status:
                return

    def memory(self, x: Array) -> Array:
        """The memory before the first step."""
        start: dict[str, float | Array | list[float]] = {"x": x}
        if self.control is None:
            start["p"] = self.parameters
        if "fresh" in self.runner.program.registers:
            start["fresh"] = 1.0
        return self.runner.memory(start)

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
            self._count(done - failed)
            self.evaluations = int(self._number(memory, "evaluations"))
            t_old, x_old = self._number(before, "t"), self.runner.read(before, "x").copy()
            if failed:
                rows = rows[:-1] if self.every_step else self._run(before, done - 1, max(1, done - 1))[0]
            if len(rows):
                self.largest = max(self.largest, min(abs(stretch.h), self.options.step))
                if not left and not failed:
                    rows[-1, 0] = stretch.end
                block = _block(rows[:, 0], rows[:, 1 : 1 + m], t_old, x_old)
                yield block._replace(normalization=self.program.normalization)
            if failed:
                self.status = self.failure(memory, rows[-1, 1 : 1 + m] if len(rows) else x_old)
                return

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block that has come last, with dense output of the method's order: by shorter steps of the method."""
        runner, shares = self.runner, inside_nodes(self.program.order)
        states = np.empty((len(shares), len(block.t), self.program.size))
        if len(shares):
            memory = runner.memory({"p": self.parameters})
            if "fresh" in runner.program.registers:
                runner.write(memory, "fresh", 1.0)
            start, call = memory.copy(), runner.bind(memory, np.empty((1, runner.program.width)))
            x, t, begin, h = (runner.read(memory, name) for name in ("x", "t", "start", "h"))
            for k, row in np.ndindex(states.shape[:2]):
                memory[:] = start
                x[:], t[:], begin[:], h[:] = (
                    block.x_old[row],
                    block.t_old[row],
                    block.t_old[row],
                    shares[k] * block.h[row],
                )
                call()
                states[k, row] = x
        return with_hermite(block, self.program.rate, self.parameters, states)

    def failure(self, memory: Array, before: Array) -> str:
        """Reason why the step from a state (m,) failed."""
        singular = self._number(memory, "singular") if "singular" in self.runner.program.registers else 0.0
        after = self.runner.read(memory, "x")
        return failed_step(self.components, self._number(memory, "t"), before, after, int(singular))


def failed_step(components: Sequence[str], t: float, before: Array, x: Array, singular: int) -> str:
    """Reason why a step from one state to another, (m,), at t, failed.

    singular: the number of the component whose inertia is not positive, from 1 on; else 0.
    """
    if singular:
        reason = f"{components[singular - 1]} has an inertia that is not positive"
    else:
        reason = nonfinite(components, x) or unsolved(components, before, x)
    return f"stopped at t = {t:.6g} s: {reason}"


def begin_equal(runner: Runner, memory: Array, begin: float, h: float) -> None:
    """The steps that follow are of h [s], from `begin` on."""
    for name, value in (("start", begin), ("t", begin), ("count", 0.0), ("h", h)):
        runner.write(memory, name, value)


def nonfinite(components: Sequence[str], state: Array) -> str:
    """The first component that is not finite, in words; empty if all are."""
    bad = np.flatnonzero(~np.isfinite(state))
    return f"{components[bad[0]]} is {state[bad[0]]} after the step" if len(bad) else ""


def unsolved(components: Sequence[str], before: Array, x: Array) -> str:
    """Reason why a step to a state, (m,), that is no solution failed: with the component that moved most."""
    moved = np.abs(x - before) / np.maximum(np.abs(x), np.abs(before)).clip(TINY)
    first = components[int(np.argmax(moved))]
    return f"the equations of the step did not converge; the step is too long, first of all for {first}"


def _block(t: Array, states: Array, t_old: float, x_old: Array) -> StepBlock:
    """The steps that end at the times t (T,), from x_old at t_old on."""
    times, before = np.append(t_old, t[:-1]), np.concatenate([x_old[None], states[:-1]])
    return StepBlock(t, states, times, t - times, before, None)
