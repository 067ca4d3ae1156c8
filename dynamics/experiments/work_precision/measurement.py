"""Measurement of solvers, ways to integrate a task: their errors from coarse to fine, and run times in turns.

Ours are the methods of `simulate`.
"""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from cgraph import Graph
from cgraph._shared import Array

from ...equations.equations_of_motion import energy
from ...equations.state_equation import state_inputs
from ...integrators import METHODS, Problem, derive
from ...multiprecision import Reference
from ...simulation.outcome import Recorder
from ...simulation.run_options import Span, Steps
from ...simulation.stepper import Stepper, stepper
from ...simulation.steps.step_program import CompiledSteps, compile_steps, step_program
from ...systems.model import as_system
from ..accuracy_task import INTERVALS, AccuracyTask
from ..timing import Spent, Timed, in_turns, spent

AnySolver = TypeVar("AnySolver", bound="Solver")
ErrorOf = Callable[[Array], float]  # of a state (m,) at t_end

EQUAL, CHOSEN = "equal steps", "chosen steps"
TRIAL = 4096  # steps that tell how long many more take
LONGEST_RUN = 3.0  # s; a run that takes longer is given up
CHUNK = 5e-3  # s, of runs that are timed in one turn
FLOOR_ERROR = 5e-12  # an error that is rounding
ENOUGH_TIME = 0.5  # s of timed runs of a knob, after which three runs are enough
STALLED = 2  # knobs in a row without a smaller error, after which no finer one is tried


class Outcome(NamedTuple):
    """A run to t_end.  status: empty, or why it did not get there.  None: a count that is not told."""

    x: Array  # (m,)
    steps: int | None = None
    rejected: int | None = None
    evaluations: int | None = None
    status: str = ""


@dataclass
class Run(Timed):
    """A run made ready, and timed; `read` tells its outcome."""

    read: Callable[[Any], Outcome] = lambda outcome: outcome

    def __call__(self) -> Outcome:
        """Outcome of the run."""
        self.rewind()
        return self.read(self.run())


class Solver(ABC):
    """A way to integrate one task.

    kind: `EQUAL`, where the knob is the number of steps, or `CHOSEN`, where it is the relative tolerance.
    order: of its error, as declared; None where that is no fixed number.
    """

    order: int | None = None
    kind = CHOSEN
    tolerances: Sequence[float] = tuple([10.0**-k for k in range(3, 16)])

    def __init__(self, name: str, task: AccuracyTask, smallest: float) -> None:
        self.name, self.task, self.smallest = name, task, smallest
        self.start = np.array(task.start)

    @abstractmethod
    def ready(self, knob: float) -> Run:
        """Run with that knob, everything before it done. Raises for a knob that cannot be had."""

    def absolute(self, knob: float) -> float:
        """The absolute tolerance that goes with a relative one: as small a part of the smallest state."""
        return knob * self.smallest


def problem_of(task: AccuracyTask) -> Problem:
    """The task's equations, with parameters bound and no force applied."""
    inputs = state_inputs(task.model)
    return derive(task.model, dict(inputs.parameters) | dict.fromkeys(inputs.applied, 0.0))


def finished(run: Stepper, start: Array, span: Span) -> Outcome:
    """The run, to its end or until it has taken too long."""
    begin, last, status = time.perf_counter(), start, ""
    with np.errstate(all="ignore"):
        for block in run.blocks(start, span):
            if len(block.x):
                last = block.x[-1]
            if time.perf_counter() - begin > LONGEST_RUN:
                status = f"took longer than {LONGEST_RUN:g} s"
                break
    return Outcome(np.array(last), run.steps, run.rejected, run.evaluations, run.status or status)


def recorded(run: Stepper, start: Array, span: Span) -> Array:
    """The states of a run at the times of a span, (T, m)."""
    recorder, times = Recorder(start, span), span.times
    assert times is not None
    begin = time.perf_counter()
    with np.errstate(all="ignore"):
        for block in run.blocks(start, span):
            recorder.record(block)
            if time.perf_counter() - begin > 2 * LONGEST_RUN:
                break
    states = recorder.table()[1]
    result = np.full((len(times), len(start)), math.nan)
    result[: len(states)] = states
    return result


class Ours(Solver):
    """One of our methods in its native loop; the program is made once."""

    def __init__(self, name: str, task: AccuracyTask, smallest: float, problem: Problem) -> None:
        super().__init__(name, task, smallest)
        self.problem, self.method = problem, METHODS[name]
        self.order = self.method.order
        self.kind = CHOSEN if self.method.adaptive else EQUAL

    def _compiled(self, dense: bool) -> CompiledSteps:
        return compile_steps(step_program(self.problem, self.method, dense=dense), "auto", True)

    def _options(self, knob: float, times: Sequence[float], max_steps: float = math.inf) -> tuple[Steps, Span]:
        t_end = self.task.t_end
        if self.method.adaptive:
            return Steps(self.name, rtol=knob, atol=self.absolute(knob)), Span(t_end, t_eval=times)
        return Steps(self.name, dt=t_end / knob, max_steps=max_steps), Span(t_end, t_eval=times)

    def ready(self, knob: float) -> Run:
        """The run to t_end, without dense output."""
        if self.kind == EQUAL and self._at_least(knob) > LONGEST_RUN:  # one that does not look at the clock on its way
            return Run(lambda: Outcome(self.start, status=f"would take longer than {LONGEST_RUN:g} s"))
        compiled, (steps, span) = self._compiled(False), self._options(knob, [self.task.t_end])
        return Run(lambda: finished(stepper(compiled, steps), self.start, span))

    def _at_least(self, knob: float) -> float:
        """Seconds that so many equal steps take, by the first few of them."""
        steps, span = self._options(knob, [self.task.t_end], TRIAL)
        run, begin = stepper(self._compiled(False), steps), time.perf_counter()
        finished(run, self.start, span)
        return (time.perf_counter() - begin) * knob / min(knob, TRIAL)

    def rows(self, knob: float) -> Array:
        """The states at the task's times, (T, m); NaN from where it stopped."""
        steps, span = self._options(knob, self.task.times)
        dense = self.method.adaptive and span.has_inner_times
        return recorded(stepper(self._compiled(dense), steps), self.start, span)


