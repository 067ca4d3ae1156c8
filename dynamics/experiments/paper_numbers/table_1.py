"""Table 1: what one evaluation of each formulation costs on the three-link arm."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import cgraph as cg
from cgraph import Counts

from ...equations.formulations.formulations import inverse_dynamics
from ...peers.torch import eager_evaluations
from ...scenes.scenes import triple_pendulum

# The paper's Table 1: mean and standard deviation over 1000 evaluations, in ms.
PAPER_MS = {"euler_embedded": (51.7, 9.62), "kinetic_only": (43.8, 8.03), "chain_rule": (6.29, 1.15)}


@dataclass(frozen=True)
class Timing:
    """Median and quartiles of one evaluation, in microseconds: one interruption does not move them."""

    median: float
    lower: float  # a quarter of the evaluations take less
    upper: float  # a quarter take more


@dataclass(frozen=True)
class Row:
    """One formulation: its graph's size and its cost by each way of evaluating it."""

    formulation: str
    counts: Counts
    timings: dict[str, Timing]  # {"interpreted" | "compiled" | "PyTorch eager": ...}


def table_1(evaluations: int = 1000, seed: int = 0) -> list[Row]:
    """The three formulations, each evaluated at random states; formulations take turns, so that drift is shared.

    PyTorch eager, which builds its graph anew at every evaluation, is measured beside ours where torch is installed.
    """
    scene = triple_pendulum()
    graphs = {name: inverse_dynamics(scene, name) for name in PAPER_MS}
    runs: dict[str, Mapping[str, Callable[[np.ndarray], object]]] = {
        "interpreted": {name: _interpreted(graph) for name, graph in graphs.items()},
        "compiled": {name: cg.compile(graph, "python") for name, graph in graphs.items()},
    }
    if eager := eager_evaluations(scene.system, PAPER_MS):
        runs["PyTorch eager"] = eager
    rng = np.random.default_rng(seed)
    states = {
        name: np.where([x == "dt" for x in graph.input_names], 1e-3, rng.normal(size=(evaluations, len(graph.inputs))))
        for name, graph in graphs.items()
    }
    timings: dict[str, dict[str, Timing]] = {name: {} for name in graphs}
    for way, functions in runs.items():
        taken = np.empty((len(graphs), evaluations))
        for name, function in functions.items():
            function(states[name][0])  # warm
        for k in range(evaluations):
            for row, (name, function) in enumerate(functions.items()):
                start = time.perf_counter()
                function(states[name][k])
                taken[row, k] = time.perf_counter() - start
        for row, name in enumerate(functions):
            timings[name][way] = timing(taken[row])
    return [Row(name, graph.counts(), timings[name]) for name, graph in graphs.items()]


def timing(seconds: np.ndarray) -> Timing:
    """The median and quartiles of times [s]."""
    return Timing(*[float(share) * 1e6 for share in np.quantile(seconds, (0.5, 0.25, 0.75))])


def _interpreted(graph: cg.Graph) -> Callable[[np.ndarray], object]:
    names = graph.input_names
    return lambda x: graph.evaluate(dict(zip(names, x.tolist(), strict=True)))
