"""Work and precision: run time beside error of every integrator on one setting, ours and others', in one run."""

from __future__ import annotations

import csv
import gc
import io
import math
import os
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cgraph import Graph
from cgraph.extend import Array

from ...equations.equations_of_motion import energy
from ...integrators import METHODS, Problem
from ...peers import UnavailableError
from ...reference import Reference
from ...simulation.run_options import SCIPY
from ...systems.model import as_system
from ...systems.system import System
from ..paper_numbers.fit import exponent
from ..speed.bench_table import machine
from .cold_start import STARTS, ColdStart, cold_starts
from .trajectory_peers import offers
from .trajectory_runs import CHOSEN, EQUAL, Contender, Ours, Outcome, problem_of
from .trajectory_scenes import INTERVALS, Setting, load

DIGITS = 30
LIMIT = 0.3  # s; no finer knob is tried after a run of this length
PATIENCE = 3.0  # times as long for the others, most of which need more time for the same error
CHUNK = 5e-3  # s, of runs that are timed in one turn
WORST, FLOOR = 1e-1, 5e-12  # errors between which an order is fitted: above is no order yet, below is rounding
FITTED = 3  # points of equal steps, the finest between those bounds: the coarser are no order yet
ENOUGH = 0.5  # s of timed runs of a knob, after which three runs are enough
STALLED = 2  # knobs in a row without a smaller error, after which no finer one is tried
PEERS = ("MuJoCo", "SciPy", "heyoka", "CasADi")  # what can be named in place of its contenders
OURS = "ours"
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
_BEGINS = {"MuJoCo": "MuJoCo", "SciPy": SCIPY, "heyoka": "heyoka", "CasADi": "CVODES"}


