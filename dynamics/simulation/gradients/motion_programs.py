"""Motion programs: the start and the steps of a motion, with its running loss, and their derivatives, compiled once.

The parameters of a problem are taken apart for them: applied forces, p, and numbers c, which p alone decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Along, Array, Passes, adjoint, kept_by_first, memo, tangent
from cgraph.extend import STATEMENTS, Builder, Call, Map, Program, Statement, folded, topological

from ...equations.substitute import substitute
from ...integrators import Method, Problem
from ...integrators.step import with_registers
from ...integrators.step_control import equal_registers
from ...systems.arguments import TIME, new_variables
from ..steps.step_program import normalizing
from .rate_pullback import RatePullback, rate_pullback, sharing

PARAMETERS = ("tau", "p", "c")  # registers: what the parameters of the problem are, end to end
LOSS = "loss"  # register: the running loss so far
GIVEN = (*PARAMETERS, "t", "rtol", "atol")  # registers: what a motion has from without
PROGRAMS_KEPT = 16  # motions whose programs stay ready for another run
_T, _H = cg.variables("t h")
_LATER = Graph([_T, _H], {"t": _T + _H})


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """A problem whose parameters are applied forces, p, and numbers c, which p alone decides.

    given: the one without c.  forces: how many of the parameters are applied forces.  names: of p.
    numbers: p and c, a graph over p; none where there is no c.  pullback: of the rate, where there is one.
    start, end: (q, qd) to a state of the steps and back, over states, t, parameters; None where they are the same.
    """

    given: Problem
    problem: Problem
    forces: int
    names: tuple[str, ...]
    numbers: Graph | None
    pullback: RatePullback | None
    start: Graph | None
    end: Graph | None

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the registers of the parameters."""
        count = len(self.problem.parameters) - self.forces - len(self.names)
        return dict(zip(PARAMETERS, (self.forces, len(self.names), count), strict=True))

    def registers(self, inputs: Array) -> dict[str, Array]:
        """The registers of the parameters, of these end to end."""
        p = self.forces + len(self.names)
        return dict(zip(PARAMETERS, (inputs[: self.forces], inputs[self.forces : p], inputs[p:]), strict=True))

    def values(self, p: Array, backend: str) -> Array:
        """p and c, (P + C, N), from p (P, N)."""
        return p if self.numbers is None else outputs_at(function_of(self.numbers, backend), p)

    def by_parameters(self, p: Array, bars: Array, backend: str) -> Array:
        """Cotangents of p from those of p and c."""
        return (
            bars if self.numbers is None else outputs_at(pullback_of(self.numbers, backend), np.concatenate([p, bars]))
        )


@kept_by_first
def motion_equations(problem: Problem, forces: int) -> MotionEquations:
    """The equations of a problem whose first `forces` parameters are applied forces."""
    names, pullback = problem.parameters[forces:], rate_pullback(problem)
    graphs = [problem.rate] if problem.projection is None else [problem.rate, problem.projection]
    parts = [node for graph in graphs for node in graph.outputs.values()]
    if pullback is not None:
        parts += [pullback.power, *pullback.solved, *pullback.q_dot]
    p = cg.variables(list(names))
    numbers, changed = _apart(parts, p, problem.rate.input_names)
    new = dict(zip(parts, changed, strict=True))
    rate, *projection = [
        Graph([*graph.inputs, *numbers], {name: new[node] for name, node in graph.outputs.items()}) for graph in graphs
    ]
    if pullback is not None:
        solved, q_dot = ([new[node] for node in nodes] for nodes in (pullback.solved, pullback.q_dot))
        pullback = replace(pullback, inputs=rate.inputs, power=new[pullback.power], solved=solved, q_dot=q_dot)
    outputs = {str(variable.name): node for variable, node in numbers.items()}
    parameters, projected = (*problem.parameters, *outputs), projection[0] if projection else None
    made = replace(problem, parameters=parameters, rate=rate, projection=projected, multipliers=None)
    over_p = Graph(p, dict(zip(names, p, strict=True)) | outputs) if outputs else None
    ways = _whole(made, made.momentum), _whole(made, made.velocities)
    return MotionEquations(problem, made, forces, names, over_p, pullback, *ways)


def _whole(problem: Problem, last: Graph | None) -> Graph | None:
    """States to states, whose coordinates stay and whose last numbers a graph gives."""
    if last is None:
        return None
    q = {str(node.name): node for node in last.inputs[: problem.nq]}
    return problem.bind(last.input_names[: problem.size], Graph(last.inputs, q | last.outputs))


def _apart(
    nodes: Sequence[Node], parameters: Sequence[Node], taken: Sequence[str]
) -> tuple[dict[Node, Node], list[Node]]:
    """{variable c: what it is of the parameters alone, where others use it}, and the nodes over these variables.

    taken: names that the variables do not get.
    """
    build = Builder()
    copies = folded(nodes, build)
    order = topological(copies)
    alone, edge = set(parameters), dict.fromkeys(copies)
    for node in order:
        if node.args and all([arg in alone or arg.op.name == "constant" for arg in node.args]):
            alone.add(node)
        else:
            edge |= dict.fromkeys(node.args)
    used = [node for node in edge if node in alone]
    numbers = dict(zip(used, new_variables("number", len(used), taken), strict=True))
    return {variable: node for node, variable in numbers.items()}, substitute(copies, numbers)


@kept_by_first
def function_of(graph: Graph, backend: str) -> Any:
    """The graph as a function."""
    return cg.compile(graph, backend)


@kept_by_first
def pullback_of(graph: Graph, backend: str) -> Any:
    """J^T y_bar as a function of the inputs, then y_bar."""
    return cg.compile(cg.simplify(cg.vjp(graph)), backend)


def outputs_at(function: Any, x: Array) -> Array:
    """The outputs, (k, N), at points (n, N)."""
    values: Array = function(x[:, 0])[:, None] if x.shape[1] == 1 else function.batch(x)
    return values


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
    if rule is not None and not forwards and not many:  # calls of the rate record what the pullback shares with it
        shared, pullback = sharing(rate, rule)
        rules[id(shared)] = problem.size, pullback
        for k, each in enumerate(body):
            if isinstance(each, Call) and each.graph is rate:
                lengths[f"shared{k}"] = len(shared.outputs) - len(rate.outputs)
                body[k] = Call(shared, each.inputs, (*each.outputs, f"shared{k}"))
    make = partial(Passes, constant=(*made.fixed, "evaluations", "nonfinite"))
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
        first = Along(start, tangent(start, ["x"]) if forwards else adjoint(start, seeds, rules), read, backend)
    results = [name for name in ("x", LOSS, made.failed) if name in step.handed]
    rows = [step.handed[name] for name in (made.failed, "x") if name in step.handed]
    return MotionPrograms(first, Along(step, linear, results, backend, rows), made.failed)


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
