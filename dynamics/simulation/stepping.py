"""Runs: from a start to an end in pieces, by methods of equal steps and by those that choose their steps."""

from __future__ import annotations

import itertools
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph.extend import Runner, runner

from ..integrators import Method, Problem
from ..integrators.step_control import DONE, TOO_SMALL
from .run_options import Limits, step_count
from .trajectory import Array

Indices = np.ndarray[Any, np.dtype[np.intp]]
KEPT = 16  # programs that stay ready for another run
PIECE = 0.1  # s of run time after which a run comes back to Python: for Ctrl-C, progress and events
FIRST = 32  # passes of the first piece, before it is known how long one takes
LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60  # of a first step
HUGE = 1e300  # a tolerance that anything meets


class Piece(NamedTuple):
    """Consecutive steps. With dense output: x(t_old + s h) = x_old + sum_k dense_k s^k for 0 <= s <= 1."""

    t: Array  # (T,) ends of the steps
    x: Array  # (T, m)
    t_old: Array  # (T,)
    h: Array  # (T,)
    x_old: Array  # (T, m)
    dense: Array | None  # (T, degree, m)

    def at(self, rows: Indices, s: Array) -> Array:
        """States (k, m) at the shares s (k,) of the steps `rows` (k,)."""
        assert self.dense is not None
        total = np.zeros((len(rows), self.x.shape[1]))
        for k in reversed(range(self.dense.shape[1])):
            total = (total + self.dense[rows, k]) * s[:, None]
        inside: Array = np.where((s == 1.0)[:, None], self.x[rows], self.x_old[rows] + total)
        return inside


class Clock:
    """Whether enough run time has passed since the last time it said so."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def passed(self, seconds: float) -> bool:
        """Whether it has."""
        now = time.perf_counter()
        if now - self._last < seconds:
            return False
        self._last = now
        return True


class Tally(ABC):
    """One run. `pieces` makes the steps; the attributes say how far it has come.

    status: empty while all is well, else why it stopped before the end.  largest: step [s].
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.steps = self.rejected = self.evaluations = 0
        self.largest = 0.0
        self.status = ""

    @abstractmethod
    def pieces(self, x: Array) -> Iterator[Piece]:
        """The steps from x (m,) on, a piece at a time."""

    def where(self, state: Array) -> str:
        """The first component that is no number, in words; empty if all are."""
        bad = np.flatnonzero(~np.isfinite(state))
        return f"{self.component(int(bad[0]))} is {state[bad[0]]} after the step" if len(bad) else ""

    def component(self, index: int) -> str:
        """A component of the state, in words."""
        system = self.problem.system
        if system is None:
            return f"state {self.problem.states[index]!r}"
        what = "coordinate" if index < system.n else "velocity of"
        return f"{what} {system.coordinates[index % system.n]!r}"

    def too_many(self, t: float, most: float) -> str:
        """The status of a run that may not go on."""
        return f"stopped at t = {t:.6g} s after max_steps = {most:g} steps"


class Run(Tally):
    """A run of one of our methods."""

    def __init__(
        self, problem: Problem, method: Method, parameters: Sequence[float], backend: str, *, dense: bool
    ) -> None:
        super().__init__(problem)
        self.method, self.dense = method, dense
        self.runner = _ready(problem, method, dense, backend)
        self.parameters = list(parameters)
        self._passes = FIRST

    def _advance(self, memory: Array, most: int, whole: bool) -> tuple[Array, int]:
        """Some passes, at most so many: their rows (the last alone, with `whole`), and how many."""
        passes = min(self._passes, most)
        begin = time.perf_counter()
        rows, done = self.runner.run(memory, passes, passes if whole else 1)
        spent = time.perf_counter() - begin
        if passes == self._passes:
            self._passes = max(1, int(passes * min(4.0, PIECE / max(spent, 1e-9))))
        return rows, done

    def _number(self, memory: Array, name: str) -> float:
        return float(self.runner.read(memory, name)[0])


