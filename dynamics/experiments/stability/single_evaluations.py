"""Single evaluations: torques and accelerations in float64 beside fifty digits, in ulps of what rounding the data does.

For y = f(x), x all inputs and parameters (angles, velocities, torques or accelerations, of each link mass, length,
centre and inertia, damping, gravity), the error is
    max_i |y_i - exact_i| / (ulp max_i (|y_i| + sum_j |df_i/dx_j| |x_j|)),    ulp = 2^-52.
The sum is what a relative change of each x_j makes of y_i: the componentwise condition, in the maximum norm. So 1 is
what rounding the data once would do, whatever the algorithm. The derivatives are the graph's own (`cg.jvp`, of an arm
whose parameters are inputs), and so are the exact values: the same graph in 200 digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Compiled, Graph, Node
from cgraph._shared import Array

from ...equations.equations_of_motion import forward_dynamics
from ...equations.formulations.formulations import inverse_dynamics
from ...multibody.builders import PlanarLink, planar_arm, planar_links
from ...multibody.trees.mechanism import Mechanism
from ...multiprecision.decimal_numbers import values_in_digits, working
from ...systems.system import System
from .case_result import CaseResult, Measurement, reason

SECTION = "Single evaluations"
ULP = 2.0**-52
BOUND = 10.0  # ulps of the condition
LINKS, QUICK = (3, 10, 50), (3, 10)
STATES = 5  # of each arm
LANES = 9  # of a batch: full vectors and what is left over
SEED = 2025
DIGITS = 200  # of exact values


Task = Callable[..., Graph]  # of a model
TASKS: dict[str, Task] = {"inverse dynamics": inverse_dynamics, "forward dynamics": forward_dynamics}


@dataclass(frozen=True)
class Family:
    """Arms and states: random around 1, changed by these. Masses and lengths of every other link, or of the last."""

    name: str
    about: str
    mass: float = 1.0
    length: float = 1.0
    last: bool = False  # the last link alone
    angle: float = 3.0  # rad, the largest
    velocity: float = 2.0  # rad/s, standard deviation


FAMILIES = (
    Family("ordinary", "masses and lengths about 1, any angles"),
    Family("nearly straight", "angles of 1e-3 rad: rows of the mass matrix nearly alike", angle=1e-3),
    Family("angles of 1e8 rad", "the sum of angles is rounded to 1e-8 rad", angle=1e8),
    Family("angles of 1e15 rad", "the sum of angles is rounded to 0.1 rad", angle=1e15),
    Family("velocities of 1e8 rad/s", "gravity and torques are lost in rounding", velocity=1e8),
    Family("velocities of 1e-310 rad/s", "squares of velocities vanish", velocity=1e-310),
    Family("every other mass 1e-12", "light links between heavy ones", mass=1e-12),
    Family("last mass 1e-12", "a light link at the end", mass=1e-12, last=True),
    Family("every other mass 1e12", "heavy links between light ones", mass=1e12),
    Family("last mass 1e12", "a heavy link at the end of light ones", mass=1e12, last=True),
    Family("every other length 1e-6", "short links between long ones", length=1e-6),
    Family("last length 1e-6", "a short link at the end", length=1e-6, last=True),
    Family("every other length 1e6", "long links between short ones", length=1e6),
    Family("last length 1e6", "a long link at the end of short ones", length=1e6, last=True),
)


def results(links: Sequence[int] = LINKS, backends: Sequence[str] | None = None) -> Iterator[CaseResult]:
    """A result for each task and family, measured at each number of links: the worst of states and backends.

    backends: of `cg.compile`; default: Python, and machine code where llvmlite is installed. Each is called at one
    point and for a batch. Raises ImportError without mpmath.
    """
    chosen = tuple(backends or available())
    for name, task in TASKS.items():
        arms = [Arms(task, n, chosen) for n in links]
        for family in FAMILIES:
            rows = tuple([measurement(family, each) for each in arms])
            case = f"{name}, {family.name}"
            known = reason(SECTION, case, "", rows)
            yield CaseResult(SECTION, case, family.about, "+".join(chosen), rows, reason=known)


def available() -> tuple[str, ...]:
    """Python, and machine code where llvmlite is installed."""
    try:
        cg.compile(cg.Graph([], {"one": 1.0}), "llvm")
    except ImportError:
        return ("python",)
    return ("python", "llvm")


def measurement(family: Family, arms: Arms) -> Measurement:
    """The worst error over some states, one point at a time and in a batch."""
    n = arms.n
    rng = np.random.default_rng([SEED, n])
    arm = arm_of(family, n, rng)
    functions = [cg.compile(arms.task(arm), backend) for backend in arms.backends]
    worst = 0.0
    for _ in range(STATES):
        q = rng.uniform(-family.angle, family.angle, n)
        qd, third = family.velocity * rng.normal(size=n), 5.0 * rng.normal(size=n)
        point = np.concatenate([q, qd, third])
        exact = arms.exact(arm, point)
        size = max(abs(float(y)) + moved for y, moved in zip(exact, arms.condition(arm, point).tolist(), strict=True))
        for function in functions:
            lanes = function.batch(np.repeat(point[:, None], LANES, axis=1))
            for values in (function(point), lanes[:, 0], lanes[:, -1]):
                error = np.max(np.abs(deviation(values, exact))) / (ULP * size)
                worst = float(np.maximum(worst, error))  # NaN stays NaN
    why = "of the condition: some operations one after another, each an ulp"
    return Measurement(f"{n} links", worst, BOUND, "ulp", why)


def arm_of(family: Family, n: int, rng: np.random.Generator) -> Mechanism:
    """A random arm of the family."""
    masses, lengths = rng.uniform(0.5, 1.5, n), rng.uniform(0.5, 1.5, n)
    changed = slice(n - 1, n) if family.last else slice(1, n, 2)
    masses[changed] *= family.mass
    lengths[changed] *= family.length
    return planar_arm(masses.tolist(), lengths.tolist(), damping=0.1)


def deviation(values: Array, exact: Sequence[Decimal]) -> Array:
    """values - exact, to the last bits of the values."""
    with working(DIGITS):
        return np.array([float(Decimal(x) - y) for x, y in zip(values.tolist(), exact, strict=True)])


class Arms:
    """A task for arms of n links: its graph whose parameters are inputs, with exact values and their condition."""

    def __init__(self, task: Task, n: int, backends: Sequence[str] = ()) -> None:
        self.task, self.n, self.backends = task, n, backends
        self._graph = task(arm_with_parameters(n))

    def exact(self, arm: Mechanism, point: Array) -> list[Decimal]:
        """The task's values at a point (3n,): angles, velocities, and the third."""
        return values_in_digits(self._graph, self.with_parameters(arm, point).tolist(), DIGITS)

    def with_parameters(self, arm: Mechanism, point: Array) -> Array:
        """The inputs of the graph whose parameters are inputs: the point (3n,), and then those of the arm."""
        rows = [(each.mass, each.length, each.center, each.inertia) for each in planar_links(arm)]
        return np.array([*point, *np.array(rows).T.ravel(), *arm.system.damping, -np.asarray(arm.gravity)[2]])

    @cached_property
    def _slopes(self) -> Compiled:
        return cg.compile(cg.simplify(cg.jvp(self._graph)), "numpy")

    def condition(self, arm: Mechanism, point: Array) -> Array:
        """sum_j |df_i/dx_j| |x_j| over all inputs and parameters, (n,), by the JVP of the graph."""
        x = self.with_parameters(arm, point)
        directions = np.concatenate([np.repeat(x[:, None], len(x), axis=1), np.diag(x)])
        with np.errstate(all="ignore"):
            moved: Array = np.abs(self._slopes.batch(directions)).sum(axis=1)
        return moved


