"""Equality constraints of MuJoCo's model as loops: exact, where MuJoCo's give way as springs do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from cgraph._shared import Array

from ..multibody.algebra import spatial
from ..multibody.bodies.body import WORLD, Body, MechanismError
from ..multibody.loops import Loop
from .left_out import listed, present
from .mujoco_module import word_of
from .smooth_forces import disabled, fixed_tendon

if TYPE_CHECKING:
    from mujoco import MjModel

_MODELLED = ("joint", "connect", "weld", "tendon")
End = tuple[str, Array, Array]  # one of our bodies, and position [m] and axes in it of a frame of MuJoCo's


def read_loops(mj: MjModel, moving: Sequence[Body], ends: Sequence[tuple[str, Array]]) -> list[Loop]:
    """The loops of MuJoCo's model.

    moving: the bodies on its joints, in their order.  ends: for each of its bodies ours, and the origin of its frame in
    that of ours. Raises MechanismError for what holds a body to itself.
    """
    loops: list[Loop] = []
    taken = {mj.equality(i).name for i in range(mj.neq)} - {""}
    for i in _modelled(mj):
        loop = _loop(mj, i, moving, ends)
        while not mj.equality(i).name and loop.label in taken:
            loop = replace(loop, name=loop.label + "'")
        taken.add(loop.label)
        loops.append(loop)
    return loops


def other_equalities(mj: MjModel) -> list[str]:
    """Sentences on active constraints that no loop stands for."""
    others: dict[str, list[int]] = {}
    for i in _active(mj):
        if not _is_modelled(mj, i):
            others.setdefault(_kind(mj, i), []).append(i)
    return [f"equality constraints of the type {kind} ({names_of(mj, which)})" for kind, which in others.items()]


def left_of_equalities(mj: MjModel) -> list[str]:
    """Sentences on the softness of constraints that are loops, and on those that do not act."""
    inactive = [i for i in range(mj.neq) if not (mj.eq_active0[i] or disabled(mj, "CONSTRAINT", "EQUALITY"))]
    return present(
        {
            f"softness of equality constraints ({names_of(mj, _modelled(mj))})": _modelled(mj),
            f"inactive equality constraints ({names_of(mj, inactive)})": inactive,
        }
    )


def names_of(mj: MjModel, which: Sequence[int], kind: str = "equality") -> str:
    """Names of equality constraints, or of another kind of elements, such as "tendon", or their numbers."""
    return listed([getattr(mj, kind)(i).name or f"number {i}" for i in which])


def _active(mj: MjModel) -> list[int]:
    return [] if disabled(mj, "CONSTRAINT", "EQUALITY") else [i for i in range(mj.neq) if mj.eq_active0[i]]


def _modelled(mj: MjModel) -> list[int]:
    """Active constraints that are loops."""
    return [i for i in _active(mj) if _is_modelled(mj, i)]


def _is_modelled(mj: MjModel, i: int) -> bool:
    tendons = [int(t) for t in (mj.eq_obj1id[i], mj.eq_obj2id[i]) if t >= 0] if _kind(mj, i) == "tendon" else []
    return _kind(mj, i) in _MODELLED and all([fixed_tendon(mj, t) for t in tendons])


def _kind(mj: MjModel, i: int) -> str:
    return word_of("Eq", mj.eq_type[i])


def _loop(mj: MjModel, i: int, moving: Sequence[Body], ends: Sequence[tuple[str, Array]]) -> Loop:
    kind, name = _kind(mj, i), mj.equality(i).name
    if kind in ("joint", "tendon"):
        return _coupling(mj, i, name, moving)
    held = _frames(mj, i, ends)
    (body, at, turn), (to, to_at, to_turn) = held[::-1] if held[0][0] == WORLD else held
    if body == to:
        raise MechanismError(f"equality constraint {name or f'number {i}'} holds the body {body!r} to itself")
    if kind == "connect" or not mj.eq_data[i, 10]:  # of a weld its torquescale
        return Loop("point", body, to, at.tolist(), to_at.tolist(), name=name)
    orientation = spatial.snapped(to_turn @ turn.T)
    return Loop("weld", body, to, at.tolist(), to_at.tolist(), orientation=orientation, name=name)


def _coupling(mj: MjModel, i: int, name: str, moving: Sequence[Body]) -> Loop:
    """q - q0 = c0 + c1 (q_to - q0_to) + .., as a polynomial of q_to; c0 alone without another joint."""
    one, other = int(mj.eq_obj1id[i]), int(mj.eq_obj2id[i])
    starts = mj.tendon_length0 if _kind(mj, i) == "tendon" else mj.qpos0[mj.jnt_qposadr]
    body = _coupled(mj, i, one, moving)
    if other < 0:
        return Loop("coupling", body, coefficients=[float(mj.eq_data[i, 0] + starts[one])], name=name)
    shifted = Polynomial(mj.eq_data[i, :5])(Polynomial([-starts[other], 1.0])) + float(starts[one])
    coefficients = [float(x) for x in np.trim_zeros(shifted.coef, "b")]
    return Loop("coupling", body, _coupled(mj, i, other, moving), coefficients=coefficients or [0.0], name=name)


def _coupled(mj: MjModel, i: int, which: int, moving: Sequence[Body]) -> str | dict[str, float]:
    """The body on a joint, or those of a tendon with their coefficients."""
    if _kind(mj, i) == "joint":
        return moving[which].name
    return {moving[j].name: coefficient for j, coefficient in fixed_tendon(mj, which).items()}


def _frames(mj: MjModel, i: int, ends: Sequence[tuple[str, Array]]) -> tuple[End, End]:
    """The frames of two sites or bodies that are held together: of a weld of bodies the second's axes in the first."""
    one, other = int(mj.eq_obj1id[i]), int(mj.eq_obj2id[i])
    if hasattr(mj, "eq_objtype") and word_of("Obj", mj.eq_objtype[i]) == "site":
        (body, origin), (to, to_origin) = (ends[mj.site_bodyid[site]] for site in (one, other))
        turn, to_turn = (spatial.from_quaternion(mj.site_quat[site]) for site in (one, other))
        return (body, origin + mj.site_pos[one], turn), (to, to_origin + mj.site_pos[other], to_turn)
    (body, origin), (to, to_origin) = ends[one], ends[other]
    data, turn = np.array(mj.eq_data[i]), np.eye(3)
    point, computed = data[0:3], spatial.cleaned(data[3:6])
    if _kind(mj, i) == "connect":
        return (body, origin + point, turn), (to, to_origin + computed, turn)
    return (body, origin + computed, spatial.from_quaternion(data[6:10])), (to, to_origin + point, turn)
