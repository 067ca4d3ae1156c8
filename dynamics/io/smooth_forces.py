"""Forces of a robot file: springs of tendons; on request limits as springs, friction, actuators; and limits of MJCF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import cgraph as cg
from cgraph._shared import Array, real_array, real_number, require_flag
from cgraph.extend import Builder, building

from ..multibody.algebra import spatial
from ..multibody.algebra.spatial import ZERO
from ..multibody.bodies.body import ANYTHING, Body, Limits, MechanismError
from ..multibody.forces.contact import Force
from ..multibody.forces.joint_force import Actuator, JointForce, JointFriction, JointLimit, JointSpring, Range
from .contacts import Material, asked
from .mujoco_module import mujoco, word_of

if TYPE_CHECKING:
    from mujoco import MjModel


@dataclass(frozen=True)
class Smooth:
    """Choice of the forces of a file that are taken.

    limits: stiffness and damping of springs in place of joint limits, see `JointLimit`; None leaves limits out.
    friction: the velocity of `JointFriction`; None leaves friction loss out.
    actuators: whether they are taken.
    contacts: what these have in place of numbers that follow from the file; None leaves contacts out.
    """

    limits: tuple[float, float] | None
    friction: float | None
    actuators: bool
    contacts: Mapping[str, float | str] | None


_NOT_LINEAR = ("stiffnesspoly", "dampingpoly", "armature", "springyield")


def smooth(
    limits: Sequence[float] | None, friction: float | None, actuators: bool, contacts: Material | None
) -> Smooth:
    """Choice of forces, checked. Raises MechanismError, TypeError and ValueError."""
    springs = None
    if limits is not None:
        pair = real_array("limits", limits)
        if pair.shape != (2,) or not (np.isfinite(pair).all() and pair[0] > 0.0 and pair[1] >= 0.0):
            raise MechanismError(f"limits must be (stiffness > 0, damping >= 0) of springs, got {limits!r:.60}")
        springs = (float(pair[0]), float(pair[1]))
    if friction is not None and not 0.0 <= real_number("friction", friction) < math.inf:
        raise MechanismError(f"friction must be a velocity >= 0, at which most of it acts, got {friction!r}")
    return Smooth(springs, friction, require_flag("actuators", actuators), asked(contacts))


def disabled(mj: MjModel, *what: str) -> bool:
    """Whether the model's options switch off any of `what`; older MuJoCo has one switch for all passive force."""
    bits = mujoco().mjtDisableBit.__members__
    names = [*what, *(["PASSIVE"] if set(what) & {"DAMPER", "SPRING"} else [])]
    return any([mj.opt.disableflags & int(bits.get(f"mjDSBL_{name}", 0)) for name in names])


def single(mj: MjModel, j: int) -> bool:
    """Whether a joint of MuJoCo's model is a hinge or slide."""
    return word_of("Joint", mj.jnt_type[j]) in ("hinge", "slide")


def modelled(mj: MjModel, i: int) -> bool:
    """Whether an actuator of MuJoCo's model is taken: affine, without memory, on hinges, slides and tendons of these.

    On a site or free joint it is without a share of the velocity. If the whole force on a joint has a range, only one
    that acts on this joint alone, and is alone there, is taken.
    """
    joints, on_tendon = _joints(mj, i), word_of("Trn", mj.actuator_trntype[i]) == "tendon"
    ranged = [j for j in joints or range(mj.njnt) if mj.jnt_actfrclimited[j]]
    others = [_joints(mj, k) or range(mj.njnt) for k in range(actuators(mj)) if k != i]
    shared = on_tendon or not joints or any([j in other or mj.jnt_actgravcomp[j] for j in ranged for other in others])
    return (
        word_of("Dyn", mj.actuator_dyntype[i]) == "none"
        and word_of("Gain", mj.actuator_gaintype[i]) in ("fixed", "affine")
        and word_of("Bias", mj.actuator_biastype[i]) in ("none", "affine")
        and not (ranged and shared)
        and not (on_tendon and mj.tendon_actfrclimited[mj.actuator_trnid[i, 0]])
        and not getattr(mj, "actuator_delay", [0.0] * (i + 1))[i] > 0.0  # in newer versions of MuJoCo
        and len(inputs(mj, i)) == 1
        and bool(joints or (_is_wrench(mj, i) and not any([numbers[2] for numbers in gain_and_bias(mj, i)])))
    )


def _joints(mj: MjModel, i: int) -> dict[int, float]:
    """{hinge or slide: how far it moves the length that an actuator acts on}, empty for another transmission."""
    at = int(mj.actuator_trnid[i, 0])
    if _on_joint(mj, i):
        return {at: 1.0} if single(mj, at) else {}
    return fixed_tendon(mj, at) if word_of("Trn", mj.actuator_trntype[i]) == "tendon" else {}


