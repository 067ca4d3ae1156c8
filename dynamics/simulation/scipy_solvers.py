"""Runs by SciPy's solvers, on our compiled rate and our exact Jacobian: the well-kept reference beside our methods."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import cgraph as cg
from cgraph.errors import install

from ..integrators import Problem
from .run_options import Limits
from .stepping import PIECE, Clock, Piece, Tally
from .trajectory import Array

PREFIX = "scipy:"
SOLVERS = ("Radau", "BDF", "LSODA", "DOP853", "RK45")
IMPLICIT = ("Radau", "BDF", "LSODA")


class ScipyRun(Tally):
    """A run by one of SciPy's solvers. With `asked`, its dense output gives rows at those times besides its steps."""

    def __init__(
        self,
        problem: Problem,
        solver: str,
        backend: str,
        limits: Limits,
        *,
        asked: Array | None,
    ) -> None:
        super().__init__(problem)
        try:
            from scipy import integrate
        except ImportError:
            raise ImportError(f"method {PREFIX + solver!r} needs SciPy: {install('scipy')}") from None
        self.solver, self.make = solver, getattr(integrate, solver)
        self.limits, self.asked = limits, asked
        self._rate = cg.compile(problem.rate, backend)
        self._jacobian: dict[str, Any] = {}
        if solver in IMPLICIT:
            slopes, m = cg.compile(problem.jacobian, backend), problem.size
            self._jacobian["jac"] = lambda t, x: slopes([*x, t]).reshape(m, m)

    def pieces(self, x: Array) -> Iterator[Piece]:
        """See Tally."""
        limits = self.limits
        options = {"rtol": limits.rtol, "atol": limits.atol, "max_step": limits.longest, "first_step": limits.first}
        solver = self.make(lambda t, x: self._rate([*x, t]), 0.0, x, limits.t_end, **options, **self._jacobian)
        times, states = [0.0], [np.array(x)]
        clock = Clock()
        while solver.status == "running":
            if self.steps >= limits.most:
                self.status = self.too_many(solver.t, limits.most)
                break
            message = solver.step()
            self.evaluations = solver.nfev
            where = self.where(solver.y)
            if solver.status == "failed" or where:
                reason = where or f"SciPy's {self.solver} gave up: {message}"
                self.status = f"stopped at t = {solver.t:.6g} s: {reason}"
                break
            self.steps += 1
            self.largest = max(self.largest, float(solver.t - solver.t_old))
            if self.asked is not None:
                first, last = np.searchsorted(self.asked, [solver.t_old, solver.t], side="right")
                inside = [t for t in self.asked[first:last].tolist() if t < solver.t]
                if inside:
                    between = solver.dense_output()
                    times += inside
                    states += [np.array(between(t)) for t in inside]
            times.append(float(solver.t))
            states.append(np.array(solver.y))
            if clock.passed(PIECE) and len(times) > 1:
                yield _piece(times, states)
                times, states = times[-1:], states[-1:]
        if len(times) > 1:
            yield _piece(times, states)


def _piece(times: list[float], states: list[Array]) -> Piece:
    t, x = np.array(times), np.array(states)
    return Piece(t[1:], x[1:], t[:-1], np.diff(t), x[:-1], None)


def solver_of(method: str) -> str | None:
    """The solver that a method names, None for one of ours. Raises ValueError for one that is not known."""
    if not method.startswith(PREFIX):
        return None
    name = method.removeprefix(PREFIX)
    if name not in SOLVERS:
        raise ValueError(f"SciPy's methods are {', '.join(PREFIX + each for each in SOLVERS)}, got {method!r}")
    return name


def solve_ivp() -> Any:
    """SciPy's `solve_ivp` itself, to compare with. Raises ImportError without SciPy."""
    from scipy.integrate import solve_ivp as function

    return function
