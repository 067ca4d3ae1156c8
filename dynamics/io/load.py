"""Mechanisms from MJCF and URDF files, read through MuJoCo's own compiler."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..multibody import spatial
from ..multibody.mechanism import WORLD, Body, Joint, Mechanism, MechanismError
from ..multibody.spatial import Array
from .mujoco_model import mujoco

_BEFORE_XML = "\ufeff \t\r\n"  # what editors leave there

# Fields of MuJoCo's model that say so when they are not zero.
_OF_A_TENDON = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature")
_OF_AN_ACTUATOR = ("actuator_armature", "actuator_damping", "actuator_dampingpoly")
_NOT_LINEAR = ("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly")


def load_mjcf(source: Any, *, ignore: bool = False, left_out: list[str] | None = None) -> Mechanism:
    """The mechanism of a MuJoCo model: its trees of hinges, slides and welds, springs, damping and armature.

    source: a path, the XML text (it starts with "<"), or an MjModel. Coordinates are MuJoCo's qpos of the hinges and
    slides, in its order and from the same zero. A body with several joints becomes a chain; its last joint carries the
    body's name, the others the body's and their own.
    ignore: leave out what a mechanism cannot have (free and ball joints, which then are welds; tendons, equality,
    friction loss, fluid, ...). left_out: a list that takes what was left out, one sentence for each; contacts, limits
    and actuators, which act on a mechanism and do not belong to it, are always left out.

    Raises MechanismError for a file that is missing or wrong, for what a mechanism cannot have, unless `ignore`, and as
    Mechanism does. Raises ImportError without MuJoCo.
    """
    model = source if isinstance(source, mujoco().MjModel) else _compiled(source, _called(source))
    return _mechanism(model, ignore, left_out)


def _mechanism(model: Any, ignore: bool, left_out: list[str] | None) -> Mechanism:
    serious, outside = _not_modelled(model), _acting_from_outside(model)
    if serious and not ignore:
        raise MechanismError(f"a mechanism cannot have {'; '.join(serious)} (the option ignore leaves this out)")
    if left_out is not None:
        left_out += [*serious, *outside]
    names = _names(model)
    bodies: list[Body] = []
    ends = [(WORLD, np.zeros(3))]  # of each MuJoCo body: the last of its chain, and its origin in that one's frame
    with np.errstate(all="ignore"):  # of numbers that are not finite Mechanism says where they stand
        for body in range(1, model.nbody):
            chain, origin = _chain(model, body, names, *ends[model.body_parentid[body]])
            bodies += chain
            ends.append((chain[-1].name, origin))
    return Mechanism(bodies, model.opt.gravity * (not _disabled(model, "GRAVITY")))


def load_urdf(source: Any, *, ignore: bool = False, left_out: list[str] | None = None) -> Mechanism:
    """The mechanism of a URDF file: its joints, the damping in <dynamics>, and the mass in <inertial>.

    source: a path or the XML text (it starts with "<"). Shapes are not read, so their meshes need not be there; the
    root link stands still. ignore, left_out and errors as for `load_mjcf`.
    """
    return _mechanism(_compiled(_without_shapes(source), _called(source)), ignore, left_out)


def _without_shapes(source: Any) -> str:
    """The text of a URDF without the shapes of its links."""
    text = _text(source)
    try:
        robot = ElementTree.fromstring(text)  # noqa: S314 - MuJoCo is about to read the same text
    except ElementTree.ParseError as error:
        raise MechanismError(f"{_called(source)} is not XML: {error}") from None
    if robot.tag != "robot":
        raise MechanismError(f"a URDF's root element is <robot>, {_called(source)} has <{robot.tag}>")
    for link in robot.iter("link"):
        for shape in [each for each in link if each.tag in ("visual", "collision")]:
            link.remove(shape)
    return ElementTree.tostring(robot, encoding="unicode")


def load_model(source: Any, *, ignore: bool = False, left_out: list[str] | None = None) -> Mechanism:
    """As `load_urdf` for XML whose root element is <robot>, else as `load_mjcf`."""
    load = load_urdf if _root(source) == "robot" else load_mjcf
    return load(source, ignore=ignore, left_out=left_out)


def compiled(source: Any) -> Any:
    """MuJoCo's own model, an MjModel, of what `load_model` takes. Raises MechanismError and ImportError as it does."""
    if isinstance(source, mujoco().MjModel):
        return source
    return _compiled(_without_shapes(source) if _root(source) == "robot" else source, _called(source))


