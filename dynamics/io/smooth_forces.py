"""Smooth forces of a robot file, taken on request: limits as springs, friction loss, actuators; and limits of MJCF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cgraph._shared import real_array, real_number, require_flag

from ..multibody.bodies.body import Body, MechanismError
from ..multibody.bodies.limits import ANYTHING, Limits
from ..multibody.forces.joint_force import Actuator, JointForce, JointFriction, JointLimit, Range
from .contacts import Material, asked
from .mujoco_module import mujoco

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

    limits: tuple[float, float] | None = None
    friction: float | None = None
    actuators: bool = False
    contacts: Mapping[str, float | str] | None = None

    def limit(self, body: str, lower: float, upper: float) -> JointLimit:
        """The limit of a joint."""
        assert self.limits is not None
        return JointLimit(body, lower, upper, *self.limits)


NONE = Smooth()


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
    types = mujoco().mjtJoint
    return int(mj.jnt_type[j]) in (int(types.mjJNT_HINGE), int(types.mjJNT_SLIDE))


def modelled(mj: MjModel, i: int) -> bool:
    """Whether an actuator of MuJoCo's model is an `Actuator`: on a hinge or slide, affine, without memory.

    Of several on a joint whose whole force has a range, none is.
    """
    j = int(mj.actuator_trnid[i, 0])
    if not (_on_joint(mj, i) and single(mj, j)):
        return False
    sharing = sum(_on_joint(mj, k) and mj.actuator_trnid[k, 0] == j for k in range(actuators(mj)))
    return (
        _called("Dyn", mj.actuator_dyntype[i]) == "none"
        and _called("Gain", mj.actuator_gaintype[i]) in ("fixed", "affine")
        and _called("Bias", mj.actuator_biastype[i]) in ("none", "affine")
        and not (mj.jnt_actfrclimited[j] and sharing > 1)
        and not (_delayed(mj, i) or mj.jnt_actgravcomp[j])
        and len(inputs(mj, i)) == 1
    )


def actuators(mj: MjModel) -> int:
    """The number of actuators, which may have several inputs each in newer versions of MuJoCo."""
    return len(mj.actuator_trntype)


def _called(kind: str, value: int) -> str:
    """MuJoCo's word for a type of a transmission, gain, ..."""
    word: str = getattr(mujoco(), f"mjt{kind}")(int(value)).name
    return word.removeprefix(f"mj{kind.upper()}_").lower()


def _on_joint(mj: MjModel, i: int) -> bool:
    return _called("Trn", mj.actuator_trntype[i]) in ("joint", "jointinparent")


def inputs(mj: MjModel, i: int) -> range:
    """Indices of an actuator's inputs among all; newer versions of MuJoCo have several of one."""
    first = int(getattr(mj, "actuator_ctrladr", range(i + 1))[i])
    return range(first, first + int(getattr(mj, "actuator_ctrlnum", [1] * (i + 1))[i]))


def first_output(mj: MjModel, i: int) -> int:
    """Index of an actuator's first output among all."""
    return int(getattr(mj, "actuator_outadr", range(i + 1))[i])


def _delayed(mj: MjModel, i: int) -> bool:
    """Whether an actuator acts later than its input, as in newer versions of MuJoCo."""
    delays = np.asarray(getattr(mj, "actuator_delay", []))
    return bool(delays.size and delays[i] > 0.0)


def mjcf_forces(mj: MjModel, moving: Sequence[Body], taken: Smooth) -> list[JointForce]:
    """The forces of MuJoCo's model that are taken.  moving: the bodies on its joints, in their order."""
    forces: list[JointForce] = []
    for j, body in enumerate(moving):
        if taken.limits is not None and mj.jnt_limited[j] and single(mj, j) and not disabled(mj, "CONSTRAINT", "LIMIT"):
            lower, upper = mj.jnt_range[j].tolist()
            margin = float(mj.jnt_margin[j])
            forces.append(taken.limit(body.name, lower + margin, upper - margin))
        loss = float(mj.dof_frictionloss[mj.jnt_dofadr[j]])
        if taken.friction is not None and loss and not disabled(mj, "CONSTRAINT", "FRICTIONLOSS"):
            forces.append(JointFriction(body.name, loss, taken.friction))
    if taken.actuators and not disabled(mj, "ACTUATION"):
        names = _input_names(mj)
        acting = [i for i in range(actuators(mj)) if modelled(mj, i) and not _switched_off(mj, i)]
        forces += [_actuator(mj, i, names[i], moving) for i in acting]
    return forces


def _switched_off(mj: MjModel, i: int) -> bool:
    """Whether the model's options switch the group of an actuator off."""
    group = int(mj.actuator_group[i])
    return 0 <= group < 31 and bool(int(mj.opt.disableactuator) >> group & 1)


def _input_names(mj: MjModel) -> list[str]:
    """Names of the parameters that control the actuators, all different."""
    names: list[str] = []
    for i in range(actuators(mj)):
        name = "ctrl_" + (mj.actuator(i).name or str(i)).replace(" ", "_")
        while name in names:
            name += "_"
        names.append(name)
    return names


def _actuator(mj: MjModel, i: int, name: str, moving: Sequence[Body]) -> Actuator:
    j, ctrl = int(mj.actuator_trnid[i, 0]), inputs(mj, i)[0]
    gain, bias = mj.actuator_gainprm[i, :3].tolist(), mj.actuator_biasprm[i, :3].tolist()
    if _called("Gain", mj.actuator_gaintype[i]) == "fixed":
        gain[1:] = 0.0, 0.0
    if _called("Bias", mj.actuator_biastype[i]) == "none":
        bias = [0.0, 0.0, 0.0]
    return Actuator(
        moving[j].name,
        name,
        float(mj.actuator_gear[first_output(mj, i), 0]),
        gain,
        bias,
        None if disabled(mj, "CLAMPCTRL") else _range(mj, "actuator_ctrl", ctrl),
        _range(mj, "actuator_force", i),
        _range(mj, "jnt_actfrc", j),
    )


def _range(mj: MjModel, what: str, i: int) -> Range | None:
    low, high = getattr(mj, f"{what}range")[i].tolist()
    return (low, high) if getattr(mj, f"{what}limited")[i] else None


def joint_limits(mj: MjModel, j: int) -> Limits:
    """Limits of a hinge or slide of MuJoCo's model as numbers: its range, and what its actuators can do together."""
    driving = [i for i in range(actuators(mj)) if _on_joint(mj, i) and mj.actuator_trnid[i, 0] == j]
    efforts = [_effort(mj, i) for i in driving]
    total = (sum([low for low, _ in efforts]), sum([high for _, high in efforts])) if efforts else ANYTHING
    effort = _clipped(total, _range(mj, "jnt_actfrc", j))
    return Limits(_range(mj, "jnt_", j) or ANYTHING, effort=effort)


def _effort(mj: MjModel, i: int) -> Range:
    """What an actuator can do along its joint: gear times its force, which its input gives where it is a motor."""
    kinds = [_called(kind, getattr(mj, f"actuator_{kind.lower()}type")[i]) for kind in ("Dyn", "Gain", "Bias")]
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