@dataclass(frozen=True)
class Point:
    """One knob of one contender.  None: not told by the contender.

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
    """One contender.  kind: "equal steps" or "chosen steps".  order: declared.  fitted: see `fitted_order`.

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
    """The report of one setting.  absent: {contender: why it is not there}.  load: of the machine, at start and end."""

    name: str
    about: str
    states: int
    t_end: float
    nodes: int  # of the rate's graph
    conservative: bool
    stiff: bool
    relative_to: str  # errors: "largest", "given" sizes, or the "own" value of the state at that time
    times: tuple[float, ...]
    reference: str  # how the exact motion was come by
    reference_error: float
    reference_seconds: float
    machine: str
    load: tuple[float, float]
    curves: tuple[Curve, ...]
    cold: tuple[ColdStart, ...]
    absent: dict[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain data for JSON; None in place of what is no number."""
        plain: dict[str, Any] = _plain(asdict(self) | {"targets": [asdict(each) for each in targets(self.curves)]})
        return plain


def work_precision(
    name: str,
    *,
    methods: Sequence[str] = tuple(METHODS),
    peers: Sequence[str] = PEERS,
    digits: int = DIGITS,
    turns: int = 9,
    limit: float = LIMIT,
    cold: Sequence[str] = tuple(STARTS),
    cold_turns: int = 5,
    budget: float = 60.0,
    folder: str | Path | None = None,
    backend: str = "auto",
    options: dict[str, Any] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> WorkPrecision:
    """The report of a setting.

    name, options: as of `trajectory_scenes.load`.  methods: ours.  peers: of `PEERS`; what is not installed is absent.
    digits: of the exact motion.  turns: all contenders run in turns, this often.  limit: seconds of a run after which
    no finer knob is tried, thrice as long for the others.  cold: of `cold_start.STARTS`, with `cold_turns` turns and
    `budget` seconds each.  folder: where exact motions are kept.  backend: see `simulate`.  say: takes progress lines.

    Raises ValueError for a name that is not known, ImportError without what makes the exact motion, and what
    `reference` raises.
    """
    for what, given, known in (("method", methods, METHODS), ("peer", peers, PEERS), ("cold start", cold, STARTS)):
        if unknown := [each for each in given if each not in known]:
            raise ValueError(f"there is no {what} {unknown[0]!r}; there are {', '.join(known)}")
    if turns < 1 or not limit > 0.0:
        raise ValueError(f"turns must be at least 1 and limit positive, got {turns!r} and {limit!r} s")
    setting = load(name, **(options or {}))
    begins, before = time.perf_counter(), _load()
    say(f"{name}: exact motion")
    exact = setting.exact(digits, folder)
    spent = time.perf_counter() - begins
    problem, scales = problem_of(setting), setting.scales(exact)
    smallest = float(scales.min())
    absent: dict[str, str] = {}
    entries = []
    judge = Judge(setting, exact, scales)
    for contender in _contenders(setting, smallest, problem, methods, peers, backend, absent):
        say(f"{name}: {contender.name}")
        entry = _sweep(contender, judge, limit if contender.ours else PATIENCE * limit)
        if entry.tried:
            entries.append(entry)
        else:
            absent[contender.name] = entry.stopped
    say(f"{name}: {turns} turns")
    _in_turns([tried for entry in entries for tried in entry.tried], turns)
    curves = tuple([entry.curve(judge, problem) for entry in entries])
    started = cold_starts(name, options or {}, cold, turns=cold_turns, budget=budget, say=say) if cold else []
    return WorkPrecision(
        setting.name,
        setting.about,
        problem.size,
        setting.t_end,
        len(problem.rate.nodes),
        setting.conservative,
        setting.stiff,
        "own" if setting.decades else "given" if setting.sizes else "largest",
        tuple(setting.times),
        exact.how,
        exact.error,
        spent,
        machine(),
        (before, _load()),
        curves,
        tuple(started),
        absent,
        setting.left_out,
    )


def _contenders(
    setting: Setting,
    smallest: float,
    problem: Problem,
    methods: Sequence[str],
    peers: Sequence[str],
    backend: str,
    absent: dict[str, str],
) -> Iterable[Contender]:
    """Those that can be made; why others cannot goes to `absent`."""
    makers: dict[str, Callable[[], Contender]] = {
        method: lambda method=method: Ours(method, setting, smallest, problem, backend)  # type: ignore[misc]
        for method in METHODS
        if method in methods
    }
    begins = tuple([_BEGINS[peer] for peer in peers])
    makers |= {
        name: make for name, make in offers(setting, smallest, problem, backend).items() if name.startswith(begins)
    }
    for name, make in makers.items():
        try:
            contender = make()
            if contender.kind == EQUAL and setting.decades:
                absent[name] = "equal steps cannot span this many powers of ten"
                continue
            yield contender
        except ImportError as error:
            absent[name] = f"not installed ({error})"
        except (UnavailableError, ValueError, TypeError) as error:
            absent[name] = " ".join(str(error).split())[:200]


class Judge:
    """Errors of states against the exact motion, and the energy of conservative systems."""

    def __init__(self, setting: Setting, exact: Reference, scales: Array) -> None:
        self.setting, self.exact, self.scales = setting, exact, scales
        self.energies = _energies(as_system(setting.model)) if setting.conservative else None

    def errors(self, rows: Array) -> Array:
        """The largest error of a state at each time, (T,), of rows (T, m); infinite where there is no number."""
        with np.errstate(all="ignore"):
            found = np.max(np.abs(self.exact.deviation(rows)) / self.scales, axis=1)
        result: Array = np.where(np.isfinite(found), found, math.inf)
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
        parameters = as_system(self.setting.model).parameters
        given = dict(zip(self.energies.input_names, rows.T, strict=False)) | dict(parameters)
        values = {name: np.asarray(value) for name, value in self.energies.evaluate(given).items()}
        turned = float(np.max(values["K"])) or float(np.max(np.abs(values["E"]))) or 1.0
        return float(np.max(np.abs(values["E"] - values["E"][0]))) / turned


def _energies(system: System) -> Graph:
    """(q, qd) -> E, the energy, and K, the kinetic part."""
    found = energy(system)
    return Graph(found.inputs, found.outputs | {"K": system.kinetic})


@dataclass
class Tried:
    """One knob of a contender, and what was timed of it."""

    knob: float
    run: Callable[[], Outcome]
    outcome: Outcome
    error: float
    seconds: list[float] = field(default_factory=list)


@dataclass
class Entry:
    """A contender with its knobs."""

    contender: Contender
    tried: list[Tried] = field(default_factory=list)
    stopped: str = ""

    def curve(self, judge: Judge, problem: Problem) -> Curve:
        """What the report keeps."""
        contender = self.contender
        points = tuple([_point(contender, each, judge) for each in self.tried])
        theirs = contender.rates(judge.exact.x)
        difference = None
        if theirs is not None:
            names = problem.rate.input_names
            given: dict[str, Any] = dict.fromkeys(names, 0.0) | dict(zip(names, judge.exact.x.T, strict=False))
            ours = np.array(np.broadcast_arrays(*problem.rate.evaluate(given).values(), judge.exact.x[:, 0])[:-1]).T
            largest = np.max(np.abs(ours), axis=0)
            difference = float(np.max(np.abs(theirs - ours) / np.where(largest > 0.0, largest, 1.0)))
        return Curve(
            contender.name,
            contender.about,
            contender.ours,
            contender.kind,
            contender.order,
            None if contender.order is None else _fitted(contender.kind, points),
            difference,
            self.stopped,
            points,
        )


def _point(contender: Contender, tried: Tried, judge: Judge) -> Point:
    outcome = tried.outcome
    with np.errstate(all="ignore"):
        try:
            rows = contender.rows(tried.knob)
        except Exception:  # noqa: BLE001 (a peer may fail at these instants where it did not at the end alone)
            rows = np.full(judge.exact.x.shape, math.nan)
        largest = float(np.max(judge.errors(rows)))
        drift = judge.drift(rows) if math.isfinite(largest) else None
    return Point(
        tried.knob,
        judge.setting.t_end / outcome.steps if outcome.steps else None,
        min(tried.seconds),
        statistics.median(tried.seconds),
        outcome.steps,
        outcome.rejected,
        outcome.evaluations,
        tried.error,
        max(largest, tried.error),
        drift,
    )


def _sweep(contender: Contender, judge: Judge, limit: float) -> Entry:
    """From coarse to fine: each knob once, until it takes too long or is no longer better."""
    entry = Entry(contender)
    best, stalled = math.inf, 0
    knobs = contender.tolerances if contender.kind == CHOSEN else [float(INTERVALS * 2**k) for k in range(24)]
    for knob in knobs:
        begin = time.perf_counter()
        try:
            run = contender.ready(knob)
            begin = time.perf_counter()
            outcome = run()
            status = outcome.status
        except Exception as error:  # noqa: BLE001 (whatever a peer's own code raises is a line in the report)
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            status = kind + " ".join(str(error).split())[:200]
        spent = time.perf_counter() - begin
        if not status and not math.isfinite(error_at_end := judge.at_end(outcome.x)):
            status = "left the numbers"
        entry.stopped = status
        if status:
            if entry.tried or spent > limit:  # a coarse knob may fail, and a finer one not
                break
            continue
        entry.tried.append(Tried(knob, run, outcome, error_at_end))
        stalled = 0 if error_at_end < 0.5 * best else stalled + 1
        best = min(best, error_at_end)
        if stalled >= STALLED and best < FLOOR:
            entry.stopped = "rounding"
            break
        if spent > limit:
            entry.stopped = f"run time above {limit:g} s"
            break
    else:
        entry.stopped = entry.stopped or "finest that was tried"
    return entry


def _in_turns(tried: Sequence[Tried], turns: int) -> None:
    """Time every run in turns, so that all share the machine's moods; short runs several times a turn."""
    gc.disable()
    try:
        for _ in range(turns):
            for each in tried:
                if len(each.seconds) >= 3 and sum(each.seconds) > ENOUGH:
                    continue
                left = CHUNK
                while left > 0.0:
                    begin = time.perf_counter()
                    each.run()
                    spent = time.perf_counter() - begin
                    each.seconds.append(spent)
                    left -= spent
    finally:
        gc.enable()


def fitted_order(steps: Sequence[float], errors: Sequence[float], finest: int | None = None) -> float | None:
    """The exponent of the error in the step, over the points above rounding, or the finest of them; None below three.

    steps: [s], positive.
    """
    kept = sorted({(h, e) for h, e in zip(steps, errors, strict=True) if FLOOR < e < WORST})[:finest]
    return exponent(*zip(*kept, strict=True)) if len(kept) >= 3 else None


def _fitted(kind: str, points: Sequence[Point]) -> float | None:
    """Of equal steps by the largest error; of chosen ones, whose dense output has another order, by that at the end."""
    told = [each for each in points if each.step]
    steps = [each.step or 0.0 for each in told]
    if kind == EQUAL:
        return fitted_order(steps, [each.largest for each in told], FITTED)
    return fitted_order(steps, [each.error for each in told])


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
    found = []
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
            found.append(Target(error, group, curve.name, point.knob, point.seconds, ratio))
    return found


def group_of(curve: Curve) -> str:
    """Ours, or the peer that a contender belongs to."""
    return OURS if curve.ours else next(peer for peer, begin in _BEGINS.items() if curve.name.startswith(begin))


def _fastest(curves: Sequence[Curve], error: float) -> tuple[Curve, Point] | None:
    met = [(curve, point) for curve in curves for point in curve.points if point.error <= error]
    return min(met, key=lambda each: each[1].seconds, default=None)


COLUMNS = (
    *("contender", "kind", "declared_order", "fitted_order", "knob", "step", "seconds", "median_seconds", "steps"),
    *("rejected", "evaluations", "error_at_end", "largest_error", "energy_drift", "model_error"),
)


def to_csv(report: WorkPrecision) -> str:
    """The points of a report as CSV, a line each; an empty cell is what is not known."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for curve in report.curves:
        for p in curve.points:
            first = (curve.name, curve.kind, curve.order, curve.fitted, p.knob, p.step, p.seconds, p.median)
            rest = (p.steps, p.rejected, p.evaluations, p.error, p.largest, p.drift, curve.model_error)
            rows.writerow(["" if each is None else each for each in (*first, *rest)])
    return text.getvalue()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _load() -> float:
    """Processes that want to run, mean over the last minute; NaN where that is not told."""
    with suppress(OSError, AttributeError):
        return os.getloadavg()[0]
    return math.nan
