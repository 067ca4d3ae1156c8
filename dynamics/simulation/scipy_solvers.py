"""Runs by SciPy's solvers, on our compiled rate and our exact Jacobian: the well-kept reference beside our methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import cgraph as cg
from cgraph.extend import Array, install

from ..integrators import Problem, state_jacobian
from .dense_output import StepBlock
from .run_options import SCIPY, RunOptions
from .stepping import BLOCK_TIME, Clock, Integration

IMPLICIT = ("Radau", "BDF", "LSODA")


@dataclass(frozen=True, eq=False)
class ScipySolver:
    """One of SciPy's solvers and what it calls."""

    name: str
    components: tuple[str, ...]
    make: Any  # SciPy's class
    rate: Any  # f(t, x) -> (m,)
    jacobian: dict[str, Any]  # {"jac": f(t, x) -> (m, m)} where the solver takes it


def scipy_solver(problem: Problem, name: str, backend: str) -> ScipySolver:
    """The solver, with the problem's rate and Jacobian compiled. Raises ImportError without SciPy."""
    try:
        from scipy import integrate
    except ImportError:
        raise ImportError(f"method {SCIPY + name!r} needs SciPy: {install('scipy')}") from None
    rate = cg.compile(problem.rate, backend)
    jacobian: dict[str, Any] = {}
    if name in IMPLICIT:
        slopes, m = cg.compile(state_jacobian(problem), backend), problem.size
        jacobian["jac"] = lambda t, x: slopes([*x, t]).reshape(m, m)
    return ScipySolver(name, problem.components, getattr(integrate, name), lambda t, x: rate([*x, t]), jacobian)


class ScipyIntegration(Integration):
    """A run by one of SciPy's solvers. Its dense output gives rows at the times of t_eval besides its steps."""

    def __init__(self, solver: ScipySolver, options: RunOptions) -> None:
        super().__init__(solver.components)
        self.solver, self.options = solver, options
        self._jacobians = self._factorizations = 0

    @property
    def jacobians(self) -> int:
        """Evaluations of the Jacobian, as SciPy counts them."""
        return self._jacobians

    @property
    def factorizations(self) -> int:
        """LU factorizations, as SciPy counts them."""
        return self._factorizations

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time."""
        options, times = self.options, self.options.times
        limits: dict[str, Any] = {"rtol": options.relative, "atol": options.absolute}
        limits |= {"max_step": options.longest_step, "first_step": options.first_step}
        solver = self.solver.make(self.solver.rate, options.t0, x, options.t_end, **limits, **self.solver.jacobian)
        t, states = [options.t0], [np.array(x)]
        clock = Clock()
        while solver.status == "running":
            if self.steps >= options.max_steps:
                self.status = self.too_many(solver.t, options.max_steps)
                break
            message = solver.step()
            self.evaluations, self._jacobians, self._factorizations = solver.nfev, solver.njev, solver.nlu
            reason = self.nonfinite(solver.y)
            if solver.status == "failed" or reason:
                reason = reason or f"SciPy's {self.solver.name} gave up: {message}"
                self.status = f"stopped at t = {solver.t:.6g} s: {reason}"
                break
            self.steps += 1
            self.largest = max(self.largest, abs(float(solver.t - solver.t_old)))
            if times is not None:
                ends = options.direction * np.array([solver.t_old, solver.t])
                first, last = np.searchsorted(options.direction * times, ends, side="right")
                inside = [at for at in times[first:last].tolist() if at != solver.t]
                if inside:
                    between = solver.dense_output()
                    t += inside
                    states += [np.array(between(at)) for at in inside]
            t.append(float(solver.t))
            states.append(np.array(solver.y))
            if clock.passed(BLOCK_TIME) and len(t) > 1:
                yield _block(t, states)
                t, states = t[-1:], states[-1:]
        if len(t) > 1:
            yield _block(t, states)


def _block(times: list[float], states: list[Array]) -> StepBlock:
    t, x = np.array(times), np.array(states)
    return StepBlock(t[1:], x[1:], t[:-1], np.diff(t), x[:-1], None)


def solve_ivp() -> Any:
    """SciPy's `solve_ivp` itself, to compare with. Raises ImportError without SciPy."""
    from scipy.integrate import solve_ivp as function

    return function
