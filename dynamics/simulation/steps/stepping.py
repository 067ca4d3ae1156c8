"""Integrations: from a start to an end, a block of steps at a time or unrecorded; by equal steps."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ...integrators.step_control import RUNNING
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

    prices = (0.0, 0.0)

    def __init__(self, components: Sequence[str]) -> None:
        self.components = components
        self.parameters: list[float] = []
        self.restart()

    def restart(self) -> None:
        """Nothing of a run is done."""
        self.steps = self.rejected = self.evaluations = self.jacobians = self.factorizations = self.resets = 0
        self.largest = 0.0
        self.status = ""
        self.warnings: list[str] = []
        self.event = self.stiff = self.slope = ""

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
    """Runs of one of our methods, one after another in a memory that is kept; one thread at a time.

    A run is recorded, by `blocks`, or goes on unrecorded: from `begin` by `step`, `until` an instant, or `to_end`.
    x: the state, (m,), in the memory, whose halves are q and qd.
    """

    def __init__(self, run: NativeRun, start: Mapping[str, float]) -> None:
        """start: registers of one number before a run, besides its span."""
        compiled = run.compiled
        super().__init__(compiled.program.components)
        self.run, self.program, self.runner, self.options = run, compiled.program, compiled.runner, run.options
        self.control = run.control
        self._passes, self._factored, self.prices = FIRST_PASSES, compiled.factorizations, compiled.prices
        self._stop = compiled.places[str(self.runner.program.stop)]
        self._start, self._memory, self._at = np.zeros(self.runner.size), np.zeros(self.runner.size), compiled.places
        self._numbers: Any = self._memory.data  # whose items are read and written faster
        self._zero: Any = self._start.data
        for name, value in start.items():
            self._start[self._at[name]] = value
        if run.control is None:
            self.set_parameters(run.parameters)
        self.x = self.runner.read(self._memory, "x")
        self.q, self.qd = self.x[: self.program.nq], self.x[self.program.nq :]
        self._halves: Any = (self.q.data, self.qd.data)

    @property
    def t(self) -> float:
        """Time that the run has reached [s]."""
        return self._number("t")

    def set_parameters(self, p: Sequence[float]) -> None:
        """Values of the parameters in the runs that begin from here on."""
        self.parameters = list(p)
        self.runner.write(self._start, "p", self.parameters)

    def begin(self, x: Array, t0: float, t_end: float) -> None:
        """Start anew, from x (m,) at t0, on the way to t_end."""
        self._numbers[:], self.status = self._zero, ""
        self.x[:] = x
        self._begin(t0, t_end)

    def begins(self, q: object, qd: object, t0: float, t_end: float) -> bool:
        """Start anew from q and qd, if they are arrays of float64 that fit and finite. qd: None where q is all."""
        self._numbers[:], self.status = self._zero, ""
        try:  # which compares shapes and types, quicker than to look at them first
            self._halves[0][:] = q
            if len(self.qd):
                self._halves[1][:] = qd
            elif qd is not None:
                return False
        except (TypeError, ValueError, NotImplementedError, BufferError):
            return False
        self._begin(t0, t_end)
        return math.isfinite(self.x.dot(self.x))

    @abstractmethod
    def _begin(self, t0: float, t_end: float) -> None: ...

    @abstractmethod
    def to_end(self) -> None:
        """After `begin`, all steps; `status` says why they do not come to t_end."""

    @abstractmethod
    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there; `status` says why they do not come there."""

    @abstractmethod
    def step(self) -> None:
        """Take one step on the way to t_end."""

    @cached_property
    def _unrecorded(self) -> Callable[[int], None]:
        return self.runner.advancing(self._memory)

    def _go(self, most: int = 2**62) -> None:
        """Make so many passes, or until the program stops, in pieces of bounded time: Ctrl-C ends them in between."""
        self._unrecorded(min(FIRST_PASSES, most))
        most -= FIRST_PASSES
        while most > 0 and self._numbers[self._stop] == RUNNING:
            most -= self._piece(most)

    def _piece(self, most: int) -> int:
        """How many passes were made, unrecorded, at most so many or until the program stops."""
        if self.run.stopped():
            raise StoppedError
        passes, begin = min(self._passes, most), time.perf_counter()
        self._unrecorded(passes)
        if passes == self._passes and self._numbers[self._stop] == RUNNING:
            self._pace(passes, begin)
        return passes

    def _advance(self, most: int, *, whole: bool = False) -> tuple[Array, int]:
        """Make passes, at most so many: their rows (the last alone, with `whole`), and how many."""
        if self.run.stopped():
            raise StoppedError
        passes, begin = min(self._passes, most), time.perf_counter()
        rows, done = self.runner.run(self._memory, passes, passes if whole else 1)
        if done == self._passes:
            self._pace(passes, begin)
        return rows, done

    def _pace(self, passes: int, begin: float) -> None:
        """How many passes may go together, since so many took until now."""
        self._passes = max(1, int(passes * min(4.0, BLOCK_TIME / max(time.perf_counter() - begin, 1e-9))))

    def _count(self, steps: int) -> None:
        """So many steps more.

        The Jacobian is evaluated for every state that steps are tried from, and factored in every trial.
        """
        self.steps, self.evaluations = self.steps + steps, int(self._number("evaluations"))
        if "jacobians" in self._at:  # a method that keeps them counts by itself
            self.jacobians, self.factorizations = int(self._number("jacobians")), int(self._number("factorizations"))
        elif self._factored:
            self.jacobians = self.steps + (self.program.adaptive and not self._number("accepted"))
            self.factorizations = self._factored * (self.steps + self.rejected)

    def _number(self, name: str) -> float:
        return float(self._numbers[self._at[name]])

    def _set(self, **values: float) -> None:
        for name, value in values.items():
            self._numbers[self._at[name]] = value


