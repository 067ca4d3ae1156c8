"""Programs of steps of equal size: the registers that all of them have, and explicit Runge-Kutta methods.

Registers: x the state, t = start + count * h, p the parameters, evaluations of the rate, and `nonfinite`, which
is not 0 after a step whose state is not finite.
"""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Map, Program, Statement, Sum

from .elementwise import ahead
from .problem import Problem
from .step import Step
from .tableau import Tableau


def registers(problem: Problem) -> dict[str, int]:
    """What every program has."""
    single = dict.fromkeys(("t", "h", "start", "count", "evaluations", "nonfinite"), 1)
    return {"x": problem.size, "p": len(problem.parameters), **single}


def advance(evaluations: int) -> list[Statement]:
    """After a step: the next time, computed from the start so that it does not drift; whether the state is finite."""
    names = ("start", "count", "h", "evaluations")
    start, count, h, done = inputs = cg.variables(names)
    outputs = {"t": start + (count + 1.0) * h, "count": count + 1.0, "evaluations": done + float(evaluations)}
    x = cg.variable("x")
    return [Call(Graph(inputs, outputs), names, tuple(outputs)), Sum(Graph([x], {"none": x - x}), ("x",), "nonfinite")]


def stage(problem: Problem, tableau: Tableau, k: int) -> list[Statement]:
    """Slope k of an explicit method: register slope{k}, from registers x, t, h and the slopes before."""
    if k == 0:
        return [Call(problem.rate, ("x", "t", "p"), ("slope0",))]
    return [
        stage_state("at", tableau.a[k]),
        stage_time("at_t", tableau.c[k]),
        Call(problem.rate, ("at", "at_t", "p"), (f"slope{k}",)),
    ]


def stage_time(target: str, c: float) -> Call:
    """target = t + c h."""
    t, h = cg.variables("t h")
    return Call(Graph([t, h], {"y": t + c * h}), ("t", "h"), (target,))


def stage_state(target: str, weights: Sequence[float]) -> Map:
    """target = x + h * (sum of weight * slope)."""
    used = [k for k, weight in enumerate(weights) if weight]
    slopes = tuple([f"slope{k}" for k in used])
    return Map(ahead([weights[k] for k in used]), ("x", "h", *slopes), (target,))


def explicit_step(tableau: Tableau, problem: Problem) -> Step:
    """One explicit step, embedded or not."""
    body: list[Statement] = []
    for k in range(len(tableau.b)):
        body += stage(problem, tableau, k)
    slopes = {f"slope{k}": problem.size for k in range(len(tableau.b))}
    return Step({"at": problem.size, "at_t": 1, **slopes}, [], [*body, stage_state("x", tableau.b)])


def explicit(tableau: Tableau, problem: Problem) -> Program:
    """One explicit step a pass."""
    step = explicit_step(tableau, problem)
    body = [*step.body, *advance(len(tableau.b))]
    return Program({**registers(problem), **step.lengths}, body, record=["t", "x"], stop="nonfinite")
