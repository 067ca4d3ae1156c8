"""Mechanisms from files: MJCF by MuJoCo's own compiler, URDF by its own numbers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias
from xml.etree import ElementTree

import numpy as np

from cgraph._shared import require_flag

from ..multibody.bodies.joint_coordinates import neutral
from ..multibody.trees.mechanism import Mechanism, MechanismError
from .contacts import Material, standing
from .left_out import warned
from .mujoco_module import mujoco
from .read_mjcf import compiled_mjcf, read_mjcf
from .read_urdf import add_floating_base, armatures, origin_of, read_urdf
from .smooth_forces import Smooth, smooth
from .source import called, is_text, require_root, root_of, urdf_root

if TYPE_CHECKING:
    from mujoco import MjModel

    Source: TypeAlias = str | os.PathLike[str] | MjModel


def load_mjcf(
    source: Source,
    *,
    ignore: bool = False,
    limits: Sequence[float] | None = None,
    friction: float | None = None,
    actuators: bool = False,
    contacts: Material | None = None,
) -> Mechanism:
    """The mechanism of a MuJoCo model: its trees of joints and welds, springs, damping and armature, and its loops.

    Coordinates are MuJoCo's qpos, in its order and from the same zero, and velocities its qvel; both have the names of
    its joints, as "root.x" and "root.vx" of a free one. A body with several joints becomes a chain; its last joint
    carries the body's name, the others the body's and their own. Equality constraints of joints, points and welds are
    loops of their names, see `Loop`: exact, where MuJoCo's are soft, which `left_out` says.

    Parameters
    ----------
    source : str, path or MjModel
        A path, the XML text (it starts with "<") of a model that names no other files, or MuJoCo's own model.
    ignore : bool
        Leave out what a mechanism cannot have: springs of free joints, tendons, fluid, ...
        Contacts, joint limits, friction loss and actuators, which act on a mechanism and do not belong to it, are
        left out unless asked for; of an actuator that acts with no input, such as a servo, the force is said.
    limits : pair of floats, optional
        (stiffness, damping) of springs that stand for the limits of hinges and slides, see `JointLimit`.
    friction : float, optional
        A velocity [rad/s or m/s] with which friction loss acts, as loss tanh(qd / friction); with 0 it sticks, as
        loss sign(qd), see `JointFriction`.
    actuators : bool
        Take motors, position and velocity servos and the like on hinges and slides, see `Actuator`. Their inputs are
        parameters, "ctrl_" and the actuator's name (or number), 0 where nothing else is said.
    contacts : "compliant" or mapping of str to float or str, optional
        Take spheres on planes and on spheres, and the ends of capsules on planes, where MuJoCo lets them collide, as
        compliant contacts, see `Contact`. The file's softness is not taken, its sliding friction is. With the weight W
        of all that moves, g of gravity, the radius r (of two spheres 1/r = 1/r_1 + 1/r_2) and a sink s = 0.01 r, the
        stiffness is W / s^(3/2), so that a sphere that carries it all sinks by s; dissipation is 1 / sqrt(g s), which
        damps that motion with a ratio of 0.4; the velocity of friction is 0.1 sqrt(g s). A mapping, such as
        {"stiffness": 1e5, "friction": "mu"}, has other numbers in place of these, the same for all contacts, and names
        of parameters, whose values are these. Other shapes and pairs are left out.

    Returns
    -------
    Mechanism
        Its `left_out` says what was left out, a sentence each; a `MechanismWarning` says it, too.

    Raises
    ------
    MechanismError
        For a file that is missing or wrong, a text that names other files, more than 10 000 copies by `count`, for what
        a mechanism cannot have, unless `ignore`, for loops that cannot be closed together, and as `Mechanism`. Rows of
        loops that follow from others are a `ConstraintWarning`.
    ImportError
        Without MuJoCo.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.load_mjcf(dyn.to_mjcf(dyn.planar_arm([1.0, 0.8], [1.0, 0.5])))
    >>> arm.coordinates
    ('joint 1', 'joint 2')
    """
    given, name = isinstance(source, mujoco().MjModel), called(source)
    if not given:
        require_root(source, "mujoco", root_of(source))
    mj = source if given else compiled_mjcf(source, name)
    return warned(read_mjcf(mj, ignore, smooth(limits, friction, actuators, contacts)), "the model" if given else name)


def load_urdf(
    source: str | os.PathLike[str],
    *,
    ignore: bool = False,
    floating: bool = False,
    limits: Sequence[float] | None = None,
    friction: float | None = None,
    contacts: Material | None = None,
) -> Mechanism:
    """The mechanism of a URDF file, with the numbers of the file; its root link stands still, or floats.

    Every link is a body of its name, those without mass and those on fixed joints too, so that `position("tool0")` is
    where that frame is. Coordinates have the names of the joints, in the order of the file, those that carry
    others first. A joint that mimics another is coupled to it by a loop, see `Loop`. Meshes are not read, and
    need not be there. Drake's `drake:rotor_inertia` and `drake:gear_ratio` in the actuator of a simple transmission are
    the armature gear^2 inertia of its joint. A link whose moments no rigid body can have is taken as it is, with a
    warning; of negative moments 0 is taken, without `ignore` only of those that rounding can make of 0.

    Parameters
    ----------
    source : str or path
        A path or the XML text (it starts with "<").
    ignore : bool
        Leave out what a mechanism cannot have: joints that mimic one that is not there, or themselves by way of others,
        or that have not one coordinate, negative moments of inertia, and macros of xacro that nobody has expanded.
        Contacts, joint limits and friction loss are left out unless asked for, and all that is not read, such as
        transmissions, is left out and named; <visual> and <material> are no part of a mechanism.
    floating : bool
        Whether the root link moves freely, by a joint that is called as the link is. Joints that are floating in the
        file are free in any case. A root link called "world" is then "world'", as "world" is what it moves in.
    limits : pair of floats, optional
        (stiffness, damping) of springs that stand for the limits of hinges and slides, see `JointLimit`.
    friction : float, optional
        A velocity [rad/s or m/s] with which friction loss acts, as loss tanh(qd / friction); with 0 it sticks, as
        loss sign(qd), see `JointFriction`.
    contacts : "compliant" or mapping of str to float or str, optional
        Take collision shapes that are spheres, and the ends of capsules, as compliant contacts with the ground, the
        plane through the world's origin across gravity, with the numbers of `load_mjcf` and a friction of 1. Other
        shapes, and contacts of links with one another, are left out.

    Returns
    -------
    Mechanism
        Its `left_out` says what was left out, a sentence each; a `MechanismWarning` says it, too.

    Raises
    ------
    MechanismError
        For a file that is missing or wrong, for joints of other types, for what a mechanism cannot have, unless
        `ignore`, and as `Mechanism`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> inertia = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    >>> rotor = f'<link name="base"/><link name="rotor"><inertial>{inertia}</inertial></link>'
    >>> joint = '<joint name="j" type="continuous"><parent link="base"/><child link="rotor"/></joint>'
    >>> dyn.load_urdf(f'<robot name="r">{rotor}{joint}</robot>').coordinates
    ('j',)
    """
    taken = smooth(limits, friction, False, contacts)
    return warned(read_urdf(urdf_root(source), called(source), ignore, floating, taken), called(source))


def load_at_start(source: Source, ignore: bool, floating: bool, taken: Smooth) -> tuple[Mechanism, tuple[float, ...]]:
    """The mechanism of MJCF or URDF, by the root element, and the coordinates (nq,) at which the file has it.

    Of MJCF these are the references of joints and the places of free bodies; of URDF they are neutral,
    but that a root link that floats stands on the ground, where it has contacts: its lowest sphere touches it.
    ignore, floating: as of `load_mjcf` and `load_urdf`. Raises as these do, for `floating` of MJCF, which says itself
    what is free, and for actuators of URDF, which has none.
    """
    name = called(source)
    if root_of(source) == "robot" or (not is_text(source) and str(source).lower().endswith(".urdf")):
        if taken.actuators:
            raise MechanismError(f"actuators go with MJCF, and URDF, as is {name}, has none")
        mechanism = warned(read_urdf(urdf_root(source), name, ignore, floating, taken), name)
        return mechanism, tuple(standing(mechanism, neutral(mechanism.moving), floating))
    if require_flag("floating", floating):
        raise MechanismError(f"floating goes with URDF, and MJCF, as is {name}, says itself which bodies float")
    require_root(source, "mujoco", root_of(source))
    mj = compiled_mjcf(source, name)
    return warned(read_mjcf(mj, ignore, taken), name), tuple(mj.qpos0.tolist())


def compiled(source: Source, *, floating: bool = False) -> MjModel:
    """MuJoCo's own model, an MjModel, of a model, MJCF or URDF, read as `load_at_start` does, with its `armatures`.

    Raises MechanismError for what MuJoCo cannot read, and for joints with other coordinates there; and ImportError.
    """
    if isinstance(source, mujoco().MjModel):
        return source
    if root_of(source) != "robot":
        return compiled_mjcf(source, called(source))
    robot = urdf_root(source)
    mj = compiled_mjcf(_for_mujoco(robot, floating), called(source))
    for name, armature in armatures(robot).items():
        mj.joint(name).armature = armature
    return mj


def _for_mujoco(robot: ElementTree.Element, floating: bool) -> str:
    """The text of a URDF for MuJoCo: without shapes, and to be read without fusing links, which drops inertia."""
    if floating:
        add_floating_base(robot)
    for joint in robot.findall("joint[@type='floating']"):
        where = f"joint {joint.get('name')!r}"
        position, orientation = origin_of(joint, where)
        if np.any(position) or np.any(orientation != np.eye(3)):
            raise MechanismError(
                f"in MuJoCo a free joint has the axes and the origin of the world, and {where} has not"
            )
    for link in robot.iter("link"):
        for shape in [each for each in link if each.tag in ("visual", "collision")]:
            link.remove(shape)
    extension = robot.find("mujoco")
    extension = ElementTree.SubElement(robot, "mujoco") if extension is None else extension
    for compiler in extension.findall("compiler"):
        extension.remove(compiler)
    ElementTree.SubElement(extension, "compiler", fusestatic="false")
    return ElementTree.tostring(robot, encoding="unicode")
