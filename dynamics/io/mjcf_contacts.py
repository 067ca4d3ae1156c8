"""Contacts of MuJoCo's model: which of its geoms meet, and the spheres and capsules among them that are taken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array

from ..multibody.algebra import spatial
from ..multibody.forces.contact import Contact
from .contacts import capsule_ends
from .left_out import listed, present
from .mujoco_module import mujoco, word_of
from .smooth_forces import disabled

if TYPE_CHECKING:
    from mujoco import MjModel

TAKEN = (("plane", "sphere"), ("plane", "capsule"), ("sphere", "sphere"))  # kinds of geoms that meet
SLIDING = 3  # dimensions of a contact with friction that slides and does no more


def mjcf_balls(mj: MjModel, ends: Sequence[tuple[str, Array]]) -> tuple[list[Contact], list[str]]:
    """Spheres that meet planes and spheres, ends of capsules on planes, and sentences on other contacts.

    ends: of each of MuJoCo's bodies, the name of ours, and the origin of its frame in that one's.
    """
    if disabled(mj, "CONSTRAINT", "CONTACT"):
        return [], []
    words, data = [word_of("Geom", kind) for kind in mj.geom_type], mujoco().MjData(mj)
    mujoco().mj_kinematics(mj, data)  # planes stand still
    balls: list[Contact] = []
    others: list[str] = []
    rolling, weld = False, mj.body_weldid[mj.geom_bodyid]
    for (first, second), (friction, dimensions) in _meetings(mj).items():
        ground, geom = sorted((first, second), key=lambda g: (words[g] != "plane", weld[g] != 0))
        kinds = words[ground], words[geom]
        known = kinds in TAKEN and weld[ground] != weld[geom]
        if not known or (kinds[0] == "sphere" and (data.geom_xpos[ground] == data.geom_xpos[geom]).all()):
            others.append(f"{_called(mj, first)} and {_called(mj, second)}")
            continue
        rolling |= dimensions > SLIDING
        (body, origin), (to, to_origin) = (ends[int(mj.geom_bodyid[each])] for each in (geom, ground))
        center, radius = origin + mj.geom_pos[geom], float(mj.geom_size[geom, 0])
        against: dict[str, Any] = {"stiffness": 0.0, "friction": friction if dimensions >= SLIDING else 0.0}
        if kinds[0] == "plane":
            normal = spatial.snapped(data.geom_xmat[ground].reshape(3, 3)[:, 2])
            against |= {"to_at": data.geom_xpos[ground].copy(), "normal": normal}
        else:
            against |= {"to": to, "to_at": spatial.cleaned(to_origin + mj.geom_pos[ground])}
            against |= {"to_radius": float(mj.geom_size[ground, 0])}
        axis = spatial.from_quaternion(mj.geom_quat[geom])[:, 2]
        centers = capsule_ends(center, axis, float(mj.geom_size[geom, 1])) if kinds[1] == "capsule" else [center]
        balls += [Contact(body, at=spatial.cleaned(at), radius=radius, **against) for at in centers]
    sentences = {
        f"contacts other than of spheres, and of capsules with planes ({listed(others)})": others,
        "torsional and rolling friction of contacts": rolling,
    }
    return balls, present(sentences)


def _meetings(mj: MjModel) -> dict[tuple[int, int], tuple[float, int]]:
    """Pairs of geoms that MuJoCo lets collide, with their friction and the dimensions of the contact."""
    kind, affinity, weld = mj.geom_contype, mj.geom_conaffinity, mj.body_weldid[mj.geom_bodyid]
    meet = ((kind[:, None] & affinity) | (kind & affinity[:, None])) != 0
    meet &= weld[:, None] != weld
    if not disabled(mj, "FILTERPARENT"):
        above = mj.body_weldid[mj.body_parentid[weld]]
        meet &= ~((above[:, None] == weld) & (weld != 0)) & ~((above == weld[:, None]) & (weld[:, None] != 0))
    body = mj.geom_bodyid.astype(np.int64)
    lower, upper = np.minimum(body[:, None], body), np.maximum(body[:, None], body)
    meet &= ~np.isin((lower << 16) + upper, mj.exclude_signature)
    found = {(int(a), int(b)): _mixed(mj, int(a), int(b)) for a, b in np.argwhere(np.triu(meet, 1))}
    for k in range(mj.npair):
        a, b = sorted((int(mj.pair_geom1[k]), int(mj.pair_geom2[k])))
        found[a, b] = float(mj.pair_friction[k, 0]), int(mj.pair_dim[k])
    return found


def _mixed(mj: MjModel, a: int, b: int) -> tuple[float, int]:
    """Friction and dimensions of two geoms: those of the one of higher priority, else the larger."""
    first, second = int(mj.geom_priority[a]), int(mj.geom_priority[b])
    chosen = [a, b] if first == second else [a if first > second else b]
    return max([float(mj.geom_friction[g, 0]) for g in chosen]), max([int(mj.geom_condim[g]) for g in chosen])


def _called(mj: MjModel, geom: int) -> str:
    name: str = mj.geom(geom).name
    return name or f"a geom of body {mj.body(int(mj.geom_bodyid[geom])).name!r}"
