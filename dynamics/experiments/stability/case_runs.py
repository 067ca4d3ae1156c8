"""Case runs: every case of the stability table by the methods that suit it, measured beside the case's bounds."""

import math
from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np

from cgraph._shared import Array

from ...equations.state_equation import state_inputs
from ...integrators import METHODS
from ...multiprecision import Reference
from ...simulation.simulate import simulate
from ...simulation.trajectory import Trajectory
from ...systems.arguments import TIME
from . import cases
from .case_result import CaseResult, Measurement, reason
from .cases import RTOL, Criterion, StabilityCase

SECTION = "Cases"
STIFF, SMOOTH = ("radau", "rodas"), ("dop853", "dopri5")
EQUAL_STEPS: dict[str, dict[str, float]] = {  # case: method: step [s]
    "angle of 1e+15 rad": {"verlet": 1e-3},
}
LARGE_CASE = 400  # states; beyond, one method is enough of a wait
MOST_STEPS = 3 * 10**6
BLOCK = 4096  # rows whose invariants are taken at once


def methods_of(case: StabilityCase) -> tuple[str, ...]:
    """The integrators to run a case with: two that choose their steps, and what `EQUAL_STEPS` has beside them."""
    if len(case.start) > LARGE_CASE:
        return SMOOTH[:1]
    return (STIFF if case.stiff else SMOOTH) + tuple(EQUAL_STEPS.get(case.name, ()))


def results(names: Iterable[str] | None = None, methods: tuple[str, ...] | None = None) -> Iterator[CaseResult]:
    """A result for each case (default: all) and method (default: those that suit the case)."""
    for name in cases.names() if names is None else names:
        case = cases.load(name)
        for method in methods or methods_of(case):
            yield result(case, method)


def result(case: StabilityCase, method: str) -> CaseResult:
    """One case by one method, with the relative tolerance that the bounds are for."""
    solution, run = case.solution(), trajectory(case, method)
    values = errors(case, run, solution) if solution is not None and run.stats.success else {}
    quantities = {criterion.quantity for criterion in case.criteria}
    values |= changes(case, run, {name for name in quantities if not name.startswith("error")})
    measurements = tuple([measurement(criterion, values) for criterion in case.criteria])
    stats = run.stats
    counts = stats.steps, stats.rejected, stats.seconds, "" if stats.success else stats.message
    known = reason(SECTION, case.name, method, measurements)
    return CaseResult(SECTION, case.name, case.about, method, measurements, *counts, known)


def trajectory(case: StabilityCase, method: str) -> Trajectory:
    """The run of a case."""
    start = case.model, case.q, case.qd or None
    run = partial(simulate, *start, case.t_end, method, max_steps=MOST_STEPS, progress=False)
    if METHODS[method].adaptive:
        return run(rtol=RTOL, atol=case.atol)
    return run(dt=EQUAL_STEPS.get(case.name, {}).get(method), estimate_error=False)  # the error is measured


def errors(case: StabilityCase, run: Trajectory, solution: Reference) -> dict[str, float]:
    """The error at t_end by the quantity's name: "error" of all states, "error 0 1" of some, each over its size."""
    end = np.concatenate([run.q[-1], run.qd[-1]])
    relative = np.abs(solution.deviation(end[None])[0]) / np.array(case.sizes(solution))
    values = {}
    for criterion in case.criteria:
        what, *states = criterion.quantity.split()
        if what == "error":
            chosen = relative[[int(state) for state in states]] if states else relative
            values[criterion.quantity] = float(np.max(chosen))  # NaN stays NaN
    return values


def changes(case: StabilityCase, run: Trajectory, wanted: set[str]) -> dict[str, float]:
    """The largest change of these invariants during the run, each in its own unit."""
    if wanted == {"energy"} and case.mechanical:  # simulate has taken it already
        return {"energy": float(np.max(np.abs(run.energy - run.energy[0])))}
    if not wanted or case.invariants is None:
        return {}
    graph, inputs = case.invariants(case.model), state_inputs(case.model)
    states = np.concatenate([run.q, run.qd], axis=1)
    largest = dict.fromkeys(wanted, 0.0)
    first: dict[str, float] = {}
    for start in range(0, len(run.t), BLOCK):
        part = slice(start, start + BLOCK)
        values: dict[str, float | Array] = dict(zip(inputs.states, states[part].T, strict=True)) | inputs.parameters
        values[TIME] = run.t[part]
        rows = graph.evaluate({name: values[name] for name in graph.input_names})
        for name in wanted:
            row = np.atleast_1d(rows[name])
            first.setdefault(name, float(row[0]))
            largest[name] = float(np.maximum(largest[name], np.max(np.abs(row - first[name]))))
    return largest


def measurement(criterion: Criterion, values: dict[str, float]) -> Measurement:
    """The measurement of a criterion, relative to its size; NaN where it could not be had."""
    value, of_size = values.get(criterion.quantity, math.nan), criterion.quantity.startswith("error")
    scale, unit = (1.0, "of size") if of_size else (criterion.scale, "of scale")
    return Measurement(criterion.quantity, value / scale, criterion.bound, unit, criterion.why)
