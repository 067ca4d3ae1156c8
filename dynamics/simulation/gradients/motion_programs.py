"""Motion programs: the start and the steps of a motion, with its running loss, and their derivatives, compiled once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cgraph as cg
from cgraph import Graph
from cgraph.extend import STATEMENTS, Call, Linearization, Linearized, Map, Program, Runner, Statement, memo, runner

from ...integrators import Method, Problem
from ...integrators.method import equal_registers
from ...integrators.step import with_registers
from ...systems.arguments import TIME, new_variables
from .motion_equations import PARAMETERS, MotionEquations, sharing

LOSS = "loss"  # register: the running loss so far
GIVEN = (*PARAMETERS, "t", "rtol", "atol")  # registers: what a motion has from without


@dataclass(frozen=True, eq=False)
class MotionSteps:
    """The steps of a method.

    start: from x to what the first step reads; None where that is x.  step: one step; fed t, h, and tau where it
    changes.  failed: a register of the step that is not 0 where its equations were not solved, or empty.
    """

    start: Linearization | None
    step: Linearization
    failed: str


def motion_steps(
    equations: MotionEquations,
    method: Method,
    running: Graph | None,
    *,
    each_step: bool,
    wrt: tuple[str, ...],
    shares: bool,
) -> MotionSteps:
    """The steps with derivatives by `wrt`: among "tau", "p", "c", "h" and "t", besides the state.

    running: the loss of a step, a graph over the states, t and parameters.  each_step: whether the applied forces are
    new in every step.  shares: whether the rate records what its pullback needs of it.
    """
    problem = equations.problem
    made = method.step(problem)
    lengths = with_registers(made, {**equal_registers(problem), **equations.lengths, "arrival": 1, LOSS: 1})
    body: list[Statement] = [*made.derived, *_arrival(problem)]
    carried = ["x"]
    if running is not None:
        (before,) = new_variables(LOSS, 1, running.input_names)
        total = Graph([*running.inputs, before], {LOSS: running.only_output() + before})
        body.insert(0, Call(total, ("x", "t", "p", LOSS), (LOSS,)))
        carried.append(LOSS)
    pullbacks = {} if equations.pullback is None else {id(problem.rate): equations.pullback}
    if shares and (both := sharing(equations)) is not None:
        body = _sharing(body, problem.rate, both[0], lengths)
        pullbacks[id(both[0])] = both[1]
    fed = ("t", "h", "tau") if each_step else ("t", "h")
    make = partial(
        Linearization,
        constant=(*made.fixed, "evaluations", "nonfinite"),
        rules=pullbacks,
    )
    step = make(Program(lengths, _separate(body), record=(), feed=fed), carried, wrt)
    read = [name for name in (*step.handed, *step.constants) if name not in GIVEN]
    begin = _separate([*_normalized(problem, TIME), *made.start])
    start = make(Program(lengths, begin, record=()), read, [name for name in wrt if name != "h"]) if begin else None
    return MotionSteps(start, step, made.failed)


def _separate(statements: Sequence[Statement]) -> list[Statement]:
    """The statements, whose parameters p, end to end, are in several registers."""
    result: list[Statement] = []
    for statement in statements:
        row = STATEMENTS[type(statement)]
        changed: dict[str, Any] = {name: tuple(_separate(getattr(statement, name))) for name in row.bodies}
        for name in row.reads:
            registers: str | tuple[str, ...] = getattr(statement, name)
            if "p" in registers and not isinstance(registers, str):
                parts = [PARAMETERS if each == "p" else (each,) for each in registers]
                changed[name] = tuple([each for part in parts for each in part])
        result.append(replace(statement, **changed) if changed else statement)  # type: ignore[type-var]
    return result


def _sharing(body: list[Statement], rate: Graph, sharing_rate: Graph, lengths: dict[str, int]) -> list[Statement]:
    """The statements, of which those that call the rate record what its pullback shares with it."""
    result: list[Statement] = []
    for k, statement in enumerate(body):
        if isinstance(statement, Call) and statement.graph is rate:
            register = f"shared{k}"
            lengths[register] = len(sharing_rate.outputs) - len(statement.graph.outputs)
            statement = Call(sharing_rate, statement.inputs, (*statement.outputs, register))
        result.append(statement)
    return result


def _arrival(problem: Problem) -> list[Statement]:
    """What is done where a step arrived: quaternions get length 1, constraints are met."""
    normalized = _normalized(problem, "arrival")
    if not normalized:
        return []
    t, h = cg.variables("t h")
    return [Call(Graph([t, h], {"t": t + h}), ("t", "h"), ("arrival",)), *normalized]


def _normalized(problem: Problem, time: str) -> list[Statement]:
    if problem.projection is not None:
        return [Call(problem.projection, ("x", time, "p"), ("x",))]
    if problem.normalization is not None:
        return [Call(problem.normalization, ("x",), ("x",))]
    return []


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
