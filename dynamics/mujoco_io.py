"""MuJoCo twins: the same arm as an MJCF model, and what MuJoCo computes for it."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from typing import Any

import numpy as np

from .planar_arm import PlanarArm

Array = np.ndarray[Any, np.dtype[np.float64]]
# MuJoCo wants diagonal inertias that are positive and obey the triangle inequality; a planar arm feels only the one
# about the hinge axis (y), so the other two are any that are allowed.
_SMALLEST = 1e-14  # kg m^2, in place of the zero inertia of a point mass
CAMERA = "side"  # looks along y at the arm's plane
_COLORS = ("0.46 0.24 0.62 1", "0.16 0.38 0.78 1", "0.80 0.20 0.16 1")  # the paper's purple, blue and red


def mujoco() -> Any:
    """The mujoco module. Raises ImportError naming the extra when it is not installed."""
    try:
        import mujoco as module
    except ImportError as error:
        raise ImportError("MuJoCo is not installed: pip install 'cgraph[mujoco]'") from error
    return module


def to_mjcf(arm: PlanarArm, timestep: float = 1e-3) -> str:
    """The arm as MJCF text: hinges about -y, masses and inertias explicit, RK4, contacts off.

    The arm's plane is x to the right, z up; a positive angle swings the hanging arm towards +x.
    """
    reach = sum(link.length for link in arm.links)
    lines = [
        '<mujoco model="planar arm">',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep!r}" integrator="RK4" gravity="0 0 {-arm.gravity!r}">',
        '    <flag contact="disable"/>',
        "  </option>",
        "  <visual>",
        '    <headlight ambient="0.5 0.5 0.5" diffuse="0.5 0.5 0.5"/>',
        '    <global offwidth="480" offheight="320"/>',
        '    <rgba haze="1 1 1 1"/>',
        "  </visual>",
        '  <asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/></asset>',
        "  <worldbody>",
        f'    <camera name="{CAMERA}" pos="0 {-1.75 * reach!r} {-0.45 * reach!r}" xyaxes="1 0 0 0 0 1"/>',
    ]
    indent = "    "
    for i, link in enumerate(arm.links):
        drop = arm.links[i - 1].length if i else 0.0
        diagonal = " ".join([repr(max(link.inertia, _SMALLEST))] * 3)
        radius, colour = 0.05 * arm.links[0].length, _COLORS[i % len(_COLORS)]
        lines += [
            f'{indent}<body name="link{i + 1}" pos="0 0 {-drop!r}">',
            f'{indent}  <joint name="joint{i + 1}" type="hinge" axis="0 -1 0" damping="{arm.damping[i]!r}"/>',
            f'{indent}  <inertial pos="0 0 {-link.center!r}" mass="{link.mass!r}" diaginertia="{diagonal}"/>',
            f'{indent}  <geom type="capsule" fromto="0 0 0 0 0 {-link.length!r}" size="{radius!r}" rgba="{colour}"/>',
        ]
        indent += "  "
    for _ in arm.links:
        indent = indent[:-2]
        lines.append(f"{indent}</body>")
    return "\n".join([*lines, "  </worldbody>", "</mujoco>"]) + "\n"


class MujocoTwin:
    """MuJoCo's model of a planar arm, asked for the quantities that the graphs give.

    Damping is in the accelerations and not in `bias`, as in `dynamics`. Raises ImportError without MuJoCo.
    """

    def __init__(self, arm: PlanarArm, timestep: float = 1e-3) -> None:
        self.mujoco = mujoco()
        self.arm = arm
        self.model = self.mujoco.MjModel.from_xml_string(to_mjcf(arm, timestep))
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

    def trajectory(self, q: Array, qd: Array, steps: int) -> tuple[Array, Array, Array]:
        """q and qd, (steps + 1, n), and body frames' origins with the tip, (steps + 1, n + 1, 2), by MuJoCo's RK4."""
        self.mujoco.mj_resetData(self.model, self.data)
        self._set(q, qd)
        n = self.model.nv
        states, places = np.empty((steps + 1, 2 * n)), np.empty((steps + 1, n + 1, 2))
        for k in range(steps + 1):
            states[k] = np.concatenate([self.data.qpos, self.data.qvel])
            self.mujoco.mj_kinematics(self.model, self.data)
            tip = self.data.xpos[-1] - self.arm.links[-1].length * self.data.xmat[-1].reshape(3, 3)[:, 2]
            places[k] = np.vstack([self.data.xpos[1:], tip])[:, [0, 2]]
            if k < steps:
                self.mujoco.mj_step(self.model, self.data)
        return states[:, :n], states[:, n:], places


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
