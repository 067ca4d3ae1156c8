"""MJCF read: the mechanism of MuJoCo's own model, which its compiler makes of a file of modest size."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

import numpy as np

from cgraph._shared import Array

from ..multibody.algebra import spatial
from ..multibody.bodies.joint_coordinates import coordinate_names, velocity_names
from ..multibody.joints import TYPES
from ..multibody.trees.mechanism import WORLD, Body, Joint, Mechanism, MechanismError, MechanismWarning
from .contacts import untaken, with_contacts
from .left_out import listed, present, refused_or_left_out, unused
from .mjcf_contacts import mjcf_balls
from .mujoco_module import mujoco, word_of
from .read_equality import left_of_equalities, names_of, other_equalities, read_loops
from .smooth_forces import (
    Smooth,
    actuators,
    disabled,
    first_output,
    fixed_tendon,
    gain_and_bias,
    input_places,
    inputs,
    is_linear,
    joint_limits,
    mjcf_forces,
    modelled,
    single,
)
from .source import is_text, path_of, root_of, text_of
from .write_mjcf import zeros_again

if TYPE_CHECKING:
    from mujoco import MjModel


# Fields of MuJoCo's model that say so when they are not zero.
_OF_A_TENDON = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature", "springyield")
_OF_AN_ACTUATOR = ("actuator_armature", "actuator_damping", "actuator_dampingpoly")
_NOT_LINEAR = ("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly")


def read_mjcf(mj: MjModel, ignore: bool, smooth: Smooth) -> Mechanism:
    """The mechanism of MuJoCo's model. Raises MechanismError for what a mechanism cannot have."""
    names, labels = _body_names(mj), [mj.joint(j).name for j in range(mj.njnt)]
    left_out = refused_or_left_out(_not_modelled(mj), _acting_from_outside(mj, smooth), ignore)
    bodies: list[Body] = []
    ends = [(WORLD, np.zeros(3))]  # of each MuJoCo body: the last of its chain, and its origin in that one's frame
    with np.errstate(all="ignore"):  # of numbers that are not finite Mechanism says where they stand
        for body in range(1, mj.nbody):
            chain, origin = _chain(mj, body, names, labels, *ends[mj.body_parentid[body]])
            bodies += chain
            ends.append((chain[-1].name, origin))
    gravity = mj.opt.gravity * (not disabled(mj, "GRAVITY"))
    moving = [body for body in bodies if body.joint.type.moves]
    forces, loops = mjcf_forces(mj, moving, smooth, ends), read_loops(mj, moving, ends)
    named = {name: 0.0 for force in forces for name in sorted(force.names)}
    mechanism = Mechanism(
        bodies, gravity, forces, named, left_out=left_out, loops=loops, starts=_starts(mj, moving, named)
    )
    return mechanism if smooth.contacts is None else with_contacts(mechanism, smooth.contacts, *mjcf_balls(mj, ends))


