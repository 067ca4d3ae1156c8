"""Measurement of solvers: their errors against the exact motion, from coarse to fine, and run times in turns."""

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from cgraph import Graph
from cgraph._shared import Array

from ...equations.energies import energy
from ...multiprecision import Reference
from ...systems.model import as_system
from ..accuracy_task import INTERVALS, AccuracyTask
from ..timing import Spent, in_turns, spent
from .trajectory_runs import CHOSEN, Outcome, Run, Solver

AnySolver = TypeVar("AnySolver", bound=Solver)

CHUNK = 5e-3  # s, of runs that are timed in one turn
FLOOR_ERROR = 5e-12  # an error that is rounding
ENOUGH_TIME = 0.5  # s of timed runs of a knob, after which three runs are enough
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


def sweep(
    solver: AnySolver, metrics: EndMetrics, limit: float, knobs: Sequence[float] | None = None
) -> Entry[AnySolver]:
    """Sweep from coarse to fine: each knob once, until it takes too long or is no longer better."""
    entry = Entry(solver)
    best, stalled = math.inf, 0
    usual = solver.tolerances if solver.kind == CHOSEN else [float(INTERVALS * 2**k) for k in range(24)]
    for knob in usual if knobs is None else knobs:
        tried, entry.stopped, took = attempt(solver, metrics, knob)
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


def attempt(solver: Solver, metrics: EndMetrics, knob: float) -> tuple[Tried | None, str, float]:
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
    off = math.inf if outcome.status else metrics.at_end(outcome.x)
    if not math.isfinite(off):
        return None, outcome.status or "is not finite", once.processor
    return Tried(knob, run, outcome, off, once), "", once.processor


def time_in_turns(tried: Iterable[Tried], turns: int) -> None:
    """Time every run in turns; short runs several times a turn, long ones three times in all."""
    in_turns([each.run for each in tried], turns, CHUNK, ENOUGH_TIME)