class ErrorMetrics:
    """Errors of states against the exact motion, and the change of energy of conservative systems."""

    def __init__(self, task: AccuracyTask, exact: Reference) -> None:
        self.task, self.exact, self.scales = task, exact, task.scales(exact)
        self.smallest = float(self.scales.min())  # size of a state
        self.energies: Graph | None = None
        if task.conservative:
            system, of_energy = as_system(task.model), energy(task.model)
            self.energies = Graph(of_energy.inputs, of_energy.outputs | {"K": system.energies.kinetic})

    def errors(self, rows: Array) -> Array:
        """The largest error of a state at each time, (T,), of rows (T, m); infinite where there is no number."""
        with np.errstate(all="ignore"):
            largest = np.max(np.abs(self.exact.deviation(rows)) / self.scales, axis=1)
        return np.where(np.isfinite(largest), largest, math.inf)

    def at_end(self, x: Array) -> float:
        """The error of a state (m,) at t_end."""
        rows = self.exact.x.copy()
        rows[-1] = x
        return float(self.errors(rows)[-1])

    def drift(self, rows: Array) -> float | None:
        """The largest change of energy over the rows, over the largest kinetic energy."""
        if self.energies is None:
            return None
        inputs = dict(zip(self.energies.input_names, rows.T, strict=False)) | dict(self.task.parameters)
        values = {name: np.asarray(value) for name, value in self.energies.evaluate(inputs).items()}
        turned = float(np.max(values["K"])) or float(np.max(np.abs(values["E"]))) or 1.0
        return float(np.max(np.abs(values["E"] - values["E"][0]))) / turned


class Tried(NamedTuple):
    """One knob of a solver: its run, which is timed in turns, and what the first run took."""

    knob: float
    run: Run
    outcome: Outcome
    error: float
    once: Spent[Any] | None = None

    @property
    def seconds(self) -> float:
        """Shortest of the turns by the clock."""
        return min(self.run.seconds)


@dataclass
class Entry(Generic[AnySolver]):
    """A solver with its knobs."""

    solver: AnySolver
    tried: list[Tried] = field(default_factory=list)
    stopped: str = ""


def sweep(solver: AnySolver, error_of: ErrorOf, limit: float, knobs: Sequence[float] | None = None) -> Entry[AnySolver]:
    """Sweep from coarse to fine: each knob once, until it takes too long or is no longer better."""
    entry = Entry(solver)
    best, stalled = math.inf, 0
    usual = solver.tolerances if solver.kind == CHOSEN else [float(INTERVALS * 2**k) for k in range(24)]
    for knob in usual if knobs is None else knobs:
        tried, entry.stopped, took = attempt(solver, error_of, knob)
        if tried is None:
            if entry.tried or took > limit:  # a coarse knob may fail, and a finer one not
                break
            continue
        entry.tried.append(tried)
        stalled = 0 if tried.error < 0.5 * best else stalled + 1
        best = min(best, tried.error)
        if stalled >= STALLED and best < FLOOR_ERROR:
            entry.stopped = "rounding"
            break
        if took > limit:
            entry.stopped = f"run time above {limit:g} s"
            break
    else:
        entry.stopped = entry.stopped or "finest that was tried"
    return entry


def attempt(solver: Solver, error_of: ErrorOf, knob: float) -> tuple[Tried | None, str, float]:
    """The first run with that knob, or why there is none; and seconds of the processor that it took."""
    begin = time.process_time()
    try:
        run = solver.ready(knob)
        run.rewind()
        begin = time.process_time()
        once = spent(run.run)
        outcome = run.read(once.made)
    except Exception as error:  # noqa: BLE001 (whatever a run raises is a line in the report)
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        return None, kind + " ".join(str(error).split())[:200], time.process_time() - begin
    off = math.inf if outcome.status else error_of(outcome.x)
    if not math.isfinite(off):
        return None, outcome.status or "is not finite", once.processor
    return Tried(knob, run, outcome, off, once), "", once.processor


def time_in_turns(tried: Iterable[Tried], turns: int) -> None:
    """Time every run in turns; short runs several times a turn, long ones three times in all."""
    in_turns([each.run for each in tried], turns, CHUNK, ENOUGH_TIME)
