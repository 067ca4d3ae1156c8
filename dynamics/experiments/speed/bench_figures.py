"""Figures of the bench beside speed: their names, what they tell, and the numbers that one may choose."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple


class BenchFigure(NamedTuple):
    """A figure.  home: the function that prints it part by part, as module.name.  takes: of links, repeats, count."""

    about: str
    home: str
    takes: tuple[str, ...]

    def run(self, **numbers: int) -> Iterator[str]:
        """What is printed. The module is imported now."""
        module, name = self.home.split(".")
        parts: Iterator[str] = getattr(import_module(f".{module}", __package__), name)(**numbers)
        return parts


FIGURES = {
    "counts": BenchFigure(
        "nodes of forward dynamics, and what leaving out one idea adds", "node_counts.node_counts", ("links",)
    ),
    "build": BenchFigure("time to build the graph of forward dynamics", "stages.build_time", ("links", "repeats")),
    "compile": BenchFigure("time to compile chains, and derivatives of them", "stages.compile_time", ("links",)),
    "agreement": BenchFigure(
        "largest differences from MuJoCo and Pinocchio", "agreement.agreement", ("links", "count")
    ),
    "ensembles": BenchFigure(
        "many pendulums beside MuJoCo's rollout and JAX's vmap", "ensembles.ensembles", ("count", "repeats")
    ),
    "reconfiguration": BenchFigure(
        "first torque after a change of structure", "reconfiguration.reconfiguration", ("links", "repeats")
    ),
    "closed-chains": BenchFigure(
        "chains pinned at the tip beside Pinocchio and MuJoCo", "closed_chains.closed_chains", ("repeats",)
    ),
    "long-chains": BenchFigure(
        "cost of a thousand links, and accuracy of long chains", "stages.long_chains", ("links",)
    ),
}
