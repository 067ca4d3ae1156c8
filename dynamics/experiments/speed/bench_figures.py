"""Figures of the bench beside speed: their names, what they tell, and the numbers that one may choose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from ..trust.cascades import with_cascades
from ..trust.tightest import tightest
from .agreement import agreement
from .build_time import build_time
from .closed_chains import closed_chains
from .compile_time import compile_time
from .ensembles import ensembles
from .long_chains import long_chains
from .node_counts import node_counts
from .operation_counts import operation_counts
from .reconfiguration import reconfiguration


class BenchFigure(NamedTuple):
    """What is printed, part by part.  takes: of links, repeats and count."""

    about: str
    run: Callable[..., Iterator[str]]
    takes: tuple[str, ...]


FIGURES = {
    "counts": BenchFigure("nodes of forward dynamics, and what leaving out one idea adds", node_counts, ("links",)),
    "operations": BenchFigure(
        "products and sums of robots' equations beside published ones", operation_counts, ("links",)
    ),
    "build": BenchFigure("time to build the graph of forward dynamics", build_time, ("links", "repeats")),
    "compile": BenchFigure("time to compile chains, and derivatives of them", compile_time, ("links",)),
    "agreement": BenchFigure("largest differences from MuJoCo and Pinocchio", agreement, ("links", "count")),
    "ensembles": BenchFigure("many pendulums beside MuJoCo's rollout and JAX's vmap", ensembles, ("count", "repeats")),
    "reconfiguration": BenchFigure("first torque after a change of structure", reconfiguration, ("links", "repeats")),
    "trust": BenchFigure(
        "random motions with exact answers: runs right, said to be wrong, silent", with_cascades, ("count",)
    ),
    "tightest": BenchFigure("random Lagrangians as exactly as float64 has them, beside heyoka", tightest, ("count",)),
    "closed-chains": BenchFigure("chains pinned at the tip beside Pinocchio and MuJoCo", closed_chains, ("repeats",)),
    "long-chains": BenchFigure("cost of a thousand links, and accuracy of long chains", long_chains, ("links",)),
}
