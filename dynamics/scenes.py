"""Scenes: named models with a start, for examples, figures and the command line."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .planar_arm import planar_arm
from .system import System, as_system


@dataclass(frozen=True)
class Scene:
    """A model, the state it starts from, and how long it is watched."""

    name: str
    about: str  # one line
    model: Any  # a System, or what has one
    q: tuple[float, ...]  # rad or m
    qd: tuple[float, ...]  # rad/s or m/s
    t_end: float  # s

    @property
    def system(self) -> System:
        """The Lagrangian system of the model."""
        return as_system(self.model)


def spring_mass() -> Scene:
    """A rotor of inertia I held by a spring of stiffness k, the one-joint system of Figures 1 to 3."""
    system = System(
        lambda q, qd, t, p: 0.5 * p["I"] * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2,
        coordinates=["theta"],
        parameters={"I": 1.0, "k": 1.0},
    )
    about = "a rotor on a spring, L = I qd^2/2 - k q^2/2 (Figures 1 to 3)"
    return Scene("spring_mass", about, system, (1.0,), (0.0,), 10.0)


def triple_pendulum(model: str = "rod") -> Scene:
    """The paper's three-link arm: masses 1.0 0.8 0.7 kg, lengths 1.0 0.8 0.7 m, damping 0.1 N m s, in free fall.

    It starts at rest, straight out to the right: q = (pi/2, 0, 0). model: "rod" or "point", as in `planar_arm`.
    """
    arm = planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1, model=model)
    about = "the three-link arm in free fall (Figures 4 to 6, Table 1)"
    return Scene("triple_pendulum", about, arm, (math.pi / 2, 0.0, 0.0), (0.0,) * 3, 3.0)


def chain(n: int = 10) -> Scene:
    """A chain of n equal rods, 1 kg and 1 m in all, let go at 45 degrees."""
    if n < 1:
        raise ValueError(f"a chain needs at least one link, got {n}")
    arm = planar_arm([1.0 / n] * n, [1.0 / n] * n)
    start = (math.pi / 4,) + (0.0,) * (n - 1)
    return Scene("chain", f"a chain of {n} equal rods, let go at 45 degrees", arm, start, (0.0,) * n, 3.0)


_SCENES: dict[str, Callable[..., Scene]] = {each.__name__: each for each in (spring_mass, triple_pendulum, chain)}


def names() -> list[str]:
    """Names of the scenes."""
    return list(_SCENES)


def load(name: str, **options: Any) -> Scene:
    """The scene of that name; options go to its function, as in `load("chain", n=20)`.

    Raises ValueError for a name that is not among `names()`.
    """
    if name not in _SCENES:
        raise ValueError(f"there is no scene {name!r}; the scenes are {', '.join(_SCENES)}")
    return _SCENES[name](**options)
