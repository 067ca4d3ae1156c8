"""Measurement of solvers: their errors against the exact motion, and run times in turns; and the report of them."""

from __future__ import annotations

import gc
import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from cgraph import Graph
from cgraph.extend import Array

from ...equations.energies import energy
from ...integrators import Problem
from ...multiprecision import Reference
from ...simulation.run_options import SCIPY
from ...systems.model import as_system
from ..accuracy_task import INTERVALS, AccuracyTask
from ..clock import Spent, spent
from ..paper_numbers import exponent
from ..text_table import csv_text
from .cold_start import ColdStart
from .trajectory_runs import CHOSEN, EQUAL, EndSolver, Outcome, Run, Solver

OURS = "ours"
# How the names of peers' solvers begin.
PEERS = {"MuJoCo": "MuJoCo", "SciPy": SCIPY, "heyoka": "heyoka", "CasADi": "CVODES", "diffrax": "diffrax"}
AnySolver = TypeVar("AnySolver", bound=EndSolver)
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(frozen=True)
class Point:
    """One knob of one solver.  None: not told by the solver.

    knob: the number of equal steps, or the relative tolerance.  step: t_end over the accepted steps [s].
    seconds, median: the shortest and the median of the timed runs.
    error: of the state at t_end; largest: over all times; see `AccuracyTask.scales`.
    drift: largest change of energy, over the largest kinetic energy of the motion; of a conservative system.
    """

    knob: float
    step: float | None
    seconds: float
    median: float
    steps: int | None
    rejected: int | None
    evaluations: int | None
    error: float
    largest: float
    drift: float | None


