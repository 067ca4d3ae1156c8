"""Sizes of the formulations' graphs, and how much of each is there by mistake: what figures and lessons count."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import NamedTuple

from cgraph import Graph, Node

from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from .formulations import inverse_dynamics, momentum_rate
from .lagrange_terms import momenta, torques
from .verdict import Blame, blame, formulation_verdict

PAPER = ("by_definition", "kinetic_only", "chain_rule")  # of Figures 1 to 3, in this order
INERTIAL_TERM, TORQUE = "p and dp/dt", "tau"
TERMS: dict[str, tuple[Callable[[Model, str], Graph], Callable[[System, str, Node], Graph]]] = {
    INERTIAL_TERM: (partial(momentum_rate, keep_momentum=True), momenta),  # drawn in Figures 1 to 3
    TORQUE: (inverse_dynamics, torques),  # what `lint`, `why` and the inspector look at
}  # the graph, and as it is derived


class FormulationSize(NamedTuple):
    """Nodes, edges and depth of a graph, and what of it is there by mistake, as `formulation_verdict` has it.

    spurious_edges: those out of spurious nodes, and others by which what is wrong enters.
    missing_terms: outputs in which a wrong term has cancelled a right one, so that nothing is left to be counted.
    """

    nodes: int
    edges: int
    depth: int
    spurious_nodes: int
    spurious_edges: int
    missing_terms: int


def blamed(model: Model, term: str, formulation: str) -> tuple[Graph, Blame]:
    """The graph of a term by a formulation, and what is to blame in it, nothing where it does not differ."""
    derive, written = TERMS[term]
    graph = derive(model, formulation)
    differs = formulation_verdict(model, formulation).differs
    return graph, blame(as_system(model), formulation, written, graph) if differs else Blame()


@documented
def formulation_sizes(model: Model) -> dict[tuple[str, str], FormulationSize]:
    """The sizes of the graphs of the inertial term and of the whole torque, by the paper's three formulations.

    The two count differently, since the torque tau = dp/dt - dL/dq needs the branch of dL/dq by right: what serves it,
    too, is not there by mistake; and since the momentum p is an output of the first alone.

    Returns
    -------
    dict of (str, str) to FormulationSize
        {(term, formulation): size}; terms are "p and dp/dt", drawn in Figures 1 to 3, and "tau", what `cgraph lint` and
        `cgraph inspect` look at.

    Examples
    --------
    >>> import dynamics as dyn
    >>> sizes = dyn.formulation_sizes(dyn.scenes.load("spring_mass"))
    >>> [(term, size.spurious_nodes, size.nodes) for (term, name), size in sizes.items() if name == "by_definition"]
    [('p and dp/dt', 10, 20), ('tau', 4, 18)]
    """
    sizes = {}
    for term, formulation in product(TERMS, PAPER):
        graph, wrong = blamed(model, term, formulation)
        edges = sum([edge.source in wrong.nodes or edge in wrong.edges for edge in graph.edges])
        faults = len(wrong.nodes), edges, len(wrong.cancelled)
        sizes[term, formulation] = FormulationSize(len(graph.nodes), len(graph.edges), graph.counts().depth, *faults)
    return sizes