@lru_cache(KEPT)
def _ready(problem: Problem, method: Method, dense: bool, backend: str) -> Runner:
    """The method's steps, made ready once for runs of the same problem."""
    return runner(method.program(problem, dense), backend)


class FixedRun(Run):
    """Equal steps between the instants, at most dt. Every step is a row with `each`, else only those at instants."""

    def __init__(
        self,
        problem: Problem,
        method: Method,
        parameters: Sequence[float],
        backend: str,
        *,
        instants: Sequence[float],
        dt: float,
        each: bool,
        most: float,
    ) -> None:
        super().__init__(problem, method, parameters, backend, dense=False)
        self.instants, self.dt, self.each, self.most = instants, dt, each, most

    def pieces(self, x: Array) -> Iterator[Piece]:
        """See Tally."""
        start: dict[str, float | Array | list[float]] = {"x": x, "p": self.parameters}
        if "fresh" in self.runner.program.registers:
            start["fresh"] = 1.0
        memory = self.runner.memory(start)
        m = self.problem.size
        for begin, end in itertools.pairwise(self.instants):
            steps = step_count(end - begin, self.dt)
            size = (end - begin) / steps
            for name, value in (("start", begin), ("t", begin), ("count", 0.0), ("h", size)):
                self.runner.write(memory, name, value)
            left = steps
            while left:
                if self.steps >= self.most:
                    self.status = self.too_many(self._number(memory, "t"), self.most)
                    return
                x_old = self.runner.read(memory, "x").copy()
                rows, done = self._advance(memory, int(min(left, self.most - self.steps)), whole=not self.each)
                left -= done
                lost = self._number(memory, "lost") != 0.0
                self.steps += done - lost
                self.evaluations = int(self._number(memory, "evaluations"))
                if self.each:
                    rows = rows[: len(rows) - lost]
                elif left or lost:
                    rows = rows[:0]
                if len(rows):
                    self.largest = max(self.largest, min(size, self.dt))
                    if not left and not lost:
                        rows[-1, 0] = end
                    t, states = rows[:, 0], rows[:, 1 : 1 + m]
                    before = np.concatenate([x_old[None], states[:-1]])
                    yield Piece(t, states, t - size, np.full(len(t), size), before, None)
                if lost:
                    self.status = self._lost(memory)
                    return

    def _lost(self, memory: Array) -> str:
        t = self._number(memory, "t")
        if where := self.where(self.runner.read(memory, "x")):
            return f"stopped at t = {t:.6g} s: {where}"
        return f"stopped at t = {t:.6g} s: the equations of the step did not converge; the step is too long"


