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

from cgraph.extend import require_flag

from ..multibody import spatial
from ..multibody.joints import TYPES
from ..multibody.mechanism import WORLD, Body, Joint, Mechanism, MechanismError
from ..multibody.spatial import Array
from .mujoco_twin import mujoco

_BEFORE_XML = "\ufeff \t\r\n"  # what editors leave there

# Fields of MuJoCo's model that say so when they are not zero.
_OF_A_TENDON = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature")
_OF_AN_ACTUATOR = ("actuator_armature", "actuator_damping", "actuator_dampingpoly")
_NOT_LINEAR = ("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly")


def load_mjcf(source: Any, *, ignore: bool = False) -> Mechanism:
    """The mechanism of a MuJoCo model: its trees of hinges, slides and welds, springs, damping and armature.

    Coordinates are MuJoCo's qpos of the hinges and slides, in its order and from the same zero. A body with several
    joints becomes a chain; its last joint carries the body's name, the others the body's and their own.

    Parameters
    ----------
    source : str, path or MjModel
        A path, the XML text (it starts with "<"), or MuJoCo's own model.
    ignore : bool
        Leave out what a mechanism cannot have: springs of ball joints, tendons, equality, friction loss, fluid, ...
        Contacts, limits and actuators, which act on a mechanism and do not belong to it, are always left out.

    Returns
    -------
    Mechanism
        Its `omitted` says what was left out, a sentence each.

    Raises
    ------
    MechanismError
        For a file that is missing or wrong, for what a mechanism cannot have, unless `ignore`, and as `Mechanism`.
    ImportError
        Without MuJoCo.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.load_mjcf(dyn.to_mjcf(dyn.planar_arm([1.0, 0.8], [1.0, 0.5])))
    >>> arm.coordinates
    ('link 1', 'link 2')
    """
    mj = source if isinstance(source, mujoco().MjModel) else _compiled(source, _called(source))
    return _mechanism(mj, ignore)


def _mechanism(mj: Any, ignore: bool) -> Mechanism:
    serious, outside = _not_modelled(mj), _acting_from_outside(mj)
    if not require_flag("ignore", ignore) and serious:
        raise MechanismError(f"a mechanism cannot have {'; '.join(serious)} (the option ignore leaves this out)")
    names = _names(mj)
    bodies: list[Body] = []
    ends = [(WORLD, np.zeros(3))]  # of each MuJoCo body: the last of its chain, and its origin in that one's frame
    with np.errstate(all="ignore"):  # of numbers that are not finite Mechanism says where they stand
        for body in range(1, mj.nbody):
            chain, origin = _chain(mj, body, names, *ends[mj.body_parentid[body]])
            bodies += chain
            ends.append((chain[-1].name, origin))
    gravity = mj.opt.gravity * (not _disabled(mj, "GRAVITY"))
    return Mechanism(bodies, gravity, omitted=(*serious, *outside))


def load_urdf(source: Any, *, ignore: bool = False) -> Mechanism:
    """The mechanism of a URDF file: its joints, the damping in <dynamics>, and the mass in <inertial>.

    Shapes are not read, so their meshes need not be there; the root link stands still.

    Parameters
    ----------
    source : str or path
        A path or the XML text (it starts with "<").
    ignore : bool
        Leave out what a mechanism cannot have, as in `load_mjcf`.

    Returns
    -------
    Mechanism
        Its `omitted` says what was left out, a sentence each.

    Raises
    ------
    MechanismError
        For a file that is missing or wrong, for what a mechanism cannot have, unless `ignore`, and as `Mechanism`.
    ImportError
        Without MuJoCo.

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Body("rotor", dyn.Joint("revolute"), mass=1.0, inertia=(0.1, 0.1, 0.1))
    >>> dyn.load_urdf(dyn.to_urdf(dyn.Mechanism([rotor]))).coordinates
    ('rotor',)
    """
    return _mechanism(_compiled(_without_shapes(source), _called(source)), ignore)


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


