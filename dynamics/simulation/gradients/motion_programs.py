"""Motion programs: the start and the steps of a motion, with its running loss, and their derivatives, compiled once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import cgraph as cg
from cgraph import Graph
from cgraph._shared import TURNS, Along, Passes, adjoint, along, memo, tangent
from cgraph.extend import STATEMENTS, Call, Map, Program, Statement

from ...integrators import Method
from ...integrators.method import equal_registers
from ...integrators.step import with_registers
from ...systems.arguments import TIME, new_variables
from ..steps.step_program import normalizing
from .motion_equations import PARAMETERS, MotionEquations
from .rate_pullback import sharing

LOSS = "loss"  # register: the running loss so far
GIVEN = (*PARAMETERS, "t", "rtol", "atol")  # registers: what a motion has from without
PROGRAMS_KEPT = 16  # motions whose programs stay ready for another run
_T, _H = cg.variables("t h")
_LATER = Graph([_T, _H], {"t": _T + _H})


class MotionPrograms(NamedTuple):
    """The programs of a motion.

    start: from x to what the first step reads; None where that is x.
    step: one step, with the running loss where there is one; fed t, h, and tau where it changes.
    failed: a register that is not 0 after steps whose equations were not solved; empty where there is none.
    """

    start: Along | None
    step: Along
    failed: str


@memo(PROGRAMS_KEPT)
def motion_programs(
    equations: MotionEquations,
    method: Method,
    wrt: tuple[str, ...],
    running: Graph | None,
    backend: str,
    *,
    each_step: bool,
    forwards: bool,
    many: bool,
) -> MotionPrograms:
    """The programs; of the last few motions, those made before.

    wrt: among "tau", "p", "c", "h" and "t", besides the state.  running: the loss of a step, over the states, t and
    parameters.  each_step: whether the applied forces are new in every step.  forwards: tangents are pushed on, else
    cotangents pulled back.  many: motions go side by side.
    """
    problem, made = equations.problem, method.step(equations.problem)
    lengths = with_registers(made, {**equal_registers(problem), **equations.lengths, "arrival": 1, LOSS: 1})
    body: list[Statement] = list(made.derived)
    if arrived := normalizing(problem, "arrival"):
        body += [Call(_LATER, ("t", "h"), ("arrival",)), *arrived]
    carried = ["x"] if running is None else ["x", LOSS]
    if running is not None:
        (before,) = new_variables(LOSS, 1, running.input_names)
        total = Graph([*running.inputs, before], {LOSS: running.only_output() + before})
        body.insert(0, Call(total, ("x", "t", "p", LOSS), (LOSS,)))
    rate, rule = problem.rate, equations.pullback
    rules = {} if rule is None else {id(rate): (problem.size, rule)}
    if rule is not None and not forwards and not many:
        both = sharing(rate, rule)
        body, rules[id(both[0])] = _sharing(body, rate, both[0], lengths), (problem.size, both[1])
    constant, turns = (*made.fixed, "evaluations", "nonfinite"), 0 if forwards else TURNS
    make = partial(Passes, constant=constant, turns=turns)
    fed = ("t", "h", "tau") if each_step else ("t", "h")
    step = make(Program(lengths, _separate(body), record=(), feed=fed), carried, wrt)
    if forwards:
        then = [Map(_LATER, ("t:dot", "h:dot"), ("t:dot",))] if {"t", "h"} <= set(wrt) else []
        linear = tangent(step, ["x"], then)
    else:
        linear = adjoint(step, carried, rules)
    first = None
    if begin := _separate([*normalizing(problem, TIME), *made.start]):
        read = [name for name in (*step.handed, *step.constants) if name not in GIVEN]
        start = make(Program(lengths, begin, record=()), read, [name for name in wrt if name != "h"])
        seeds = [name for name in linear.vectors if name in start.handed]
        first = along(start, tangent(start, ["x"]) if forwards else adjoint(start, seeds, rules), read, backend)
    results = [name for name in ("x", LOSS, made.failed) if name in step.handed]
    rows = [step.handed[name] for name in (made.failed, "x") if name in step.handed]
    return MotionPrograms(first, along(step, linear, results, backend, rows), made.failed)


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
            lengths[register] = len(sharing_rate.outputs) - len(rate.outputs)
            statement = Call(sharing_rate, statement.inputs, (*statement.outputs, register))
        result.append(statement)
    return result
