"""The bench's own scenes: planar chains, 3D arms and trees, of sizes that show how cost grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dynamics import Joint, Mechanism, planar_arm, scenes
from dynamics.multibody.bodies.body import WORLD
from dynamics.scenes import Scene
from viz.paper.mechanisms import binary_tree, chain, turned_arm, turned_body


def free_tree(n: int) -> Mechanism:
    """A free base with limbs of up to seven revolute joints, n degrees of freedom, the bodies of `turned_arm`."""
    rng = np.random.default_rng(n)
    base = replace(turned_body(0, WORLD, rng), joint=Joint("free"))
    return Mechanism([base, *(turned_body(i, f"link{i if (i - 1) % 7 else 1}", rng) for i in range(1, n - 5))])


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
    """The scene of that name, of `SCENES`, of `dynamics.scenes` or a file; reading: options of `scenes.of_file`."""
    if name in SCENES:
        return SCENES[name]()
    if name not in scenes.names() and not Path(name).suffix and ":" not in name:
        raise ValueError(f"there is no scene {name!r}; the bench has {', '.join(SCENES)}, and takes scenes and files")
    return scenes.load(name, **({} if name in scenes.names() else reading))
