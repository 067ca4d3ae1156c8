"""Motion steps: the start and the steps of a motion, with its running loss, ready to be linearized."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Statement

from ...integrators import Method, Problem
from ...integrators.equal import registers
from ...integrators.step import with_registers
from ...systems.arguments import TIME, new_variables
from .linearization import Linearization
from .motion_equations import PARAMETERS, MotionEquations
from .products import Products

LOSS = "loss"  # register: the running loss so far


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
    sharing: bool,
) -> MotionSteps:
    """The steps with derivatives by `wrt`: among "tau", "p", "c", "h" and "t", besides the state.

    running: the loss of a step, a graph over the states, t and parameters.  each_step: whether the applied forces are
    new in every step.  sharing: whether the rate records what its pullback needs of it.
    """
    problem = equations.problem
    made = method.step(problem)
    lengths = with_registers(made, {**registers(problem), **equations.lengths, "arrival": 1, LOSS: 1})
    body: list[Statement] = [*made.derived, *_arrival(problem)]
    carried = ["x"]
    if running is not None:
        (before,) = new_variables(LOSS, 1, running.input_names)
        total = Graph([*running.inputs, before], {LOSS: running.only_output() + before})
        body.insert(0, Call(total, ("x", "t", "p", LOSS), (LOSS,)))
        carried.append(LOSS)
    pullbacks = {id(problem.rate): equations.pullback, id(equations.sharing_rate): equations.sharing_pullback}
    if sharing and equations.sharing_pullback is not None:
        body = _sharing(body, equations, lengths)
    fed = ("t", "h", "tau") if each_step else ("t", "h")
    make = partial(
        Linearization,
        lengths=lengths,
        fixed=(*made.fixed, "evaluations", "nonfinite"),
        renamed={"p": PARAMETERS},
        products=Products({key: pullback for key, pullback in pullbacks.items() if pullback is not None}),
    )
    inputs_of_step, varied = [name for name in wrt if name not in fed], [name for name in wrt if name in fed]
    step = make(body, fed=fed, inputs=inputs_of_step, varied=varied, carried=carried)
    read = [name for name in (*step.handed, *step.constants) if name not in (*PARAMETERS, "t")]
    begin = [*_normalized(problem, TIME), *made.start]
    inputs_of_start = [name for name in wrt if name != "h"]
    start = make(begin, fed=(), inputs=inputs_of_start, varied=(), carried=read) if begin else None
    return MotionSteps(start, step, made.failed)


def _sharing(body: list[Statement], equations: MotionEquations, lengths: dict[str, int]) -> list[Statement]:
    """The statements, of which those that call the rate record what its pullback shares with it."""
    result: list[Statement] = []
    for k, statement in enumerate(body):
        if isinstance(statement, Call) and statement.graph is equations.problem.rate:
            register = f"shared{k}"
            lengths[register] = len(equations.sharing_rate.outputs) - len(statement.graph.outputs)
            statement = Call(equations.sharing_rate, statement.inputs, (*statement.outputs, register))
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
