"""Motion programs: the start and the steps of a motion and what goes along them, derived and compiled once."""

from __future__ import annotations

from dataclasses import dataclass

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Linearization, Linearized, Map, Runner, memo, runner

from ...integrators import Method
from .motion_equations import MotionEquations
from .motion_steps import LOSS, motion_steps

_T, _H = cg.variables("t h")
_ADDED = Graph([_T, _H], {"t": _T + _H})
KEPT = 16  # motions whose programs stay ready for another run


@dataclass(frozen=True, eq=False)
class Along:
    """Passes and what goes along them: the passes themselves, and their linearization, compiled."""

    passes: Linearization
    forward: Runner
    linear: Linearized
    back: Runner


@dataclass(frozen=True, eq=False)
class MotionPrograms:
    """The programs of a motion.

    start: from x to what the first step reads, if that is not x.
    step: the steps, with the running loss where there is one.
    failed: a register that is not 0 after steps whose equations were not solved; empty where there is none.
    """

    start: Along | None
    step: Along
    failed: str


@dataclass(frozen=True)
class Request:
    """What programs are made of."""

    equations: MotionEquations
    method: Method
    each_step: bool
    wrt: tuple[str, ...]
    forwards: bool  # tangents pushed on, else cotangents pulled back
    backend: str
    many: bool = False  # motions side by side
    running: Graph | None = None


@memo(KEPT)
def motion_programs(request: Request) -> MotionPrograms:
    """The programs; of the last few requests, those made before."""
    steps = motion_steps(
        request.equations,
        request.method,
        request.running,
        each_step=request.each_step,
        wrt=request.wrt,
        shares=not request.forwards and not request.many,
    )
    step, start, first = steps.step, steps.start, None
    if request.forwards:
        then = [Map(_ADDED, ("t:dot", "h:dot"), ("t:dot",))] if {"t", "h"} <= set(step.wrt) else []
        linear = step.tangent(step.wrt, ["x"], then)
    else:
        linear = step.adjoint(["x", LOSS] if LOSS in step.handed else ["x"])
    if start is not None:
        seeds = [name for name in linear.vectors if name in start.handed]
        pass_on = start.tangent(start.wrt, ["x"]) if request.forwards else start.adjoint(seeds)
        first = _along(start, pass_on, list(start.handed), request.backend)
    results = [name for name in ("x", LOSS, steps.failed) if name in step.handed]
    return MotionPrograms(first, _along(step, linear, results, request.backend), steps.failed)


def _along(passes: Linearization, linear: Linearized, results: list[str], backend: str) -> Along:
    forward = passes.forward([*linear.program.feed, passes.handed["x"]], results)
    return Along(passes, runner(forward, backend), linear, runner(linear.program, backend))
