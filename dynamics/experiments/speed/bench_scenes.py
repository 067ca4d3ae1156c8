"""The bench's own scenes: planar chains, 3D arms and trees, of sizes that show how cost grows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cgraph._shared import Array

from ... import scenes
from ...multibody.algebra.spatial import rotation
from ...multibody.bodies.body import WORLD, Body, Joint
from ...multibody.builders.planar_arm import planar_arm
from ...multibody.trees.mechanism import Mechanism
from ...scenes import Scene


def chain(mass: float, length: float, n: int) -> Mechanism:
    """A planar chain of n equal rods with damping."""
    return planar_arm([mass] * n, [length] * n, damping=0.1)


def turned_arm(n: int) -> Mechanism:
    """A 3D arm of n revolute joints, full inertias, frames turned by quarter turns."""
    rng = np.random.default_rng(n)
    return Mechanism([_body(i, WORLD if i == 0 else f"link{i}", rng) for i in range(n)])


def binary_tree(n: int) -> Mechanism:
    """A tree of n revolute bodies, each with two children until there are n."""
    rng = np.random.default_rng(n)
    return Mechanism([_body(i, WORLD if i == 0 else f"link{(i - 1) // 2 + 1}", rng) for i in range(n)])


def free_tree(n: int) -> Mechanism:
    """A free base with limbs of up to seven revolute joints, n degrees of freedom, the bodies of `turned_arm`."""
    rng = np.random.default_rng(n)
    base = replace(_body(0, WORLD, rng), joint=Joint("free"))
    return Mechanism([base, *(_body(i, f"link{i if (i - 1) % 7 else 1}", rng) for i in range(1, n - 5))])


def _body(i: int, parent: str, rng: np.random.Generator) -> Body:
    turn = rotation(np.array([1.0, 0.0, 0.0]), (0.0, math.pi / 2, -math.pi / 2)[i % 3])
    joint = Joint("revolute", position=(0.1, 0.0, 0.3) if i else (0.0, 0.0, 0.0), orientation=turn, damping=0.1)
    return Body(f"link{i + 1}", joint, parent, *inertial_numbers(rng))


def inertial_numbers(rng: np.random.Generator) -> tuple[float, Array, Array]:
    """Mass [kg], center [m] and inertia [kg m^2] of a body without symmetry."""
    mixed = rng.normal(size=(3, 3))
    second = 0.05 * mixed @ mixed.T + 0.01 * np.eye(3)  # of mass; any such matrix is a body's
    mass, center = float(rng.uniform(1.0, 2.0)), 0.1 * rng.normal(size=3)
    return mass, center, np.trace(second) * np.eye(3) - second


def _at_rest(name: str, n: int, build: Callable[[int], Mechanism]) -> Scene:
    model = build(n)
    q = tuple(model.system.kinematics.neutral)
    return Scene(name, f"a mechanism of the bench with {n} degrees of freedom", model, q, (0.0,) * n, 3.0)


_MODELS: dict[str, Callable[[int], Mechanism]] = {
    "planar 3": lambda _: planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1),
    "planar 7": partial(chain, 0.5, 0.5),
    "planar 20": partial(chain, 0.2, 0.2),
    "planar 50": partial(chain, 0.1, 0.1),
    "planar 100": partial(chain, 0.1, 0.1),
    "arm 7": turned_arm,
    "arm 30": turned_arm,
    "tree 15": binary_tree,
    "free 35": free_tree,
}
SCENES: dict[str, Callable[[], Scene]] = {
    name: partial(_at_rest, name, int(name.split()[1]), build) for name, build in _MODELS.items()
}


def load(name: str, **reading: Any) -> Scene:
    """The scene of that name, of `SCENES` or else of `dynamics.scenes` or a file.

    reading: options of `dynamics.scenes.of_file`. Raises ValueError for a name that is neither, and as
    `dynamics.scenes.load` does.
    """
    if name in SCENES:
        return SCENES[name]()
    if name not in scenes.names() and not Path(name).suffix and ":" not in name:
        raise ValueError(
            f"there is no scene {name!r}; the bench has {', '.join(SCENES)}, the scenes {', '.join(scenes.names())}, "
            "files end in .xml or .urdf, and models in Python are file.py:name"
        )
    return scenes.load(name, **({} if name in scenes.names() else reading))