def load_model(source: Any, *, ignore: bool = False) -> Mechanism:
    """As `load_urdf` for XML whose root element is <robot>, else as `load_mjcf`."""
    load = load_urdf if _root(source) == "robot" else load_mjcf
    return load(source, ignore=ignore)


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
    if path.is_dir():
        raise MechanismError(f"{os.fspath(source)!r:.200} is a folder, and a model is a file")
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
        mj = models.from_xml_string(given) if _is_text(source) else models.from_xml_path(given)
    except ValueError as error:
        if not _root(source):
            raise MechanismError(f"{called} is not XML, as MJCF and URDF are") from None
        raise MechanismError(f"MuJoCo cannot read {called}: {' '.join(str(error).split())}") from None
    finally:
        mujoco().set_mju_user_warning(before)
    if any(["NaN" in each for each in said]):
        raise MechanismError(f"{called} has a number that is NaN, and a model needs finite ones")
    for each in said:
        warnings.warn(f"MuJoCo on {called}: {' '.join(each.split())}", stacklevel=4)
    return mj


def _names(mj: Any) -> list[str]:
    """Names of MuJoCo's bodies; one without gets one that no other has."""
    names = [mj.body(i).name for i in range(mj.nbody)]
    for i, name in enumerate(names):
        names[i] = name or _unused(f"body {i}", names)
    return names


def _unused(name: str, names: Sequence[str]) -> str:
    return name if name not in names else _unused(name + "'", names)


def _chain(mj: Any, body: int, names: list[str], parent: str, origin: Array) -> tuple[list[Body], Array]:
    """One of MuJoCo's bodies as a chain with one joint each, and the origin of its frame in that of the chain's last.

    MuJoCo turns a body about a point (its joint's `pos`) other than its origin; here the body's origin is that point.
    names: all that are taken, MuJoCo's bodies first.  origin: of the parent's MuJoCo frame in that of `parent`.
    """
    name = names[body]
    first = mj.body_jntadr[body]
    joints = [j for j in range(first, first + mj.body_jntnum[body]) if _kind(mj, j)]
    chain: list[Body] = []
    position, orientation = origin + mj.body_pos[body], spatial.from_quaternion(mj.body_quat[body])
    for j in joints:
        anchor = mj.jnt_pos[j] if TYPES[_kind(mj, j)].turns else np.zeros(3)
        link = _joint(mj, j, position + orientation @ anchor, orientation)
        called = name
        if j != joints[-1]:
            called = _unused(f"{name} {mj.joint(j).name or f'joint {j}'}", names)
            names.append(called)
        chain.append(Body(called, link, parent))
        parent, position, orientation = called, -anchor, np.eye(3)
    if not joints:
        chain.append(Body(name, Joint("fixed", position=position, orientation=orientation), parent))
        position = np.zeros(3)
    axes = spatial.from_quaternion(mj.body_iquat[body])
    inertia = spatial.cleaned(axes @ np.diag(mj.body_inertia[body]) @ axes.T)
    center = position + spatial.cleaned(mj.body_ipos[body])
    last = chain[-1]
    chain[-1] = Body(last.name, last.joint, last.parent, float(mj.body_mass[body]), center, inertia)
    return chain, position


def _joint(mj: Any, j: int, position: Array, orientation: Array) -> Joint:
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
        damping=float(mj.dof_damping[dof]) * (not _disabled(mj, "DAMPER")),
        stiffness=float(mj.jnt_stiffness[j]) * single * (not _disabled(mj, "SPRING")),
        spring_reference=float(mj.qpos_spring[mj.jnt_qposadr[j]]) if single else 0.0,
        armature=float(mj.dof_armature[dof]),
    )


def _kind(mj: Any, j: int) -> str:
    """Our kind of a joint, "" for the kinds that a mechanism has not."""
    types = mujoco().mjtJoint
    kinds = {int(getattr(types, f"mjJNT_{each.mjcf.upper()}")): kind for kind, each in TYPES.items() if each.mjcf}
    return kinds.get(int(mj.jnt_type[j]), "")


