"""Case runs: every case of the stability table by the methods that suit it, with figures beside the case's bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...equations.initial_value import split_state
from ...equations.state_equation import state_inputs
from ...reference import Reference
from ...simulation.simulate import simulate
from ...simulation.trajectory import Trajectory
from ...systems.model import Model, as_ode
from ...systems.system import TIME
from . import cases, solutions
from .cases import RTOL, Case, Watch
from .known_limits import reason
from .verdict import Figure, Verdict

Array = np.ndarray[Any, np.dtype[np.float64]]

SECTION = "Cases"
STIFF, SMOOTH = ("radau", "rodas"), ("dop853", "dopri5")
LONG = ("dop853",)  # of a large case
EQUAL_STEPS: dict[str, dict[str, float]] = {  # case: method: step [s]
    "angle of 1e+15 rad": {"verlet": 1e-3},
}
LARGE = 200  # coordinates; beyond, one method is enough of a wait
MOST_STEPS = 3 * 10**6
BLOCK = 4096  # rows whose invariants are taken at once


def methods_of(case: Case) -> tuple[str, ...]:
    """The integrators to run a case with: two that choose their steps, and what `EQUAL_STEPS` has beside them."""
    if len(case.start) > 2 * LARGE:
        return LONG
    return (STIFF if case.stiff else SMOOTH) + tuple(EQUAL_STEPS.get(case.name, ()))


def verdicts(names: Iterable[str] | None = None, methods: tuple[str, ...] | None = None) -> Iterator[Verdict]:
    """A verdict for each case (default: all) and method (default: those that suit the case)."""
    for name in cases.names() if names is None else names:
        case = cases.load(name)
        for method in methods or methods_of(case):
            yield verdict(case, method)


def verdict(case: Case, method: str) -> Verdict:
    """One case by one method, with the relative tolerance that the bounds are for."""
    model, solution = case.build(), solutions.solution(case)
    run = trajectory(case, model, method)
    found = {}
    if solution is not None and run.stats.success:
        found = errors(case, run, solution)
    watched = {watch.quantity for watch in case.watch}
    found |= changes(case, model, run, {name for name in watched if not name.startswith("error")})
    figures = tuple([figure(watch, found) for watch in case.watch])
    return Verdict(
        SECTION,
        case.name,
        case.about,
        method,
        figures,
        run.stats.steps,
        run.stats.rejected,
        run.stats.seconds,
        "" if run.stats.success else run.stats.message,
        reason(SECTION, case.name, method, figures),
    )


def trajectory(case: Case, model: Model, method: str) -> Trajectory:
    """The run of a case."""
    q, qd = split_state(model, case.start)
    return simulate(
        model,
        q,
        qd,
        case.t_end,
        method,
        dt=EQUAL_STEPS.get(case.name, {}).get(method),
        rtol=RTOL,
        atol=case.atol,
        max_steps=MOST_STEPS,
        progress=False,
    )


def sizes(case: Case, solution: Reference | None) -> list[float]:
    """A size for each state: the case's own, or the larger of the values at the start and at t_end, or 1 for zeros."""
    if case.size:
        return list(case.size)
    end = [0.0] * len(case.start) if solution is None else solution.x[-1].tolist()
    return [max(abs(a), abs(b)) or 1.0 for a, b in zip(case.start, end, strict=True)]


def errors(case: Case, run: Trajectory, solution: Reference) -> dict[str, float]:
    """The error at t_end by the quantity's name: "error" of all states, "error 0 1" of some, each over its size."""
    end = np.concatenate([run.q[-1], run.qd[-1]])
    relative = np.abs(solution.deviation(end[None])[0]) / np.array(sizes(case, solution))
    found = {}
    for watch in case.watch:
        what, *states = watch.quantity.split()
        if what == "error":
            chosen = relative[[int(each) for each in states]] if states else relative
            found[watch.quantity] = float(np.max(chosen))  # NaN stays NaN
    return found


def changes(case: Case, model: Model, run: Trajectory, wanted: set[str]) -> dict[str, float]:
    """The largest change of these invariants during the run, each in its own unit."""
    if wanted == {"energy"} and as_ode(model) is None:  # simulate has taken it already
        return {"energy": float(np.max(np.abs(run.energy - run.energy[0])))}
    if not wanted or case.invariants is None:
        return {}
    graph, inputs = case.invariants(model), state_inputs(model)
    states = np.concatenate([run.q, run.qd], axis=1)
    found = dict.fromkeys(wanted, 0.0)
    first: dict[str, float] = {}
    for start in range(0, len(run.t), BLOCK):
        part = slice(start, start + BLOCK)
        given: dict[str, Any] = dict(zip(inputs.states, states[part].T, strict=True)) | inputs.parameters
        given[TIME] = run.t[part]
        values = graph.evaluate({name: given[name] for name in graph.input_names})
        for name in wanted:
            row = np.atleast_1d(values[name])
            first.setdefault(name, float(row[0]))
            found[name] = float(np.maximum(found[name], np.max(np.abs(row - first[name]))))
    return found


def figure(watch: Watch, found: dict[str, float]) -> Figure:
    """The figure of a watched quantity, relative to its size; NaN where it could not be had."""
    unit = "of size" if watch.quantity.startswith("error") else "of scale"
    value = found.get(watch.quantity, math.nan)
    return Figure(watch.quantity, value if unit == "of size" else value / watch.scale, watch.bound, unit, watch.why)