def _starts(mj: MjModel, moving: Sequence[Body], taken: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """{keyframe: its coordinates, velocities and inputs, by name}."""
    names = [*[f"q.{name}" for name in coordinate_names(moving)], *[f"qd.{name}" for name in velocity_names(moving)]]
    ctrl = {name: place for name, place in input_places(mj).items() if name in taken}
    return {
        mj.key(k).name or f"key {k}": dict(
            zip(names, [*mj.key_qpos[k].tolist(), *mj.key_qvel[k].tolist()], strict=True)
        )
        | {name: float(mj.key_ctrl[k, at]) for name, at in ctrl.items()}
        for k in range(mj.nkey)
    }


def compiled_mjcf(source: object, called: str) -> MjModel:
    """MuJoCo's model of a path or text.  called: what errors call it.

    MuJoCo by itself prints its warnings and adds them to a file in the current folder; a handler takes them instead.
    """
    models = mujoco().MjModel
    require_modest(source, called)
    given = text_of(source).decode() if is_text(source) else str(path_of(source))
    said: list[str] = []
    before = mujoco().get_mju_user_warning()
    mujoco().set_mju_user_warning(said.append)
    try:
        mj = models.from_xml_string(given) if is_text(source) else models.from_xml_path(given)
    except (ValueError, RuntimeError) as error:
        if not root_of(source):
            raise MechanismError(f"{called} is not XML, as MJCF and URDF are") from None
        raise MechanismError(f"MuJoCo cannot read {called}: {' '.join(str(error).split())}") from None
    finally:
        mujoco().set_mju_user_warning(before)
    if any(["NaN" in each for each in said]):
        raise MechanismError(f"{called} has a number that is NaN, and a model needs finite ones")
    for each in said:
        warnings.warn(f"MuJoCo on {called}: {' '.join(each.split())}", MechanismWarning, stacklevel=4)
    return mj


def _body_names(mj: MjModel) -> list[str]:
    """Names of MuJoCo's bodies; one without gets one that no other has."""
    names = [mj.body(i).name for i in range(mj.nbody)]
    for i, name in enumerate(names):
        names[i] = name or unused(f"body {i}", names)
    return names


def _chain(
    mj: MjModel, body: int, names: list[str], labels: Sequence[str], parent: str, origin: Array
) -> tuple[list[Body], Array]:
    """One of MuJoCo's bodies as a chain with one joint each, and the origin of its frame in that of the chain's last.

    MuJoCo turns a body about a point (its joint's `pos`) other than its origin; here the body's origin is that point.
    names, labels: all that are taken, of bodies, MuJoCo's first and without a gap, and of joints.
    origin: of the parent's MuJoCo frame in that of `parent`.
    """
    name = names[body]
    joints = range(mj.body_jntadr[body], mj.body_jntadr[body] + mj.body_jntnum[body])
    chain: list[Body] = []
    position, orientation = origin + mj.body_pos[body], spatial.from_quaternion(mj.body_quat[body])
    for j in joints:
        called = name
        if j != joints[-1]:
            called = unused(f"{name} {labels[j] or f'joint {j}'}", names)
            names.append(called)
        anchor = mj.jnt_pos[j] if TYPES[_kind(mj, j)].turns else np.zeros(3)
        label = labels[j] or unused(called, labels)
        link = replace(_joint(mj, j, position + orientation @ anchor, orientation), name=label * (label != called))
        chain.append(Body(called, link, parent))
        parent, position, orientation = called, -anchor, np.eye(3)
    if not joints:
        chain.append(Body(name, Joint("fixed", position=position, orientation=orientation), parent))
        position = np.zeros(3)
    mass, moments = mj.body_mass[body], mj.body_inertia[body]
    if joints:
        mass, moments = zeros_again(mass), zeros_again(moments)
    axes = spatial.from_quaternion(mj.body_iquat[body])
    inertia = spatial.cleaned(axes @ np.diag(moments) @ axes.T)
    center = position + spatial.cleaned(mj.body_ipos[body])
    last = chain[-1]
    share = float(mj.body_gravcomp[body]) * (not disabled(mj, "GRAVITY"))
    chain[-1] = Body(last.name, last.joint, last.parent, float(mass), center, inertia, share)
    return chain, position


def _joint(mj: MjModel, j: int, position: Array, orientation: Array) -> Joint:
    """The joint, with the frame where it is at q = 0: MuJoCo's stands at q = qpos0 (`ref`)."""
    kind, axis, dof = _kind(mj, j), np.array(mj.jnt_axis[j]), mj.jnt_dofadr[j]
    single = len(TYPES[kind].coordinates) == 1
    zero = float(mj.qpos0[mj.jnt_qposadr[j]]) if single else 0.0
    if kind == "free":  # its coordinates are the body's place in the world, whatever the file says of its frame
        position, orientation = np.zeros(3), np.eye(3)
    if zero:
        turn, shift = TYPES[kind].placement(axis, np.array([-zero]))
        position, orientation = position + orientation @ shift, orientation @ turn
    return Joint(
        kind,
        axis,
        position,
        orientation,
        damping=float(mj.dof_damping[dof]) * (not disabled(mj, "DAMPER")),
        stiffness=float(mj.jnt_stiffness[j]) * (not _elsewhere(mj, j)) * (not disabled(mj, "SPRING")),
        spring_reference=float(mj.qpos_spring[mj.jnt_qposadr[j]]) if single else 0.0,
        armature=float(mj.dof_armature[dof]),
        limits=joint_limits(mj, j) if single else None,
    )


def _kind(mj: MjModel, j: int) -> str:
    """Our kind of a joint, "" for the kinds that a mechanism has not."""
    return {each.mjcf: kind for kind, each in TYPES.items()}.get(word_of("Joint", mj.jnt_type[j]), "")


def _not_modelled(mj: MjModel) -> list[str]:
    """Sentences on parts of the model's mechanism that a mechanism cannot have."""
    sprung = [] if disabled(mj, "SPRING") else sorted(j for j in _where(mj, "jnt_stiffness") if _elsewhere(mj, j))
    pulling = sorted(set().union(*(_where(mj, f"tendon_{what}") for what in _OF_A_TENDON)))
    pulling = [t for t in pulling if not is_linear(mj, t)]
    others = {
        f"springs of free joints, or of turned ball joints ({listed(_joint_names(mj, sprung))})": sprung,
        f"tendons with a spring, damper or mass ({names_of(mj, pulling, 'tendon')})": pulling,
        "springs or dampers that are not linear": _any(mj, *_NOT_LINEAR),
        f"joints with several dampings or armatures ({listed(_joint_names(mj, _uneven(mj)))})": _uneven(mj),
        "actuators with armature or damping": _any(mj, *_OF_AN_ACTUATOR),
        "a fluid (density or viscosity)": mj.opt.density or mj.opt.viscosity,
        "flexible bodies": getattr(mj, "nflex", 0),
        "plugins": getattr(mj, "nplugin", 0),
    }
    return [*present(others), *other_equalities(mj)]


def _acting_from_outside(mj: MjModel, smooth: Smooth) -> list[str]:
    """Sentences on inputs and forces on the mechanism that are not smooth, and not taken."""
    limited = not disabled(mj, "CONSTRAINT", "LIMIT")
    limits = [j for j in sorted(_where(mj, "jnt_limited")) if smooth.limits is None or not single(mj, j)]
    takeable = any([word_of("Geom", kind) in ("sphere", "capsule") for kind in mj.geom_type])
    touching = (np.any(mj.geom_contype) and np.any(mj.geom_conaffinity)) or mj.npair
    pulling = {
        what: [t for t in sorted(_where(mj, f"tendon_{field}")) if taken is None or not fixed_tendon(mj, t)]
        for what, field, taken in (("limits", "limited", smooth.limits), ("loss", "frictionloss", smooth.friction))
    }
    rubbing = not disabled(mj, "CONSTRAINT", "FRICTIONLOSS")
    rubbed = sorted(_where(mj, "dof_frictionloss"))
    names = _joint_names(mj, [int(mj.dof_jntid[i]) for i in rubbed])
    losses = [f"{name}: {mj.dof_frictionloss[i]:g}" for name, i in zip(names, rubbed, strict=True)]
    mocap = [_body_names(mj)[i] for i in np.flatnonzero(mj.body_mocapid >= 0)]
    weightless = _any(mj, "body_gravcomp") and not disabled(mj, "GRAVITY")
    none_acts = not mj.nu or disabled(mj, "ACTUATION")
    balancing = np.flatnonzero(mj.jnt_actgravcomp & (mj.jnt_actfrclimited | none_acts)).tolist() if weightless else []
    left = [i for i in range(actuators(mj)) if not (smooth.actuators and modelled(mj, i))]
    acting = {} if disabled(mj, "ACTUATION") else {i: _at_rest(mj, i) for i in left}
    servos = [f"{mj.actuator(i).name or f'number {i}'}: {force}" for i, force in acting.items() if force]
    others = {
        untaken(takeable): touching and smooth.contacts is None and not disabled(mj, "CONSTRAINT", "CONTACT"),
        f"joint limits ({listed(_joint_names(mj, limits))})": limits and limited,
        f"tendon limits ({names_of(mj, pulling['limits'], 'tendon')})": pulling["limits"] and limited,
        f"friction loss ({listed(losses)})": losses and rubbing and smooth.friction is None,
        f"friction loss of tendons ({names_of(mj, pulling['loss'], 'tendon')})": pulling["loss"] and rubbing,
        f"motions of mocap bodies, which stand where the file has them ({listed(mocap)})": mocap,
        f"ranges, or lack, of actuators that balance weight ({listed(_joint_names(mj, balancing))})": balancing,
        f"actuators ({len(acting) - len(servos)})": len(acting) > len(servos),
        f"actuators that act with no input ({listed(servos)})": servos,
    }
    return [*present(others), *left_of_equalities(mj)]


def _at_rest(mj: MjModel, i: int) -> str:
    """The force of an actuator whose input is 0, "" for none."""
    if (kind := word_of("Bias", mj.actuator_biastype[i])) not in ("none", "affine"):
        return kind
    numbers = zip(gain_and_bias(mj, i)[1], ("", " length", " velocity"), strict=True)
    terms = [f"{number:+g}{of}" for number, of in numbers if number]
    limited = [] if disabled(mj, "CLAMPCTRL") else [k for k in inputs(mj, i) if mj.actuator_ctrllimited[k]]
    nearest = [float(np.clip(0.0, *mj.actuator_ctrlrange[k])) for k in limited]
    terms += [f"input at {'least' if least > 0.0 else 'most'} {least:g}" for least in nearest if least]
    gear = mj.actuator_gear[first_output(mj, i), 0]
    return " ".join([*terms, *([f"times gear {gear:g}"] if terms and gear != 1.0 else [])])


def _where(mj: MjModel, field: str) -> set[int]:
    """Rows of a model's field that are not all zero; none for a field that this version of MuJoCo has not."""
    values = np.asarray(getattr(mj, field, []))
    return {int(i) for i in np.flatnonzero(values.reshape(len(values), -1).any(axis=1))} if values.size else set()


def _elsewhere(mj: MjModel, j: int) -> bool:
    """Whether a joint's spring is one that ours cannot have, or pulls where ours does not."""
    kind, at = TYPES[_kind(mj, j)], mj.jnt_qposadr[j]
    count = len(kind.coordinates)
    return not kind.sprung or (count > 1 and mj.qpos_spring[at : at + count].tolist() != [*kind.neutral])


def _uneven(mj: MjModel) -> list[int]:
    """Joints of which one degree of freedom has another damping or armature than the first."""
    first = mj.jnt_dofadr[mj.dof_jntid]
    dofs = (mj.dof_damping != mj.dof_damping[first]) | (mj.dof_armature != mj.dof_armature[first])
    return sorted({int(j) for j in mj.dof_jntid[dofs]})


def _any(mj: MjModel, *fields: str) -> bool:
    return any([_where(mj, field) for field in fields])


def _joint_names(mj: MjModel, joints: Sequence[int]) -> list[str]:
    """Names of joints; of one that has none, the body's."""
    bodies = _body_names(mj)
    return [mj.joint(j).name or f"of body {bodies[mj.jnt_bodyid[j]]!r}" for j in joints]


COPIES = 10_000  # of replicated elements: MuJoCo's time grows with their square
_FILES = {f"file{side}" for side in ("", "right", "left", "up", "down", "front", "back")}


def require_modest(source: object, called: str) -> None:
    """Raises MechanismError for a text that names another file or is not XML, too many copies, and a blank anchor.

    called: what errors call the source.
    """
    asked = _Asked(None if is_text(source) else path_of(source).parent)
    try:
        asked.read(text_of(source))
    except (expat.ExpatError, LookupError, ValueError) as error:
        if is_text(source):
            raise MechanismError(f"{called} is not XML: {error}") from None
    if is_text(source) and asked.files:
        named = f"{called} names the file {asked.files[0]!r:.200}"
        raise MechanismError(f"{named}, and a text reads no other files: give the path of a model instead")
    if asked.blank:
        raise MechanismError(f"MuJoCo cannot read {called}: the anchor of a <connect> needs three numbers, got none")
    if asked.copies > COPIES:
        raise MechanismError(f"{called} asks for {asked.copies:.6g} copies by `count`, at most {COPIES} are made")


class _Asked:
    """Files that a model names, and the copies that its elements and those of the files that it includes ask for.

    folder: where included files are; None: they are not read.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.files: list[str] = []
        self.included: set[Path] = set()
        self.copies = 0.0
        self.blank = False  # an anchor without numbers, after which MuJoCo 4 reads no other model in this process
        self.within = [1.0]  # of each open element, how often it is made

    def read(self, text: bytes) -> None:
        """Add what a text asks for. Raises what expat does, also where MuJoCo takes it, as "--" in a comment."""
        parser = expat.ParserCreate("utf-8" if self.folder is None else None)
        parser.StartElementHandler, parser.EndElementHandler = self._opened, lambda _: self.within.pop()
        parser.Parse(text, True)

    def _opened(self, tag: str, attributes: dict[str, str]) -> None:
        self.files += [attributes[name] for name in sorted(_FILES & attributes.keys())]
        self.blank |= not attributes.get("anchor", "0").strip()
        times = 1.0
        with suppress(ValueError):  # MuJoCo says what is no number
            times = math.prod([float(each) for each in attributes.get("count", "1").split()])
        self.within.append(self.within[-1] * max(times, 1.0))
        if times > 1.0:
            self.copies += self.within[-1]
        if tag == "include" and self.folder is not None:
            path, depth = self.folder / attributes.get("file", ""), len(self.within)
            if path not in self.included and path.is_file():  # MuJoCo refuses a file that is included twice
                self.included.add(path)
                with suppress(expat.ExpatError, LookupError):
                    self.read(path.read_bytes())
                del self.within[depth:]