def _disabled(mj: Any, *what: str) -> bool:
    """Whether the model's options switch off any of `what`; older MuJoCo has one switch for all passive force."""
    bits = mujoco().mjtDisableBit.__members__
    names = [*what, *(["PASSIVE"] if set(what) & {"DAMPER", "SPRING"} else [])]
    return any([mj.opt.disableflags & int(bits.get(f"mjDSBL_{name}", 0)) for name in names])


def _not_modelled(mj: Any) -> list[str]:
    """What the model has and a mechanism cannot have."""
    sprung = [j for j in _where(mj, "jnt_stiffness") if len(TYPES[_kind(mj, j)].coordinates) > 1]
    sprung = [] if _disabled(mj, "SPRING") else sorted(sprung)
    pulling = sorted(set().union(*(_where(mj, f"tendon_{what}") for what in _OF_A_TENDON)))
    tendons = [mj.tendon(i).name or f"number {i}" for i in pulling]
    equalities = 0 if _disabled(mj, "CONSTRAINT", "EQUALITY") else int(np.sum(mj.eq_active0))
    rubbing = _any(mj, "dof_frictionloss", "tendon_frictionloss") and not _disabled(mj, "CONSTRAINT", "FRICTIONLOSS")
    return _present(
        {
            f"springs of free or ball joints ({_listed(_joint_names(mj, sprung))})": sprung,
            f"tendons with a spring, damper or mass ({_listed(tendons)})": pulling,
            f"equality constraints ({equalities})": equalities,
            "friction loss": rubbing,
            "springs or dampers that are not linear": _any(mj, *_NOT_LINEAR),
            "actuators with armature or damping": _any(mj, *_OF_AN_ACTUATOR),
            "a fluid (density or viscosity)": mj.opt.density or mj.opt.viscosity,
            "gravity compensation": _any(mj, "body_gravcomp") and not _disabled(mj, "GRAVITY"),
            "flexible bodies": getattr(mj, "nflex", 0),
            "plugins": getattr(mj, "nplugin", 0),
        }
    )


def _acting_from_outside(mj: Any) -> list[str]:
    """What the model has that acts on a mechanism: inputs and one-sided constraints."""
    limited = not _disabled(mj, "CONSTRAINT", "LIMIT")
    limits = sorted(_where(mj, "jnt_limited"))
    touching = (np.any(mj.geom_contype) and np.any(mj.geom_conaffinity)) or mj.npair
    return _present(
        {
            "contacts": touching and not _disabled(mj, "CONSTRAINT", "CONTACT"),
            f"joint limits ({_listed(_joint_names(mj, limits))})": limits and limited,
            "tendon limits": _any(mj, "tendon_limited") and limited,
            f"actuators ({mj.nu})": mj.nu and not _disabled(mj, "ACTUATION"),
        }
    )


def _present(found: dict[str, Any]) -> list[str]:
    return [what for what, is_there in found.items() if is_there]


def _where(mj: Any, field: str) -> set[int]:
    """Rows of a model's field that are not all zero; none for a field that this version of MuJoCo has not."""
    values = np.asarray(getattr(mj, field, []))
    return {int(i) for i in np.flatnonzero(values.reshape(len(values), -1).any(axis=1))} if values.size else set()


def _any(mj: Any, *fields: str) -> bool:
    return any([_where(mj, field) for field in fields])


def _joint_names(mj: Any, joints: Sequence[int]) -> list[str]:
    """Names of joints; of one that has none, the body's."""
    bodies = _names(mj)
    return [mj.joint(j).name or f"of body {bodies[mj.jnt_bodyid[j]]!r}" for j in joints]


def _listed(names: Sequence[str]) -> str:
    """All of the names, or the first few of many."""
    return ", ".join([*names[:5], *(["..."] if len(names) > 5 else [])])
