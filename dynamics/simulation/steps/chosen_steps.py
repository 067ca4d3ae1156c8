"""Integration by steps chosen by error, and what a user should know of the steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, Runner

from ...integrators.step_control import DONE, RUNNING, SMALLEST_ATOL, TOO_SMALL
from ..row_values import values_of
from ..run_options import RunOptions
from .dense_output import StepBlock
from .first_step import TOLERANCE, given, instant
from .flat_position import CREEP, FlatPosition
from .stepping import NativeIntegration, NativeRun, nonfinite

HELD, SHARE = 100, 0.25  # steps at the stability limit, of all, from which on a run is called stiff


class AdaptiveIntegration(NativeIntegration):
    """Steps chosen by the method."""

    def __init__(self, run: NativeRun) -> None:
        super().__init__(run)
        self.relative = max(run.options.relative, self.program.finest)
        self._below_rounding = False
        self.flat = FlatPosition(self.program)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        memory = self.memory(x)
        self.flat.begin(self.options.t0, x, self.parameters)
        while True:
            left = self.options.max_steps - self._number(memory, "trials")
            if left <= 0:
                at = self._number(memory, "t")
                self.status = self.too_many(at, self.options.max_steps) + self.flat.near(self.parameters)
                return
            tolerance = self.runner.read(memory, TOLERANCE).copy()
            most = left if self.flat.rows is None else min(left, CREEP)
            rows, _ = self._advance(memory, int(min(most, 2**31)), whole=False)
            status = self._number(memory, "status")
            self._count(len(rows), int(self._number(memory, "rejected")))
            if "jacobians" in self.runner.program.registers:  # a method that keeps them counts by itself
                self.jacobians = int(self._number(memory, "jacobians"))
                self.factorizations = int(self._number(memory, "factorizations"))
            self.evaluations = int(self._number(memory, "evaluations"))
            if len(rows):
                self._look(memory, rows, tolerance)
                yield self._block(rows)
            self.status = self.flat.creeping(status == RUNNING, self.steps, self.largest, rows, self.parameters)
            if self.status:
                return
            if status == TOO_SMALL:
                self.status = self.too_small(memory) + self.flat.near(self.parameters)
            if status == TOO_SMALL or (status == DONE and not self._next_period(memory)):
                return

    def memory(self, x: Array) -> Array:
        """The memory before the first step."""
        end = self._hold(self.options.t0, x)
        return self.runner.memory({"x": x, "p": self.parameters, **beginning(self.options, self.relative, end)})

    def _hold(self, t: float, x: Array) -> float:
        """End of the steps from t on; take a controller's forces for this period."""
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

    def _look(self, memory: Array, rows: Array, absolute: Array) -> None:
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
            short = (absolute + options.relative * size < self.relative * size).any(axis=0)
            if short.any():
                self._below_rounding = True
                self.warnings.append(
                    f"rtol = {options.relative:g} with the atol of {self.components[int(np.argmax(short))]} is below "
                    f"the rounding of a step: raised to {self.relative:.3g}"
                )

    def too_small(self, memory: Array) -> str:
        """Reason why a run stopped whose step became too small."""
        t, x = self._number(memory, "t"), self.runner.read(memory, "x")
        where = f"stopped at t = {t:.6g} s: "
        rate = values_of(self.program.rate, [*x.tolist(), t, *self.parameters])
        if not np.isfinite(rate).all():
            first = self.components[int(np.flatnonzero(~np.isfinite(rate))[0])]
            return f"{where}the rate of {first} is not finite{' at the start' if t == self.options.t0 else ''}"
        self.slope = _lacking(self.runner, memory, self.components)
        if self.slope:
            return f"{where}{self.slope} is not finite, and method {self.options.method!r} takes it"
        if reason := nonfinite(self.components, self.runner.read(memory, "x_new")):
            return f"{where}{reason}, however small"
        scale = self.runner.read(memory, TOLERANCE) + self.relative * np.abs(x)
        fastest = self.components[int(np.argmax(np.abs(rate) / scale))]
        h = self._number(memory, "tried")
        return f"{where}the step, {h:.3g} s, is below the resolution of the time; fastest is {fastest}"


def beginning(options: RunOptions, relative: float, goal: float) -> dict[str, ArrayLike]:
    """The registers with which a run begins, besides x and p.  goal: where its steps end first."""
    values = {
        "t_end": options.t_end,
        "goal": goal,
        "relative": relative,
        "tolerance": np.maximum(options.absolute, SMALLEST_ATOL),
        "longest_step": options.longest_step,
        "first": options.first_step or 0.0,
        "instant": instant(options.t0, options.t_end),
    }
    return {"t": options.t0, "sized": float(options.atol is None), **given(values)}


def _lacking(runner: Runner, memory: Array, components: Sequence[str]) -> str:
    """The first derivative of the rate that a method takes and that is not finite; empty if all are."""
    lengths = runner.program.registers
    for register, by in (("time_slope", ["the time"]), ("jacobian", components)):
        if lengths.get(register) and len(bad := np.flatnonzero(~np.isfinite(runner.read(memory, register)))):
            row, column = divmod(int(bad[0]), len(by))
            return f"the derivative of the rate of {components[row]} by {by[column]}"
    return ""
