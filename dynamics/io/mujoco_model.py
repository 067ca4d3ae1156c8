"""MuJoCo twins: the same arm as an MJCF model, and what MuJoCo computes for it."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from cgraph.extend import install

from ..multibody.mechanism import Mechanism
from ..multibody.planar_arm import PlanarArm
from .mjcf import CAMERA, to_mjcf

Array = np.ndarray[Any, np.dtype[np.float64]]


def mujoco() -> Any:
    """The mujoco module. Raises ImportError naming the extra when it is not installed."""
    try:
        import mujoco as module
    except ImportError as error:
        raise ImportError(f"MuJoCo is not installed: {install('mujoco')}") from error
    return module


def rollout(model: Any, starts: Array, states: Array) -> Callable[[], None]:
    """A run of MuJoCo's own native loop of steps, one thread, from every start.

    starts: (N, 1 + 2n), the time, positions and velocities in MuJoCo's order.  states: (N, steps, 1 + 2n), which each
    run overwrites with what is after every step. The model, such as its time step, is read when it runs.
    """
    module = mujoco()
    from mujoco.rollout import rollout as native

    models, data = [model] * len(starts), [module.MjData(model)]  # one datum: one thread
    steps, sensors = states.shape[1], np.empty((*states.shape[:2], 0))

    def run() -> None:
        native(models, data, starts, nstep=steps, state=states, sensordata=sensors, skip_checks=True)

    return run


class MujocoTwin:
    """MuJoCo's model of a planar arm or a mechanism, asked for the quantities that the graphs give.

    Damping is in the accelerations and not in `bias`, as in `dynamics`. Raises ImportError without MuJoCo.
    """

    def __init__(self, of: PlanarArm | Mechanism, timestep: float = 1e-3) -> None:
        self.mujoco = mujoco()
        self.of = of
        self.model = self.mujoco.MjModel.from_xml_string(to_mjcf(of, timestep))
        self.data = self.mujoco.MjData(self.model)

    def _set(self, q: Array, qd: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, qd
        self.data.qfrc_applied[:] = 0.0

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        """qdd, (n,), by `mj_forward` under applied torque tau, (n,)."""
        self._set(q, qd)
        self.data.qfrc_applied[:] = tau
        self.mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qacc)

    def inverse(self, q: Array, qd: Array, qdd: Array) -> Array:
        """tau, (n,), by `mj_inverse`; damping included."""
        self._set(q, qd)
        self.data.qacc[:] = qdd
        self.mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse)

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (n, n)."""
        self._set(q, np.zeros_like(q))
        self.mujoco.mj_forward(self.model, self.data)
        columns = np.empty((self.model.nv, self.model.nv))
        for column, unit in zip(columns, np.eye(self.model.nv), strict=True):  # mj_fullM differs between versions
            self.mujoco.mj_mulM(self.model, self.data, column, unit)
        return columns

    def bias(self, q: Array, qd: Array) -> Array:
        """Coriolis, centrifugal and gravity force, (n,)."""
        self._set(q, qd)
        self.mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qfrc_bias)

    def trajectory(self, q: Array, qd: Array, steps: int) -> tuple[Array, Array]:
        """q and qd, (steps + 1, n) each, from the start on, by MuJoCo's RK4."""
        self.mujoco.mj_resetData(self.model, self.data)
        self._set(q, qd)
        n = self.model.nv
        states = np.empty((steps + 1, 2 * n))
        for k in range(steps + 1):
            states[k] = np.concatenate([self.data.qpos, self.data.qvel])
            if k < steps:
                self.mujoco.mj_step(self.model, self.data)
        return states[:, :n], states[:, n:]

    def arm_positions(self, q: Array) -> Array:
        """Places of base, joints and tip [m] of a planar arm, (T, n + 1, 2), by MuJoCo's kinematics at q, (T, n)."""
        assert isinstance(self.of, PlanarArm)
        places = np.empty((len(q), len(self.of.links) + 1, 2))
        for place, pose in zip(places, q, strict=True):
            self.data.qpos[:] = pose
            self.mujoco.mj_kinematics(self.model, self.data)
            tip = self.data.xpos[-1] - self.of.links[-1].length * self.data.xmat[-1].reshape(3, 3)[:, 2]
            place[:] = np.vstack([self.data.xpos[1:], tip])[:, [0, 2]]
        return places


def frames(arm: PlanarArm, poses: Array, timeout: float = 60.0) -> list[np.ndarray] | None:
    """Pictures by MuJoCo's own renderer at joint angles poses, (k, n); None on a machine without OpenGL.

    Each picture is (height, width, 3), uint8. The renderer runs in a process of its own: where OpenGL is missing, the
    attempt fails at import and can end the process.
    """
    for backend in ("egl", "osmesa"):
        try:
            done = subprocess.run(
                [sys.executable, "-c", f"from {__name__} import _write_frames; _write_frames()"],
                input=_packed(xml=np.array(to_mjcf(arm)), poses=np.asarray(poses, dtype=np.float64)),
                capture_output=True,
                check=False,
                timeout=timeout,
                env=os.environ | {"MUJOCO_GL": backend, "PYTHONPATH": os.pathsep.join(sys.path)},
            )
        except subprocess.TimeoutExpired:
            continue
        if done.returncode == 0 and done.stdout:
            return list(np.load(io.BytesIO(done.stdout))["frames"])
    return None


def _write_frames() -> None:
    """The child's half of `frames`: a model and poses from standard input, pictures to standard output."""
    module = mujoco()
    given = np.load(io.BytesIO(sys.stdin.buffer.read()))
    model = module.MjModel.from_xml_string(str(given["xml"]))
    data = module.MjData(model)
    pictures = []
    with module.Renderer(model, 320, 480) as renderer:
        for pose in given["poses"]:
            data.qpos[:] = pose
            module.mj_forward(model, data)
            renderer.update_scene(data, CAMERA)
            pictures.append(renderer.render().copy())
    sys.stdout.buffer.write(_packed(frames=np.array(pictures)))


def _packed(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
