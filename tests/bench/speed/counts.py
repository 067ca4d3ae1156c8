"""Counts: nodes of forward dynamics with an idea left out, and operations of robots beside published ones. No times.

A variant is another way to write or to solve the same equations, through the public functions.

Robots are rows of modified Denavit-Hartenberg numbers, every body with ten general inertial numbers, gravity along the
first axis, no friction. Sines and cosines are counted apart. Formulas are those of R. Featherstone, "Rigid Body
Dynamics Algorithms" (2008), tables 6.6 and 10.1, equation 10.3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cgraph import Graph
from dynamics.equations.equations_of_motion import forward_dynamics, mass_matrix
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.equations.mass_matrix.accelerations import accelerations
from dynamics.experiments.stability.single_evaluations import by_centers
from dynamics.experiments.timing import exponent
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.bodies.body import WORLD, Body, Joint
from dynamics.multibody.builders import planar_arm, planar_links
from dynamics.multibody.trees.mechanism import Mechanism
from dynamics.systems.system import System
from tests.bench.tables import Table
from viz.paper.mechanisms import binary_tree, chain, inertial_numbers, turned_arm

LARGEST_COUNTED = 200  # coordinates
CHAINS: dict[str, Callable[[int], Mechanism]] = {
    f"planar {n}": lambda n: chain(0.9, 0.7, n) for n in (3, 10, 20, 50, 100, LARGEST_COUNTED)
}
COUNTED = CHAINS | {"arm 7": turned_arm, "arm 30": turned_arm, "tree 15": binary_tree}
FITTED_FROM = 10  # links; below, the fixed part of the graph bends the curve


@dataclass(frozen=True)
class Variant:
    """Forward dynamics of a mechanism in another way.  largest: coordinates up to which that takes bearable time."""

    graph: Callable[[Mechanism], Graph]
    largest: int = LARGEST_COUNTED
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


def node_counts(links: int = LARGEST_COUNTED) -> Iterator[Table]:
    """The table of counts: of every idea in nodes, of the others relative to it. links: of the largest model.

    Raises ValueError for fewer links than the smallest model has.
    """
    all_sizes = {name: int(name.split()[1]) for name in COUNTED}
    sizes = {name: size for name, size in all_sizes.items() if size <= links}
    if not sizes:
        raise ValueError(f"the smallest model that is counted has {min(all_sizes.values())} links, got links = {links}")
    rows = []
    base: dict[str, int] = {}
    for name, variant in VARIANTS.items():
        chosen = [
            model for model in sizes if sizes[model] <= variant.largest and (model in CHAINS or not variant.planar)
        ]
        nodes = {model: len(variant.graph(COUNTED[model](sizes[model])).nodes) for model in chosen}
        base = base or nodes
        cells = {model: f"{k}" if base is nodes else f"{k / base[model] - 1.0:+.1%}" for model, k in nodes.items()}
        fitted = {sizes[model]: k for model, k in nodes.items() if model in CHAINS and sizes[model] >= FITTED_FROM}
        slope = f"{exponent(list(fitted), list(fitted.values())):.3f}" if len(fitted) > 1 else ""
        rows.append([name, *[cells.get(model, "") for model in sizes], slope])
    yield Table("", ["nodes of forward dynamics", *sizes, "exponent, n >= 10"], rows)


Row = tuple[float, float, float] | tuple[float, float, float, str]  # alpha [degrees], a, d [m]; "prismatic"
SLIDE = "prismatic"
# fmt: off   (rows of numbers)
ROBOTS: dict[str, Sequence[Row]] = {
    "PUMA 560": ((0, 0, 0), (-90, 0, 0.2435), (0, 0.4318, -0.0934), (-90, 0.0203, 0.4331), (90, 0, 0), (-90, 0, 0)),
    "Stanford arm": ((0, 0, 0), (-90, 0, 0.1524), (90, 0, 0, SLIDE), (0, 0, 0), (-90, 0, 0), (90, 0, 0)),
    "RX90": ((0, 0, 0), (90, 0, 0), (0, 0.45, 0), (-90, 0, 0.45), (90, 0, 0), (-90, 0, 0)),
    "7R arm": ((0, 0, 0.34), (-90, 0, 0), (90, 0, 0.4), (90, 0, 0), (-90, 0, 0.4), (-90, 0, 0), (90, 0, 0.126)),
}
# fmt: on
GENERAL, PLANAR = (6, 7, 12, 18, 30), (3, 4, 5, 7, 10, 15, 20)
LARGEST = 30  # links
SYMORO = {  # inverse dynamics, mass matrix, forward dynamics of base numbers, run on the same robots
    "PUMA 560": (568, 459, 1729),
    "Stanford arm": (473, 248, 1206),
    "RX90": (513, 327, 1422),
    "7R arm": (624, 462, 1807),
}


class Operations(NamedTuple):
    """Operations of one graph.  turns: sines and cosines.  depth: operations on the longest path."""

    products: int
    sums: int
    divisions: int
    turns: int
    depth: int

    @property
    def total(self) -> int:
        """Products, sums and divisions."""
        return self.products + self.sums + self.divisions


def operations(graph: Graph) -> Operations:
    """The operations of a graph of bodies' equations."""
    counts = graph.counts()
    of = counts.by_operation
    sums = of.get("add", 0) + of.get("sub", 0)
    return Operations(of.get("mul", 0), sums, of.get("div", 0), of.get("sin", 0) + of.get("cos", 0), counts.depth)


