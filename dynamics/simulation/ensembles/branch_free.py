"""BranchFreeProgram: a step program that takes the same course for every state, for many trajectories at once."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from cgraph.extend import If, Program

from ..step_program import StepProgram


class BranchFreeProgram(NamedTuple):
    """What is done once, before the first pass, and a pass. Neither branches on numbers."""

    start: Program | None
    one_pass: Program


def branch_free(program: StepProgram) -> BranchFreeProgram | None:
    """The program for many at once; None if its course depends on numbers.

    That a run ends when its state is not finite (register `nonfinite`) is left out: the others go on.
    """
    steps = program.steps
    first, body, start = steps.body[0], steps.body, None
    if isinstance(first, If) and first.register == "fresh" and not first.otherwise:
        start, body = replace(steps, body=first.body, stop=None), body[1:]
    one_pass = replace(steps, body=body, stop=None)
    if one_pass.alone or (start is not None and start.alone):
        return None
    return BranchFreeProgram(start, one_pass)