class FixedStepIntegration(NativeIntegration):
    """Equal steps between the instants, at most dt. Every step is in a block, or of a block the last alone.

    stretches: its steps, those of the options unless others are given.  stretch: the one that it is in.
    Unrecorded, steps from a start or an end to the next end have one length.
    """

    def __init__(
        self, run: NativeRun, *, every_step: bool = True, stretches: Sequence[EqualSteps] | None = None
    ) -> None:
        super().__init__(run, {"fresh": 1.0} if "fresh" in run.compiled.places else {})
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
        self.restart()
        self.begin(x, self.options.t0, self.options.t_end)
        for stretch in self.stretches:
            self._enter(stretch)
            if self.control is not None:
                self.parameters = self.control.at(stretch.begin, self.x)
                self.runner.write(self._memory, "p", self.parameters)
            yield from self._recorded(stretch)
            if self.status:
                return

    def _begin(self, t0: float, t_end: float) -> None:
        self._set(t=t0)
        self._t_end, self._left = t_end, 0

    def _enter(self, stretch: EqualSteps) -> None:
        self.stretch, self._left = stretch, stretch.steps
        self._set(start=stretch.begin, t=stretch.begin, count=0.0, h=stretch.h)

    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there."""
        self._enter(equal_steps([self.t, t], self.options.step)[0])
        self._steps(self._left)
        self._left = 0

    def to_end(self) -> None:
        """Take all steps."""
        self.until(self._t_end)

    def step(self) -> None:
        """Take one step on the way to t_end."""
        if not self._left:
            self._enter(equal_steps([self.t, self._t_end], self.options.step)[0])
        self._steps(1)

    def _steps(self, steps: int) -> None:
        """So many steps of the stretch, unrecorded; those before one that fails, for the state before it."""
        before = self._memory.copy()
        self._go(steps)
        self._left -= steps
        if self._number("nonfinite"):
            done = int(self._number("count") - before[self._at["count"]])
            self._memory[:] = before
            self._go(done - 1)
            before[:] = self._memory
            self._go(1)
            self.status = self.failure(self.runner.read(before, "x"))
            self._memory[:] = before
        elif not self._left:
            self._set(t=self.stretch.end)

    def _recorded(self, stretch: EqualSteps) -> Iterator[StepBlock]:
        """The steps of a stretch, recorded."""
        m, most = self.program.size, self.options.max_steps
        while self._left:
            if self.steps >= most:
                self.status = self.too_many(self.t, most)
                return
            before, t_old, x_old = self._memory.copy(), self.t, self.x.copy()
            rows, done = self._advance(int(min(self._left, most - self.steps)), whole=not self.every_step)
            self._left -= done
            failed = self._number("nonfinite") != 0.0
            self._count(done - failed)
            if failed:
                rows = rows[:-1] if self.every_step else self.runner.run(before, done - 1, max(1, done - 1))[0]
            if len(rows):
                self.largest = max(self.largest, min(abs(stretch.h), self.options.step))
                if not self._left and not failed:
                    rows[-1, 0] = stretch.end
                block = _block(rows[:, 0], rows[:, 1 : 1 + m], t_old, x_old)
                yield block._replace(normalization=self.program.normalization)
            if failed:
                self.status = self.failure(rows[-1, 1 : 1 + m] if len(rows) else x_old)
                return

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block that has come last, with dense output of the method's order: by shorter steps of the method."""
        runner, shares = self.runner, inside_nodes(self.program.order)
        states = np.empty((len(shares), len(block.t), self.program.size))
        if len(shares):
            start = self._start.copy()
            runner.write(start, "p", self.parameters)
            memory = start.copy()
            call = runner.bind(memory, np.empty((1, runner.program.width)))
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

    def failure(self, before: Array) -> str:
        """Reason why the step from a state (m,) failed."""
        if "singular" in self._at and (singular := int(self._number("singular"))):
            reason = f"{self.components[singular - 1]} has an inertia that is not positive"
        else:
            reason = nonfinite(self.components, self.x) or unsolved(self.components, before, self.x)
        return f"stopped at t = {self.t:.6g} s: {reason}"


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
