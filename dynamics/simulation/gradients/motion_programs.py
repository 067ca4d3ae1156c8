"""Motion programs: the start and the steps of a motion, with its running loss, and their derivatives, compiled once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Linearization, Linearized, memo
from cgraph.extend import STATEMENTS, Call, Map, Program, Runner, Statement, runner

from ...integrators import Method, Step
from ...integrators.method import equal_registers
from ...integrators.step import with_registers
from ...systems.arguments import TIME, new_variables
from ..steps.step_program import normalizing
from .motion_equations import PARAMETERS, MotionEquations, sharing

LOSS = "loss"  # register: the running loss so far
GIVEN = (*PARAMETERS, "t", "rtol", "atol")  # registers: what a motion has from without
PROGRAMS_KEPT = 16  # motions whose programs stay ready for another run
_T, _H = cg.variables("t h")
_LATER = Graph([_T, _H], {"t": _T + _H})


@dataclass(frozen=True, eq=False)
class WithDerivative:
    """Passes and what goes along them: the passes themselves, and their linearization, compiled."""

    passes: Linearization
    forward: Runner
    linear: Linearized
    derivative: Runner


@dataclass(frozen=True, eq=False)
class MotionPrograms:
    """The programs of a motion.

    start: from x to what the first step reads; None where that is x.
    step: one step, with the running loss where there is one; fed t, h, and tau where it changes.
    failed: a register that is not 0 after steps whose equations were not solved; empty where there is none.
    """

    start: WithDerivative | None
    step: WithDerivative
    failed: str


@dataclass(frozen=True)
class ProgramRequest:
    """Request for the programs of a motion.

    each_step: whether the applied forces are new in every step.  wrt: among "tau", "p", "c", "h" and "t", besides the
    state.  forwards: tangents are pushed on, else cotangents pulled back.  many: motions go side by side.
    running: the loss of a step, a graph over the states, t and parameters.
    """

    equations: MotionEquations
    method: Method
    each_step: bool
    wrt: tuple[str, ...]
    forwards: bool
    backend: str
    many: bool = False
    running: Graph | None = None


@memo(PROGRAMS_KEPT)
def motion_programs(request: ProgramRequest) -> MotionPrograms:
    """The programs; of the last few requests, those made before."""
    made = request.method.step(request.equations.problem)
    (step, start), first = _linearizations(request, made), None
    if request.forwards:
        then = [Map(_LATER, ("t:dot", "h:dot"), ("t:dot",))] if {"t", "h"} <= set(step.wrt) else []
        linear = step.tangent(step.wrt, ["x"], then)
    else:
        linear = step.adjoint(["x", LOSS] if LOSS in step.handed else ["x"])
    if start is not None:
        seeds = [name for name in linear.vectors if name in start.handed]
        pass_on = start.tangent(start.wrt, ["x"]) if request.forwards else start.adjoint(seeds)
        first = _with_derivative(start, pass_on, list(start.handed), request.backend)
    results = [name for name in ("x", LOSS, made.failed) if name in step.handed]
    return MotionPrograms(first, _with_derivative(step, linear, results, request.backend), made.failed)


def _with_derivative(passes: Linearization, linear: Linearized, results: list[str], backend: str) -> WithDerivative:
    forward = passes.forward([*linear.program.feed, passes.handed["x"]], results)
    return WithDerivative(passes, runner(forward, backend), linear, runner(linear.program, backend))


def _linearizations(request: ProgramRequest, made: Step) -> tuple[Linearization, Linearization | None]:
    """Linearizations of a step with its running loss, and of the statements before the first step."""
    equations, problem, running = request.equations, request.equations.problem, request.running
    lengths = with_registers(made, {**equal_registers(problem), **equations.lengths, "arrival": 1, LOSS: 1})
    body: list[Statement] = list(made.derived)
    if arrived := normalizing(problem, "arrival"):
        body += [Call(_LATER, ("t", "h"), ("arrival",)), *arrived]
    carried = ["x"]
    if running is not None:
        (before,) = new_variables(LOSS, 1, running.input_names)
        total = Graph([*running.inputs, before], {LOSS: running.only_output() + before})
        body.insert(0, Call(total, ("x", "t", "p", LOSS), (LOSS,)))
        carried.append(LOSS)
    pullbacks = {} if equations.pullback is None else {id(problem.rate): equations.pullback}
    if not request.forwards and not request.many and (both := sharing(equations)) is not None:
        body = _sharing(body, problem.rate, both[0], lengths)
        pullbacks[id(both[0])] = both[1]
    make = partial(Linearization, constant=(*made.fixed, "evaluations", "nonfinite"), rules=pullbacks)
    fed = ("t", "h", "tau") if request.each_step else ("t", "h")
    step = make(Program(lengths, _separate(body), record=(), feed=fed), carried, request.wrt)
    read = [name for name in (*step.handed, *step.constants) if name not in GIVEN]
    begin, wrt = _separate([*normalizing(problem, TIME), *made.start]), [name for name in request.wrt if name != "h"]
    return step, make(Program(lengths, begin, record=()), read, wrt) if begin else None


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