def _is_wrench(mj: MjModel, i: int) -> bool:
    """Whether an actuator pushes a site against the world, or a free body."""
    at, reference = mj.actuator_trnid[i].tolist()
    on_site = word_of("Trn", mj.actuator_trntype[i]) == "site" and reference < 0
    return on_site or (_on_joint(mj, i) and word_of("Joint", mj.jnt_type[at]) == "free")


def fixed_tendon(mj: MjModel, tendon: int) -> dict[int, float]:
    """{joint: coefficient} of a fixed tendon, empty for a spatial one."""
    rows = range(mj.tendon_adr[tendon], mj.tendon_adr[tendon] + mj.tendon_num[tendon])
    if any([word_of("Wrap", mj.wrap_type[k]) != "joint" for k in rows]):
        return {}
    return {int(mj.wrap_objid[k]): float(mj.wrap_prm[k]) for k in rows}


def is_linear(mj: MjModel, tendon: int) -> bool:
    """Whether a tendon is fixed, without mass, and its spring and damper are linear."""
    others = [np.asarray(getattr(mj, f"tendon_{what}", 0.0)) for what in _NOT_LINEAR]
    return bool(fixed_tendon(mj, tendon)) and not any([each[tendon].any() for each in others if each.ndim])


def actuators(mj: MjModel) -> int:
    """The number of actuators, which may have several inputs each in newer versions of MuJoCo."""
    return len(mj.actuator_trntype)


def _on_joint(mj: MjModel, i: int) -> bool:
    return word_of("Trn", mj.actuator_trntype[i]) in ("joint", "jointinparent")


def inputs(mj: MjModel, i: int) -> range:
    """Indices of an actuator's inputs among all; newer versions of MuJoCo have several of one."""
    first = int(getattr(mj, "actuator_ctrladr", range(i + 1))[i])
    return range(first, first + int(getattr(mj, "actuator_ctrlnum", [1] * (i + 1))[i]))


def first_output(mj: MjModel, i: int) -> int:
    """Index of an actuator's first output among all."""
    return int(getattr(mj, "actuator_outadr", range(i + 1))[i])


def mjcf_forces(
    mj: MjModel, moving: Sequence[Body], taken: Smooth, ends: Sequence[tuple[str, Array]]
) -> list[JointForce | Force]:
    """The forces of MuJoCo's model that are taken.

    moving: the bodies on its joints, in their order.  ends: for each of its bodies ours, and the origin of its frame in
    that of ours.
    """
    forces: list[JointForce | Force] = []
    tendons = [{moving[j].name: share for j, share in fixed_tendon(mj, t).items()} for t in range(mj.ntendon)]
    for t, shares in enumerate(tendons):
        stiffness = float(mj.tendon_stiffness[t]) * (not disabled(mj, "SPRING"))
        damping = float(mj.tendon_damping[t]) * (not disabled(mj, "DAMPER"))
        if is_linear(mj, t) and (stiffness or damping):
            forces.append(JointSpring(shares, stiffness, damping, *mj.tendon_lengthspring[t].tolist()))
    losses = [*mj.dof_frictionloss[mj.jnt_dofadr].tolist(), *mj.tendon_frictionloss.tolist()]
    ways: list[Any] = [*[body.name for body in moving], *tendons]
    for k, of in enumerate(ways):
        what, i = ("jnt", k) if k < mj.njnt else ("tendon", k - mj.njnt)
        limited = getattr(mj, f"{what}_limited")[i] and not disabled(mj, "CONSTRAINT", "LIMIT")
        if taken.limits is not None and limited and of and (what == "tendon" or single(mj, i)):
            (lower, upper), margin = getattr(mj, f"{what}_range")[i].tolist(), float(getattr(mj, f"{what}_margin")[i])
            forces.append(JointLimit(of, lower + margin, upper - margin, *taken.limits))
        if taken.friction is not None and losses[k] and of and not disabled(mj, "CONSTRAINT", "FRICTIONLOSS"):
            forces.append(JointFriction(of, losses[k], taken.friction))
    if taken.actuators and not disabled(mj, "ACTUATION"):
        names = list(input_places(mj))
        for i in [i for i in range(actuators(mj)) if modelled(mj, i) and not _switched_off(mj, i)]:
            actuator = _actuator(mj, i, names[i], moving)
            forces += [actuator] if actuator.body else _pushes(mj, i, actuator, ends)
    return forces


