"""Random starts: motions that begin with states at 0, from rest or as chains, and with forces that jump in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

import cgraph as cg
from cgraph import Node

from ...systems.ode_system import OdeSystem
from ...systems.system import System
from ..setting import Setting
from .random_lagrangians import LAGRANGIANS, random_setting

EACH = 100  # of every family
UNITS = 6.0  # decades of the units of length and time, each way
Push = Callable[[Node], Node]


def random_motion(number: int) -> Setting:
    """The random Lagrangian of this number, and from the last of them on the random starts, the families in turn."""
    if number < LAGRANGIANS:
        return random_setting(number)
    make = FAMILIES[number % len(FAMILIES)]
    name = f"{make.__name__.replace('_', ' ')} {(number - LAGRANGIANS) // len(FAMILIES)}"
    return make(np.random.default_rng([number, 24061]), name)


def from_rest(rng: np.random.Generator, name: str) -> Setting:
    """At rest at 0, under forces that begin at 0 and grow."""
    power = float(rng.integers(1, 5))
    pushes: list[Push] = [
        lambda t: cg.sin(3.0 * t),
        lambda t: t**power,
        lambda t: 1.0 - cg.cos(2.0 * t),
        lambda t: t * cg.exp(-t),
        lambda t: t / (1.0 + t),
        lambda t: 40.0 * t,
    ]
    return _driven(rng, name, pushes[rng.integers(len(pushes))], moving=False)


def jump(rng: np.random.Generator, name: str) -> Setting:
    """Forces that jump, or have a kink, at one instant or at several; from rest or on the way."""
    first, second = np.sort(rng.uniform(0.1, 2.5, 2)).tolist()
    pushes: list[Push] = [
        lambda t: cg.where(t > first, 1.0, 0.0),
        lambda t: cg.where(t > first, 1.0, -0.5) + cg.where(t > second, 30.0, 0.0),
        lambda t: cg.maximum(t - first, 0.0),
        lambda t: abs(t - first) + cg.where(t > second, t, 0.0),
        lambda t: cg.where(t > first, cg.where(t > second, 0.0, 1.0), 0.0) / (second - first),
    ]
    return _driven(rng, name, pushes[rng.integers(len(pushes))], moving=bool(rng.integers(2)))


def chain(rng: np.random.Generator, name: str) -> Setting:
    """Substances that turn into one another, the first alone at the start; some need two that meet."""
    n, second, amount = int(rng.integers(3, 13)), _unit(rng), _unit(rng)
    rates = rng.uniform(0.3, 3.0, (2, n)) / second
    meets = rng.random(n) < 0.3

    def rate(x: Sequence[Node], t: Node) -> list[Node]:
        flows = [rates[0, k] * x[k] * (x[0] / amount if meets[k] and k else 1.0) for k in range(n - 1)]
        back = [rates[1, k] * x[k + 1] * 0.3 for k in range(n - 1)]
        none = cg.constant(0.0)
        net = [none, *[a - b for a, b in zip(flows, back, strict=True)], none]
        return [net[k] - net[k + 1] for k in range(n)]

    model = OdeSystem(rate, [f"x{k}" for k in range(n)])
    start = (amount, *[0.0] * (n - 1))
    return Setting(name, "a chain of reactions", model, start, (), float(rng.uniform(2.0, 6.0) * second))


FAMILIES = (from_rest, jump, chain)


def _driven(rng: np.random.Generator, name: str, push: Push, *, moving: bool) -> Setting:
    """One to three coordinates, some of them pushed, coupled by their inertia and by springs."""
    n, length, second = int(rng.integers(1, 4)), _unit(rng), _unit(rng)
    mass = np.eye(n) + 0.3 * np.ones((n, n))
    stiffness, turning = rng.uniform(-1.0, 5.0, n), rng.uniform(0.0, 0.4)
    strength = rng.uniform(0.3, 2.0, n) * (np.arange(n) == rng.integers(n)).astype(float)
    gain, energy = rng.choice([0.0, 20.0]), (length / second) ** 2.0

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node) -> Node:
        x, v = [each / length for each in q], [each * (second / length) for each in qd]
        pairs = [(i, j) for i in range(n) for j in range(n)]
        kinetic = sum([0.5 * mass[i, j] * v[i] * v[j] for i, j in pairs], cg.constant(0.0))
        kinetic = kinetic * (1.0 + turning * cg.sin(x[-1]))
        springs = [0.5 * stiffness[i] * x[i] ** 2.0 + 0.5 * (x[i] - x[i - 1]) ** 2.0 for i in range(n)]
        total: Node = energy * (kinetic - sum(springs, cg.constant(0.0)))
        return total

    def forces(q: Sequence[Node], qd: Sequence[Node], t: Node) -> list[Node | float]:
        return [float(s) * energy / length * push(t / second) for s in strength]

    damping = float(gain * 0.2 * energy * second / length**2)
    model = System(lagrangian, [f"x{i}" for i in range(n)], forces=forces, damping=damping)
    q, qd = (rng.normal(size=(2, n)) if moving else np.zeros((2, n))).tolist()
    start = tuple([length * x for x in q]), tuple([length / second * x for x in qd])
    return Setting(name, "driven", model, *start, float(rng.uniform(2.6, 4.0) * second))


def _unit(rng: np.random.Generator) -> float:
    """A unit, a power of two; 1 as often as not."""
    return float(2.0 ** round(rng.uniform(-UNITS, UNITS) / math.log10(2.0))) if rng.integers(2) else 1.0
