"""Mechanisms from files: MJCF by MuJoCo's own compiler, URDF by its own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

from ..multibody.mechanism import Mechanism
from .left_out import warned
from .mujoco_twin import mujoco
from .read_mjcf import compiled_mjcf, read_mjcf
from .read_urdf import read_urdf
from .smooth_forces import smooth
from .source import called, root_of, urdf_root


def load_mjcf(
    source: Any,
    *,
    ignore: bool = False,
    limits: Sequence[float] | None = None,
    friction: float | None = None,
    actuators: bool = False,
) -> Mechanism:
    """The mechanism of a MuJoCo model: its trees of joints and welds, springs, damping and armature.

    Coordinates are MuJoCo's qpos, in its order and from the same zero, and velocities its qvel; both have the names of
    its joints, as "root.x" and "root.vx" of a free one. A body with several joints becomes a chain; its last joint
    carries the body's name, the others the body's and their own.

    Parameters
    ----------
    source : str, path or MjModel
        A path, the XML text (it starts with "<"), or MuJoCo's own model.
    ignore : bool
        Leave out what a mechanism cannot have: springs of ball joints, tendons, equality constraints, fluid, ...
        Contacts, joint limits, friction loss and actuators, which act on a mechanism and do not belong to it, are
        left out unless asked for; of an actuator that acts with no input, such as a servo, the force is said.
        Contact always is.
    limits : pair of floats, optional
        (stiffness, damping) of springs that stand for the limits of hinges and slides, see `JointLimit`.
    friction : float, optional
        A velocity [rad/s or m/s]; friction loss then acts as loss tanh(qd / friction), see `JointFriction`.
    actuators : bool
        Take motors, position and velocity servos and the like on hinges and slides, see `Actuator`. Their inputs are
        parameters, "ctrl_" and the actuator's name (or number), 0 where nothing else is said.

    Returns
    -------
    Mechanism
        Its `left_out` says what was left out, a sentence each; a `MechanismWarning` says it, too.

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
    ('joint 1', 'joint 2')
    """
    given, name = isinstance(source, mujoco().MjModel), called(source)
    mj = source if given else compiled_mjcf(source, name)
    return warned(read_mjcf(mj, ignore, smooth(limits, friction, actuators)), "the model" if given else name)


def load_urdf(
    source: Any, *, ignore: bool = False, limits: Sequence[float] | None = None, friction: float | None = None
) -> Mechanism:
    """The mechanism of a URDF file, with the numbers of the file; it stands on its root link.

    Every link is a body of its name, those without mass and those on fixed joints too, so that `position("tool0")` is
    where that frame is. Coordinates have the names of the joints, in the order of the file, those that carry
    others first. Shapes are not read, so their meshes need not be there. A link whose moments no rigid body
    can have is taken as it is, with a warning.

    Parameters
    ----------
    source : str or path
        A path or the XML text (it starts with "<").
    ignore : bool
        Leave out what a mechanism cannot have, the coupling of joints that mimic others. Contacts, joint limits,
        friction loss and extensions of URDF, such as transmissions, are left out, the second and third unless asked
        for.
    limits : pair of floats, optional
        (stiffness, damping) of springs that stand for the limits of hinges and slides, see `JointLimit`.
    friction : float, optional
        A velocity [rad/s or m/s]; friction loss then acts as loss tanh(qd / friction), see `JointFriction`.

    Returns
    -------
    Mechanism
        Its `left_out` says what was left out, a sentence each; a `MechanismWarning` says it, too.

    Raises
    ------
    MechanismError
        For a file that is missing or wrong, for joints of other types, for joints that mimic others,
        unless `ignore`, and as `Mechanism`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Body("rotor", dyn.Joint("revolute"), mass=1.0, inertia=(0.1, 0.1, 0.1))
    >>> dyn.load_urdf(dyn.to_urdf(dyn.Mechanism([rotor]))).coordinates
    ('rotor',)
    """
    taken = smooth(limits, friction, False)
    return warned(read_urdf(urdf_root(source), called(source), ignore, taken), called(source))


def load_model(source: Any, *, ignore: bool = False) -> Mechanism:
    """As `load_urdf` for XML whose root element is <robot>, else as `load_mjcf`."""
    load = load_urdf if root_of(source) == "robot" else load_mjcf
    return load(source, ignore=ignore)


def compiled(source: Any) -> Any:
    """MuJoCo's own model, an MjModel, of what `load_model` takes. Raises MechanismError and ImportError."""
    if isinstance(source, mujoco().MjModel):
        return source
    text = _for_mujoco(urdf_root(source)) if root_of(source) == "robot" else source
    return compiled_mjcf(text, called(source))


def _for_mujoco(robot: ElementTree.Element) -> str:
    """The text of a URDF for MuJoCo: without shapes, and to be read without fusing links, which drops inertia."""
    for link in robot.iter("link"):
        for shape in [each for each in link if each.tag in ("visual", "collision")]:
            link.remove(shape)
    extension = robot.find("mujoco")
    extension = ElementTree.SubElement(robot, "mujoco") if extension is None else extension
    for compiler in extension.findall("compiler"):
        extension.remove(compiler)
    ElementTree.SubElement(extension, "compiler", fusestatic="false")
    return ElementTree.tostring(robot, encoding="unicode")
