"""Runs by SciPy's solvers, on our compiled rate and our exact Jacobian: the well-kept reference beside our methods."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, scipy_module

from ...integrators import Problem
from ...integrators.step_control import RESOLUTION
from ..estimates.state_sizes import StateKinds
from ..run_options import SCIPY, RunOptions
from .dense_output import StepBlock, normalized
from .step_program import between, state_kinds
from .stepping import BLOCK_TIME, Integration, nonfinite

IMPLICIT = ("Radau", "BDF", "LSODA")
DEGREES = {"RK45": 4, "DOP853": 7, "Radau": 3, "BDF": 5, "LSODA": 12}  # at most, of the dense output
FINEST = 100.0 * 2.0**-52  # the smallest rtol that SciPy takes
LEAP = 1e-6  # of the run: the first step where SciPy finds none
COARSE = 1e-4  # of the largest component of a kind, which the default atol may be
IDLE = 1000  # steps below the resolution of the time, after which a run ends


@dataclass(frozen=True, eq=False)
class ScipySolver:
    """One of SciPy's solvers and what it calls."""

    name: str
    components: tuple[str, ...]
    make: Any  # SciPy's class
    rate: Any  # f(t, x) -> (m,)
    jacobian: dict[str, Any]  # {"jac": f(t, x) -> (m, m)} where the solver takes it
    normalization: Graph | None  # of the states that it gives, see Problem
    kinds: StateKinds


def scipy_solver(problem: Problem, name: str, backend: str) -> ScipySolver:
    """The solver, with the problem's rate and Jacobian compiled. Raises ImportError without SciPy."""
    integrate = scipy_module("integrate", f"method {SCIPY + name!r}")
    rate = cg.compile(problem.rate, backend)
    jacobian: dict[str, Any] = {}
    if name in IMPLICIT:
        jacobian["jac"] = lambda t, x: rate.jacobian([*x, t])[:, : problem.size]
    make, kinds = getattr(integrate, name), state_kinds(problem)
    return ScipySolver(name, problem.components, make, lambda t, x: rate([*x, t]), jacobian, between(problem), kinds)


class _Step(NamedTuple):
    """One step of a solver."""

    t_old: float
    t: float
    x_old: Array
    x: Array
    dense: Array  # (degree, m), see StepBlock; NaN where nobody asks