def _pushes(mj: MjModel, i: int, actuator: Actuator, ends: Sequence[tuple[str, Array]]) -> list[Force]:
    """The forces of an actuator on a site or free joint: its gear is a wrench in the axes of the site."""
    at = int(mj.actuator_trnid[i, 0])
    with building(Builder()):
        (force,) = actuator.along([ZERO], [ZERO], {actuator.input: cg.variable(actuator.input)})
        gear, kind = np.reshape(mj.actuator_gear[first_output(mj, i)], (2, 3)), word_of("Trn", mj.actuator_trntype[i])
        if kind == "site":
            gear = gear @ spatial.from_quaternion(mj.site_quat[at]).T
        push, turn = ([float(share) * force for share in row] for row in gear)
    if kind == "site":
        body, origin = ends[mj.site_bodyid[at]]
        return [Force(body, push, origin + mj.site_pos[at], "body", turn)]
    body = ends[mj.jnt_bodyid[at]][0]
    return [Force(body, push), Force(body, torque=turn, frame="body" if kind == "joint" else "world")]


def _switched_off(mj: MjModel, i: int) -> bool:
    """Whether the model's options switch the group of an actuator off."""
    group = int(mj.actuator_group[i])
    return 0 <= group < 31 and bool(int(mj.opt.disableactuator) >> group & 1)


def input_places(mj: MjModel) -> dict[str, int]:
    """{name of the parameter that controls an actuator, all different: place of its first input among all}."""
    places: dict[str, int] = {}
    for i in range(actuators(mj)):
        name = "ctrl_" + (mj.actuator(i).name or str(i)).replace(" ", "_")
        while name in places:
            name += "_"
        places[name] = inputs(mj, i)[0]
    return places


def gain_and_bias(mj: MjModel, i: int) -> tuple[list[float], list[float]]:
    """Of 1, length and velocity."""
    gain, bias = mj.actuator_gainprm[i, :3].tolist(), mj.actuator_biasprm[i, :3].tolist()
    if word_of("Gain", mj.actuator_gaintype[i]) == "fixed":
        gain[1:] = 0.0, 0.0
    if word_of("Bias", mj.actuator_biastype[i]) == "none":
        bias = [0.0, 0.0, 0.0]
    return gain, bias


def _actuator(mj: MjModel, i: int, name: str, moving: Sequence[Body]) -> Actuator:
    """The actuator, on the joints that it acts on; on none of those, with a gear of 1."""
    joints = _joints(mj, i)
    shares = {moving[j].name: coefficient for j, coefficient in joints.items()}
    on_joint = _on_joint(mj, i) and bool(joints)
    return Actuator(
        next(iter(shares)) if on_joint else shares,
        name,
        float(mj.actuator_gear[first_output(mj, i), 0]) if joints else 1.0,
        *gain_and_bias(mj, i),
        None if disabled(mj, "CLAMPCTRL") else _range(mj, "actuator_ctrl", inputs(mj, i)[0]),
        _range(mj, "actuator_force", i),
        _range(mj, "jnt_actfrc", next(iter(joints))) if on_joint else None,
    )


def _range(mj: MjModel, what: str, i: int) -> Range | None:
    low, high = getattr(mj, f"{what}range")[i].tolist()
    return (low, high) if getattr(mj, f"{what}limited")[i] else None


def joint_limits(mj: MjModel, j: int) -> Limits:
    """Limits of a hinge or slide of MuJoCo's model as numbers: its range, and what its actuators can do together."""
    efforts = [_effort(mj, i) for i in range(actuators(mj)) if _on_joint(mj, i) and mj.actuator_trnid[i, 0] == j]
    total = (sum([low for low, _ in efforts]), sum([high for _, high in efforts])) if efforts else ANYTHING
    return Limits(_range(mj, "jnt_", j) or ANYTHING, effort=_clipped(total, _range(mj, "jnt_actfrc", j)))


def _effort(mj: MjModel, i: int) -> Range:
    """What an actuator can do along its joint: gear times its force, which its input gives where it is a motor."""
    kinds = [word_of(kind, getattr(mj, f"actuator_{kind.lower()}type")[i]) for kind in ("Dyn", "Gain", "Bias")]
    ctrl, force = inputs(mj, i), ANYTHING
    if kinds == ["none", "fixed", "none"] and len(ctrl) == 1 and not disabled(mj, "CLAMPCTRL"):
        force = _scaled(mj.actuator_gainprm[i, 0], _range(mj, "actuator_ctrl", ctrl[0]))
    force = _clipped(force, _range(mj, "actuator_force", i))
    return _scaled(mj.actuator_gear[first_output(mj, i), 0], force)


def _scaled(factor: float, pair: Range | None) -> Range:
    """The pair times a number, in order; an infinite one times 0 is 0."""
    low, high = sorted([float(factor) * end if factor else 0.0 for end in pair or ANYTHING])
    return low, high


def _clipped(pair: Range, to: Range | None) -> Range:
    low, high = np.clip(pair, *(to or ANYTHING))
    return float(low), float(high)
