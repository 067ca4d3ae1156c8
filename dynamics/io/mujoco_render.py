"""Pictures of a mechanism by MuJoCo's own renderer."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np

from ..multibody.mechanism import require_mechanism
from ..multibody.spatial import Array
from ..systems.model import Model
from .mujoco_twin import mujoco
from .write_mjcf import mjcf_text
from .xml_numbers import numbers

CAMERA = "side"  # looks along y
_COLORS = ("0.46 0.24 0.62 1", "0.16 0.38 0.78 1", "0.80 0.20 0.16 1")  # the paper's purple, blue and red


def frames(model: Model, poses: Array, timeout: float = 60.0) -> list[np.ndarray] | None:
    """Pictures of a mechanism, its bodies as sticks, at poses, (k, n); None on a machine without OpenGL.

    Each picture is (height, width, 3), uint8. The renderer runs in a process of its own: where OpenGL is missing, the
    attempt fails at import and can end the process.
    """
    for backend in ("egl", "osmesa"):
        try:
            done = subprocess.run(
                [sys.executable, "-c", f"from {__name__} import _write_frames; _write_frames()"],
                input=_packed(xml=np.array(drawn_mjcf(model)), poses=np.asarray(poses, dtype=np.float64)),
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


def drawn_mjcf(model: Model) -> str:
    """MJCF with a stick from the joint of every moving body to the joints and marks on it, a camera and light."""
    mechanism = require_mechanism(model, "MJCF").bind()
    ends: dict[str, list[Array]] = {body.name: [] for body in mechanism.moving}
    for body in mechanism.bodies:
        if body.parent in ends:
            ends[body.parent].append(np.asarray(body.joint.position, dtype=np.float64))
    lengths = [float(np.linalg.norm(end)) for places in ends.values() for end in places]
    reach, radius = sum(lengths), 0.05 * max(lengths, default=0.0)
    shapes = {
        name: [
            f'<geom type="capsule" fromto="0 0 0 {numbers(end)}" size="{radius!r}" rgba="{_COLORS[i % len(_COLORS)]}"/>'
            for end in places
            if np.any(end)
        ]
        for i, (name, places) in enumerate(ends.items())
    }
    head = [
        "<visual>",
        '  <headlight ambient="0.5 0.5 0.5" diffuse="0.5 0.5 0.5"/>',
        '  <global offwidth="480" offheight="320"/>',
        '  <rgba haze="1 1 1 1"/>',
        "</visual>",
        '<asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/></asset>',
        "<worldbody>",
        f'  <camera name="{CAMERA}" pos="0 {-1.75 * reach!r} {-0.45 * reach!r}" xyaxes="1 0 0 0 0 1"/>',
        "</worldbody>",
    ]
    return mjcf_text(replace(mechanism, loops=()), 1e-3, head, shapes)


def _write_frames() -> None:
    """The child's half of `frames`: a model and poses from standard input, pictures to standard output."""
    module = mujoco()
    given = np.load(io.BytesIO(sys.stdin.buffer.read()))
    mj = module.MjModel.from_xml_string(str(given["xml"]))
    data = module.MjData(mj)
    pictures = []
    with module.Renderer(mj, 320, 480) as renderer:
        for pose in given["poses"]:
            data.qpos[:] = pose
            module.mj_forward(mj, data)
            renderer.update_scene(data, CAMERA)
            pictures.append(renderer.render().copy())
    sys.stdout.buffer.write(_packed(frames=np.array(pictures)))


def _packed(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
