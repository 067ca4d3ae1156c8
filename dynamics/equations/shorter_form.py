"""Shorter form: a graph derived from a Lagrangian as written, or as written anew by identities if that is smaller."""

from __future__ import annotations

from collections.abc import Callable

import cgraph as cg
from cgraph import Graph, extend

from ..systems.body_system import BodySystem
from ..systems.system import System

LONGEST = 200  # nodes of a graph whose outputs are written anew


def shorter_form(system: System, derive: Callable[[System], Graph], *, mirrored: bool = False) -> Graph:
    """derive(system), or of the system's energies written anew by identities, or its outputs so, if that is smaller.

    mirrored: whether outputs are the same up to their sign, which to be to the last bit they must not be written anew.
    """
    graph = derive(system)
    if isinstance(system, BodySystem):  # bodies write their energy as short as it is
        return graph
    if system.shortened is not None:
        graph = min(graph, derive(system.shortened), key=_size)
    if mirrored or len(graph.nodes) > LONGEST:
        return graph
    outputs = dict(zip(graph.outputs, extend.shortened(list(graph.outputs.values())), strict=True))
    return min(graph, cg.simplify(Graph(graph.inputs, outputs)), key=_size)


def _size(graph: Graph) -> int:
    return len(graph.nodes)
