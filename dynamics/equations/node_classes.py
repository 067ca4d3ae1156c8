"""Classes of the nodes of a formulation: needed, Euler edge or spurious."""

from __future__ import annotations

from collections.abc import Callable

from cgraph import Graph, Node
from cgraph.extend import ADJOINT

from .formulations import EULER, spurious_nodes


def formulation_classes(graph: Graph) -> Callable[[Node], str]:
    """The class of each node of a graph of `inverse_dynamics`, as `cg.compare` asks for it.

    "spurious adjoint": it serves only derivatives through q = qd dt + q_old.  "Euler edge": the embedded relations
    q = qd dt + q_old and qd = qdd dt + qd_old, and their rates.  "needed": all else.
    """
    wrong = spurious_nodes(graph)

    def name(node: Node) -> str:
        if node in wrong:
            return "spurious adjoint"
        return "Euler edge" if EULER in node.tags and ADJOINT not in node.roles else "needed"

    return name
