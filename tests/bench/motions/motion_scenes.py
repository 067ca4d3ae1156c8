"""The motions of the bench: models from pendulums to a free base with limbs, and their exact ends."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.stability.cases.rotation import kepler
from dynamics.multibody.builders import planar_arm
from dynamics.multibody.trees.mechanism import Mechanism
from dynamics.multiprecision import Reference
from dynamics.multiprecision.reference import from_text
from dynamics.systems.ode_system import OdeSystem
from dynamics.systems.system import System
from tests.bench.speed.scenes import free_tree, turned_arm

FILE = Path(__file__).with_name("motion_ends.json")  # exact ends at `TIMES`, made by renew.py
TIMES = (0.01, 10.0, 200.0)  # s
DIGITS = 20  # of the ends


def double_pendulum() -> AccuracyTask:
    """Two rods from half a radian each: regular."""
    arm = planar_arm([1.0, 1.0], [1.0, 1.0])
    return AccuracyTask("double pendulum", "two rods, regular", arm, (0.5, 0.5), (0.0, 0.0), 200.0)


def triple_fall() -> AccuracyTask:
    """Three rods let go almost level: chaotic."""
    # Exactly level, heyoka's first step is ten times too long at orders 12, 16 and 20, and a loss that tells nothing.
    model, q = planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]), (1.5, 0.2, -0.1)
    return AccuracyTask("triple fall", "three rods let go almost level", model, q, (0.0,) * 3, 200.0, series=False)


def henon_heiles() -> AccuracyTask:
    """Hénon and Heiles' potential at an energy of about 1/12: most motions are regular."""

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        x, y = q
        return [0.5 * (qd[0] ** 2 + qd[1] ** 2), -0.5 * (x * x + y * y), y * y * y / 3.0 - x * x * y]

    model = System(lagrangian, ["x", "y"])
    return AccuracyTask("Henon and Heiles", "energy 1/12", model, (0.0, 0.1), (0.39, 0.0), 200.0)


def figure_eight() -> AccuracyTask:
    """Three unit masses on the orbit of Chenciner and Montgomery (2000), with the numbers of C. Simó."""

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        pairs = ((0, 1), (0, 2), (1, 2))
        near = [1.0 / cg.hypot(q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]) for i, j in pairs]
        return [*[0.5 * u**2 for u in qd], *near]

    x, y, u, v = 0.97000436, -0.24308753, 0.93240737, 0.86473146
    places, speeds = (x, y, -x, -y, 0.0, 0.0), (u / 2, v / 2, u / 2, v / 2, -u, -v)
    model = System(lagrangian, [f"{axis}{i}" for i in range(3) for axis in "xy"])
    return AccuracyTask("figure eight", "three unit masses on one curve", model, places, speeds, 200.0)


def seven_joints() -> AccuracyTask:
    """The bench's arm of seven hinges in space, damped, let go."""
    return AccuracyTask(
        "arm 7", "seven hinges in space, damped", turned_arm(7), (0.1,) * 7, (0.0,) * 7, 200.0, series=False
    )


def free_base() -> AccuracyTask:
    """The bench's free base with limbs, as large as a humanoid, without gravity; limbs bent, all turning."""
    tree = free_tree(35)
    model = Mechanism(tree.bodies, (0.0, 0.0, 0.0))
    neutral = list(model.system.kinematics.neutral)
    q = (*neutral[:7], *[0.2] * 29)
    qd = (0.3, -0.2, 0.5, 0.1, 0.0, 0.2, *np.tile([0.4, -0.4], 15)[:29].tolist())
    return AccuracyTask("free 35", "a free base with limbs, 35 degrees of freedom", model, q, qd, 200.0, series=False)


def van_der_pol() -> AccuracyTask:
    """x'' = mu (1 - x^2) x' - x with mu = 100: slow arcs and jumps, one period in 163 s."""
    model = OdeSystem(lambda x, t, p: [x[1], p["mu"] * ((1.0 - x[0] * x[0]) * x[1]) - x[0]], ["x", "v"], {"mu": 100.0})
    about = "slow arcs and jumps"
    return AccuracyTask("van der Pol 100", about, model, (2.0, 0.0), (), 200.0, stiff=True, series=False)


def stiff_chain() -> AccuracyTask:
    """Four rods that swing as one: the first hinge is free, springs and dampers hold the others straight."""
    arm = planar_arm([0.25] * 4, [0.25] * 4)
    held = [replace(each, joint=replace(each.joint, stiffness=1e4, damping=2e1)) for each in arm.bodies[1:4]]
    model = Mechanism([arm.bodies[0], *held, *arm.bodies[4:]], arm.gravity)
    about = "four rods, three hinges with stiff springs and dampers"
    return AccuracyTask("stiff chain", about, model, (1.0, 0, 0, 0), (0.0,) * 4, 200.0, stiff=True, series=False)


MOTIONS: dict[str, Callable[[], AccuracyTask]] = {
    "double pendulum": double_pendulum,
    "triple fall": triple_fall,
    "Henon and Heiles": henon_heiles,
    "figure eight": figure_eight,
    "kepler 0.9": lambda: replace(kepler(0.9, 3.5, 1.0), t_end=200.0),
    "arm 7": seven_joints,
    "free 35": free_base,
    "van der Pol 100": van_der_pol,
    "stiff chain": stiff_chain,
}


def _entry(name: str) -> dict[str, Any]:
    """Entry of a motion in the file. Raises ValueError where it is of another start."""
    task, entry = MOTIONS[name](), json.loads(FILE.read_text(encoding="utf-8"))[name]
    if entry["start"] != task.identity["start"]:
        raise ValueError(f"the exact ends of {name!r} are of another start; compute them again")
    return dict(entry)


def sizes(name: str) -> Array:
    """The largest value of each state over the longest motion, (m,), which errors are relative to."""
    return np.array(_entry(name)["size"])


def exact_end(name: str, t_end: float) -> Reference | str:
    """The exact state at t_end: known, or else computed; or why it is not to be had. Raises as `reference` does."""
    task = MOTIONS[name]()
    for end in _entry(name)["ends"]:
        if end["t"] == t_end:
            return from_text([t_end], [end["x"]], end["error"], end["how"]) if "x" in end else str(end["how"])
    solution = task.solution([t_end], digits=DIGITS)
    return f"no exact end at {t_end:g} s is known" if solution is None else solution
