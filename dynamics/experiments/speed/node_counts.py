"""Node counts: what each idea of the library saves in nodes of forward dynamics, and how counts grow with the links.

Counts with every idea, then with one of them left out at a time. The library has no switches for its ideas, so a
variant is made here, by another Lagrangian or by replacing one of the library's functions while its graph is built.
Exact, no times.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np

from cgraph import Graph, Node
from cgraph.extend import OPS, Builder, building, cotangents, solve_nodes

from ...equations import equations_of_motion
from ...equations.equations_of_motion import forward_dynamics
from ...multibody import link as links_module, mechanism
from ...multibody.planar_arm import PlanarArm
from ...systems.model import Model
from ...systems.system import BodySystem, System
from ..paper_numbers.fit import exponent
from ..planar_by_centers import by_centers
from ..text_table import table
from .bench_scenes import binary_tree, chain, turned_arm

LARGEST = 200  # coordinates
MODELS: dict[str, Callable[[int], Any]] = {
    **{f"planar {n}": lambda n: chain(0.9, 0.7, n) for n in (3, 10, 20, 50, 100, LARGEST)},
    "arm 7": turned_arm,
    "arm 30": turned_arm,
    "tree 15": binary_tree,
}
FITTED_FROM = 10  # links; below, the fixed part of the graph bends the curve

# By the names of the modules, which are no interface; importing cgraph loads both.
folding, solving = sys.modules["cgraph.simplify.builder"], sys.modules["cgraph.autodiff.hessian_solve"]


def about_centers(arm: PlanarArm) -> System:
    """The planar chain with the velocity of the centers of mass."""
    names = [f"joint {i + 1}" for i in range(len(arm.links))]
    return System(lambda q, qd, t: by_centers(q, qd, arm.links, arm.gravity), names, damping=arm.damping)


def body_about_center(motion: Any, link: Any, q: Node, qd: Node) -> Node:
    """The same for a body in space, in place of the mechanism's own energy."""
    center = np.array([float(each) for each in link.moment]) / link.mass
    lower = np.array([[link.inertia[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)])
    inertia = lower - link.mass * (center @ center * np.eye(3) - np.outer(center, center))
    body = links_module._in_own_axes(motion)
    (x, y, z), (a, b, c) = body.omega, center.tolist()
    v = [m + k for m, k in zip(body.velocity, (y * c - z * b, z * a - x * c, x * b - y * a), strict=True)]
    spin = sum(float(inertia[i, j]) * (body.omega[i] * body.omega[j]) for i in range(3) for j in range(3))
    height = motion.height + sum(float(k) * up for k, up in zip(center, body.up, strict=True))
    kinetic = 0.5 * link.mass * sum(k * k for k in v) + 0.5 * spin
    result: Node = kinetic - link.mass * height
    return result


def apart(output: Node, wrt: Sequence[Node], rhs: Sequence[Node], build: Builder, **options: Any) -> list[Node]:
    """Solve after the inertial terms have been pulled to the coordinates, not by the elimination."""
    more = cotangents(options.pop("at"), wrt, build)
    with building(build):
        rhs = [a + b for a, b in zip(rhs, more, strict=True)]
    return solve_nodes(output, wrt, rhs, build, **options)


def lu_solve(lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder, **_: Any) -> list[Node]:
    """The dense solve without symmetry: both halves of the matrix are eliminated."""
    n, b = len(rhs), list(rhs)
    a = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    with building(build):
        for i in reversed(range(n)):
            for j in range(i):
                gain = a[j][i] / a[i][i]
                a[j] = [a[j][k] - gain * a[i][k] for k in range(i)]
                b[j] = b[j] - gain * b[i]
        x: list[Node] = []
        for i in range(n):
            total = b[i]
            for k in range(i):
                total = total - a[i][k] * x[k]
            x.append(total / a[i][i])
    return x


def keeping(op: str, constant: float) -> Callable[..., Node | None]:
    """The folding rule of an operation, except where an argument is this constant."""
    rule = folding._RULES[OPS[op]]
    return lambda *args: None if any(arg.value == constant for arg in args) else rule(*args)


@contextmanager
def unshared(*ops: str) -> Iterator[None]:
    """These operations (none: all) are built anew each time they are asked for."""
    build = Builder.__call__

    def anew(self: Any, op: Any, args: tuple[Node, ...], label: Any, name: str | None = None) -> Node:
        self.__dict__.setdefault("kept", []).append(args)  # the ids in the table must stay in use
        if not ops or op.name in ops:
            self._made.clear() if not ops else self._made.pop((op.name, *map(id, args)), None)
        return build(self, op, args, label, name)

    with replaced(Builder, "__call__", anew):
        yield


def rules(**changed: Any) -> AbstractContextManager[None]:
    """Other folding rules for operations by name; None for no rule."""
    others = {OPS[op]: rule or (lambda *_: None) for op, rule in changed.items()}
    return replaced(folding, "_RULES", folding._RULES | others)


@contextmanager
def replaced(place: Any, name: str, value: Any) -> Iterator[None]:
    """Something of the library replaced while a graph is built."""
    kept = getattr(place, name)
    setattr(place, name, value)
    try:
        yield
    finally:
        setattr(place, name, kept)


# name: (what is replaced, up to which size that takes bearable time)
VARIANTS: dict[str, tuple[Callable[[], AbstractContextManager[Any]], int]] = {
    "every idea": (nullcontext, LARGEST),
    "energy by the center's velocity": (lambda: replaced(mechanism, "energy", body_about_center), LARGEST),
    "no rates but qd": (lambda: replaced(equations_of_motion, "rates", lambda _, q, qd, *rest: list(qd)), LARGEST),
    "inertial terms apart": (lambda: replaced(equations_of_motion, "solve_nodes", apart), LARGEST),
    "bias from the Lagrangian": (lambda: replaced(BodySystem, "bias_forces", lambda system: None), LARGEST),
    "rotations product by product": (lambda: replaced(solving, "rotations", lambda *_: []), LARGEST),
    "dense": (nullcontext, 15),
    "dense, without symmetry": (lambda: replaced(equations_of_motion, "ldl_solve", lu_solve), 15),
    "sine and cosine not shared": (lambda: unshared("sin", "cos"), 100),
    "no zeros left out": (lambda: rules(**{op: keeping(op, 0.0) for op in ("add", "sub", "mul", "div")}), 20),
    "no folding but of constants": (lambda: rules(**{op.name: None for op in folding._RULES}), 20),
    "nothing shared": (unshared, 20),
}


def variant_graph(variant: str, model: Model) -> Graph:
    """Forward dynamics by elimination, or dense where the variant says so."""
    if variant == "energy by the center's velocity" and isinstance(model, PlanarArm):
        model = about_centers(model)
    with VARIANTS[variant][0]():
        return forward_dynamics(model, "dense" if "dense" in variant else "recursive")


def node_counts(links: int = LARGEST) -> Iterator[str]:
    """The table of counts: of every idea in nodes, of the others relative to it. links: of the largest model."""
    sizes = {name: int(name.split()[1]) for name in MODELS if int(name.split()[1]) <= links}
    rows = []
    base: dict[str, int] = {}
    for variant, (_, most) in VARIANTS.items():
        nodes = {name: len(variant_graph(variant, MODELS[name](n)).nodes) for name, n in sizes.items() if n <= most}
        base = base or nodes
        cells = {name: f"{k}" if base is nodes else f"{k / base[name] - 1.0:+.1%}" for name, k in nodes.items()}
        fitted = {sizes[name]: k for name, k in nodes.items() if name[0] == "p" and sizes[name] >= FITTED_FROM}
        slope = f"{exponent(list(fitted), list(fitted.values())):.3f}" if len(fitted) > 1 else ""
        rows.append([variant, *[cells.get(name, "") for name in sizes], slope])
    yield "\n".join(table(["nodes of forward dynamics", *sizes, "exponent, n >= 10"], rows))
