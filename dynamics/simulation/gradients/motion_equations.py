"""Motion equations: a problem with its parameters taken apart: applied forces, p, and what p alone decides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, folded, topological

from ...equations.substitute import substitute
from ...integrators import Problem
from ...systems.arguments import new_variables
from .rate_pullback import RatePullback, rate_pullback

PARAMETERS = ("tau", "p", "c")  # registers: what the parameters of the problem are, end to end


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
        ends = np.cumsum([*self.lengths.values()])[:-1]
        return dict(zip(PARAMETERS, np.split(inputs, ends), strict=True))

    def values(self, p: Array, backend: str) -> Array:
        """p and c, (P + C, N), from p (P, N)."""
        return p if self.numbers is None else at(compiled(self.numbers, backend), p)

    def by_parameters(self, p: Array, bars: Array, backend: str) -> Array:
        """Cotangents of p from those of p and c."""
        return bars if self.numbers is None else at(pulled_back(self.numbers, backend), np.concatenate([p, bars]))


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
def compiled(graph: Graph, backend: str) -> Any:
    """The graph as a function."""
    return cg.compile(graph, backend)


@kept_by_first
def pulled_back(graph: Graph, backend: str) -> Any:
    """J^T y_bar as a function of the inputs, then y_bar."""
    return cg.compile(cg.simplify(cg.vjp(graph)), backend)


def at(function: Any, x: Array) -> Array:
    """The outputs, (k, N), at points (n, N)."""
    values: Array = function(x[:, 0])[:, None] if x.shape[1] == 1 else function.batch(x)
    return values
