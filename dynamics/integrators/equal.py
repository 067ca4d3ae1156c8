"""Equal steps: a method's step of a length that is given, over and over.

Registers: x the state, t = start + count * h, p the parameters, evaluations of the rate, and `nonfinite`, which
is not 0 after a step whose state is not finite.
"""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, Program, Statement, Sum

from .problem import Problem
from .step import Step, arriving, rate_calls, with_registers
from .step_control import first_pass


def registers(problem: Problem) -> dict[str, int]:
    """What every program has."""
    single = dict.fromkeys(("t", "h", "start", "count", "evaluations", "nonfinite"), 1)
    return {"x": problem.size, "x_new": problem.size, "p": len(problem.parameters), **single}


def equal(step: Step, problem: Problem) -> Program:
    """One step a pass."""
    lengths = with_registers(step, registers(problem))
    body = arriving([*step.rates, *step.prepare, *step.body, *step.kept])
    body += _advance(rate_calls(problem, step.rates, step.prepare, step.body))
    if step.failed:
        body.append(_judged(step.failed, "singular" in step.lengths))
    if step.start:
        body.insert(0, first_pass(*step.start))
        lengths["fresh"] = 1
    return Program(lengths, body, record=["t", "x"], stop="nonfinite")


def _advance(evaluations: int) -> list[Statement]:
    """After a step: the next time, computed from the start so that it does not drift; whether the state is finite."""
    names = ("start", "count", "h", "evaluations")
    start, count, h, done = inputs = cg.variables(names)
    outputs = {"t": start + (count + 1.0) * h, "count": count + 1.0, "evaluations": done + float(evaluations)}
    x = cg.variable("x")
    return [Call(Graph(inputs, outputs), names, tuple(outputs)), Sum(Graph([x], {"none": x - x}), ("x",), "nonfinite")]


def _judged(failed: str, singular: bool) -> Call:
    """Whether the step failed; of what goes on, an inertia that is negative says nothing."""
    names = ["nonfinite", failed, *(["singular"] if singular else [])]
    inputs = cg.variables(names)
    bad = inputs[0] + inputs[1]
    outputs: dict[str, Node | float] = {"nonfinite": bad, failed: 0.0}
    if singular:
        outputs["singular"] = cg.where(bad, inputs[2], 0.0)
    return Call(Graph(inputs, outputs), tuple(names), tuple(names))
