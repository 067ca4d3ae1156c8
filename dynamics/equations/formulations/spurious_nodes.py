"""Spurious nodes: those of a graph that are there only because of a derivative through the embedded Euler relation."""

from __future__ import annotations

from cgraph import Graph, Node
from cgraph.extend import require_graph

from .formulations import COUPLING


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
    >>> [len(dyn.spurious_nodes(dyn.momentum_rate(spring, name))) for name in ("chain_rule", "euler_embedded")]
    [0, 13]
    """
    require_graph("spurious_nodes", graph)
    coupling = {node for node in graph.nodes if COUPLING in node.tags and "adjoint" in node.roles}
    needed: set[Node] = set()
    stack = [node for node in graph.outputs.values() if node not in coupling]
    while stack:
        node = stack.pop()
        if node not in needed:
            needed.add(node)
            stack.extend(arg for arg in node.args if arg not in coupling)
    return frozenset(node for node in graph.nodes if node not in needed)
