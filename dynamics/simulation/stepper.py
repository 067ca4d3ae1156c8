"""Steppers: the steps of a method from one start after another, equal or chosen, recorded block by block or not."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..integrators import Problem
from ..integrators.step_control import CROSSED, DONE, RESOLUTION, RUNNING, SMALLEST_ATOL, TOO_SMALL
from .applied_force import Hold
from .events.crossing_search import Crossing, outputs_of
from .events.event import EventProgram
from .events.event_log import EventLog
from .events.modes import Modes
from .run_options import Span, Steps
from .steps.dense_output import Indices, StepBlock, inside_nodes, with_hermite
from .steps.equal_steps import EqualSteps, equal_steps, steps_after
from .steps.first_step import START, TOLERANCE, start_registers
from .steps.flat_position import CREEP, FlatPosition
from .steps.row_values import values_of
from .steps.step_program import CompiledSteps, StepProgram, compile_steps, slide_program, step_program

BLOCK_TIME = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
TINY = np.finfo(float).tiny
CROSSED_BLOCK, LONGEST_BLOCK = 64, 4096  # equal steps between two looks for crossings, at first and at most
FIRST_PASSES = 32  # of the first block, before it is known how long one takes
NEARLY = 0.99  # of a step, from where on it is cut for sure
AGAIN = 8  # times that a step is made shorter for it
OFF = 10.0  # tolerances, by which a step may be off where it is cut
HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff
COUNTED = "steps", "rejected", "evaluations", "jacobians", "factorizations"
END, GOAL, FIRST, WISH = [f"{START}{name}" for name in ("t_end", "goal", "first", "wish")]  # registers


class StoppedError(Exception):
    """Nobody waits for the rest of the run any more."""


@dataclass(eq=False)
class Stepper(ABC):
    """Runs of a method in one memory: recorded, by `blocks`, or unrecorded, from `begin` by `advance`.

    status: why it stopped before the end, or empty.  event: the one that has ended it, in words.  largest: step [s].
    """

    compiled: CompiledSteps
    options: Steps
    parameters: Sequence[float] = ()
    _: KW_ONLY
    control: Hold | None = None
    events: EventProgram | None = None
    modes: Modes | None = None
    stopped: Callable[[], bool] = lambda: False  # asked before every block
    every_step: bool = False  # whether all are in blocks, also where rows and checks need the last of a block alone

    def __post_init__(self) -> None:
        self._passes, self._given, self._wish, self._again = FIRST_PASSES, list(self.parameters), 0.0, 0
        self._plain, self._pending = self.compiled, list[tuple[int, float, Array, float]]()
        self._load(self.compiled)
        if self.control is None:
            self.set_parameters(self._given)
        self._clear()

    def _load(self, compiled: CompiledSteps) -> None:
        """Take these steps, in a memory of their own."""
        self.compiled, self.program, self.runner = compiled, compiled.program, compiled.runner
        self._at, self._stop = compiled.places, compiled.places[str(self.runner.program.stop)]
        self._relative = max(self.options.relative, self.program.finest)
        self._start, self._memory = np.zeros(self.runner.size), np.zeros(self.runner.size)
        self._numbers: Any = self._memory.data  # whose items are read and written faster
        self._zero: Any = self._start.data
        for name, value in first_registers(self.program, self.options).items():
            self.runner.write(self._start, name, value)
        self.x = self.runner.read(self._memory, "x")
        self.q, self.qd = self.x[: self.program.nq], self.x[self.program.nq :]
        self._halves: Any = (self.q.data, self.qd.data)
        vars(self).pop("_unrecorded", None)

    def _clear(self) -> None:
        """Forget the run before."""
        self.steps = self.rejected = self.evaluations = self.jacobians = self.factorizations = self.resets = 0
        self._before = dict.fromkeys(COUNTED, 0)  # the last reset
        self._wish = 0.0
        self.largest, self.warnings, self._is_stiff, self._is_told = 0.0, list[str](), False, False
        self._is_unsure = False
        if self.modes is not None:
            self.modes.turns.clear()
        self.status = self.event = ""
        self.log = None if self.events is None else EventLog(self.events)

    @property
    def t(self) -> float:
        """Time that the run has reached [s]."""
        return self._number("t")

    def set_parameters(self, p: Sequence[float]) -> None:
        """Values of the parameters in the runs that begin from here on."""
        self._given = list(p)
        self.parameters = self._given if self.modes is None else [*p, *self.modes.values.tolist()]
        self.runner.write(self._start, "p", self.parameters)

    def begin(self, x: Array, t0: float, t_end: float) -> None:
        """Start anew, from x (m,) at t0, on the way to t_end."""
        if self.modes is not None:
            if self.control is not None:
                self._given = self._controlled(self.control.at(t0, x))
            self.modes.direction = math.copysign(1.0, t_end - t0)
            self.modes.begin(t0, x, self._given)
            x = self._enter_modes(t0, x)
        self._numbers[:], self.status = self._zero, "" if self.modes is None else self.modes.failed
        self.x[:] = x
        self._begin(t0, t_end)

    def _enter_modes(self, t: float, x: Array) -> Array:
        """Take the steps of the problem that the modes are of, and their values; the state, on what it slides on."""
        assert self.modes is not None
        compiled, problem, options = self._plain, self.modes.problem, self.options
        if problem is not self.modes.plain:
            program = slide_program(compiled.program, problem, options.integrator)
            compiled = compile_steps(program, options.backend, options.fma)
        if compiled is not self.compiled:
            self._load(compiled)
        self.set_parameters(self._given)
        onto = problem.projection if problem.slides else None
        return x if onto is None else outputs_of(onto, np.append(x, t)[:, None], np.array(self.parameters))[:, 0]

    def _turn(self, t_end: float) -> None:
        """Go on where a surface is crossed, at the end of a block, with a step as long as the one that ends there."""
        assert self.modes is not None
        number, t, x, h = self._pending.pop()
        sizes = self.modes.sizes
        self._before = {name: getattr(self, name) for name in COUNTED}
        if number >= 0:
            self.modes.turn(t, x, self._given, number)
            x = self._enter_modes(t, x)
        self._numbers[:], self.status = self._zero, self.modes.failed
        self.x[:] = x
        self._wish = abs(h)
        self._begin(t, t_end)
        if (name := f"{START}so_far") in self.runner.program.registers:
            self.runner.write(self._memory, name, sizes)

    def try_begin(self, q: object, qd: object, t0: float, t_end: float) -> bool:
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

    def blocks(self, x: Array, span: Span) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset by an event is a step of no length."""
        self._clear()
        self.begin(x, span.t0, span.t_end)
        yield from self._going(span)

    def _going(self, span: Span) -> Iterator[StepBlock]:
        """The steps of a run that has begun, or goes on."""
        looked, log = self._is_looked_at(span), self.log
        while not self.status:
            crossing: Crossing | None = None
            for block in self._recorded(span, looked):
                parts = [block]
                if self.modes is not None:
                    parts, crossing = self._up_to_crossing(block, span.t_end)
                if log is not None:
                    log.parameters = self.parameters
                    parts = [log(self.with_dense(parts[0]))]
                    crossing = None if log.ended or log.restart else crossing
                self.steps -= len(block.t) - sum([len(part.t) for part in parts])
                if crossing is None:
                    self._pending.clear()
                yield from [part for part in parts if len(part.t)]
                if crossing is not None or (log is not None and (log.ended or log.restart)):
                    self.status = ""  # of a step beyond
                    break
            if self.modes is not None and self._is_refused and not self._pending:  # a surface that no step passes
                found = self.modes.touched(self.t, self.x, self._given)
                self._pending = [] if found is None else [(found[0], self.t, found[1], self._number("h"))]
            if self._pending:
                self._turn(span.t_end)
                continue
            if self.modes is not None and self._is_refused and self._shorten():
                self.status = ""
                continue
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
            if self.event or t == span.t_end:
                return
            self._before, self._wish = {name: getattr(self, name) for name in COUNTED}, 0.0
            self.begin(x, t, span.t_end)

    def _up_to_crossing(self, block: StepBlock, t_end: float) -> tuple[list[StepBlock], Crossing | None]:
        """The steps up to where the first surface is crossed, and this; or all."""
        assert self.modes is not None
        if block.dense is not None or self.log is not None:
            block = self.with_dense(block)
            parts: Iterable[StepBlock] = [block]
        else:  # the cubics through the ends tell where to look
            cubics = with_hermite(block, self.program.rate, self.parameters, np.empty((0, *block.x.shape)))
            doubtful = self.modes.doubtful(cubics, self._given)
            parts = (self.with_dense(block.part(slice(row, row + 1))) for row in doubtful)
        for part in parts:
            crossing, is_sure = self.modes.first_crossing(part, self._given)
            if not (is_sure or self._is_unsure):
                self._is_unsure, when = True, f"first after t = {part.t_old[0]:.6g} s"
                self.warnings.append(f"surfaces may be crossed unseen, {when}: take a shorter dt or max_step")
            if crossing is not None:
                row, at = crossing.row, (np.array([crossing.row]), np.array([crossing.s]))
                t, x = float(part.times_at(*at)[0]), part.states_at(*at)[0]
                if self._again < AGAIN and self._is_off(part, at, t, x):
                    self.modes.look_again(row)
                    self._again += 1
                    self._pending = [(-1, float(part.t_old[row]), part.x_old[row], crossing.s * float(part.h[row]))]
                    return [part.part(slice(row))], crossing
                self._again = 0
                self._pending = [(crossing.number, t, x, float(part.h[row]))] if t != t_end else []
                self.modes.see(x)
                moves = t != part.t_old[row]
                last = part.part(slice(row + moves))
                first = int(np.flatnonzero(block.t_old == part.t_old[0])[0])
                before = [block.part(slice(first))] if first else []
                return [*before, last.shortened(crossing.s, t, x) if moves else last], crossing
        self.modes.see(block.x)
        return [block], None

    def _is_off(self, part: StepBlock, at: tuple[Indices, Array], t: float, x: Array) -> bool:
        """Whether the motion of a step that goes on beyond a surface is off there, as where a law is sharp."""
        row, begin = at[0][0], part.x_old[at[0][0]]
        if not self.program.adaptive or part.t_old[row] == t or at[1][0] > NEARLY:
            return False
        rate = outputs_of(self.program.rate, np.append(x, t)[:, None], np.array(self.parameters))[: len(x), 0]
        off = np.abs(part.slopes_at(*at)[0] - float(part.h[row]) * rate)
        scale = self.runner.read(self._memory, TOLERANCE) + self._relative * np.fmax(np.abs(x), np.abs(begin))
        return not bool((off <= OFF * scale).all())

    def go(self, t: float, *, single: bool = False) -> None:
        """Go on to t, or by a single step, across surfaces."""
        if self.modes is None:
            self.advance(t, single=single)
            return
        self._aim(t)
        span, self._passes = Span(t, t0=self.t), 1 if single else self._passes
        for _ in self._going(span):
            if single:
                break
        if self._pending:
            self._turn(t)

    def with_dense(self, block: StepBlock) -> StepBlock:
        """The block that has come last, with dense output; that of equal steps is made by shorter steps."""
        if block.dense is not None:
            return block
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

    @abstractmethod
    def _begin(self, t0: float, t_end: float) -> None:
        """Set the registers of a span."""

    def _is_looked_at(self, span: Span) -> bool:
        """Whether a run over this span has to have every step in a block."""
        own = self.options.estimated
        if self.program.adaptive:
            own = span.has_inner_times or self.program.rows is not None or self.options.relative < self._relative
        return own or self.every_step or span.times is None or self.events is not None or self.modes is not None

    @property
    @abstractmethod
    def _is_refused(self) -> bool:
        """Whether no step can be made from here."""

    def _shorten(self) -> bool:
        """Whether a shorter step is left to try."""
        return False

    @abstractmethod
    def _aim(self, t: float) -> None:
        """Go on to this end."""

    @abstractmethod
    def _recorded(self, span: Span, looked: bool) -> Iterator[StepBlock]:
        """The steps of the run that has begun; looked: every one, or of a block the last."""

    @abstractmethod
    def advance(self, t: float, *, single: bool = False) -> None:
        """Go on to t, where the last step ends, or by a single step; `status` says why that cannot be."""

    @cached_property
    def _unrecorded(self) -> Callable[[int], None]:
        return self.runner.bind(self._memory)

    def _repeat(self, most: int) -> None:
        """Make so many passes, or until the program stops, in pieces of bounded time: Ctrl-C ends them in between."""
        self._unrecorded(min(FIRST_PASSES, most))
        most -= FIRST_PASSES
        while most > 0 and self._numbers[self._stop] == RUNNING:
            passes, begin = self._next(most)
            self._unrecorded(passes)
            self._pace(passes, begin)
            most -= passes

    def _rows(self, most: int, looked: bool) -> tuple[Array, int]:
        """Make passes, at most so many: the rows of all or of the last; and how many."""
        passes, begin = self._next(most)
        rows, done = self.runner.run(self._memory, passes, 1 if looked else passes)
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
        """Note so many steps since the last reset."""
        found = {"steps": steps, "rejected": rejected, "evaluations": int(self._number("evaluations"))}
        if "jacobians" in self._at:  # a method that keeps them counts by itself
            found |= {name: int(self._number(name)) for name in ("jacobians", "factorizations")}
        elif self.compiled.factorizations:  # in every trial, with one Jacobian for every state that is tried from
            found["jacobians"] = steps + (self.program.adaptive and not self._number("accepted"))
            found["factorizations"] = self.compiled.factorizations * (steps + rejected)
        for name, number in found.items():
            setattr(self, name, self._before[name] + number)
        self.largest = max(self.largest, longest)

    def _too_many(self) -> str:
        return f"stopped at t = {self.t:.6g} s after max_steps = {self.options.max_steps:g} steps"

    def _hold(self, control: Hold, t_end: float) -> float:
        """Take the forces of the period of control that begins; when it ends, or the run."""
        self.set_parameters(self._controlled(control.at(self.t, self.x)))
        self.runner.write(self._memory, "p", self.parameters)
        return next(control.ends(self.t, t_end))

    def _controlled(self, forces: Sequence[float]) -> list[float]:
        """The parameters, with these forces in place of the first."""
        return [*forces, *self._given[len(forces) :]]

    def _number(self, name: str) -> float:
        return float(self._numbers[self._at[name]])

    def _set(self, **values: float) -> None:
        for name, value in values.items():
            self._numbers[self._at[name]] = value


