"""LaneSteps: the equal steps of many trajectories at once, each in a lane of a vector."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, FixedPoint, If, Program, While

from ..steps.step_program import StepProgram


class LaneSteps(NamedTuple):
    """What is done once, before the first pass, and a pass.

    stops: whether a lane whose step failed makes no more; else it goes on, and its state is not finite.
    """

    start: Program | None
    one_pass: Program
    stops: bool


def lane_steps(program: StepProgram) -> LaneSteps:
    """The equal steps of a program, without its `stop`: lanes that go on do not stop for one that failed."""
    steps = replace(program.steps, stop=None)
    first, start = steps.body[0], None
    if isinstance(first, If) and first.register == "fresh" and not first.otherwise:
        start, steps = replace(steps, body=first.body), replace(steps, body=steps.body[1:])
    stops = iterates(program)
    if stops:  # equations that were not solved leave a state that is finite
        registers = {**steps.registers, "live": 1}
        body = (Call(_LIVE, ("nonfinite",), ("live",)), If("live", tuple(steps.body)))
        start = start and replace(start, registers=registers)
        steps = replace(steps, registers=registers, body=body)
    return LaneSteps(start, steps, stops)


def iterates(program: StepProgram) -> bool:
    """Whether steps turn as often as numbers say, so that lanes wait for one another."""
    return any(isinstance(each, While | FixedPoint) for each in program.steps.statements())


_NONFINITE = cg.variable("nonfinite")
_LIVE = Graph([_NONFINITE], {"live": cg.where(_NONFINITE, 0.0, 1.0)})