@dataclass(frozen=True)
class Curve:
    """One solver.  kind: "equal steps" or "chosen steps".  order: declared.  fitted: see `fitted_order`.

    model_error: largest difference of its rates from ours along the motion, relative to the largest rate of the same
    state; None where the rates are ours.
    stopped: why there is no finer point.
    """

    name: str
    about: str
    ours: bool
    kind: str
    order: int | None
    fitted: float | None
    model_error: float | None
    stopped: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class WorkPrecision:
    """The report of one task.  absent: {solver: why it is not there}.  load: of the machine, at start and end."""

    name: str
    about: str
    states: int
    t_end: float
    nodes: int  # of the rate's graph
    conservative: bool
    stiff: bool
    relative_to: str  # errors: "largest", "given" sizes, or the "own" value of the state at that time
    times: tuple[float, ...]
    reference: str  # how the exact motion was computed
    reference_error: float
    reference_seconds: float
    machine: str
    load: tuple[float | None, float | None]
    curves: tuple[Curve, ...]
    cold: tuple[ColdStart, ...]
    absent: dict[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain data for JSON; None in place of what is no number."""
        plain: dict[str, Any] = _plain(asdict(self) | {"targets": [asdict(each) for each in targets(self.curves)]})
        return plain


@dataclass(frozen=True)
class Target:
    """The fastest of ours, and of a peer, with at most this error at t_end.  ratio: to the fastest of ours."""

    error: float
    group: str
    name: str
    knob: float
    seconds: float
    ratio: float | None


def targets(curves: Sequence[Curve], errors: Sequence[float] = TARGETS) -> list[Target]:
    """Targets for each error, ours first."""
    fastest_runs = []
    for error in errors:
        ours = None
        for group in (OURS, *PEERS):
            fastest = _fastest([each for each in curves if group_of(each) == group], error)
            if fastest is None:
                continue
            curve, point = fastest
            if group == OURS:
                ours = point.seconds
            ratio = None if ours is None else point.seconds / ours
            fastest_runs.append(Target(error, group, curve.name, point.knob, point.seconds, ratio))
    return fastest_runs


def group_of(curve: Curve) -> str:
    """Ours, or the peer that a solver belongs to."""
    return OURS if curve.ours else group(curve.name)


def group(name: str) -> str:
    """The peer that a solver of this name belongs to; ours for none."""
    return next((peer for peer, begin in PEERS.items() if name.startswith(begin)), OURS)


def _fastest(curves: Sequence[Curve], error: float) -> tuple[Curve, Point] | None:
    met = [(curve, point) for curve in curves for point in curve.points if point.error <= error]
    return min(met, key=lambda each: each[1].seconds, default=None)


COLUMNS = (
    *("solver", "kind", "declared_order", "fitted_order", "knob", "step", "seconds", "median_seconds", "steps"),
    *("rejected", "evaluations", "error_at_end", "largest_error", "energy_drift", "model_error"),
)


def to_csv(report: WorkPrecision) -> str:
    """The points of a report as CSV, a line each; an empty cell is what is not known."""
    rows = []
    for curve in report.curves:
        for p in curve.points:
            first = (curve.name, curve.kind, curve.order, curve.fitted, p.knob, p.step, p.seconds, p.median)
            rest = (p.steps, p.rejected, p.evaluations, p.error, p.largest, p.drift, curve.model_error)
            rows.append([*first, *rest])
    return csv_text(COLUMNS, rows)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


CLOCKS = 200  # readings of the clocks, of which the quickest tells what they take
CHUNK = 5e-3  # s, of runs that are timed in one turn
WORST, FLOOR = 1e-1, 5e-12  # errors between which an order is fitted: above is no order yet, below is rounding
FITTED = 3  # points of equal steps, the finest between those bounds: the coarser are no order yet
ENOUGH = 0.5  # s of timed runs of a knob, after which three runs are enough
STALLED = 2  # knobs in a row without a smaller error, after which no finer one is tried


class EndMetrics(Protocol):
    """Measures of the error of an end."""

    def at_end(self, x: Array) -> float:
        """The error of a state at t_end."""


class ErrorMetrics:
    """Errors of states against the exact motion, and the change of energy of conservative systems."""

    def __init__(self, task: AccuracyTask, exact: Reference) -> None:
        self.task, self.exact, self.scales = task, exact, task.scales(exact)
        self.smallest = float(self.scales.min())  # size of a state
        self.energies: Graph | None = None
        if task.conservative:
            system, of_energy = as_system(task.model), energy(task.model)
            self.energies = Graph(of_energy.inputs, of_energy.outputs | {"K": system.kinetic})

    def errors(self, rows: Array) -> Array:
        """The largest error of a state at each time, (T,), of rows (T, m); infinite where there is no number."""
        with np.errstate(all="ignore"):
            largest = np.max(np.abs(self.exact.deviation(rows)) / self.scales, axis=1)
        result: Array = np.where(np.isfinite(largest), largest, math.inf)
        return result

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


@dataclass
class Tried:
    """One knob of a solver, and what was timed of it: by the clock, of the processor, and `once`, of its first run."""

    knob: float
    run: Run
    outcome: Outcome
    error: float
    once: Spent[Any] | None = None
    seconds: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)


@dataclass
class Entry(Generic[AnySolver]):
    """A solver with its knobs."""

    solver: AnySolver
    tried: list[Tried] = field(default_factory=list)
    stopped: str = ""

    def curve(self: Entry[Solver], metrics: ErrorMetrics, problem: Problem) -> Curve:
        """Curve of the report."""
        solver = self.solver
        points = tuple([_point(solver, each, metrics) for each in self.tried])
        theirs = solver.rates(metrics.exact.x)
        difference = None
        if theirs is not None:
            names, x = problem.rate.input_names, metrics.exact.x
            inputs: dict[str, float | Array] = dict.fromkeys(names, 0.0) | dict(zip(names, x.T, strict=False))
            ours = np.array(np.broadcast_arrays(*problem.rate.evaluate(inputs).values(), x[:, 0])[:-1]).T
            largest = np.max(np.abs(ours), axis=0)
            difference = float(np.max(np.abs(theirs - ours) / np.where(largest > 0.0, largest, 1.0)))
        fitted = None if solver.order is None else _fitted(solver.kind, points)
        about = solver.name, solver.about, solver.ours, solver.kind, solver.order
        return Curve(*about, fitted, difference, self.stopped, points)


def _point(solver: Solver, tried: Tried, metrics: ErrorMetrics) -> Point:
    outcome = tried.outcome
    with np.errstate(all="ignore"):
        try:
            rows = solver.rows(tried.knob)
        except Exception:  # noqa: BLE001 (a peer may fail at these instants where it did not at the end alone)
            rows = np.full(metrics.exact.x.shape, math.nan)
        largest = float(np.max(metrics.errors(rows)))
        drift = metrics.drift(rows) if math.isfinite(largest) else None
    return Point(
        tried.knob,
        metrics.task.t_end / outcome.steps if outcome.steps else None,
        min(tried.seconds),
        statistics.median(tried.seconds),
        outcome.steps,
        outcome.rejected,
        outcome.evaluations,
        tried.error,
        max(largest, tried.error),
        drift,
    )


def sweep(
    solver: AnySolver, metrics: EndMetrics, limit: float, knobs: Sequence[float] | None = None
) -> Entry[AnySolver]:
    """Sweep from coarse to fine: each knob once, until it takes too long or is no longer better."""
    entry = Entry(solver)
    best, stalled = math.inf, 0
    usual = solver.tolerances if solver.kind == CHOSEN else [float(INTERVALS * 2**k) for k in range(24)]
    for knob in usual if knobs is None else knobs:
        begin, once = time.process_time(), None
        try:
            run = solver.ready(knob)
            run.rewind()
            begin = time.process_time()
            once = spent(run.run)
            outcome = run.read(once.made)
            status = outcome.status
        except Exception as error:  # noqa: BLE001 (whatever a peer's own code raises is a line in the report)
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            status = kind + " ".join(str(error).split())[:200]
        took = time.process_time() - begin if once is None else once.processor
        if not status and not math.isfinite(error_at_end := metrics.at_end(outcome.x)):
            status = "is not finite"
        entry.stopped = status
        if status:
            if entry.tried or took > limit:  # a coarse knob may fail, and a finer one not
                break
            continue
        entry.tried.append(Tried(knob, run, outcome, error_at_end, once))
        stalled = 0 if error_at_end < 0.5 * best else stalled + 1
        best = min(best, error_at_end)
        if stalled >= STALLED and best < FLOOR:
            entry.stopped = "rounding"
            break
        if took > limit:
            entry.stopped = f"run time above {limit:g} s"
            break
    else:
        entry.stopped = entry.stopped or "finest that was tried"
    return entry


def in_turns(tried: Sequence[Tried], turns: int) -> None:
    """Time every run in turns, so that all share the machine's moods; short runs several times a turn."""
    gc.disable()
    read = min(
        [spent(_nothing).processor for _ in range(CLOCKS)]
    )  # what the reading of the clocks takes of the processor
    try:
        for _ in range(turns):
            for each in tried:
                if len(each.seconds) >= 3 and sum(each.seconds) > ENOUGH:
                    continue
                left = CHUNK
                while left > 0.0:
                    each.run.rewind()
                    taken = spent(each.run.run)
                    each.seconds.append(taken.seconds)
                    each.processor.append(max(taken.processor - read, 0.0))
                    left -= taken.seconds
    finally:
        gc.enable()


def _nothing() -> None:
    """A run of no length."""


def fitted_order(steps: Sequence[float], errors: Sequence[float], finest: int | None = None) -> float | None:
    """The exponent of the error in the step, over the points above rounding, or the finest of them; None below three.

    steps: [s], positive.
    """
    kept = sorted({(h, e) for h, e in zip(steps, errors, strict=True) if FLOOR < e < WORST})[:finest]
    return exponent(*zip(*kept, strict=True)) if len(kept) >= 3 else None


def _fitted(kind: str, points: Sequence[Point]) -> float | None:
    """Fitted order by the largest error; of chosen steps, whose dense output has another order, by that at the end."""
    told = [each for each in points if each.step]
    steps = [each.step or 0.0 for each in told]
    if kind == EQUAL:
        return fitted_order(steps, [each.largest for each in told], FITTED)
    return fitted_order(steps, [each.error for each in told])
