"""Scaling: nodes, edges and time of each formulation as links are added."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import cgraph as cg

from ...equations.formulations.formulations import inverse_dynamics
from ...multibody.builders.planar_arm import planar_arm
from .fit import exponent

COUNTS = (1, 2, 3, 4, 6, 8, 10, 14, 20, 28, 40)
FITTED_FROM = 6  # links; below, the fixed part of the graph bends the curve
SCALED = ("euler_embedded", "kinetic_only", "chain_rule", "chain_rule_literal")


@dataclass(frozen=True)
class NodeScaling:
    """One formulation over chains of n equal rods; exponents are fitted over n >= 6."""

    formulation: str
    n: tuple[int, ...]
    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    microseconds: tuple[float, ...]  # one compiled evaluation, best of several

    def fitted(self, values: Sequence[float]) -> float:
        """The exponent of `values`, one of this row's columns, over n >= 6."""
        kept = [(n, value) for n, value in zip(self.n, values, strict=True) if n >= FITTED_FROM]
        return exponent(*zip(*kept, strict=True))


def node_scaling(
    counts: Sequence[int] = COUNTS, report: Callable[[float], None] = lambda done: None
) -> list[NodeScaling]:
    """Each formulation of `SCALED` over arms of `counts` links. report: called with the share done."""
    rows = []
    total = len(SCALED) * sum(n * n for n in counts)
    done = 0
    for formulation in SCALED:
        nodes, edges, micros = [], [], []
        for n in counts:
            graph = inverse_dynamics(planar_arm([1.0] * n, [1.0] * n), formulation)
            nodes.append(len(graph.nodes))
            edges.append(len(graph.edges))
            micros.append(_microseconds(graph))
            done += n * n
            report(done / total)
        rows.append(NodeScaling(formulation, tuple(counts), tuple(nodes), tuple(edges), tuple(micros)))
    return rows


def _microseconds(graph: cg.Graph, repeats: int = 7) -> float:
    function = cg.compile(graph, "python").values
    x = np.random.default_rng(0).normal(size=len(graph.inputs)).tolist()
    best = float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(10):
            function(x)
        best = min(best, (time.perf_counter() - start) / 10)
    return best * 1e6