def arm_with_parameters(n: int) -> System:
    """A planar arm whose numbers are parameters: mass0.., length0.., center0.., inertia0.., damping0.., g."""

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node, p: dict[str, Node]) -> list[Node]:
        links = [PlanarLink(*[p[f"{what}{i}"] for what in PlanarLink._fields]) for i in range(n)]
        return by_centers(q, qd, links, p["g"])

    names = [f"{what}{i}" for what in (*PlanarLink._fields, "damping") for i in range(n)]
    return System(
        lagrangian,
        [f"joint {i + 1}" for i in range(n)],
        dict.fromkeys([*names, "g"], 1.0),
        forces=lambda q, qd, t, p: [-p[f"damping{i}"] * qd[i] for i in range(n)],
    )


def by_centers(q: Sequence[Node], qd: Sequence[Node], links: Sequence[Any], gravity: Node | float) -> list[Node]:
    """The partial Lagrangians by positions and velocities of the centers of mass, K = m v.v / 2 + I w^2 / 2."""
    partials: list[Node] = []
    angle, omega = q[0], qd[0]
    x, y, height = cg.constant(0.0), cg.constant(0.0), cg.constant(0.0)  # velocity of the joint, and its height
    for i, link in enumerate(links):
        if i:
            angle, omega = angle + q[i], omega + qd[i]
        s, c = cg.sin(angle), cg.cos(angle)
        r = link.center
        u, v = x + r * omega * c, y + r * omega * s
        kinetic = 0.5 * link.mass * (u * u + v * v) + 0.5 * link.inertia * (omega * omega)
        partials.append(kinetic - link.mass * gravity * (height - r * c))
        r = link.length
        x, y, height = x + r * omega * c, y + r * omega * s, height - r * c
    return partials
