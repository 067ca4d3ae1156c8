"""Steppers: the steps of a method from one start after another, equal or chosen, recorded block by block or not."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..integrators import Problem
from ..integrators.step_control import DONE, RUNNING, SMALLEST_ATOL, TOO_SMALL
from .applied_force import Hold
from .run_options import RunOptions
from .steps.dense_output import StepBlock, inside_nodes, with_hermite
from .steps.equal_steps import EqualSteps, equal_steps
from .steps.first_step import TOLERANCE, given, instant
from .steps.flat_position import CREEP, FlatPosition
from .steps.row_values import values_of
from .steps.step_program import CompiledSteps, compile_steps, step_program

if TYPE_CHECKING:
    from .events.event import EventProgram
    from .events.event_log import EventLog

BLOCK_TIME = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
TINY = np.finfo(float).tiny
FIRST_PASSES = 32  # of the first block, before it is known how long one takes
HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff
COUNTED = "steps", "rejected", "evaluations", "jacobians", "factorizations"


class StoppedError(Exception):
    """Nobody waits for the rest of the run any more."""


class Stepper(ABC):
    """Runs of one of our methods, one after another in a memory that is kept; one thread at a time.

    A run is recorded, by `blocks`, or goes on unrecorded: from `begin` by `step`, `until` an instant, or `to_end`.

    x: the state, (m,), in the memory, whose halves are q and qd.  parameters: inputs of the program.
    control: the forces that are held over periods, which then are the parameters.  log: of the events that are watched.
    stopped: asked before every block; a run that is stopped raises StoppedError.
    steps, rejected, evaluations, jacobians, factorizations, resets: how many of a recorded run so far.
    largest: step [s].  prices: of a Jacobian and of a factorization, in evaluations of the rate.
    status: empty while all is well, else why it stopped before the end.  event: the one that has ended it, in words.
    warnings: what speaks against the result, a sentence each; stiff: that one by which steps are held at a stability
    limit.  slope: that of the rate, in words, which is not finite where the run stopped, and which the method needs.
    """

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        control: Hold | None = None,
        log: EventLog | None = None,
        stopped: Callable[[], bool] = lambda: False,
        *,
        every_step: bool = True,
    ) -> None:
        """every_step: whether every step is in a block, or of a block the last alone."""
        self.compiled, self.program, self.runner, self.options = compiled, compiled.program, compiled.runner, options
        self.control, self.log, self.stopped, self.every_step = control, log, stopped, every_step
        self.components, self.parameters = self.program.components, list[float]()
        self._at, self._passes = compiled.places, FIRST_PASSES
        self._stop = self._at[str(self.runner.program.stop)]
        self._start, self._memory = np.zeros(self.runner.size), np.zeros(self.runner.size)
        self._numbers: Any = self._memory.data  # whose items are read and written faster
        self._zero: Any = self._start.data
        for name, value in self._first().items():
            self.runner.write(self._start, name, value)
        if control is None:
            self.set_parameters(parameters)
        self.x = self.runner.read(self._memory, "x")
        self.q, self.qd = self.x[: self.program.nq], self.x[self.program.nq :]
        self._halves: Any = (self.q.data, self.qd.data)
        self._clear()

    def _clear(self) -> None:
        """Nothing of a run is done."""
        self.steps = self.rejected = self.evaluations = self.jacobians = self.factorizations = self.resets = 0
        self._before = dict.fromkeys(COUNTED, 0)  # the last reset
        self.largest, self.warnings = 0.0, list[str]()
        self.status = self.event = self.stiff = self.slope = ""

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

    def has_begun(self, q: object, qd: object, t0: float, t_end: float) -> bool:
        """Start anew from q and qd; whether they are arrays of float64 that fit and finite. qd: None where q is all."""
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

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset by an event is a step of no length."""
        t, t_end = self.options.t0, self.options.t_end
        log = self.log = None if self.log is None else self.log.anew()
        self._clear()
        while True:
            self.begin(x, t, t_end)
            for made in self._recorded(t, t_end):
                if log is None:
                    yield made
                    continue
                log.parameters = self.parameters
                block = log(self.with_dense(made))
                self.steps -= len(made.t) - len(block.t)
                if len(block.t):
                    yield block
                if log.ended or log.restart is not None:
                    break
            if log is None:
                return
            if not (self.status or log.ended or log.restart):
                log.finish()
            self.warnings += [each for each in log.said.values() if each not in self.warnings]
            self.status, self.event = log.status or self.status, log.ended
            if self.status or log.restart is None:
                return
            (t, before, x), log.restart = log.restart, None
            self.resets, at = log.resets, np.array([t])
            yield StepBlock(at, x[None], at, np.zeros(1), before[None], np.zeros((1, 1, len(x))))
            if self.event or t == t_end:
                return
            self._before = {name: getattr(self, name) for name in COUNTED}

    @abstractmethod
    def _first(self) -> Mapping[str, ArrayLike]:
        """Registers before a run, besides its span."""

    @abstractmethod
    def _begin(self, t0: float, t_end: float) -> None:
        """Set the registers of a span."""

    @abstractmethod
    def _recorded(self, t0: float, t_end: float) -> Iterator[StepBlock]:
        """The steps of the run that has begun at t0."""

    @abstractmethod
    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block that has come last, with dense output."""

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
        return self.runner.bind(self._memory)

    def _go(self, most: int = 2**62) -> None:
        """Make so many passes, or until the program stops, in pieces of bounded time: Ctrl-C ends them in between."""
        self._unrecorded(min(FIRST_PASSES, most))
        most -= FIRST_PASSES
        while most > 0 and self._numbers[self._stop] == RUNNING:
            passes, begin = self._next(most)
            self._unrecorded(passes)
            self._pace(passes, begin)
            most -= passes

    def _advance(self, most: int, every: int = 1) -> tuple[Array, int]:
        """Make passes, at most so many: the rows of each `every`th, or with 0 of the last alone; and how many."""
        passes, begin = self._next(most)
        rows, done = self.runner.run(self._memory, passes, every or passes)
        self._pace(done, begin)
        return rows, done

    def _next(self, most: int) -> tuple[int, float]:
        """How many passes may go together, and now [s]."""
        if self.stopped():
            raise StoppedError
        return min(self._passes, most), time.perf_counter()

    def _pace(self, passes: int, begin: float) -> None:
        """How many passes may go together from here on, since so many took until now."""
        if passes == self._passes:
            share = BLOCK_TIME / max(time.perf_counter() - begin, 1e-9)
            self._passes = max(1, int(passes * min(4.0, share)))

    def _count(self, steps: int, rejected: int, longest: float) -> None:
        """So many steps since the last reset.

        The Jacobian is evaluated for every state that steps are tried from, and factored in every trial.
        """
        found = {"steps": steps, "rejected": rejected, "evaluations": int(self._number("evaluations"))}
        if "jacobians" in self._at:  # a method that keeps them counts by itself
            found |= {name: int(self._number(name)) for name in ("jacobians", "factorizations")}
        elif self.compiled.factorizations:
            found["jacobians"] = steps + (self.program.adaptive and not self._number("accepted"))
            found["factorizations"] = self.compiled.factorizations * (steps + rejected)
        for name, number in found.items():
            setattr(self, name, self._before[name] + number)
        self.largest = max(self.largest, longest)

    def _too_many(self) -> str:
        return f"stopped at t = {self.t:.6g} s after max_steps = {self.options.max_steps:g} steps"

    def _number(self, name: str) -> float:
        return float(self._numbers[self._at[name]])

    def _set(self, **values: float) -> None:
        for name, value in values.items():
            self._numbers[self._at[name]] = value


class EqualStepper(Stepper):
    """Equal steps between the instants, at most dt.

    stretches: of steps, those of the options unless others are set.  stretch: the one that it is in.
    Unrecorded, steps from a start or an end to the next end have one length.
    """

    stretches: Sequence[EqualSteps] = ()

    def _first(self) -> Mapping[str, ArrayLike]:
        return {"fresh": 1.0} if "fresh" in self._at else {}

    def _begin(self, t0: float, t_end: float) -> None:
        self._set(t=t0)
        self._t_end, self._left = t_end, 0

    def beside(self, stretches: Sequence[EqualSteps], parameters: Sequence[float]) -> EqualStepper:
        """The stepper of other stretches, with parameters in place of a controller, without events."""
        options = replace(self.options, max_steps=math.inf)
        other = EqualStepper(self.compiled, options, parameters, stopped=self.stopped)
        other.stretches = stretches
        return other

    def _recorded(self, t0: float, t_end: float) -> Iterator[StepBlock]:
        instants = [t0, *[t for t in self.options.instants if self.options.direction * (t - t0) > 0.0]]
        instants = instants if self.control is None else self.control.instants(instants)
        done = 0
        for stretch in self.stretches or equal_steps(instants, self.options.step):
            self._enter(stretch)
            if self.control is not None:
                self.parameters = self.control.at(stretch.begin, self.x)
                self.runner.write(self._memory, "p", self.parameters)
            for block, count in self._steps_of_stretch(self.every_step, self.options.max_steps):
                done += count
                self._count(done, 0, min(abs(stretch.h), self.options.step) if count else 0.0)
                if count:
                    yield block
            if self.status:
                return

    def _enter(self, stretch: EqualSteps) -> None:
        self.stretch, self._left = stretch, stretch.steps
        self._set(start=stretch.begin, t=stretch.begin, count=0.0, h=stretch.h)

    def _steps_of_stretch(self, every_step: bool, most: float = math.inf) -> Iterator[tuple[StepBlock, int]]:
        """The steps of the stretch, and how many; after one that fails the state is the one before it."""
        m, normalization = self.program.size, self.program.normalization
        while self._left:
            if self.steps >= most:
                self.status = self._too_many()
                return
            before, t_old, x_old = self._memory.copy(), self.t, self.x.copy()
            rows, done = self._advance(int(min(self._left, most - self.steps)), int(every_step))
            status = ""
            if self._number("nonfinite"):
                done, after = done - 1, self._memory.copy()
                self._memory[:] = before
                rows = self.runner.run(self._memory, done, 1 if every_step else max(1, done))[0]
                status = self._failure(after)
                self._set(evaluations=after[self._at["evaluations"]])
            self._left -= done
            t, x = rows[:, 0], rows[:, 1 : 1 + m]
            if not (self._left or status):
                t[-1] = self.stretch.end
            begin, starts = np.append(t_old, t[:-1])[: len(t)], np.concatenate([x_old[None], x[:-1]])[: len(t)]
            yield StepBlock(t, x, begin, t - begin, starts, None, normalization), done
            if status:
                self.status = status
                return

    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there."""
        self._enter(equal_steps([self.t, t], self.options.step)[0])
        self._take(self._left)

    def to_end(self) -> None:
        """Take all steps."""
        self.until(self._t_end)

    def step(self) -> None:
        """Take one step on the way to t_end."""
        if not self._left:
            self._enter(equal_steps([self.t, self._t_end], self.options.step)[0])
        self._take(1)

    def _take(self, steps: int) -> None:
        """So many steps of the stretch, unrecorded; those before one that fails."""
        before = self._memory.copy()
        self._go(steps)
        if self._number("nonfinite"):
            self._memory[:] = before
            for _ in self._steps_of_stretch(every_step=False):
                pass
            return
        self._left -= steps
        if not self._left:
            self._set(t=self.stretch.end)

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block with dense output of the method's order: by shorter steps of the method."""
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
                x[:], t[:], begin[:] = block.x_old[row], block.t_old[row], block.t_old[row]
                h[:] = shares[k] * block.h[row]
                call()
                states[k, row] = x
        return with_hermite(block, self.program.rate, self.parameters, states)

    def _failure(self, memory: Array) -> str:
        """Reason why the step from the state to that of a memory failed."""
        singular, t = (memory[self._at[name]] if name in self._at else 0.0 for name in ("singular", "t"))
        return failed_step(self.components, float(t), self.x, self.runner.read(memory, "x"), int(singular))