class EqualStepper(Stepper):
    """Equal steps between the instants, at most dt; unrecorded ones of one length from where they begin to the end."""

    stretches: Sequence[EqualSteps] = ()  # in place of those of a span
    _limit: float = math.inf  # of the next step, after one that could not be made [s]

    def _begin(self, t0: float, t_end: float) -> None:
        self._set(t=t0)
        self._left, self._limit = 0, math.inf

    def beside(self, stretches: Sequence[EqualSteps]) -> EqualStepper:
        """The stepper of other stretches, without events."""
        modes, most = None, math.inf
        if self.modes is not None:  # which it meets about as often
            modes, most = Modes(self.modes.plain), sum([each.steps for each in stretches]) + 2.0 * self.steps + 1000.0
        options = replace(self.options, max_steps=most)
        other = EqualStepper(self._plain, options, self._given, stopped=self.stopped, modes=modes)
        other.stretches = stretches
        return other

    def _recorded(self, span: Span, looked: bool) -> Iterator[StepBlock]:
        instants = span.instants if self.control is None else self.control.instants(span.instants)
        m, most, total = self.program.size, self.options.max_steps, 0
        longest = CROSSED_BLOCK if self.modes is not None else math.inf  # doubled as long as none is crossed
        grid = self.stretches or equal_steps(instants, self.options.step)
        stretches = steps_after(grid, self.t)
        if stretches and abs(stretches[0].h) > self._limit:
            end = self.t + math.copysign(self._limit, stretches[0].h)
            stretches = [EqualSteps(self.t, end - self.t, 1, end), *steps_after(grid, end)]
        for stretch in stretches:
            self._enter(stretch)
            if self.control is not None:
                self._hold(self.control, stretch.end)
            while self._left:
                if self.steps >= most:
                    self.status, self._limit = self._too_many(), math.inf
                    return
                before, t_old, x_old = self._memory.copy(), self.t, self.x.copy()
                longest = min(longest, self._passes) if self._passes == 1 else longest
                rows, done = self._rows(int(min(self._left, most - self.steps, longest)), looked)
                longest = min(2 * longest, LONGEST_BLOCK) if self.modes is not None else math.inf
                if self._numbers[self._stop]:
                    done -= 1
                    rows = self._undo(before, done, looked)
                self._left, total = self._left - done, total + done
                t, x = rows[:, 0], rows[:, 1 : 1 + m]
                if not self._left:
                    t[-1] = stretch.end
                self._count(total, 0, min(abs(stretch.h), self.options.step) if done else 0.0)
                if done:
                    begin, starts = np.append(t_old, t[:-1]), np.concatenate([x_old[None], x[:-1]])
                    yield StepBlock(t, x, begin, t - begin, starts, None, self.program.normalization)
                if self.status:
                    return

    @property
    def _is_refused(self) -> bool:
        return self._limit < math.inf and bool(self.status)

    def _shorten(self) -> bool:
        assert self.modes is not None
        h = math.copysign(2.0 * self._limit, self._stretch.h)
        return self._limit > RESOLUTION * abs(self.t) and self.modes.nears(self.t, self.x, self._given, h)

    def _aim(self, t: float) -> None:
        if not self.stretches or self.stretches[-1].end != t:
            self.stretches = equal_steps([self.t, t], self.options.step)

    def _enter(self, stretch: EqualSteps) -> None:
        self._stretch, self._left = stretch, stretch.steps
        self._set(start=stretch.begin, t=stretch.begin, count=0.0, h=stretch.h)

    def advance(self, t: float, *, single: bool = False) -> None:
        """Go on to t, or by a single step; steps from a start or an end to the next end have one length."""
        if not self._left or self._stretch.end != t:
            self._enter(equal_steps([self.t, t], self.options.step)[0])
        steps, before = 1 if single else self._left, self._memory.copy()
        self._repeat(steps)
        if self._numbers[self._stop]:
            steps = int(self._number("count") - before[self._at["count"]]) - 1
            self._undo(before, steps, looked=False)
        self._left -= steps
        if not self._left:
            self._set(t=self._stretch.end)

    def _undo(self, before: Array, steps: int, looked: bool) -> Array:
        """Rows of so many steps from an earlier memory, after which the next one has failed: `status` says why."""
        failed = self._memory.copy()
        self._memory[:] = before
        rows = self.runner.run(self._memory, steps, 1 if looked else max(1, steps))[0]
        names, x = self.program.components, self.runner.read(failed, "x")
        reason = nonfinite(names, x) or unsolved(names, self.x, x)
        self.status = f"stopped at t = {failed[self._at['t']]:.6g} s: {reason}"
        self._limit = 0.5 * abs(self._stretch.h)
        self._set(evaluations=failed[self._at["evaluations"]])
        return rows


