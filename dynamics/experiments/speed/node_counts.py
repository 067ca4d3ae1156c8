"""Node counts: forward dynamics as it is and with one idea of the library left out, and how counts grow with the links.

A variant is another way to write or to solve the same equations, through the public functions. Exact, no times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from cgraph import Graph

from ...equations.equations_of_motion import forward_dynamics
from ...equations.mass_matrix.accelerations import accelerations
from ...multibody.builders.planar_arm import planar_links
from ...multibody.trees.mechanism import Mechanism
from ...systems.system import System
from ..paper_numbers import exponent
from ..stability.single_evaluations import by_centers
from ..text_table import table
from .bench_scenes import binary_tree, chain, turned_arm

LARGEST = 200  # coordinates
PLANAR: dict[str, Callable[[int], Mechanism]] = {
    f"planar {n}": lambda n: chain(0.9, 0.7, n) for n in (3, 10, 20, 50, 100, LARGEST)
}
MODELS: dict[str, Callable[[int], Mechanism]] = PLANAR | {
    "arm 7": turned_arm,
    "arm 30": turned_arm,
    "tree 15": binary_tree,
}
FITTED_FROM = 10  # links; below, the fixed part of the graph bends the curve


@dataclass(frozen=True)
class Variant:
    """Forward dynamics of a mechanism in another way.  largest: coordinates up to which that takes bearable time."""

    graph: Callable[[Mechanism], Graph]
    largest: int = LARGEST
    planar: bool = False  # for planar arms alone


def from_lagrangian(model: Mechanism) -> Graph:
    """The bias by differentiating L, where bodies give it by Newton-Euler."""
    system = model.system
    partials = system.partial_lagrangians
    plain = System(lambda q, qd, t: partials, system.coordinates, damping=system.damping)
    return accelerations(plain, "recursive")


def of_centers(model: Mechanism) -> Graph:
    """A planar arm with the velocities of the centers of mass: K = m v.v / 2 + I w^2 / 2, and its bias from L."""
    links, gravity, system = planar_links(model), -float(np.asarray(model.gravity)[2]), model.system
    other = System(lambda q, qd, t: by_centers(q, qd, links, gravity), system.coordinates, damping=system.damping)
    return accelerations(other, "recursive")


VARIANTS = {
    "every idea": Variant(lambda model: forward_dynamics(model, "recursive")),
    "bias from the Lagrangian": Variant(from_lagrangian),
    "energy by the center's velocity": Variant(of_centers, planar=True),
    "dense": Variant(lambda model: forward_dynamics(model, "dense"), 15),
}


def node_counts(links: int = LARGEST) -> Iterator[str]:
    """The table of counts: of every idea in nodes, of the others relative to it. links: of the largest model."""
    sizes = {name: int(name.split()[1]) for name in MODELS if int(name.split()[1]) <= links}
    rows = []
    base: dict[str, int] = {}
    for name, variant in VARIANTS.items():
        chosen = [
            model for model in sizes if sizes[model] <= variant.largest and (model in PLANAR or not variant.planar)
        ]
        nodes = {model: len(variant.graph(MODELS[model](sizes[model])).nodes) for model in chosen}
        base = base or nodes
        cells = {model: f"{k}" if base is nodes else f"{k / base[model] - 1.0:+.1%}" for model, k in nodes.items()}
        fitted = {sizes[model]: k for model, k in nodes.items() if model in PLANAR and sizes[model] >= FITTED_FROM}
        slope = f"{exponent(list(fitted), list(fitted.values())):.3f}" if len(fitted) > 1 else ""
        rows.append([name, *[cells.get(model, "") for model in sizes], slope])
    yield "\n".join(table(["nodes of forward dynamics", *sizes, "exponent, n >= 10"], rows))
