"""Integration by steps chosen by error: the first step, the tolerances, and what a user should know of the steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cgraph.extend import Array, Runner

from ...integrators.step_control import COLLAPSE, DONE, RESOLUTION, RUNNING, SMALLEST_ATOL, TOO_SMALL
from ..estimates.state_sizes import StateSizes
from ..row_values import values_of
from .dense_output import StepBlock
from .flat_position import FlatPosition
from .stepping import FIRST_PASSES, NativeIntegration, NativeRun, nonfinite

LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60  # of a first step
AHEAD = 3.0  # times the change of a first step: how far its first rate may point
HUGE = 1e300  # a tolerance that anything meets
ROUNDS = 4  # of a first step, by which the sizes of the states are known
HALVINGS = 100  # of a look ahead
JUMP = 1e-2  # of the longest of the last steps: how much of it a jump may take, where atol is chosen by sizes
SUDDEN = 1e-3  # of a kind of rate: a force that jumps at the start changes it by more
HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff


class StartOfChosenSteps(NativeIntegration):
    """A run by chosen steps up to its first one: that step, and the tolerances that go with the sizes ahead."""

    def __init__(self, run: NativeRun) -> None:
        super().__init__(run)
        options = run.options
        self.relative = max(options.relative, self.program.finest)
        self.absolute = np.broadcast_to(np.maximum(options.absolute, SMALLEST_ATOL), self.program.size)
        self.sizes = self._fresh_sizes() if options.atol is None else None

    def _rate(self, t: float, x: Array) -> Array:
        return values_of(self.program.rate, [*x.tolist(), t, *self.parameters])

    def _fresh_sizes(self) -> StateSizes:
        return StateSizes(self.program.kinds, self.relative, SMALLEST_ATOL)

    def _first_step(self, x: Array) -> tuple[float, float]:
        """The first step, and how far ahead the sizes of the states were seen, where they choose atol."""
        options = self.options
        if self.sizes is None and (options.first_step is not None or self.program.starts):
            return options.first_step or options.length, 0.0
        rate = self._rate(options.t0, x)
        if self.sizes is None:
            return self._confirmed(x, rate), 0.0
        given = options.first_step
        h = min(options.length, options.longest_step) * LEAP if given is None else given
        after = self._after_start(x, rate)
        for _ in range(ROUNDS):
            self.sizes = self._fresh_sizes()
            states, far = self._ahead(x, rate if after is None else after, h)
            self.sizes.see(states)
            self.absolute = self.sizes.tolerance()
            if given is not None:
                return given, max(given, far)
            if after is not None:  # halving steps only leads to the jump; step control passes it, as any later one
                return far, far
            before, h = h, self._confirmed(x, rate)
            if h >= 0.5 * before:
                break
        return h, max(h, far)

    def _confirmed(self, x: Array, rate: Array) -> float:
        """A step that two half steps confirm, their difference is within the tolerance, and the first rate, too.

        The estimate of an embedded method can vanish by symmetry, such as at a start from rest, and a guess from the
        first derivatives can be far off; halving cannot be fooled by either. Of an initial layer that a method damps,
        both the whole and the half steps keep nothing: there the first rate points much farther than the step goes.
        """
        options, runner, order = self.options, self.runner, self.program.order
        span = options.t_end - options.t0
        anything = {"rtol": HUGE, "atol": HUGE, "max_step": math.inf, "fresh": 1.0, "accepted": 1.0}
        anything |= {"t": options.t0, "end": math.copysign(math.inf, span), "error_old": 1.0}
        memory = runner.memory({"x": x, "p": self.parameters, **anything})
        least = min(abs(span), max(2.0 * RESOLUTION * abs(options.t0), math.ulp(0.0)))
        h = max(min(abs(span), options.longest_step) * LEAP, least)
        for _ in range(TRIALS):
            with np.errstate(all="ignore"):
                whole = _forced(runner, memory, [h])
                size = self._scale(x, whole)
                change = (whole - _forced(runner, memory, [0.5 * h, 0.5 * h])) / size
                difference = float(np.sqrt(np.mean(change * change)))
                ahead = float(np.max(h * np.abs(rate) / np.maximum(np.abs(whole - x), size)))
            if (difference <= 1.0 and ahead <= AHEAD) or h <= least:
                break
            # of tolerances; below a rounding, as of a state that moves evenly, it does not limit the step
            factor = 0.9 * max(difference, 1e-16) ** (-1.0 / (order + 1)) if math.isfinite(difference) else 0.0
            h = max(h * min(0.5, max(1e-3, min(factor, AHEAD / max(ahead, AHEAD)))), least)
        return h

    def _after_start(self, x: Array, rate: Array) -> Array | None:
        """The rate right after the start, where a force jumps there: it changes in the first instant, and no more."""
        options, largest = self.options, self.program.kinds.largest_of_kind
        if not self.program.timed:
            return None
        instant = max(float(np.spacing(abs(options.t0))), COLLAPSE * options.length)
        instant = math.copysign(instant, options.t_end - options.t0)
        after, later = (self._rate(options.t0 + k * instant, x) for k in (1, 2))
        with np.errstate(all="ignore"):
            least = SUDDEN * np.maximum(largest(rate), largest(after))
            jumps = (np.abs(after - rate) > least) & (np.abs(later - after) <= least)
        return after if jumps.any() else None

    def _ahead(self, x: Array, rate: Array, h: float) -> tuple[Array, float]:
        """x and where Euler's steps lead to, (.., m), of h or of so much less that they can be trusted, and their size.

        They move no kind of component by more than its size, and turn no kind of rate: it changes by no more than the
        larger of before and after.
        """
        sign = math.copysign(1.0, self.options.t_end - self.options.t0)
        with np.errstate(all="ignore"):
            for _ in range(HALVINGS):
                if (states := self._euler(x, rate, sign * h)) is not None:
                    return states, h
                h *= 0.25
        return x[None], h

    def _euler(self, x: Array, rate: Array, h: float) -> Array | None:
        """x and two of Euler's steps, (.., m), or as many as move all that moves; None where they cannot be trusted.

        At rest each step may move one component more, the next of a chain; the first moves none where a force begins
        at 0.
        """
        largest, states, moved = self.program.kinds.largest_of_kind, [x], [0, 0]
        size = largest(x)
        while len(states) < 3 or (moved[-1] < len(x) and moved[-1] > moved[-3]):
            states.append(states[-1] + h * rate)
            moved.append(int(np.count_nonzero(states[-1])))
            before, rate = rate, self._rate(self.options.t0 + (len(states) - 1) * h, states[-1])
            fast = np.maximum(largest(before), largest(rate))
            if not (((largest(states[-1] - x) <= size) | (size == 0.0)) & (largest(rate - before) <= fast)).all():
                return None
        return np.stack(states)

    def _scale(self, x: Array, x_new: Array) -> Array:
        """What the error of a step is measured by."""
        return np.asarray(self.absolute + self.relative * np.maximum(np.abs(x), np.abs(x_new)))


class AdaptiveIntegration(StartOfChosenSteps):
    """Steps chosen by the method."""

    def __init__(self, run: NativeRun) -> None:
        super().__init__(run)
        self._below_rounding = False
        self.flat = FlatPosition(self.program)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        options, end = self.options, self._hold(self.options.t0, x)
        wanted, longest = self._first_step(x)
        start: Mapping[str, float | Array | list[float]] = {
            "x": x,
            "x_old": x,
            "p": self.parameters,
            "t": options.t0,
            "t_old": options.t0,
            "end": end,
            "rtol": self.relative,
            "atol": self.absolute,
            "next": wanted,
            "longest": longest,
            "jump": JUMP if self.sizes else 0.0,
            "max_step": options.longest_step,
            "still": LEAP * options.length if self.program.timed else math.inf,
            "min_step": COLLAPSE * abs(options.t_end - options.t0),
            "fresh": 1.0,
            "error_old": 1e-4,
            "accepted": 1.0,
        }
        memory = self.runner.memory(start)
        self.flat.begin(options.t0, x, self.parameters)
        seen = FIRST_PASSES  # so many trials, and then twice as many as before, between two looks at the sizes
        while True:
            done = self.steps + self.rejected
            left = options.max_steps - done
            if left <= 0:
                self.status = self.too_many(self._number(memory, "t"), left + done) + self.flat.near(self.parameters)
                return
            rows, _ = self._advance(memory, int(min(left, seen - done if self.sizes else 2**31)), whole=False)
            status = self._number(memory, "status")
            self._count(len(rows), int(self._number(memory, "rejected")))
            self.evaluations = int(self._number(memory, "evaluations"))
            if len(rows):
                self._look(memory, rows)
                yield self._block(rows)
            self.status = self.flat.creeping(status == RUNNING, self.steps, self.largest, rows, self.parameters)
            if self.status:
                return
            if self.sizes:
                self.sizes.see(rows[:, 2 : 2 + self.program.size])
                if self.steps + self.rejected >= seen:
                    seen *= 2
                    self.absolute = self.sizes.tolerance()
                    self.runner.write(memory, "atol", self.absolute)
            if status == TOO_SMALL:
                self.status = self._too_small(memory) + self.flat.near(self.parameters)
            if status == TOO_SMALL or (status == DONE and not self._next_period(memory)):
                return

    def _hold(self, t: float, x: Array) -> float:
        """Where the steps from t on end; of a controller, take its forces for this period."""
        if self.control is None:
            return self.options.t_end
        self.parameters = self.control.at(t, x)
        return next(self.control.ends(t, self.options.t_end))

    def _next_period(self, memory: Array) -> bool:
        """Whether the run is not over yet; the memory is then at the start of the next period of a controller."""
        t = self._number(memory, "t")
        if t == self.options.t_end:
            return False
        end, wanted = self._hold(t, self.runner.read(memory, "x")), self._number(memory, "next")
        wanted = wanted if math.isfinite(wanted) else self.options.length  # Taylor's method chooses it by itself
        for name, value in (("end", end), ("p", self.parameters), ("next", wanted), ("fresh", 1.0), ("status", 0.0)):
            self.runner.write(memory, name, value)
        return True

    def _block(self, rows: Array) -> StepBlock:
        m = self.program.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        self.largest = max(self.largest, min(float(np.abs(h).max()), self.options.longest_step))
        if not self.program.dense:
            return StepBlock(t, x, t - h, h, np.full_like(x, math.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), self.program.normalization)

    def _look(self, memory: Array, rows: Array) -> None:
        """Note once what a user should know of these steps: stiffness, and tolerances below rounding."""
        options, held = self.options, int(self._number(memory, "at_limit"))
        if held >= HELD and held >= SHARE * self.steps and not self.stiff:
            t, h = rows[-1, :2]
            self.stiff = (
                f"the system is stiff: at t = {t:.6g} s the step, {abs(h):.3g} s, is held at the stability limit of "
                f"method {options.method!r}, not by its tolerance"
            )
            self.warnings.append(self.stiff)
        if self.flat.rows is not None:
            self.warnings += self.flat.look(rows, self._number(memory, "farthest"), self.parameters)
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
        self.slope = _lacking(self.runner, memory, self.components)
        if self.slope:
            return f"{where}{self.slope} is not finite, and method {self.options.method!r} takes it"
        if reason := nonfinite(self.components, self.runner.read(memory, "x_new")):
            return f"{where}{reason}, however small"
        fastest = self.components[int(np.argmax(np.abs(rate) / self._scale(x, x)))]
        h = self._number(memory, "tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"


def _lacking(runner: Runner, memory: Array, components: Sequence[str]) -> str:
    """The first derivative of the rate that a method takes and that is not finite; empty if all are."""
    lengths = runner.program.registers
    for register, by in (("time_slope", ["the time"]), ("jacobian", components)):
        if lengths.get(register) and len(bad := np.flatnonzero(~np.isfinite(runner.read(memory, register)))):
            row, column = divmod(int(bad[0]), len(by))
            return f"the derivative of the rate of {components[row]} by {by[column]}"
    return ""


def _forced(runner: Runner, memory: Array, steps: Sequence[float]) -> Array:
    """The state after these steps from a memory, which is left as it is; NaN where one could not be made."""
    memory = memory.copy()
    for h in steps:
        runner.write(memory, "next", h)
        runner.run(memory, 1)
        if not runner.read(memory, "accepted")[0]:
            return np.full(len(runner.read(memory, "x")), math.nan)
    return runner.read(memory, "x")