class ChosenStepper(Stepper):
    """Steps chosen by the method. A run that goes on after an end has steps as if that had been none, but the last."""

    _flat: FlatPosition | None = None

    def _begin(self, t0: float, t_end: float) -> None:
        numbers, at = self._numbers, self._at
        self._t0 = numbers[at["t"]] = t0
        numbers[at[END]] = t_end
        numbers[at[GOAL]] = t_end if self.control is None else self._hold(self.control, t_end)
        if self.program.rows is not None:
            self._flat = FlatPosition(self.program, t0, self.x, self.parameters)

    def _recorded(self, span: Span, looked: bool) -> Iterator[StepBlock]:
        if self.resets or self._wish:
            self._set(**{FIRST: 0.0, WISH: self._wish})
        most = max(1.0, self.options.max_steps - self._before["steps"] - self._before["rejected"])
        while True:
            left = most - self._number("trials")
            if left <= 0:
                self.status = self._too_many() + (self._flat.near() if self._flat else "")
                return
            absolute = self.runner.read(self._memory, TOLERANCE).copy()
            rows = self._rows(int(min(left, CREEP if self._flat else 2**31)), looked)[0]
            if not looked:
                made = self._number("longest_made") != 0.0
                rows = np.array([[self.t, self.t - self._number("t_old"), *self.x.tolist()]][: int(made)])
            self._count_trials()
            if len(rows):
                self._look(rows, absolute)
                yield self.program.block(rows)
            if self._numbers[self._stop] == CROSSED:  # a surface that is touched
                self._set(status=DONE if self.t == self._number("end") else RUNNING)
            self._judge(rows)
            if self.status or (self._numbers[self._stop] == DONE and not self._next_period(span)):
                return

    def _count_trials(self) -> None:
        rejected, longest = int(self._number("rejected")), self._number("longest_made")
        steps = int(self._number("trials")) - rejected if longest else 0
        self._count(steps, rejected, min(longest, self.options.longest_step))

    def unseen(self, x: Array, span: Span) -> bool:
        """Take all steps from x (m,) as `blocks` does, none looked at; whether that could be and none needs a look."""
        if self._is_looked_at(span) or self.options.max_steps < math.inf:
            return False
        self._clear()
        self.begin(x, span.t0, span.t_end)
        self.advance(span.t_end)
        self._count_trials()
        return not self.status and self._number("at_limit") < HELD

    @property
    def _is_refused(self) -> bool:
        return bool(self._numbers[self._stop] == TOO_SMALL)

    def _aim(self, t: float) -> None:
        numbers, at = self._numbers, self._at
        numbers[at[GOAL] if numbers[at["anew"]] else at["end"]] = t
        numbers[self._stop] = RUNNING

    def advance(self, t: float, *, single: bool = False) -> None:
        """Go on to t, or by a single step."""
        numbers, at = self._numbers, self._at
        self._aim(t)
        self._repeat(1 if single else 2**62)
        while single and numbers[at["row"]] <= 0.0 and numbers[self._stop] == RUNNING:
            self._repeat(1)
        if self._flat or numbers[self._stop] != DONE:
            self._judge()

    def _judge(self, rows: Array | None = None) -> None:
        """Note why the run stops after these steps, if it does; without rows, after the last."""
        stop = self._numbers[self._stop]
        if self._flat is not None and stop != DONE and (rows is None or len(rows)):
            last = np.array([[self.t, self._number("h"), *self.x]]) if rows is None else rows
            self._count_trials()
            reason = self._flat.reason(last, self.steps, self._number("farthest"), self.largest)
            self.status = f"stopped at t = {self.t:.6g} s: {reason}" if reason else ""
        if stop == TOO_SMALL:
            self.status = self._too_small() + (self._flat.near() if self._flat else "")

    def _next_period(self, span: Span) -> bool:
        """Whether the run is not over yet; the memory is then at the start of the next period of a controller."""
        if self.control is None or self.t == span.t_end:
            return False
        wanted = self._number("next")
        wanted = wanted if math.isfinite(wanted) else span.length  # Taylor's method chooses it by itself
        self._set(end=self._hold(self.control, span.t_end), next=wanted, fresh=1.0, status=RUNNING)
        return True

    def _look(self, rows: Array, absolute: Array) -> None:
        """Note once what a user should know of these steps: stiffness, and tolerances below rounding."""
        options, held = self.options, int(self._number("at_limit"))
        if held >= HELD and held >= SHARE * (self.steps - self._before["steps"]) and not self._is_stiff:
            self._is_stiff, (t, h) = True, rows[-1, :2]
            self.warnings.append(
                f"the system is stiff: at t = {t:.6g} s the step, {abs(h):.3g} s, is held at the stability limit of "
                f"method {options.method!r}, not by its tolerance; for such are method='radau' and method='rodas'"
            )
        if options.relative < self._relative and not self._is_told:
            size = np.abs(rows[:, 2 : 2 + self.program.size])
            short = (absolute + options.relative * size < self._relative * size).any(axis=0)
            if short.any():
                self._is_told, name = True, self.program.components[int(np.argmax(short))]
                self.warnings.append(
                    f"rtol = {options.relative:g} with the atol of {name} is below the rounding of a step: "
                    f"raised to {self._relative:.3g}"
                )

    def _too_small(self) -> str:
        """Reason why a run stopped whose step became too small."""
        t, x = self.t, self.x
        where = f"stopped at t = {t:.6g} s: "
        rate = values_of(self.program.rate, [*x.tolist(), t, *self.parameters])
        if not np.isfinite(rate).all():
            first = self.program.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"{where}the rate of {first} is not finite{' at the start' if t == self._t0 else ''}"
        names, lengths = self.program.components, self.runner.program.registers
        for register, by in (("time_slope", ["the time"]), ("jacobian", names)):
            values = self.runner.read(self._memory, register) if lengths.get(register) else np.zeros(0)
            if len(bad := np.flatnonzero(~np.isfinite(values))):
                row, column = divmod(int(bad[0]), len(by))
                slope = f"the derivative of the rate of {names[row]} by {by[column]} is not finite"
                return f"{where}{slope}; method {self.options.method!r} takes it, method='dop853' takes none"
        if reason := nonfinite(self.program.components, self.runner.read(self._memory, "x_new")):
            return f"{where}{reason}, and after all shorter ones, however small"
        scale = self.runner.read(self._memory, TOLERANCE) + self._relative * np.abs(x)
        fastest = self.program.components[int(np.argmax(np.abs(rate) / scale))]
        h = self._number("tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"


def first_registers(program: StepProgram, options: Steps) -> dict[str, ArrayLike]:
    """Registers with which a run begins, besides state, parameters and span."""
    if not program.adaptive:
        return {"fresh": 1.0} if "fresh" in program.steps.registers else {}
    limits = {"longest_step": options.longest_step, "first": options.first_step or 0.0}
    own = start_registers({"relative": max(options.relative, program.finest), **limits})
    return {**own, "sized": float(options.atol is None), TOLERANCE: np.maximum(options.absolute, SMALLEST_ATOL)}


def nonfinite(components: Sequence[str], state: Array) -> str:
    """The first component that is not finite, in words; empty if all are."""
    bad = np.flatnonzero(~np.isfinite(state))
    return f"{components[bad[0]]} is {state[bad[0]]} after the step" if len(bad) else ""


def unsolved(components: Sequence[str], before: Array, x: Array) -> str:
    """Reason why a step to a state, (m,), that is no solution failed: with the component that moved most."""
    moved = np.abs(x - before) / np.maximum(np.abs(x), np.abs(before)).clip(TINY)
    first = components[int(np.argmax(moved))]
    return f"the equations of the step did not converge; the step is too long, first of all for {first}"


def stepper_of(problem: Problem, options: Steps, parameters: Sequence[float], *, dense: bool, **named: Any) -> Stepper:
    """The stepper of a problem. dense: with all steps, and the dense output of chosen ones."""
    modes = None if problem.switches is None else Modes(problem)
    program = step_program(problem, options.integrator, dense=dense or modes is not None)
    compiled = compile_steps(program, options.backend, options.fma)
    return stepper(compiled, options, parameters, every_step=dense, modes=modes, **named)


def stepper(compiled: CompiledSteps, *arguments: Any, **named: Any) -> Stepper:
    """The stepper of compiled steps, with the other arguments of `Stepper`."""
    return (ChosenStepper if compiled.program.adaptive else EqualStepper)(compiled, *arguments, **named)
