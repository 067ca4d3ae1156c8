"""Integration by steps chosen by error, what a user should know of the steps; and that of a problem by any method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array
from cgraph.extend import Runner

from ...integrators import Problem
from ...integrators.step_control import DONE, RUNNING, SMALLEST_ATOL, TOO_SMALL
from ..row_values import values_of
from ..run_options import RunOptions
from ..sampled_controller import Hold
from .dense_output import StepBlock
from .first_step import TOLERANCE, given, instant
from .flat_position import CREEP, FlatPosition
from .step_program import CompiledSteps, compile_steps, step_program
from .stepping import FixedStepIntegration, Integration, NativeIntegration, nonfinite

if TYPE_CHECKING:
    from ..events.event import EventProgram

HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff


class AdaptiveIntegration(NativeIntegration):
    """Steps chosen by the method, of which the last of a block may be recorded alone.

    A run that goes on after an end has steps as if that had been none, but for the last.
    """

    def __init__(
        self,
        compiled: CompiledSteps,
        options: RunOptions,
        parameters: Sequence[float] = (),
        control: Hold | None = None,
        stopped: Callable[[], bool] = lambda: False,
        *,
        every_step: bool = True,
    ) -> None:
        program = compiled.program
        self.relative = max(options.relative, program.finest)
        super().__init__(compiled, options, parameters, control, stopped)
        self._tolerance, self._flat = self.runner.read(self._memory, TOLERANCE), None
        self._is_held = program.rows is not None  # by constraints
        self._recorded = every_step or options.relative < self.relative or self._is_held  # to be looked at

    _flat: FlatPosition | None

    def _first(self) -> Mapping[str, ArrayLike]:
        return {**beginning(self.options, self.relative), TOLERANCE: tolerance(self.options)}

    def restart(self) -> None:
        """Nothing of a run is done."""
        super().restart()
        self._below_rounding = False

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        options = self.options
        self.restart()
        self.begin(x, options.t0, options.t_end)
        while True:
            left = options.max_steps - self._number("trials")
            if left <= 0:
                self.status = self.too_many(self.t, options.max_steps) + self._near_flat()
                return
            absolute = self._tolerance.copy()
            most = int(min(left, CREEP if self._is_held else 2**31))
            rows = self._advance(most, int(self._recorded))[0]
            if not self._recorded:
                made = self._number("longest_made") != 0.0
                rows = np.array([[self.t, self.t - self._number("t_old"), *self.x.tolist()]][: int(made)])
            status = self._number("status")
            self._count()
            if len(rows):
                self._look(rows, absolute)
                yield self._block(rows)
            self._judge(rows)
            if self.status or (status == DONE and not self._next_period()):
                return

    def _count(self, steps: int = 0) -> None:
        self.rejected = int(self._number("rejected"))
        self.steps = int(self._number("trials")) - self.rejected if self._number("longest_made") else 0
        self.largest = min(self._number("longest_made"), self.options.longest_step)
        super()._count(steps)

    def _begin(self, t0: float, t_end: float) -> None:
        numbers, at = self._numbers, self._at
        numbers[at["t"]], numbers[at[END]] = self._t0, numbers[at[GOAL]] = t0, t_end
        if self.control is not None:
            numbers[at[GOAL]] = self._hold(self.control, t0, t_end)
        if self.program.timed:
            numbers[at[INSTANT]] = instant(t0, t_end)
        if self._is_held:
            self._flat = FlatPosition(self.program, t0, self.x, self.parameters)

    def unseen(self, x: Array) -> bool:
        """Take all steps from x (m,), none of them looked at; whether that could be, and nothing speaks against them.

        State and counts are then those of `blocks`, to the bit; else the run is to be made again.
        """
        if self._recorded or self.options.max_steps < math.inf:
            return False
        self.begin(x, self.options.t0, self.options.t_end)
        self.to_end()
        return not self.status and self._number("at_limit") < HELD

    @property
    def counts(self) -> dict[str, float]:
        """Numbers of `Stats` of an unseen run."""
        self._count()
        return {"steps": self.steps, "rejected": self.rejected, "nfev": self.evaluations, "dt": self.largest}

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
        self._numbers[self._at[GOAL if self._number("anew") else "end"]] = t
        self._set(status=RUNNING)

    def _near_flat(self) -> str:
        return "" if self._flat is None else self._flat.near()

    def _judge(self, rows: Array | None = None) -> None:
        """Note why the run stops after these steps, if it does; without rows, after the last."""
        stop = self._numbers[self._stop]
        if self._flat is not None and stop != DONE and (rows is None or len(rows)):
            last = np.array([[self.t, self._number("h"), *self.x]]) if rows is None else rows
            self._count()
            reason = self._flat.reason(last, self.steps, self._number("farthest"), self.largest)
            self.status = f"stopped at t = {self.t:.6g} s: {reason}" if reason else ""
        if stop == TOO_SMALL:
            self.status = self._too_small() + self._near_flat()

    def _hold(self, control: Hold, t: float, t_end: float) -> float:
        """Where the period of control from t on ends, for which its forces are taken."""
        self.parameters = control.at(t, self.x)
        self.runner.write(self._memory, "p", self.parameters)
        return next(control.ends(t, t_end))

    def _next_period(self) -> bool:
        """Whether the run is not over yet; the memory is then at the start of the next period of a controller."""
        if self.control is None or self.t == self.options.t_end:
            return False
        wanted = self._number("next")
        wanted = wanted if math.isfinite(wanted) else self.options.length  # Taylor's method chooses it by itself
        self._set(end=self._hold(self.control, self.t, self.options.t_end), next=wanted, fresh=1.0, status=RUNNING)
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
        if held >= HELD and held >= SHARE * self.steps and not self.stiff:
            t, h = rows[-1, :2]
            self.stiff = (
                f"the system is stiff: at t = {t:.6g} s the step, {abs(h):.3g} s, is held at the stability limit of "
                f"method {options.method!r}, not by its tolerance"
            )
            self.warnings.append(self.stiff)
        if options.relative < self.relative and not self._below_rounding:
            size = np.abs(rows[:, 2 : 2 + self.program.size])
            short = (absolute + options.relative * size < self.relative * size).any(axis=0)
            if short.any():
                self._below_rounding = True
                self.warnings.append(
                    f"rtol = {options.relative:g} with the atol of {self.components[int(np.argmax(short))]} is below "
                    f"the rounding of a step: raised to {self.relative:.3g}"
                )

    def _too_small(self) -> str:
        """Reason why a run stopped whose step became too small."""
        t, x = self.t, self.x
        where = f"stopped at t = {t:.6g} s: "
        rate = values_of(self.program.rate, [*x.tolist(), t, *self.parameters])
        if not np.isfinite(rate).all():
            first = self.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"{where}the rate of {first} is not finite{' at the start' if t == self._t0 else ''}"
        self.slope = _lacking(self.runner, self._memory, self.components)
        if self.slope:
            return f"{where}{self.slope} is not finite, and method {self.options.method!r} takes it"
        if reason := nonfinite(self.components, self.runner.read(self._memory, "x_new")):
            return f"{where}{reason}, however small"
        scale = self._tolerance + self.relative * np.abs(x)
        fastest = self.components[int(np.argmax(np.abs(rate) / scale))]
        h = self._number("tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"


def beginning(options: RunOptions, relative: float) -> dict[str, float]:
    """The registers of one number with which a run begins, besides its span."""
    limits = {"relative": relative, "longest_step": options.longest_step, "first": options.first_step or 0.0}
    return {"sized": float(options.atol is None), **given(limits)}


def over(t0: float, t_end: float) -> dict[str, float]:
    """The registers of a span."""
    return {"t": t0, **given({"t_end": t_end, "goal": t_end, "instant": instant(t0, t_end)})}


def tolerance(options: RunOptions) -> ArrayLike:
    """Register `TOLERANCE` at the start."""
    return np.maximum(options.absolute, SMALLEST_ATOL)


def _lacking(runner: Runner, memory: Array, components: Sequence[str]) -> str:
    """The first derivative of the rate that a method takes and that is not finite; empty if all are."""
    lengths = runner.program.registers
    for register, by in (("time_slope", ["the time"]), ("jacobian", components)):
        if lengths.get(register) and len(bad := np.flatnonzero(~np.isfinite(runner.read(memory, register)))):
            row, column = divmod(int(bad[0]), len(by))
            return f"the derivative of the rate of {components[row]} by {by[column]}"
    return ""


def integration_of(
    problem: Problem,
    options: RunOptions,
    parameters: Sequence[float] = (),
    control: Hold | None = None,
    *,
    events: EventProgram | None,
    between: bool,
) -> Integration:
    """A run of a problem, before its first step. between: with all steps, and the dense output of chosen ones."""
    method = options.integrator
    program = step_program(problem, method, dense=method.adaptive and (between or options.between))
    compiled = compile_steps(program, options.backend, options.fma)
    return integration(compiled, options, parameters, control, every_step=between, events=events)


def integration(
    compiled: CompiledSteps,
    options: RunOptions,
    parameters: Sequence[float] = (),
    control: Hold | None = None,
    stopped: Callable[[], bool] = lambda: False,
    *,
    every_step: bool = False,
    events: EventProgram | None = None,
) -> Integration:
    """A run, before its first step.  every_step: keep also those between times of t_eval."""
    if events is not None:
        from ..events.event_log import WatchedIntegration  # which a run without events does without

        def segment(rest: RunOptions) -> Integration:
            return integration(compiled, rest, parameters, control, stopped, every_step=True)

        return WatchedIntegration(segment, options, events)
    every_step = every_step or options.times is None
    if compiled.program.adaptive:
        every_step = every_step or options.between
        return AdaptiveIntegration(compiled, options, parameters, control, stopped, every_step=every_step)
    every_step = every_step or options.estimated
    return FixedStepIntegration(compiled, options, parameters, control, stopped, every_step=every_step)


END, GOAL, INSTANT = [*over(0.0, 1.0)][1:4]  # names of registers
