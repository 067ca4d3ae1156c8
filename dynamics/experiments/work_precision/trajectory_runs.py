"""Solvers: ways to integrate a setting, timed from its start to t_end; ours, and SciPy on our compiled rate."""

from __future__ import annotations

import copy
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...equations.state_equation import state_inputs
from ...integrators import METHODS, Problem
from ...simulation.recorder import Rows
from ...simulation.run_options import Limits
from ...simulation.scipy_solvers import PREFIX, ScipyRun
from ...simulation.stepping import AdaptiveRun, FixedRun, Tally
from ...simulation.trajectory import Array
from ..setting import Setting

EQUAL, CHOSEN = "equal steps", "chosen steps"
TRIAL = 4096  # steps that tell how long many more take
LONGEST = 3.0  # s; a run that takes longer is given up


class Outcome(NamedTuple):
    """A run to t_end.  status: empty, or why it did not get there.  None: a count that is not told."""

    x: Array  # (m,)
    steps: int | None = None
    rejected: int | None = None
    evaluations: int | None = None
    status: str = ""


class Solver(ABC):
    """A way to integrate one setting.

    kind: `EQUAL`, where the knob is the number of steps, or `CHOSEN`, where it is the relative tolerance.
    order: of its error, as declared; None where that is no fixed number.
    """

    order: int | None = None
    kind = CHOSEN
    ours = False
    tolerances: Sequence[float] = tuple([10.0**-k for k in range(3, 16)])

    def __init__(self, name: str, about: str, setting: Setting, smallest: float) -> None:
        self.name, self.about, self.setting, self.smallest = name, about, setting, smallest
        self.start = np.array(setting.start)

    @abstractmethod
    def ready(self, knob: float) -> Callable[[], Outcome]:
        """What is timed: the run with that knob, everything before it done. Raises for what cannot be done."""

    @abstractmethod
    def rows(self, knob: float) -> Array:
        """The states at the setting's times, (T, m); NaN from where it stopped."""

    def rates(self, x: Array) -> Array | None:
        """Its own rates of the states, (T, m), at states (T, m); None where they are computed by our graph."""
        return None

    def absolute(self, knob: float) -> float:
        """The absolute tolerance that goes with a relative one: as small a part of the smallest state."""
        return knob * self.smallest


def problem_of(setting: Setting) -> Problem:
    """The setting's equations, with parameters bound and no force applied."""
    inputs = state_inputs(setting.model)
    return Problem(setting.model, dict(inputs.parameters) | dict.fromkeys(inputs.applied, 0.0))


def finished(run: Tally, start: Array) -> Outcome:
    """The run, to its end or until it has taken too long."""
    begin, last, status = time.perf_counter(), start, ""
    with np.errstate(all="ignore"):
        for piece in run.pieces(start):
            if len(piece.x):
                last = piece.x[-1]
            if time.perf_counter() - begin > LONGEST:
                status = f"took longer than {LONGEST:g} s"
                break
    return Outcome(np.array(last), run.steps, run.rejected, run.evaluations, run.status or status)


def recorded(run: Tally, start: Array, times: Sequence[float]) -> Array:
    """The states of a run at some times, (T, m)."""
    rows = Rows(start, np.array(times))
    begin = time.perf_counter()
    with np.errstate(all="ignore"):
        for piece in run.pieces(start):
            rows.add(piece)
            if time.perf_counter() - begin > 2 * LONGEST:
                break
    states = rows.table()[1]
    result = np.full((len(times), len(start)), math.nan)
    result[: len(states)] = states
    return result


class Ours(Solver):
    """One of our methods in its native loop; the program is made once."""

    ours = True

    def __init__(self, name: str, setting: Setting, smallest: float, problem: Problem, backend: str = "auto") -> None:
        super().__init__(name, "ours", setting, smallest)
        self.problem, self.backend, self.method = problem, backend, METHODS[name]
        self.order = self.method.order
        self.kind = CHOSEN if self.method.adaptive else EQUAL

    @cached_property
    def _plain(self) -> Tally:
        return self._template(dense=False)

    @cached_property
    def _dense(self) -> Tally:
        return self._template(dense=True) if self.method.adaptive else self._plain

    def _template(self, dense: bool) -> Tally:
        """A run to be copied; its numbers come later."""
        if self.method.adaptive:
            return AdaptiveRun(self.problem, self.method, (), self.backend, Limits(), dense=dense)
        return FixedRun(self.problem, self.method, (), self.backend, instants=(), dt=1.0, each=False, most=math.inf)

    def _run(self, knob: float, template: Tally, instants: Sequence[float]) -> Tally:
        run = copy.copy(template)
        t_end = self.setting.t_end
        if self.method.adaptive:
            plan: dict[str, Any] = {"limits": Limits(t_end, knob, self.absolute(knob))}
        else:
            plan = {"instants": instants, "dt": t_end / knob}
        vars(run).update(plan)
        return run

    def ready(self, knob: float) -> Callable[[], Outcome]:
        """See Solver."""
        template, ends = self._plain, (0.0, self.setting.t_end)
        if self.kind == EQUAL and self._at_least(knob) > LONGEST:  # such a run does not look at the clock on its way
            return lambda: Outcome(self.start, status=f"would take longer than {LONGEST:g} s")
        return lambda: finished(self._run(knob, template, ends), self.start)

    def _at_least(self, knob: float) -> float:
        """Seconds that so many equal steps take, by the first few of them."""
        run = self._run(knob, self._plain, (0.0, self.setting.t_end))
        vars(run)["most"] = TRIAL
        begin = time.perf_counter()
        finished(run, self.start)
        return (time.perf_counter() - begin) * knob / min(knob, TRIAL)

    def rows(self, knob: float) -> Array:
        """See Solver."""
        times = self.setting.times
        return recorded(self._run(knob, self._dense, times), self.start, times)


class Scipy(Solver):
    """One of SciPy's solvers on our compiled rate and Jacobian. Raises ImportError without SciPy."""

    tolerances = tuple([10.0**-k for k in range(3, 14)])  # it takes none smaller than 2e-14

    def __init__(self, solver: str, setting: Setting, smallest: float, problem: Problem, backend: str = "auto") -> None:
        super().__init__(PREFIX + solver, "SciPy's solver on our compiled rate", setting, smallest)
        self._template = ScipyRun(problem, solver, backend, Limits(), asked=None)
        self.order = {"DOP853": 8, "Radau": 5, "RK45": 5}.get(solver)

    def _run(self, knob: float, asked: Array | None) -> Tally:
        run = copy.copy(self._template)
        run.limits = Limits(self.setting.t_end, knob, self.absolute(knob))
        run.asked = asked
        return run

    def ready(self, knob: float) -> Callable[[], Outcome]:
        """See Solver."""
        return lambda: finished(self._run(knob, None), self.start)._replace(rejected=None)

    def rows(self, knob: float) -> Array:
        """See Solver."""
        times = np.array(self.setting.times)
        return recorded(self._run(knob, times), self.start, times.tolist())