class ChosenStepper(Stepper):
    """Steps chosen by the method.

    A run that goes on after an end has steps as if that had been none, but for the last.
    """

    _flat: FlatPosition | None = None
    _below_rounding = False

    def _first(self) -> Mapping[str, ArrayLike]:
        self._relative = max(self.options.relative, self.program.finest)
        self._tolerance, self._is_held = self.runner.read(self._memory, TOLERANCE), self.program.rows is not None
        return {**beginning(self.options, self._relative), TOLERANCE: tolerance(self.options)}

    def _begin(self, t0: float, t_end: float) -> None:
        numbers, at = self._numbers, self._at
        numbers[at["t"]], numbers[at[END]] = self._t0, numbers[at[GOAL]] = t0, t_end
        if self.control is not None:
            numbers[at[GOAL]] = self._hold(self.control, t0, t_end)
        if self.program.timed:
            numbers[at[INSTANT]] = instant(t0, t_end)
        if self._is_held:
            self._flat = FlatPosition(self.program, t0, self.x, self.parameters)

    @property
    def _is_looked_at(self) -> bool:
        """Whether every step is recorded: asked for, below rounding, or held by constraints."""
        return self.every_step or self.options.relative < self._relative or self._is_held

    def _recorded(self, t0: float, t_end: float) -> Iterator[StepBlock]:
        if self.resets:
            self._set(**{FIRST: 0.0})
        most, looked = self.options.max_steps - self._before["steps"] - self._before["rejected"], self._is_looked_at
        most, self._below_rounding = max(1.0, most), self._below_rounding and bool(self.resets)
        while True:
            left = most - self._number("trials")
            if left <= 0:
                self.status = self._too_many() + self._near_flat()
                return
            absolute = self._tolerance.copy()
            rows = self._advance(int(min(left, CREEP if self._is_held else 2**31)), int(looked))[0]
            if not looked:
                made = self._number("longest_made") != 0.0
                rows = np.array([[self.t, self.t - self._number("t_old"), *self.x.tolist()]][: int(made)])
            status = self._number("status")
            self._count_trials()
            if len(rows):
                self._look(rows, absolute)
                yield self._block(rows)
            self._judge(rows)
            if self.status or (status == DONE and not self._next_period(t_end)):
                return

    def _count_trials(self) -> None:
        rejected, longest = int(self._number("rejected")), self._number("longest_made")
        steps = int(self._number("trials")) - rejected if longest else 0
        self._count(steps, rejected, min(longest, self.options.longest_step))

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block, which has it."""
        return block

    def unseen(self, x: Array) -> bool:
        """Take all steps from x (m,), none of them looked at; whether that could be, and nothing speaks against them.

        State and counts are then those of `blocks`, to the bit; else the run is to be made again.
        """
        if self._is_looked_at or self.options.max_steps < math.inf:
            return False
        self._clear()
        self.begin(x, self.options.t0, self.options.t_end)
        self.to_end()
        self._count_trials()
        return not self.status and self._number("at_limit") < HELD

    def until(self, t: float) -> None:
        """Steps to t, the last of which ends there."""
        self._towards(t)
        self.to_end()

    def to_end(self) -> None:
        """Take all steps."""
        self._go()
        if self._numbers[self._stop] != DONE or self._is_held:
            self._judge()

    def step(self) -> None:
        """Take one step on the way to t_end."""
        numbers, row, status = self._numbers, self._at["row"], self._at["status"]
        self._towards(numbers[self._at[END]])
        self._go(1)
        while numbers[row] <= 0.0 and numbers[status] == RUNNING:
            self._go(1)
        self._judge()

    def _towards(self, t: float) -> None:
        self._set(**{GOAL if self._number("anew") else "end": t}, status=RUNNING)

    def _near_flat(self) -> str:
        return "" if self._flat is None else self._flat.near()

    def _judge(self, rows: Array | None = None) -> None:
        """Note why the run stops after these steps, if it does; without rows, after the last."""
        stop = self._numbers[self._stop]
        if self._flat is not None and stop != DONE and (rows is None or len(rows)):
            last = np.array([[self.t, self._number("h"), *self.x]]) if rows is None else rows
            self._count_trials()
            reason = self._flat.reason(last, self.steps, self._number("farthest"), self.largest)
            self.status = f"stopped at t = {self.t:.6g} s: {reason}" if reason else ""
        if stop == TOO_SMALL:
            self.status = self._too_small() + self._near_flat()

    def _hold(self, control: Hold, t: float, t_end: float) -> float:
        """Where the period of control from t on ends, for which its forces are taken."""
        self.parameters = control.at(t, self.x)
        self.runner.write(self._memory, "p", self.parameters)
        return next(control.ends(t, t_end))

    def _next_period(self, t_end: float) -> bool:
        """Whether the run is not over yet; the memory is then at the start of the next period of a controller."""
        if self.control is None or self.t == t_end:
            return False
        wanted = self._number("next")
        wanted = wanted if math.isfinite(wanted) else self.options.length  # Taylor's method chooses it by itself
        self._set(end=self._hold(self.control, self.t, t_end), next=wanted, fresh=1.0, status=RUNNING)
        return True

    def _block(self, rows: Array) -> StepBlock:
        m = self.program.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        if not self.program.dense:
            return StepBlock(t, x, t - h, h, np.full_like(x, math.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), self.program.normalization)

    def _look(self, rows: Array, absolute: Array) -> None:
        """Note once what a user should know of these steps: stiffness, and tolerances below rounding."""
        options, held = self.options, int(self._number("at_limit"))
        if held >= HELD and held >= SHARE * (self.steps - self._before["steps"]) and not self.stiff:
            t, h = rows[-1, :2]
            self.stiff = (
                f"the system is stiff: at t = {t:.6g} s the step, {abs(h):.3g} s, is held at the stability limit of "
                f"method {options.method!r}, not by its tolerance"
            )
            self.warnings.append(self.stiff)
        if options.relative < self._relative and not self._below_rounding:
            size = np.abs(rows[:, 2 : 2 + self.program.size])
            short = (absolute + options.relative * size < self._relative * size).any(axis=0)
            if short.any():
                self._below_rounding = True
                self.warnings.append(
                    f"rtol = {options.relative:g} with the atol of {self.components[int(np.argmax(short))]} is below "
                    f"the rounding of a step: raised to {self._relative:.3g}"
                )

    def _too_small(self) -> str:
        """Reason why a run stopped whose step became too small."""
        t, x = self.t, self.x
        where = f"stopped at t = {t:.6g} s: "
        rate = values_of(self.program.rate, [*x.tolist(), t, *self.parameters])
        if not np.isfinite(rate).all():
            first = self.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"{where}the rate of {first} is not finite{' at the start' if t == self._t0 else ''}"
        self.slope = self._lacking()
        if self.slope:
            return f"{where}{self.slope} is not finite, and method {self.options.method!r} takes it"
        if reason := nonfinite(self.components, self.runner.read(self._memory, "x_new")):
            return f"{where}{reason}, however small"
        scale = self._tolerance + self._relative * np.abs(x)
        fastest = self.components[int(np.argmax(np.abs(rate) / scale))]
        h = self._number("tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"

    def _lacking(self) -> str:
        """The first derivative of the rate that the method takes and that is not finite; empty if all are."""
        lengths, names = self.runner.program.registers, self.components
        for register, by in (("time_slope", ["the time"]), ("jacobian", names)):
            values = self.runner.read(self._memory, register) if lengths.get(register) else np.zeros(0)
            if len(bad := np.flatnonzero(~np.isfinite(values))):
                row, column = divmod(int(bad[0]), len(by))
                return f"the derivative of the rate of {names[row]} by {by[column]}"
        return ""


def beginning(options: RunOptions, relative: float) -> dict[str, float]:
    """The registers of one number with which a run of chosen steps begins, besides its span."""
    limits = {"relative": relative, "longest_step": options.longest_step, "first": options.first_step or 0.0}
    return {"sized": float(options.atol is None), **given(limits)}


def over(t0: float, t_end: float) -> dict[str, float]:
    """The registers of a span."""
    return {"t": t0, **given({"t_end": t_end, "goal": t_end, "instant": instant(t0, t_end)})}


def tolerance(options: RunOptions) -> ArrayLike:
    """Register `TOLERANCE` at the start."""
    return np.maximum(options.absolute, SMALLEST_ATOL)


def failed_step(components: Sequence[str], t: float, before: Array, x: Array, singular: int) -> str:
    """Reason why a step from one state to another, (m,), at t, failed.

    singular: the number of the component whose inertia is not positive, from 1 on; else 0.
    """
    if singular:
        reason = f"{components[singular - 1]} has an inertia that is not positive"
    else:
        reason = nonfinite(components, x) or unsolved(components, before, x)
    return f"stopped at t = {t:.6g} s: {reason}"


def nonfinite(components: Sequence[str], state: Array) -> str:
    """The first component that is not finite, in words; empty if all are."""
    bad = np.flatnonzero(~np.isfinite(state))
    return f"{components[bad[0]]} is {state[bad[0]]} after the step" if len(bad) else ""


def unsolved(components: Sequence[str], before: Array, x: Array) -> str:
    """Reason why a step to a state, (m,), that is no solution failed: with the component that moved most."""
    moved = np.abs(x - before) / np.maximum(np.abs(x), np.abs(before)).clip(TINY)
    first = components[int(np.argmax(moved))]
    return f"the equations of the step did not converge; the step is too long, first of all for {first}"


def stepper_of(
    problem: Problem,
    options: RunOptions,
    parameters: Sequence[float] = (),
    control: Hold | None = None,
    *,
    events: EventProgram | None,
    between: bool,
) -> Stepper:
    """The stepper of a problem. between: with all steps, and the dense output of chosen ones."""
    method = options.integrator
    program = step_program(problem, method, dense=method.adaptive and (between or options.between))
    compiled = compile_steps(program, options.backend, options.fma)
    return stepper(compiled, options, parameters, control, every_step=between, events=events)


def stepper(
    compiled: CompiledSteps,
    options: RunOptions,
    parameters: Sequence[float] = (),
    control: Hold | None = None,
    stopped: Callable[[], bool] = lambda: False,
    *,
    every_step: bool = False,
    events: EventProgram | None = None,
) -> Stepper:
    """The stepper of compiled steps.  every_step: keep also those between times of t_eval."""
    kind, own = (ChosenStepper, options.between) if compiled.program.adaptive else (EqualStepper, options.estimated)
    log = None
    if events is not None:
        from .events.event_log import EventLog  # which a run without events does without

        log = EventLog(events)
    every_step = every_step or own or options.times is None or log is not None
    return kind(compiled, options, parameters, control, log, stopped, every_step=every_step)


END, GOAL, INSTANT = [*over(0.0, 1.0)][1:4]  # names of registers
FIRST = next(iter(given({"first": 0.0})))
