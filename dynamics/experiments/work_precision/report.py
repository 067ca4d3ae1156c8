"""The report of work and precision: points, curves and fastest runs as plain data, as JSON and as CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from ...simulation.run_options import SCIPY
from ..text_table import csv_text
from .cold_start import ColdStart

OURS = "ours"
PEERS = {"MuJoCo": "MuJoCo", "SciPy": SCIPY, "heyoka": "heyoka", "CasADi": "CVODES"}  # how their solvers' names begin
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(frozen=True)
class Point:
    """One knob of one solver.  None: not told by the solver.

    knob: the number of equal steps, or the relative tolerance.  step: t_end over the accepted steps [s].
    seconds, median: the shortest and the median of the timed runs.
    error: of the state at t_end; largest: over all times; see `Setting.scales`.
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
    """The report of one setting.  absent: {solver: why it is not there}.  load: of the machine, at start and end."""

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
    """For each error, ours first."""
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
    return OURS if curve.ours else next(peer for peer, begin in PEERS.items() if curve.name.startswith(begin))


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
