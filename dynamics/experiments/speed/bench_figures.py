"""Figures of the bench beside speed: their names, what they tell, and the numbers that one may choose."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple


class BenchFigure(NamedTuple):
    """A figure.  home: the function that prints it, as folder.module.name.  takes: of links, repeats, count."""

    about: str
    home: str
    takes: tuple[str, ...]

    def run(self, **numbers: int) -> Iterator[str]:
        """Texts to print. The module is imported now."""
        module, _, name = self.home.rpartition(".")
        parts: Iterator[str] = getattr(import_module(f"..{module}", __package__), name)(**numbers)
        return parts


FIGURES = {
    "counts": BenchFigure(
        "nodes of forward dynamics, and what leaving out one idea adds", "speed.node_counts.node_counts", ("links",)
    ),
    "operations": BenchFigure(
        "products and sums of robots' equations beside published ones",
        "speed.operation_counts.operation_counts",
        ("links",),
    ),
    "build": BenchFigure(
        "time to build the graph of forward dynamics", "speed.stages.build_time", ("links", "repeats")
    ),
    "compile": BenchFigure("time to compile chains, and derivatives of them", "speed.stages.compile_time", ("links",)),
    "agreement": BenchFigure(
        "largest differences from MuJoCo and Pinocchio", "speed.agreement.agreement", ("links", "count")
    ),
    "ensembles": BenchFigure(
        "many pendulums beside MuJoCo's rollout and JAX's vmap", "speed.ensembles.ensembles", ("count", "repeats")
    ),
    "reconfiguration": BenchFigure(
        "first torque after a change of structure", "speed.reconfiguration.reconfiguration", ("links", "repeats")
    ),
    "trust": BenchFigure(
        "random motions with exact answers: runs right, said to be wrong, silent",
        "trust.cascades.with_cascades",
        ("count",),
    ),
    "tightest": BenchFigure(
        "random Lagrangians as exactly as float64 has them, beside heyoka", "trust.tightest.tightest", ("count",)
    ),
    "closed-chains": BenchFigure(
        "chains pinned at the tip beside Pinocchio and MuJoCo", "speed.closed_chains.closed_chains", ("repeats",)
    ),
    "long-chains": BenchFigure(
        "cost of a thousand links, and accuracy of long chains", "speed.stages.long_chains", ("links",)
    ),
}