def published_inverse(n: int) -> int:
    """93 n - 108 products, 81 n - 100 sums (Balafoutis and Patel 1991)."""
    return (93 * n - 108) + (81 * n - 100)


def published_mass_matrix(n: int) -> int:
    """Composite rigid bodies, 10 n^2 + 22 n - 32 products, 6 n^2 + 37 n - 43 sums."""
    return (10 * n * n + 22 * n - 32) + (6 * n * n + 37 * n - 43)


def published_forward(n: int) -> int:
    """The smaller of articulated bodies and of inverse dynamics, mass matrix, factors and solution together.

    224 n - 259 products, 205 n - 248 sums (McMillan, Orin and Ghosh 1995); for factors and solution
    n^3/6 + 3 n^2/2 - 2 n/3 products and divisions, n^3/6 + n^2 - 7 n/6 sums.
    """
    solved = (2 * n**3 + 15 * n * n - 11 * n) // 6
    dense = published_inverse(n) + published_mass_matrix(n) + solved
    return min((224 * n - 259) + (205 * n - 248), dense)


QUANTITIES: dict[str, tuple[Callable[[Mechanism], Graph], Callable[[int], int]]] = {
    "inverse dynamics": (inverse_dynamics, published_inverse),
    "mass matrix": (mass_matrix, published_mass_matrix),
    "forward dynamics": (forward_dynamics, published_forward),
}


def robot(rows: Sequence[Row]) -> Mechanism:
    """A chain of hinges and slides by their rows, with inertias of no symmetry."""
    rng = np.random.default_rng(1)
    bodies: list[Body] = []
    for i, (alpha, a, d, *kind) in enumerate(rows):
        turn = rotation(np.array([1.0, 0.0, 0.0]), math.radians(alpha))
        place = np.array([a, 0.0, 0.0]) + d * turn[:, 2]
        joint = Joint(str(kind[0]) if kind else "revolute", (0.0, 0.0, 1.0), place, turn)
        bodies.append(Body(f"link {i + 1}", joint, bodies[-1].name if bodies else WORLD, *inertial_numbers(rng)))
    return Mechanism(bodies, (0.0, 0.0, -9.81))


def general(n: int) -> list[Row]:
    """Rows of n hinges, all numbers general but the first's, whose axis is along gravity."""
    rng = np.random.default_rng(n)
    rows: list[Row] = [(0.0, 0.0, 0.0)]
    for _ in range(n - 1):
        alpha = float(rng.uniform(20.0, 70.0))
        a, d = rng.uniform(0.1, 0.5, 2).tolist()
        rows.append((alpha, a, d))
    return rows


def models(links: int = LARGEST) -> dict[str, Mechanism]:
    """The robots and chains of up to so many links, by name."""
    result = {name: robot(rows) for name, rows in ROBOTS.items() if len(rows) <= links}
    result |= {f"general {n}": robot(general(n)) for n in GENERAL if n <= links}
    unlike = [1.0, 0.8, 0.7]
    return result | {
        f"planar {n}": planar_arm(unlike, unlike) if n == len(unlike) else planar_arm([1.0] * n, [1.0] * n)
        for n in PLANAR
        if n <= links
    }


def published(what: str, name: str, n: int) -> str:
    """The figure of another for a model, as text; nothing of chains in a plane."""
    if name in SYMORO:
        return f"{SYMORO[name][list(QUANTITIES).index(what)]}"
    return f"{QUANTITIES[what][1](n)}" if name.startswith("general") else ""


def operation_counts(links: int = LARGEST) -> Iterator[Table | str]:
    """A table for each quantity. links: of the largest model.

    Raises ValueError for fewer links than the smallest model has.
    """
    if not models(links):
        raise ValueError(f"the smallest model that is counted has {min(PLANAR)} links, got links = {links}")
    for what, (equations, _) in QUANTITIES.items():
        rows = []
        for name, model in models(links).items():
            own, base = (operations(equations(each)) for each in (model, replace(model, base_parameters=True)))
            row = [name, f"{own.total}", *[f"{count}" for count in own], f"{base.total}"]
            row.append(published(what, name, len(model.moving)))
            if equations is inverse_dynamics:
                row.append(f"{operations(inverse_dynamics(model, 'chain_rule')).total}")
            rows.append(row)
        header = [what, "all", "products", "sums", "divisions", "sin, cos", "depth", "base", "published"]
        yield Table("", [*header, *["chain rule"] * (equations is inverse_dynamics)], rows)
        yield ""
