"""Work and precision: a report of run time beside error of every integrator on one task."""

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...integrators import METHODS, Problem
from ..accuracy_task import AccuracyTask
from ..text_table import check_names, csv_text
from ..timing import exponent, load as load_of_machine, machine, spent
from .measurement import EQUAL, FLOOR_ERROR, Entry, ErrorMetrics, Ours, Tried, problem_of, sweep, time_in_turns
from .named_tasks import load

LIMIT = 0.3  # s; no finer knob is tried after a run of this length

TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
WORST = 1e-1  # the largest error from which an order is fitted: above is none yet, below `FLOOR_ERROR` is rounding
FITTED = 3  # points of equal steps, the finest between those bounds: the coarser are no order yet


@dataclass(frozen=True)
class Point:
    """One knob of one solver.

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

    stopped: why there is no finer point.
    """

    name: str
    kind: str
    order: int | None
    fitted: float | None
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
    relative_to: str  # errors: "largest" values or "given" sizes
    times: tuple[float, ...]
    reference: str  # how the exact motion was computed
    reference_error: float
    reference_seconds: float
    machine: str
    load: tuple[float | None, float | None]
    curves: tuple[Curve, ...]
    absent: dict[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain data for JSON; None in place of what is no number."""
        plain: dict[str, Any] = _plain(asdict(self) | {"targets": targets(self.curves)})
        return plain


def targets(curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """The fastest run with at most an error at t_end, for each of `TARGETS` that is met."""
    fastest_runs = []
    for error in TARGETS:
        met = [(curve.name, point) for curve in curves for point in curve.points if point.error <= error]
        if met:
            name, point = min(met, key=lambda each: each[1].seconds)
            fastest_runs.append({"error": error, "name": name, "knob": point.knob, "seconds": point.seconds})
    return fastest_runs


COLUMNS = (
    *("solver", "kind", "declared_order", "fitted_order", "knob", "step", "seconds", "median_seconds", "steps"),
    *("rejected", "evaluations", "error_at_end", "largest_error", "energy_drift"),
)


def to_csv(report: WorkPrecision) -> str:
    """The points of a report as CSV, a line each; an empty cell is what is not known."""
    rows = [(each.name, each.kind, each.order, each.fitted, *astuple(p)) for each in report.curves for p in each.points]
    return csv_text(COLUMNS, rows)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def curve(entry: Entry[Ours], metrics: ErrorMetrics) -> Curve:
    """Curve of the report."""
    solver = entry.solver
    points = tuple([_point(solver, each, metrics) for each in entry.tried])
    fitted = None if solver.order is None else _fitted(solver.kind, points)
    return Curve(solver.name, solver.kind, solver.order, fitted, entry.stopped, points)


def _point(solver: Ours, tried: Tried, metrics: ErrorMetrics) -> Point:
    outcome = tried.outcome
    with np.errstate(all="ignore"):
        try:
            rows = solver.rows(tried.knob)
        except Exception:  # noqa: BLE001 (a run may fail at these instants where it did not at the end alone)
            rows = np.full(metrics.exact.x.shape, math.nan)
        largest = float(np.max(metrics.errors(rows)))
        drift = metrics.drift(rows) if math.isfinite(largest) else None
    return Point(
        tried.knob,
        metrics.task.t_end / outcome.steps if outcome.steps else None,
        tried.seconds,
        statistics.median(tried.run.seconds),
        outcome.steps,
        outcome.rejected,
        outcome.evaluations,
        tried.error,
        max(largest, tried.error),
        drift,
    )


def fitted_order(steps: Sequence[float], errors: Sequence[float], finest: int | None = None) -> float | None:
    """The exponent of the error in the step, over the points above rounding, or the finest of them; None below three.

    steps: [s], positive.
    """
    kept = sorted({(h, e) for h, e in zip(steps, errors, strict=True) if FLOOR_ERROR < e < WORST})[:finest]
    return exponent(*zip(*kept, strict=True)) if len(kept) >= 3 else None


def _fitted(kind: str, points: Sequence[Point]) -> float | None:
    """Fitted order by the largest error; of chosen steps, whose dense output has another order, by that at the end."""
    told = [each for each in points if each.step]
    steps = [each.step or 0.0 for each in told]
    if kind == EQUAL:
        return fitted_order(steps, [each.largest for each in told], FITTED)
    return fitted_order(steps, [each.error for each in told])


def measured(task: AccuracyTask, folder: str | Path | None, digits: int | None) -> tuple[ErrorMetrics, Problem]:
    """What measures errors of a task, and its equations.  folder: where exact motions are kept.  digits: of it.

    Raises ValueError where no exact motion is known.
    """
    exact = task.solution(task.times, folder, digits)
    if exact is None:
        raise ValueError(f"no solution of {task.name!r} is known to compare with")
    return ErrorMetrics(task, exact), problem_of(task)


def work_precision(
    name: str,
    *,
    methods: Sequence[str] = tuple(METHODS),
    digits: int | None = None,
    turns: int = 9,
    limit: float = LIMIT,
    folder: str | Path | None = None,
    options: dict[str, Any] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> WorkPrecision:
    """The report of a task.

    name, options: as of `named_tasks.load`.  methods: of `METHODS`.  digits: of the exact motion.  turns: of all.
    limit: seconds of a run after which no finer knob is tried.  folder: of exact motions.  say: takes progress lines.
    Raises ValueError for an unknown name, ImportError without what makes the exact motion, and what `reference` raises.
    """
    check_names(("method", methods, METHODS))
    if turns < 1 or not limit > 0.0:
        raise ValueError(f"turns must be at least 1 and limit positive, got {turns!r} and {limit!r} s")
    task, before = load(name, **(options or {})), load_of_machine()
    say(f"{name}: exact motion")
    readied = spent(lambda: measured(task, folder, digits))
    (metrics, problem), absent = readied.made, dict[str, str]()
    entries: list[Entry[Ours]] = []
    for solver in [Ours(method, task, metrics.smallest, problem) for method in METHODS if method in methods]:
        say(f"{name}: {solver.name}")
        entry = sweep(solver, metrics.at_end, limit)
        if entry.tried:
            entries.append(entry)
        else:
            absent[solver.name] = entry.stopped
    say(f"{name}: {turns} turns")
    time_in_turns([tried for entry in entries for tried in entry.tried], turns)
    curves = tuple([curve(entry, metrics) for entry in entries])
    fields = ("name", "about", "t_end", "conservative", "stiff", "left_out")
    return WorkPrecision(
        **{field: getattr(task, field) for field in fields},
        states=problem.size,
        nodes=len(problem.rate.nodes),
        relative_to="given" if task.size else "largest",
        times=tuple(task.times),
        reference=metrics.exact.how,
        reference_error=metrics.exact.error,
        reference_seconds=readied.seconds,
        machine=machine(),
        load=(before, load_of_machine()),
        curves=curves,
        absent=absent,
    )
