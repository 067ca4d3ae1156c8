"""Motion programs: the start and the steps of a motion, with its running loss, and their derivatives, compiled once.

The parameters of a problem are taken apart for them: applied forces, p, and numbers c, which p alone decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Along, Array, Passes, adjoint, kept_by_first, memo, tangent
from cgraph.extend import STATEMENTS, Builder, Call, Map, Program, Statement, folded, topological

from ...integrators import Method, Problem
from ...integrators.rate_in_modes import sliding
from ...integrators.step import with_registers
from ...integrators.step_control import equal_registers
from ...systems.arguments import TIME, new_variables
from ...systems.evaluation import ByRows
from ...systems.kinematics import substitute
from ..steps.row_values import compiled
from ..steps.step_program import normalizing
from .rate_pullback import RatePullback, rate_pullback, sharing

PARAMETERS = ("tau", "p", "c", "modes")  # registers: what the parameters of the problem are, end to end
LOSS = "loss"  # register: the running loss so far
OVER_INPUTS = ("rate", "projection", "momentum", "velocities", "missing")  # graphs of a problem over its parameters
INPUTS = (*PARAMETERS, "t", "rtol", "atol")  # registers: what a motion has from without
PROGRAMS_KEPT = 16  # motions whose programs stay ready for another run
_T, _H = cg.variables("t h")
_LATER = Graph([_T, _H], {"t": _T + _H})


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """A problem whose parameters are applied forces, p, numbers c, which p alone decides, and modes.

    forces: how many of the parameters are applied forces.  names: of p.  numbers: p and c of p; None without c.
    start, end: (q, qd) to a state of the steps and back, over states, t, parameters; None where they are the same.
    """

    problem: Problem
    forces: int
    names: tuple[str, ...]
    numbers: Graph | None
    pullback: RatePullback | None
    start: Graph | None
    end: Graph | None

    def registers(self, inputs: Array) -> dict[str, Array]:
        """The registers of the parameters, of these end to end."""
        p, modes = self.forces + len(self.names), len(inputs) - self.modes
        parts = inputs[: self.forces], inputs[self.forces : p], inputs[p:modes], inputs[modes:]
        return dict(zip(PARAMETERS, parts, strict=True))

    @property
    def modes(self) -> int:
        """Number of modes."""
        return 0 if self.problem.switches is None else len(self.problem.switches.modes)


@kept_by_first
def motion_equations(problem: Problem, forces: int) -> MotionEquations:
    """The equations of a problem whose first `forces` parameters are applied forces."""
    if isinstance(problem.rate, ByRows):
        return MotionEquations(problem, forces, problem.parameters[forces:], None, None, None, None)
    switches, open_count = problem.switches, len(problem.parameters)
    modes = () if switches is None else switches.modes
    names, rule = problem.parameters[forces : open_count - len(modes)], None if modes else rate_pullback(problem)
    rates = problem.rate, problem.projection
    nodes = [node for graph in rates if graph for node in graph.outputs.values()] + [*(rule.nodes if rule else ())]
    p = cg.variables(list(names))
    numbers, changed = _apart(nodes, p, problem.rate.input_names)
    new = dict(zip(nodes, changed, strict=True))

    def over_numbers(graph: Graph | None) -> Graph | None:
        if graph is None:
            return None
        outputs = {name: new.get(node, node) for name, node in graph.outputs.items()}
        first = len(graph.inputs) - len(modes)
        return Graph([*graph.inputs[:first], *numbers, *graph.inputs[first:]], outputs)

    def whole(graph: Graph | None) -> Graph | None:
        """States to states, whose coordinates stay and whose last numbers the graph gives."""
        return graph and Graph(graph.inputs, {str(q.name): q for q in graph.inputs[: problem.nq]} | graph.outputs)

    graphs: dict[str, Any] = {name: over_numbers(getattr(problem, name)) for name in OVER_INPUTS}
    outputs = {str(variable.name): node for variable, node in numbers.items()}
    if switches is not None:
        wide: dict[str, Any] = {name: over_numbers(getattr(switches, name)) for name in ("gaps", "margins")}
        graphs["switches"] = replace(switches, **wide)
    parameters = (*problem.parameters[:forces], *names, *outputs, *modes)
    made = replace(problem, parameters=parameters, multipliers=None, **graphs)
    rule = rule and replace(rule, inputs=made.rate.inputs, nodes=[new[node] for node in rule.nodes])
    over_p = Graph(p, dict(zip(names, p, strict=True)) | outputs) if outputs else None
    return MotionEquations(made, forces, names, over_p, rule, whole(made.momentum), whole(made.velocities))


@kept_by_first
def sliding_equations(equations: MotionEquations, among: frozenset[int]) -> MotionEquations:
    """The equations of a motion that slides on some of these surfaces."""
    return replace(equations, problem=sliding(equations.problem, among))


def _apart(
    nodes: Sequence[Node], parameters: Sequence[Node], taken: Sequence[str]
) -> tuple[dict[Node, Node], list[Node]]:
    """{variable c: what it is of the parameters alone, where others use it}, and the nodes over these variables."""
    copies = folded(nodes, Builder())
    alone, edge = set(parameters), dict.fromkeys(copies)
    for node in topological(copies):
        if node.args and all([arg in alone or arg.op.name == "constant" for arg in node.args]):
            alone.add(node)
        else:
            edge |= dict.fromkeys(node.args)
    used = [node for node in edge if node in alone]
    numbers = dict(zip(used, new_variables("number", len(used), taken), strict=True))
    return {variable: node for node, variable in numbers.items()}, substitute(copies, numbers)


@kept_by_first
def pullback(graph: Graph) -> Graph:
    """J^T y_bar: inputs those of the graph, then y_bar."""
    return cg.simplify(cg.vjp(graph))


def outputs_at(graph: Graph, backend: str, x: Array) -> Array:
    """The outputs, (k, N), of a graph that is compiled once, at points (n, N)."""
    function: Any = compiled(graph, backend)
    values: Array = function(x[:, 0])[:, None] if x.shape[1] == 1 else function.batch(x)
    return values


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
) -> tuple[Along | None, Along, str]:
    """The programs of a motion, of the last few those made before, and their register `failed`.

    The first is from x to what the first step reads, None where that is x; the other one step with the running loss,
    fed t, h, and tau where it changes.  failed: not 0 after steps whose equations were not solved; may be empty.
    wrt: among "tau", "p", "c", "h" and "t", besides the state.  running: the loss of a step.  each_step: whether it has
    forces of its own.  forwards: tangents are pushed on, else cotangents pulled back.  many: motions go side by side.
    """
    problem, rate, rule = equations.problem, equations.problem.rate, None if forwards else equations.pullback
    made, registers = method.step(problem), equations.registers(np.empty(len(problem.parameters)))
    sizes = {name: len(each) for name, each in registers.items()} | {"arrival": 1, LOSS: 1}
    lengths, body = with_registers(made, equal_registers(problem) | sizes), list[Statement](made.derived)
    if arrived := normalizing(problem, "arrival"):
        body += [Call(_LATER, ("t", "h"), ("arrival",)), *arrived]
    carried = ["x"] if running is None else ["x", LOSS]
    if running is not None:
        (before,) = new_variables(LOSS, 1, running.input_names)
        total = Graph([*running.inputs, before], {LOSS: running.only_output() + before})
        body.insert(0, Call(total, ("x", "t", "p", LOSS), (LOSS,)))
    rules = at_start = {} if rule is None else {id(rate): (problem.size, rule)}
    if rule is not None and not many:  # calls of the rate record what the pullback shares with it
        shared, pulled = sharing(rate, rule)
        rules = rules | {id(shared): (problem.size, pulled)} if pulled.shared else {}  # else the rate's own is exact
        for k, each in enumerate(body if rules else ()):
            if isinstance(each, Call) and each.graph is rate:
                lengths[f"shared{k}"] = len(pulled.shared)
                body[k] = Call(shared, each.inputs, (*each.outputs, f"shared{k}"))
    make = partial(Passes, constant=(*made.fixed, "evaluations", "nonfinite"))
    fed = ("t", "h", "tau") if each_step else ("t", "h")
    tables = problem.evaluation.shared
    step = make(Program(lengths, _separate(body), record=(), feed=fed, shared=tables), carried, wrt)
    if forwards:
        then = [Map(_LATER, ("t:dot", "h:dot"), ("t:dot",))] if {"t", "h"} <= set(wrt) else []
        linear = tangent(step, ["x"], then)
    else:
        linear = adjoint(step, carried, rules)
    first = None
    if begin := _separate([*normalizing(problem, TIME), *made.start]):
        read = [name for name in (*step.handed, *step.constants) if name not in INPUTS]
        start = make(Program(lengths, begin, record=(), shared=tables), read, [name for name in wrt if name != "h"])
        seeds = [name for name in linear.vectors if name in start.handed]
        first = Along(start, tangent(start, ["x"]) if forwards else adjoint(start, seeds, at_start), read, backend)
    results = [name for name in ("x", LOSS, made.failed) if name in step.handed]
    rows = [step.handed[name] for name in (made.failed, "x") if name in step.handed]
    return first, Along(step, linear, results, backend, rows), made.failed


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
