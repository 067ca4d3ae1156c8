"""The fall of Figures 4 and 5: the three-link arm by our equations, and by MuJoCo at the same instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cgraph.extend import Array

from ...io.mujoco_twin import MujocoTwin
from ...multibody.mechanism import require_mechanism
from ...scenes.scenes import Scene
from ...simulation.simulate import simulate
from ...simulation.trajectory import Trajectory


@dataclass(frozen=True)
class FreeFall:
    """One run. positions: (T, n + 1, 2) [m], base, joints and tip."""

    scene: Scene
    trajectory: Trajectory
    positions: Array


@dataclass(frozen=True)
class MujocoFreeFall:
    """MuJoCo's run at the same steps. q: (T, n) [rad].  positions: (T, n + 1, 2) [m], by its own kinematics."""

    q: Array
    positions: Array
    version: str


def free_fall(scene: Scene, dt: float = 1e-3) -> FreeFall:
    """The scene's motion by RK4 on the graph's forward dynamics."""
    trajectory = simulate(scene, scene.q, scene.qd, scene.t_end, "rk4", dt=dt)
    if not trajectory.stats.success:
        raise RuntimeError(f"the fall of {scene.name} is not whole: it {trajectory.stats.message}")
    return FreeFall(scene, trajectory, require_mechanism(scene, "a fall").joint_positions(trajectory.q))


def mujoco_free_fall(run: FreeFall) -> MujocoFreeFall:
    """MuJoCo's RK4 on its twin of the arm, from the same start with the same step. Raises ImportError without it."""
    steps = len(run.trajectory.t) - 1
    twin = MujocoTwin(run.scene.model, run.scene.t_end / steps)
    q, _ = twin.trajectory(np.array(run.scene.q), np.array(run.scene.qd), steps)
    return MujocoFreeFall(q, twin.arm_positions(q), str(twin.mujoco.__version__))


def largest_differences(run: FreeFall, other: MujocoFreeFall, windows: int = 6) -> list[tuple[float, float]]:
    """(t, largest |difference in q| up to t [rad]) at the ends of equal stretches of time."""
    difference = np.abs(run.trajectory.q - other.q).max(axis=1)
    ends = np.linspace(0, len(difference) - 1, windows + 1).astype(int)[1:]
    return [(float(run.trajectory.t[k]), float(difference[: k + 1].max())) for k in ends]
