"""Blame: the nodes and edges that a graph has from a derivative through the embedded step, proved or by their tags."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import NamedTuple

import cgraph as cg
from cgraph import Edge, Graph, Node
from cgraph._shared import require_graph
from cgraph.extend import Builder, folded

from ...systems.arguments import new_variables
from ...systems.kinematics import ONE, ZERO
from ...systems.system import System
from .lagrange_terms import COUPLING, THROUGH_STEP

Derive = Callable[[System, str, Node], Graph]


class Blame(NamedTuple):
    """Nodes and edges that a graph has from the derivative through the step.

    nodes: they serve nothing else.  edges: by these it enters what is sound, or another use of a sound node is wrong.
    cancelled: outputs that have no such edge left, since simplification took it away together with a right one.
    """

    nodes: frozenset[Node] = frozenset()
    edges: frozenset[Edge] = frozenset()
    cancelled: tuple[str, ...] = ()


def split(system: System, formulation: str, derive: Derive) -> tuple[Graph, Node]:
    """Torques or momenta by a formulation of `THROUGH_STEP`, and an input by which all that comes by it is multiplied.

    At 1 they are its own, at 0 those without the step.
    """
    (through,) = new_variables("through", 1, system.parameters)
    return cg.simplify(derive(system, formulation, through)), through


def blame(
    system: System, formulation: str, derive: Derive, graph: Graph, known: tuple[Graph, Node] | None = None
) -> Blame:
    """Blame for what the graph has by the derivative through the step, whether its value is 0 or not.

    derive: `torques` or `momenta`, of which `graph` is the simplified graph by this formulation.  known: its `split`.

    All that comes through the step is multiplied by a variable. What folds to 0 when that is 0 is wrong, and the edges
    that lead out of it are to blame; at 1 the graph is the formulation's, node by node.
    """
    if formulation not in THROUGH_STEP:
        return Blame()
    marked, through = known or split(system, formulation, derive)
    without, whole = (
        dict(zip(marked.nodes, folded(marked.nodes, Builder(), {through: factor}), strict=True))
        for factor in (ZERO, ONE)
    )
    wrong = {node for node in marked.nodes if without[node].value == 0.0 and node.value != 0.0}
    image = Graph(graph.inputs, {name: whole[node] for name, node in marked.outputs.items()})
    same = dict(cg.compare(image, graph).common)
    leaving = {edge for edge in marked.edges if edge.source in wrong and edge.target not in wrong}
    drawn: dict[Edge, Edge] = {}
    for edge in leaving:
        source, target = same.get(whole[edge.source]), same.get(whole[edge.target])
        if source is not None and target is not None and source in target.args:
            drawn[edge] = Edge(source, target, target.args.index(source))
    edges, reach = frozenset(drawn.values()), dict.fromkeys(marked.nodes, 0)
    for k, node in enumerate(marked.outputs.values()):
        reach[node] |= 1 << k
    for node in reversed(marked.nodes):  # which outputs need it, a bit each
        for arg in node.args:
            reach[arg] |= reach[node]
    touched, left = (reduce(or_, [reach[edge.target] for edge in each], 0) for each in (leaving, drawn))
    cancelled = tuple([name for k, name in enumerate(marked.outputs) if touched & ~left & 1 << k])
    outputs = [graph.outputs[name] for name, node in marked.outputs.items() if node not in wrong]
    return Blame(frozenset(graph.nodes) - _needed(outputs, edges), edges, cancelled)


def spurious_nodes(graph: Graph) -> frozenset[Node]:
    """Nodes that are there only because a derivative was taken through the embedded Euler relation.

    They are the adjoints that the product qd dt of q = qd dt + q_old passes on, the "unnecessary terms" of eq. (3), and
    all that only these need, whether the author of the Lagrangian tagged anything or not. Where a slope dL/dq does not
    change along the step, such as a weight m g, the derivative of m g dt is the node m g itself, which is not marked:
    there an edge is wrong. Whether the torque is wrong, and by which edges, `formulation_verdict` says.

    Parameters
    ----------
    graph : Graph
        One of `inverse_dynamics` or `momentum_rate`, by any formulation.

    Returns
    -------
    frozenset of Node
        Empty for a formulation by the chain rule.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.scenes.load("spring_mass")
    >>> [len(dyn.spurious_nodes(dyn.momentum_rate(spring, name))) for name in ("chain_rule", "by_definition")]
    [0, 13]
    """
    require_graph("spurious_nodes", graph)
    coupling = {node for node in graph.nodes if COUPLING in node.tags and "adjoint" in node.roles}
    entering = frozenset([edge for edge in graph.edges if edge.source in coupling])
    outputs = [node for node in graph.outputs.values() if node not in coupling]
    return frozenset(graph.nodes) - _needed(outputs, entering)


def _needed(outputs: list[Node], cut: frozenset[Edge]) -> set[Node]:
    """The nodes that outputs need when these edges are cut."""
    closed = {(edge.target, edge.slot) for edge in cut}
    needed: set[Node] = set()
    stack = list(outputs)
    while stack:
        node = stack.pop()
        if node not in needed:
            needed.add(node)
            stack.extend([arg for slot, arg in enumerate(node.args) if (node, slot) not in closed])
    return needed
