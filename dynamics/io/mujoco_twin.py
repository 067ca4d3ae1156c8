"""MuJoCo twins: the same mechanism as an MJCF model, and what MuJoCo computes for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cgraph._shared import Array

from ..multibody.builders import planar_links
from ..multibody.trees.mechanism import Mechanism, MechanismError, require_mechanism
from ..systems.model import Model
from .mujoco_module import mujoco
from .write_mjcf import mujoco_spec

if TYPE_CHECKING:
    from mujoco import MjModel


def joint_order(mj: MjModel, mechanism: Mechanism) -> tuple[list[int], list[int]]:
    """Places of our coordinates in qpos, (nq,), and of our velocities in qvel, (n,), by the names of the joints."""
    joints = [(mj.joint(body.coordinate), body.joint.type) for body in mechanism.moving]
    q = [int(joint.qposadr[0]) + k for joint, kind in joints for k in range(len(kind.coordinates))]
    u = [int(joint.dofadr[0]) + k for joint, kind in joints for k in range(len(kind.velocities))]
    return q, u


class MujocoTwin:
    """MuJoCo's model of a mechanism, and its motions.

    Of a mechanism with loops it has the tree; motions are refused, as MuJoCo's equality constraints are soft. Raises
    ImportError without MuJoCo.
    """

    def __init__(self, of: Model, timestep: float = 1e-3) -> None:
        self.mujoco = mujoco()
        self.mechanism = require_mechanism(of, "MuJoCo").bind()
        balanced = any([body.gravity_compensation for body in self.mechanism.parts])
        parts = self.mechanism.parts if balanced else self.mechanism.moving
        bodies = [replace(body, joint=replace(body.joint, limits=None)) for body in parts]
        self.model = mujoco_spec(replace(self.mechanism, bodies=bodies, locked={}, loops=()), timestep).compile()
        self.data = self.mujoco.MjData(self.model)

    def require_tree(self, what: str) -> None:
        """Raises MechanismError for a mechanism with loops, whose `what` MuJoCo does not compute."""
        if self.mechanism.loops:
            raise MechanismError(f"MuJoCo has soft loops, and so no {what} of loop {self.mechanism.loops[0].label!r}")

    def trajectory(self, q: Array, qd: Array, steps: int) -> tuple[Array, Array]:
        """q and qd, (steps + 1, n) each, from the start on, by MuJoCo's RK4. Raises MechanismError for loops."""
        self.require_tree("motions")
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, qd
        nq = self.model.nq
        states = np.empty((steps + 1, nq + self.model.nv))
        for k in range(steps + 1):
            states[k] = np.concatenate([self.data.qpos, self.data.qvel])
            if k < steps:
                self.mujoco.mj_step(self.model, self.data)
        return states[:, :nq], states[:, nq:]

    def arm_positions(self, q: Array) -> Array:
        """Places of base, joints and tip [m] of a planar arm, (T, n + 1, 2), by MuJoCo's kinematics at q, (T, n)."""
        links = planar_links(self.mechanism)
        places = np.empty((len(q), len(links) + 1, 2))
        for place, pose in zip(places, q, strict=True):
            self.data.qpos[:] = pose
            self.mujoco.mj_kinematics(self.model, self.data)
            tip = self.data.xpos[-1] - links[-1].length * self.data.xmat[-1].reshape(3, 3)[:, 2]
            place[:] = np.vstack([self.data.xpos[1:], tip])[:, [0, 2]]
        return places