def _root(source: Any) -> str:
    """The name of the root element; "" where there is none to be found."""
    try:
        text = _text(source).encode() if _is_text(source) else _path(source).read_bytes()
        _, root = next(ElementTree.iterparse(io.BytesIO(text.lstrip()), ["start"]))  # noqa: S314 - MuJoCo reads it next
    except (ElementTree.ParseError, StopIteration):
        return ""
    return str(root.tag)


def _is_text(source: Any) -> bool:
    return isinstance(source, str) and source.lstrip(_BEFORE_XML).startswith("<")


def _called(source: Any) -> str:
    return "the given text" if _is_text(source) else f"{str(source)!r}"


def _path(source: Any) -> Path:
    if not isinstance(source, str | os.PathLike):
        raise MechanismError(f"a model is a path, XML text or an MjModel, got {type(source).__name__}")
    path = Path(source)
    if not path.is_file():
        raise MechanismError(f"there is no file {os.fspath(source)!r:.200}")
    return path


def _text(source: Any) -> str:
    if _is_text(source):
        return str(source).lstrip(_BEFORE_XML)
    path = _path(source)
    try:
        return path.read_text(encoding="utf-8").lstrip(_BEFORE_XML)
    except UnicodeDecodeError:
        raise MechanismError(f"{_called(source)} is not text") from None


def _compiled(source: Any, called: str) -> Any:
    """MuJoCo's model of a path or text.

    MuJoCo by itself prints its warnings and adds them to a file in the current folder; a handler takes them instead.
    """
    models = mujoco().MjModel
    given = _text(source) if _is_text(source) else str(_path(source))
    said: list[str] = []
    before = mujoco().get_mju_user_warning()
    mujoco().set_mju_user_warning(said.append)
    try:
        model = models.from_xml_string(given) if _is_text(source) else models.from_xml_path(given)
    except ValueError as error:
        raise MechanismError(f"MuJoCo cannot read {called}: {' '.join(str(error).split())}") from None
    finally:
        mujoco().set_mju_user_warning(before)
    if any(["NaN" in each for each in said]):
        raise MechanismError(f"{called} has a number that is NaN, and a model needs finite ones")
    for each in said:
        warnings.warn(f"MuJoCo on {called}: {' '.join(each.split())}", stacklevel=4)
    return model


def _names(model: Any) -> list[str]:
    """Names of MuJoCo's bodies; one without gets one that no other has."""
    names = [model.body(i).name for i in range(model.nbody)]
    for i, name in enumerate(names):
        names[i] = name or _unused(f"body {i}", names)
    return names


def _unused(name: str, names: Sequence[str]) -> str:
    return name if name not in names else _unused(name + "'", names)


def _chain(model: Any, body: int, names: list[str], parent: str, origin: Array) -> tuple[list[Body], Array]:
    """One of MuJoCo's bodies as a chain with one joint each, and the origin of its frame in that of the chain's last.

    MuJoCo turns a body about a point (its joint's `pos`) other than its origin; here the body's origin is that point.
    names: all that are taken, MuJoCo's bodies first.  origin: of the parent's MuJoCo frame in that of `parent`.
    """
    name = names[body]
    first = model.body_jntadr[body]
    joints = [j for j in range(first, first + model.body_jntnum[body]) if _kind(model, j)]
    chain: list[Body] = []
    position, orientation = origin + model.body_pos[body], spatial.from_quaternion(model.body_quat[body])
    for j in joints:
        anchor = model.jnt_pos[j] if _kind(model, j) == "revolute" else np.zeros(3)
        link = _joint(model, j, position + orientation @ anchor, orientation)
        called = name
        if j != joints[-1]:
            called = _unused(f"{name} {model.joint(j).name or f'joint {j}'}", names)
            names.append(called)
        chain.append(Body(called, link, parent))
        parent, position, orientation = called, -anchor, np.eye(3)
    if not joints:
        chain.append(Body(name, Joint("fixed", position=position, orientation=orientation), parent))
        position = np.zeros(3)
    axes = spatial.from_quaternion(model.body_iquat[body])
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    center = position + model.body_ipos[body]
    last = chain[-1]
    chain[-1] = Body(last.name, last.joint, last.parent, float(model.body_mass[body]), center, inertia)
    return chain, position


