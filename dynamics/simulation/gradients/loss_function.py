"""Loss functions: losses of a problem as graphs that are made once, and their slopes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import kept_by_first, memo, topological

from ...integrators import Problem

KEPT = 64  # losses whose graphs stay for another run


@dataclass(frozen=True)
class _Quantity:
    """A quantity of a problem, known by its operations, so that what is derived from it is derived once."""

    problem: Problem
    key: tuple[object, ...]
    node: Node = field(compare=False)


def loss_graph(problem: Problem, node: Node) -> Graph:
    """The loss over the states, t and parameters; the same object for an equal one."""
    order = topological([node])
    places = {each: k for k, each in enumerate(order)}
    key: list[object] = []
    for each in order:
        if each.args:
            key.append((each.op.name, *[places[arg] for arg in each.args]))
        else:
            key.append(each.name if each.value is None else float(each.value).hex())  # 0.0 and -0.0 stay apart
    return _bound(_Quantity(problem, tuple(key), node))


@memo(KEPT)
def _bound(quantity: _Quantity) -> Graph:
    return quantity.problem.observed({"loss": quantity.node})


@kept_by_first
def with_slopes(graph: Graph, backend: str) -> Any:
    """The loss, and its slopes by all inputs, as a function."""
    slopes = cg.gradient(graph)
    both = {"loss": graph.only_output()} | {f"slope{k}": node for k, node in enumerate(slopes.outputs.values())}
    return cg.compile(cg.simplify(Graph(graph.inputs, both)), backend)
