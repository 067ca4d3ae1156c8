"""What each idea saves in nodes of forward dynamics: `python tests/benchmarks/node_counts.py`.

Counts with every idea, then with one of them left out at a time. The library has no switches, so a variant is made
here, by another Lagrangian or by replacing one function. Also how the counts of planar chains grow. Exact, no times.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph import Node
from cgraph.autodiff.reverse import cotangents
from cgraph.core.label import building
from cgraph.simplify import builder as fold
from cgraph.simplify.builder import Builder
from dynamics.equations import equations_of_motion as equations
from dynamics.experiments.paper_numbers.fit import exponent
from dynamics.experiments.speed.bench_scenes import binary_tree, turned_arm
from dynamics.multibody import link as links, mechanism, spatial
from dynamics.multibody.planar_arm import planar_links
from dynamics.systems.system import BodySystem

solving = sys.modules["cgraph.autodiff.hessian_solve"]  # the module; `cgraph.hessian_solve` is the function
solve_nodes, rates = solving.solve_nodes, equations.rates
PLANAR = (3, 10, 20, 50, 100, 200)


def planar(n: int) -> dyn.Mechanism:
    """A planar chain of equal rods."""
    return dyn.planar_arm([0.9] * n, [0.7] * n, damping=0.1)


MODELS: dict[str, Callable[[], Any]] = {f"planar {n}": lambda n=n: planar(n) for n in PLANAR} | {
    "arm 7": lambda: turned_arm(7),
    "arm 30": lambda: turned_arm(30),
    "tree 15": lambda: binary_tree(15),
}


def about_centers(arm: dyn.Mechanism) -> dyn.System:
    """The planar chain with the velocity of each centre of mass: K = m v.v / 2 + I w^2 / 2."""

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node) -> Iterator[Node]:
        angle, omega, gravity = q[0], qd[0], -float(np.asarray(arm.gravity)[2])
        x, y, height = cg.constant(0.0), cg.constant(0.0), cg.constant(0.0)
        for i, link in enumerate(planar_links(arm)):
            if i:
                angle, omega = angle + q[i], omega + qd[i]
            s, c = cg.sin(angle), cg.cos(angle)

            def along(r: float, w: Node = omega, s: Node = s, c: Node = c) -> tuple[Node, Node, Node]:
                return x + r * w * c, y + r * w * s, height - r * c  # noqa: B023 (called in this turn of the loop)

            u, v, h = along(link.center)
            kinetic = 0.5 * link.mass * (u * u + v * v) + 0.5 * link.inertia * (omega * omega)
            yield kinetic - link.mass * gravity * h
            x, y, height = along(link.length)

    return dyn.System(lagrangian, [f"joint {i + 1}" for i in range(len(planar_links(arm)))], damping=arm.system.damping)


def body_about_center(motion: Any, link: Any, q: Node, qd: Node) -> Node:
    """The same for a body in space, in place of the mechanism's own energy."""
    center = np.array([float(each) for each in link.moment]) / link.mass
    lower = np.array([[link.inertia[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)])
    inertia = lower - spatial.about(np.zeros((3, 3)), link.mass, center)
    own = links._in_own_axes(motion)
    offset = spatial.constant(center)
    omega, v = own.omega, spatial.plus(own.velocity, spatial.cross(own.omega, offset))
    spin = spatial.total([float(inertia[i, j]) * (omega[i] * omega[j]) for i in range(3) for j in range(3)])
    height = motion.height + spatial.dot(own.up, offset)
    return 0.5 * link.mass * spatial.dot(v, v) + 0.5 * spin - link.mass * height


def pulled(output: Node, wrt: Sequence[Node], rhs: Sequence[Node], build: Builder, **options: Any) -> list[Node]:
    """Solve after the inertial terms have been carried to the coordinates, not by the elimination."""
    more = cotangents(options.pop("at"), wrt, build)
    with building(build):
        rhs = [a + b for a, b in zip(rhs, more, strict=True)]
    return solve_nodes(output, wrt, rhs, build, **options)


def lu_solve(lower: Sequence[Sequence[Node]], rhs: Sequence[Node], build: Builder, *, positive: bool) -> list[Node]:
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


def without(op: str, constant: float) -> Callable[..., Node | None]:
    """The folding rule of an operation, except where an argument is this constant."""
    rule = fold._RULES[cg.ops.OPS[op]]
    return lambda *args: None if any(arg.value == constant for arg in args) else rule(*args)


@contextmanager
def unshared(*ops: str) -> Iterator[None]:
    """These operations (none: all) are made anew each time they are asked for."""
    build = Builder.__call__

    def anew(self: Builder, op: Any, args: tuple[Node, ...], label: Any, name: str | None = None) -> Node:
        self.__dict__.setdefault("kept", []).append(args)  # the ids in the table must stay in use
        if not ops or op.name in ops:
            self._made.clear() if not ops else self._made.pop((op.name, *map(id, args)), None)
        return build(self, op, args, label, name)

    with mock.patch.object(Builder, "__call__", anew):
        yield


def rules(**changed: Any) -> AbstractContextManager[Any]:
    """Other folding rules for operations by name; None for no rule."""
    return mock.patch.dict(fold._RULES, {cg.ops.OPS[op]: rule or (lambda *_: None) for op, rule in changed.items()})


def replaced(place: Any, name: str, value: Any) -> AbstractContextManager[Any]:
    return mock.patch.object(place, name, value)


# name: (what is replaced, of which size on it takes too long)
Variant = tuple[Callable[[], AbstractContextManager[Any]], int]
VARIANTS: dict[str, Variant] = {
    "every idea": (nullcontext, 10**6),
    "energy by the centre's velocity": (lambda: replaced(mechanism, "energy", body_about_center), 10**6),
    "no rates but qd": (lambda: replaced(equations, "rates", lambda output, q, qd, t, build: list(qd)), 10**6),
    "inertial terms carried apart": (lambda: replaced(equations, "solve_nodes", pulled), 10**6),
    "bias from the Lagrangian": (lambda: replaced(BodySystem, "bias_forces", lambda system: None), 10**6),
    "rotations product by product": (lambda: replaced(solving, "rotations", lambda *_: []), 10**6),
    "dense": (lambda: replaced(equations, "SHORT", 0), 15),
    "dense, without symmetry": (lambda: replaced(equations, "ldl_solve", lu_solve), 15),
    "sine and cosine not shared": (lambda: unshared("sin", "cos"), 100),
    "no zeros left out": (lambda: rules(**{op: without(op, 0.0) for op in ("add", "sub", "mul", "div")}), 20),
    "no folding but of constants": (lambda: rules(**{op.name: None for op in fold._RULES}), 20),
    "nothing shared": (unshared, 20),
}


def count(variant: str, model: Any) -> int:
    """Nodes of forward dynamics by elimination, or dense where the variant says so."""
    if variant == "energy by the centre's velocity" and model.coordinates[0] == "joint 1":
        model = about_centers(model)
    with VARIANTS[variant][0]():
        return len(dyn.forward_dynamics(model, "dense" if "dense" in variant else "recursive").nodes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=200, help="coordinates of the largest model (default: 200)")
    arguments = parser.parse_args()
    models = {name: each for name, each in MODELS.items() if int(name.split()[1]) <= arguments.largest}
    print(f"{'nodes of forward dynamics':32}" + "".join(f"{name:>12}" for name in models) + "    exponent, n >= 10")
    base: dict[str, int] = {}
    for variant, (_, most) in VARIANTS.items():
        cells, planar_counts = [], {}
        for name, make in models.items():
            n = int(name.split()[1])
            if n > most:
                cells.append(f"{'':12}")
                continue
            nodes = count(variant, make())
            base.setdefault(name, nodes)
            cells.append(f"{nodes:12}" if variant == "every idea" else f"{nodes / base[name] - 1.0:+12.1%}")
            if name.startswith("planar") and n >= 10:
                planar_counts[n] = nodes
        slope = f"{exponent(list(planar_counts), list(planar_counts.values())):12.3f}" if len(planar_counts) > 1 else ""
        print(f"{variant:32}" + "".join(cells) + slope, flush=True)


if __name__ == "__main__":
    main()
