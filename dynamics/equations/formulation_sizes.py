"""Sizes of the formulations' graphs, and how much of each is there by mistake: what figures and lessons count."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from cgraph import Graph

from ..systems.model import Model
from .formulations import inverse_dynamics, momentum_rate, spurious_nodes

PAPER = ("euler_embedded", "kinetic_only", "chain_rule")  # of Figures 1 to 3, in this order
INERTIAL_TERM, TORQUE = "p and dp/dt", "tau"
TERMS: dict[str, Callable[[Model, str], Graph]] = {
    INERTIAL_TERM: partial(momentum_rate, keep_momentum=True),  # drawn in Figures 1 to 3
    TORQUE: inverse_dynamics,  # what `lint`, `why` and the inspector look at
}


class FormulationSize(NamedTuple):
    """Nodes, edges and depth of a graph, and the nodes of `spurious_nodes` with the edges out of them."""

    nodes: int
    edges: int
    depth: int
    spurious_nodes: int
    spurious_edges: int


def formulation_size(graph: Graph) -> FormulationSize:
    """The size of one graph of `inverse_dynamics` or `momentum_rate`, by any formulation."""
    wrong, counts = spurious_nodes(graph), graph.counts()
    edges = sum([edge.source in wrong for edge in graph.edges])
    return FormulationSize(counts.nodes, counts.edges, counts.depth, len(wrong), edges)


def formulation_sizes(model: Model) -> dict[tuple[str, str], FormulationSize]:
    """The sizes of the graphs of the inertial term and of the whole torque, by the paper's three formulations.

    The two count differently, since the torque tau = dp/dt - dL/dq needs the branch of dL/dq by right: what serves it,
    too, is not there by mistake; and since the momentum p is an output of the first alone.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.

    Returns
    -------
    dict of (str, str) to FormulationSize
        {(term, formulation): size}; terms are "p and dp/dt", drawn in Figures 1 to 3, and "tau", what `cgraph lint` and
        `cgraph inspect` look at.

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> sizes = dyn.formulation_sizes(dyn.scenes.load("spring_mass"))
    >>> [(term, size.spurious_nodes, size.nodes) for (term, name), size in sizes.items() if name == "euler_embedded"]
    [('p and dp/dt', 10, 20), ('tau', 4, 18)]
    """
    return {
        (term, formulation): formulation_size(graph_of(model, formulation))
        for term, graph_of in TERMS.items()
        for formulation in PAPER
    }