class AdaptiveRun(Run):
    """Steps chosen by the method."""

    def __init__(
        self,
        problem: Problem,
        method: Method,
        parameters: Sequence[float],
        backend: str,
        limits: Limits,
        *,
        dense: bool,
    ) -> None:
        super().__init__(problem, method, parameters, backend, dense=dense)
        self.limits = limits

    def pieces(self, x: Array) -> Iterator[Piece]:
        """See Tally."""
        limits = self.limits
        start: Mapping[str, float | Array | list[float]] = {
            "x": x,
            "p": self.parameters,
            "end": limits.t_end,
            "rtol": limits.rtol,
            "atol": limits.atol,
            "next": self._first_step(x) if limits.first is None else limits.first,
            "longest": limits.longest,
            "fresh": 1.0,
            "error_old": 1e-4,
            "accepted": 1.0,
        }
        memory = self.runner.memory(start)
        while True:
            left = limits.most - self.steps - self.rejected
            if left <= 0:
                self.status = self.too_many(self._number(memory, "t"), limits.most)
                return
            rows, _ = self._advance(memory, int(min(left, 2**31)), whole=False)
            status = self._number(memory, "status")
            self.steps += len(rows)
            self.rejected = int(self._number(memory, "rejected"))
            self.evaluations = int(self._number(memory, "evaluations"))
            if len(rows):
                yield self._piece(rows)
            if status == TOO_SMALL:
                self.status = self._too_small(memory)
            if status in (TOO_SMALL, DONE):
                return

    def _piece(self, rows: Array) -> Piece:
        m = self.problem.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        self.largest = max(self.largest, float(h.max()))
        if not self.dense:
            return Piece(t, x, t - h, h, np.full_like(x, math.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return Piece(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m))

    def _too_small(self, memory: Array) -> str:
        t, h = self._number(memory, "t"), self._number(memory, "h")
        if t == 0.0 and not np.isfinite(rate := self._rate(t, self.runner.read(memory, "x"))).all():
            first = self.component(int(np.flatnonzero(~np.isfinite(rate))[0]))
            return f"stopped at t = 0 s: the rate of {first} is not finite at the start"
        text = f"stopped at t = {t:.6g} s: the step, {h:.3g} s, is below the resolution of the time"
        if where := self.where(self.runner.read(memory, "x_new")):
            return f"stopped at t = {t:.6g} s: {where}, however small"
        x = self.runner.read(memory, "x")
        speed = np.abs(self._rate(t, x)) / self._scale(x)
        return f"{text}; fastest is {self.component(int(np.nanargmax(speed)))}"

    def _rate(self, t: float, x: Array) -> Array:
        names = self.problem.rate.input_names
        values = dict(zip(names, [*x.tolist(), t, *self.parameters], strict=True))
        return np.array(list(self.problem.rate.evaluate(values).values()), dtype=np.float64)

    def _scale(self, x: Array) -> Array:
        """What an error is measured by."""
        size: Array = self.limits.atol + self.limits.rtol * np.abs(x)
        return size

    def _first_step(self, x: Array) -> float:
        """A step that two half steps confirm: their difference is within the tolerance.

        The estimate of an embedded method can vanish by symmetry, such as at a start from rest, and a guess from the
        first derivatives can be far off; halving cannot be fooled by either.
        """
        order, scale = self.method.order, self._scale(x)
        anything = {"rtol": HUGE, "atol": HUGE, "longest": math.inf, "end": math.inf, "fresh": 1.0, "accepted": 1.0}
        memory = self.runner.memory({"x": x, "p": self.parameters, "error_old": 1.0, **anything})
        h = min(self.limits.t_end, self.limits.longest) * LEAP
        for _ in range(TRIALS):
            with np.errstate(all="ignore"):
                change = (self._forced(memory, [h]) - self._forced(memory, [0.5 * h, 0.5 * h])) / scale
                difference = float(np.sqrt(np.mean(change * change)))
            if difference <= 1.0:
                break
            factor = 0.9 * difference ** (-1.0 / (order + 1)) if math.isfinite(difference) else 0.0
            h *= min(0.5, max(1e-3, factor))
        return h

    def _forced(self, memory: Array, steps: Sequence[float]) -> Array:
        """The state after these steps from a memory, which is left as it is."""
        memory = memory.copy()
        for h in steps:
            self.runner.write(memory, "next", h)
            self.runner.run(memory, 1)
        return self.runner.read(memory, "x")


@dataclass(frozen=True)
class Hermite:
    """Dense output where a method has none: the cubic through states and rates at both ends of a step."""

    problem: Problem
    parameters: Sequence[float]

    def of(self, piece: Piece) -> Piece:
        """The piece, with dense output."""
        f = cg.compile(self.problem.rate)
        held = np.repeat(np.array(self.parameters, dtype=np.float64)[:, None], len(piece.t), axis=1)
        first = f.batch(np.concatenate([piece.x_old.T, piece.t_old[None], held])).T
        last = f.batch(np.concatenate([piece.x.T, piece.t[None], held])).T
        h, change = piece.h[:, None], piece.x - piece.x_old
        dense = np.stack([h * first, 3 * change - h * (2 * first + last), h * (first + last) - 2 * change], axis=1)
        return piece._replace(dense=dense)