class ScipyIntegration(Integration):
    """A run by one of SciPy's solvers, with its own dense output where it is asked for states between its steps."""

    def __init__(self, solver: ScipySolver, options: RunOptions, *, between: bool = False) -> None:
        super().__init__(solver.components)
        self.solver, self.options, self.between = solver, options, between
        self._idle = 0  # steps in a row that hardly moved the time
        self._largest = np.zeros(len(solver.components))  # sizes of the components so far

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        try:
            yield from self._blocks(x)
        finally:
            self._judge_atol()

    def _blocks(self, x: Array) -> Iterator[StepBlock]:
        solver = self._started(x)
        self._largest = np.abs(x)
        rows: list[_Step] = []
        begin = time.perf_counter()
        while solver is not None and solver.status == "running" and not self.status:
            if self.steps >= self.options.max_steps:
                self.status = self.too_many(solver.t, self.options.max_steps)
            elif self._stepped(solver) and solver.t != solver.t_old:
                rows.append(self._step(solver, rows[-1].x if rows else x))
            if rows and time.perf_counter() - begin >= BLOCK_TIME:
                yield self._block(rows)
                x, rows, begin = rows[-1].x, [], time.perf_counter()
        if rows:
            yield self._block(rows)

    def _judge_atol(self) -> None:
        """Note where the atol that nobody gave, a number in whatever unit, is no small part of a kind of component."""
        kind = self.solver.kinds.largest_of_kind(self._largest)
        shares = np.divide(self.options.absolute, kind, out=np.zeros_like(kind), where=kind > 0.0)
        k = int(np.argmax(shares))
        if self.options.atol is None and shares[k] > COARSE:
            self.warnings.append(
                f"atol = {self.options.absolute:g}, the default of SciPy's solvers, is {shares[k]:.2g} of "
                f"{kind[k]:.3g}, the largest that {self.components[k]} or another of its kind has been: give atol"
            )

    def _started(self, x: Array) -> Any:
        """SciPy's solver at the start; None where it would not come back from there, and then `status` says why."""
        options, name = self.options, self.solver.name
        start = f"stopped at t = {options.t0:.6g} s: "
        rate = self.solver.rate(options.t0, x)
        if len(bad := np.flatnonzero(~np.isfinite(rate))):
            self.status = f"{start}the rate of {self.components[bad[0]]} is not finite at the start"
            return None
        if len(bad := np.flatnonzero(options.absolute + options.relative * np.abs(x) == 0.0)):
            self.status = f"{start}{self.components[bad[0]]} is 0, and so is atol: nothing measures its error"
            return None
        rtol, asked = max(options.relative, FINEST), options.absolute + options.relative * np.abs(x)
        if len(fine := np.flatnonzero(asked < FINEST * np.abs(x))):
            what = f"the tolerance of {self.components[fine[0]]}, {asked[fine[0]]:.3g}, is below rounding"
            self.warnings.append(f"{what}: SciPy's {name} takes rtol = {rtol:.3g}")
        limits: dict[str, Any] = {"rtol": rtol, "atol": options.absolute, "max_step": options.longest_step}
        limits |= self.solver.jacobian
        arguments = self.solver.rate, options.t0, x, options.t_end
        solver = self.solver.make(*arguments, first_step=options.first_step, **limits)
        chosen = getattr(solver, "h_abs", 1.0)  # LSODA chooses in its first step
        if not (math.isfinite(chosen) and chosen > 0.0):  # by a division by a scale that is next to nothing
            solver = self.solver.make(*arguments, first_step=LEAP * options.length, **limits)
        return solver

    def _stepped(self, solver: Any) -> bool:
        """Take one step; False where there is none, and then `status` says why."""
        where = f"stopped at t = {solver.t:.6g} s: "
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                message = solver.step()
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # from SciPy's linear algebra
            self.status = where + self._gave_up(solver, [str(error)])
            return False
        self.evaluations, self.jacobians, self.factorizations = solver.nfev, solver.njev, solver.nlu
        if reason := nonfinite(self.components, solver.y):
            self.status = f"stopped at t = {solver.t:.6g} s: {reason}"
        elif solver.status == "failed":
            self.status = where + self._gave_up(solver, [message, *[str(one.message) for one in said]])
        else:
            still = abs(solver.t - solver.t_old) <= RESOLUTION * max(abs(self.options.t0), abs(self.options.t_end))
            self._idle = self._idle + 1 if still else 0
            if self._idle > IDLE:
                self.status = f"{where}{IDLE} steps of SciPy's {self.solver.name} have not moved the time"
        return not self.status

    def _gave_up(self, solver: Any, said: Sequence[str | None]) -> str:
        """Reason why the solver has failed: what is not finite at the state that it has come to, or what SciPy says."""
        rate = self.solver.rate(solver.t, solver.y)
        if len(bad := np.flatnonzero(~np.isfinite(rate))):
            return f"the rate of {self.components[bad[0]]} is not finite"
        jacobian = self.solver.jacobian.get("jac")
        if jacobian is not None and len(bad := np.flatnonzero(~np.isfinite(jacobian(solver.t, solver.y)).all(axis=1))):
            return f"the Jacobian of the rate of {self.components[bad[0]]} is not finite"
        return f"SciPy's {self.solver.name} gave up: " + " ".join([text for text in said if text])

    def _step(self, solver: Any, x_old: Array) -> _Step:
        self.steps += 1
        t_old, t, x = float(solver.t_old), float(solver.t), np.array(solver.y)
        self.largest = max(self.largest, abs(t - t_old))
        self._largest = np.maximum(self._largest, np.abs(x))
        degree, times = DEGREES[self.solver.name], self.options.times
        if not self.between and (times is None or not _inside(times, t_old, t)):
            return _Step(t_old, t, x_old, x, np.full((degree, len(x)), np.nan))
        shares = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, degree + 1) / degree)
        change = solver.dense_output()(t_old + shares * (t - t_old)).T - x_old
        change[-1] = x - x_old
        return _Step(t_old, t, x_old, x, np.linalg.solve(shares[:, None] ** np.arange(1, degree + 1), change))

    def _block(self, steps: list[_Step]) -> StepBlock:
        """The steps, which arrive at normalized states; the solver goes on from those that it keeps itself."""
        t_old, t, x_old, x, dense = (np.array(column) for column in zip(*steps, strict=True))
        graph = self.solver.normalization
        return StepBlock(t, normalized(graph, x, t), t_old, t - t_old, x_old, dense, graph)


def _inside(times: Array, t_old: float, t: float) -> bool:
    """Whether there are times between the ends of a step, in either direction."""
    return bool(((times > min(t_old, t)) & (times < max(t_old, t))).any())


def solve_ivp() -> Any:
    """SciPy's `solve_ivp` itself, to compare with. Raises ImportError without SciPy."""
    return scipy_module("integrate", "solve_ivp").solve_ivp
