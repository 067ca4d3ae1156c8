"""Measurement of solvers: their errors against the exact motion, and run times taken in turns."""

from __future__ import annotations

import gc
import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cgraph import Graph
from cgraph.extend import Array

from ...equations.energies import energy
from ...integrators import Problem
from ...multiprecision import Reference
from ...systems.model import as_system
from ..paper_numbers.fit import exponent
from ..setting import INTERVALS, Setting
from .report import Curve, Point
from .trajectory_runs import CHOSEN, EQUAL, Outcome, Solver

CHUNK = 5e-3  # s, of runs that are timed in one turn
WORST, FLOOR = 1e-1, 5e-12  # errors between which an order is fitted: above is no order yet, below is rounding
FITTED = 3  # points of equal steps, the finest between those bounds: the coarser are no order yet
ENOUGH = 0.5  # s of timed runs of a knob, after which three runs are enough
STALLED = 2  # knobs in a row without a smaller error, after which no finer one is tried


class ErrorMetrics:
    """Errors of states against the exact motion, and the change of energy of conservative systems."""

    def __init__(self, setting: Setting, exact: Reference) -> None:
        self.setting, self.exact, self.scales = setting, exact, setting.scales(exact)
        self.smallest = float(self.scales.min())  # size of a state
        self.energies: Graph | None = None
        if setting.conservative:
            system, of_energy = as_system(setting.model), energy(setting.model)
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
        inputs = dict(zip(self.energies.input_names, rows.T, strict=False)) | dict(self.setting.parameters)
        values = {name: np.asarray(value) for name, value in self.energies.evaluate(inputs).items()}
        turned = float(np.max(values["K"])) or float(np.max(np.abs(values["E"]))) or 1.0
        return float(np.max(np.abs(values["E"] - values["E"][0]))) / turned


@dataclass
class Tried:
    """One knob of a solver, and what was timed of it."""

    knob: float
    run: Callable[[], Outcome]
    outcome: Outcome
    error: float
    seconds: list[float] = field(default_factory=list)


@dataclass
class Entry:
    """A solver with its knobs."""

    solver: Solver
    tried: list[Tried] = field(default_factory=list)
    stopped: str = ""

    def curve(self, metrics: ErrorMetrics, problem: Problem) -> Curve:
        """What the report keeps."""
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
        metrics.setting.t_end / outcome.steps if outcome.steps else None,
        min(tried.seconds),
        statistics.median(tried.seconds),
        outcome.steps,
        outcome.rejected,
        outcome.evaluations,
        tried.error,
        max(largest, tried.error),
        drift,
    )


def sweep(solver: Solver, metrics: ErrorMetrics, limit: float) -> Entry:
    """From coarse to fine: each knob once, until it takes too long or is no longer better."""
    entry = Entry(solver)
    best, stalled = math.inf, 0
    knobs = solver.tolerances if solver.kind == CHOSEN else [float(INTERVALS * 2**k) for k in range(24)]
    for knob in knobs:
        begin = time.perf_counter()
        try:
            run = solver.ready(knob)
            begin = time.perf_counter()
            outcome = run()
            status = outcome.status
        except Exception as error:  # noqa: BLE001 (whatever a peer's own code raises is a line in the report)
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            status = kind + " ".join(str(error).split())[:200]
        spent = time.perf_counter() - begin
        if not status and not math.isfinite(error_at_end := metrics.at_end(outcome.x)):
            status = "is not finite"
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


def in_turns(tried: Sequence[Tried], turns: int) -> None:
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