def _joint(model: Any, j: int, position: Array, orientation: Array) -> Joint:
    """The joint, with the frame where it is at q = 0: MuJoCo's stands at q = qpos0 (`ref`)."""
    kind, axis, dof = _kind(model, j), np.array(model.jnt_axis[j]), model.jnt_dofadr[j]
    zero = float(model.qpos0[model.jnt_qposadr[j]])
    if kind == "prismatic":
        position = position - zero * (orientation @ axis)
    elif zero:
        orientation = orientation @ spatial.rotation(axis, -zero)
    return Joint(
        kind,
        axis,
        position,
        orientation,
        damping=float(model.dof_damping[dof]) * (not _disabled(model, "DAMPER")),
        stiffness=float(model.jnt_stiffness[j]) * (not _disabled(model, "SPRING")),
        spring_reference=float(model.qpos_spring[model.jnt_qposadr[j]]),
        armature=float(model.dof_armature[dof]),
    )


def _kind(model: Any, j: int) -> str:
    """Our kind of a joint, "" for the kinds that a mechanism has not."""
    types = mujoco().mjtJoint
    return {int(types.mjJNT_HINGE): "revolute", int(types.mjJNT_SLIDE): "prismatic"}.get(int(model.jnt_type[j]), "")


def _disabled(model: Any, *what: str) -> bool:
    """Whether the model's options switch off any of `what`; older MuJoCo has one switch for all passive force."""
    bits = mujoco().mjtDisableBit.__members__
    names = [*what, *(["PASSIVE"] if set(what) & {"DAMPER", "SPRING"} else [])]
    return any([model.opt.disableflags & int(bits.get(f"mjDSBL_{name}", 0)) for name in names])


def _not_modelled(model: Any) -> list[str]:
    """What the model has and a mechanism cannot have."""
    free = [j for j in range(model.njnt) if not _kind(model, j)]
    pulling = sorted(set().union(*(_where(model, f"tendon_{what}") for what in _OF_A_TENDON)))
    tendons = [model.tendon(i).name or f"number {i}" for i in pulling]
    equalities = 0 if _disabled(model, "CONSTRAINT", "EQUALITY") else int(np.sum(model.eq_active0))
    rubbing = _any(model, "dof_frictionloss", "tendon_frictionloss") and not _disabled(
        model, "CONSTRAINT", "FRICTIONLOSS"
    )
    return _present(
        {
            f"free or ball joints ({_listed(_joint_names(model, free))})": free,
            f"tendons with a spring, damper or mass ({_listed(tendons)})": pulling,
            f"equality constraints ({equalities})": equalities,
            "friction loss": rubbing,
            "springs or dampers that are not linear": _any(model, *_NOT_LINEAR),
            "actuators with armature or damping": _any(model, *_OF_AN_ACTUATOR),
            "a fluid (density or viscosity)": model.opt.density or model.opt.viscosity,
            "gravity compensation": _any(model, "body_gravcomp") and not _disabled(model, "GRAVITY"),
            "flexible bodies": getattr(model, "nflex", 0),
            "plugins": getattr(model, "nplugin", 0),
        }
    )


def _acting_from_outside(model: Any) -> list[str]:
    """What the model has that acts on a mechanism: inputs and one-sided constraints."""
    limited = not _disabled(model, "CONSTRAINT", "LIMIT")
    limits = sorted(_where(model, "jnt_limited"))
    touching = (np.any(model.geom_contype) and np.any(model.geom_conaffinity)) or model.npair
    return _present(
        {
            "contacts": touching and not _disabled(model, "CONSTRAINT", "CONTACT"),
            f"joint limits ({_listed(_joint_names(model, limits))})": limits and limited,
            "tendon limits": _any(model, "tendon_limited") and limited,
            f"actuators ({model.nu})": model.nu and not _disabled(model, "ACTUATION"),
        }
    )


def _present(found: dict[str, Any]) -> list[str]:
    return [what for what, is_there in found.items() if is_there]


def _where(model: Any, field: str) -> set[int]:
    """Rows of a model's field that are not all zero; none for a field that this version of MuJoCo has not."""
    values = np.asarray(getattr(model, field, []))
    return {int(i) for i in np.flatnonzero(values.reshape(len(values), -1).any(axis=1))} if values.size else set()


def _any(model: Any, *fields: str) -> bool:
    return any([_where(model, field) for field in fields])


def _joint_names(model: Any, joints: Sequence[int]) -> list[str]:
    """Names of joints; of one that has none, the body's."""
    bodies = _names(model)
    return [model.joint(j).name or f"of body {bodies[model.jnt_bodyid[j]]!r}" for j in joints]


def _listed(names: Sequence[str]) -> str:
    """All of the names, or the first few of many."""
    return ", ".join([*names[:5], *(["..."] if len(names) > 5 else [])])
