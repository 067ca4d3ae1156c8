"""URDF written: the text of a mechanism for other programs."""

from __future__ import annotations

import math
import warnings
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..multibody.bodies.limits import NO_LIMITS
from ..multibody.parameters import vanishes
from ..multibody.quantities.body_quantity import of_bodies
from ..multibody.trees.mechanism import WORLD, Body, MechanismError, MechanismWarning, require_mechanism
from ..systems.model import Model
from .read_urdf import FAR_LIMIT, GRAVITY
from .write_loops import mimic_lines, numbers


@of_bodies
def to_urdf(model: Model) -> str:
    """The bodies of a model as URDF text; the root link is "world".

    `load_urdf` reads the same bodies in the same order from it: all numbers to the last bit but axes and orientations,
    which angles cost a few roundings. A joint that is locked is a weld. Gravity other than 9.81 m/s^2 along -z, which
    URDF has not, is in an element of MuJoCo's that other programs pass over. Of parameters the values are written. A
    loop that couples two joints by a line is a <mimic>, which has no name.

    Returns
    -------
    str
        The text. Joints have the names of the coordinates, and their limits; where there are none and URDF asks for
        some, they are 1e9. A limit of effort or velocity that is not the same both ways is left out, with a warning.

    Raises
    ------
    MechanismError
        For a model without bodies, and for what URDF has not: a spring, an armature, a force, a ball joint, and
        any other loop, such as a second one on the same joint.

    Examples
    --------
    >>> import dynamics as dyn
    >>> text = dyn.to_urdf(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]))
    >>> text.count('type="continuous"')
    2
    """
    mechanism = require_mechanism(model, "URDF").bind()
    if mechanism.forces:
        raise MechanismError(f"URDF has no forces, there is one on body {mechanism.forces[0].body!r}")
    mimics = mimic_lines(mechanism)
    lines = ['<?xml version="1.0"?>', '<robot name="mechanism">']
    gravity = numbers(mechanism.gravity)
    if gravity != numbers(GRAVITY):
        lines.append(f'  <mujoco><option gravity="{gravity}"/></mujoco>')
    lines.append(f'  <link name="{WORLD}"/>')
    names = set(mechanism.coordinates)
    for body in mechanism.parts:
        lines += [*_link_lines(body), *_joint_lines(body, _joint_name(body, names), mimics.get(body.name, ""))]
    return "\n".join([*lines, "</robot>"]) + "\n"


def _link_lines(body: Body) -> list[str]:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(body.inertia).tolist()
    moments = f'ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"'
    if vanishes(body.mass) and vanishes(body.inertia) and vanishes(body.center):
        return [f"  <link name={quoteattr(body.name)}/>"]
    mass = f'<origin xyz="{numbers(body.center)}"/><mass value="{body.mass!r}"/><inertia {moments}/>'
    return [
        f"  <link name={quoteattr(body.name)}>",
        f"    <inertial>{mass}</inertial>",
        "  </link>",
    ]


def _joint_name(body: Body, names: set[str]) -> str:
    """The name of a joint, added to those that are taken; a weld gets one that no other has."""
    name = body.coordinate
    while name in names and not body.joint.type.moves:
        name += "'"
    names.add(name)
    return name


def _joint_lines(body: Body, name: str, mimic: str) -> list[str]:
    joint = body.joint
    if not joint.type.urdf:
        raise MechanismError(f"URDF has no joint of the kind {joint.kind!r}, as is the joint of body {body.name!r}")
    place = f'    <origin xyz="{numbers(joint.position)}" rpy="{numbers(_rpy(joint.orientation))}"/>'
    ends = f"    <parent link={quoteattr(body.parent)}/><child link={quoteattr(body.name)}/>"
    limits = joint.limits or NO_LIMITS
    ended = joint.type.limited or limits.position != NO_LIMITS.position
    kind = "revolute" if ended and not joint.type.limited else joint.type.urdf  # "continuous" has no ends
    opened = f'  <joint name={quoteattr(name)} type="{kind}">'
    if not joint.type.moves:
        return [opened, ends, place, "  </joint>"]
    for what in ("stiffness", "armature"):
        if getattr(joint, what):
            raise MechanismError(f"URDF has no {what}, body {body.name!r} has {getattr(joint, what)!r}")
    dynamics = f'<dynamics damping="{joint.damping!r}"/>'
    if not joint.type.has_axis:
        return [opened, ends, place, f"    {dynamics}", "  </joint>"]
    lower, upper = (min(max(end, -FAR_LIMIT), FAR_LIMIT) for end in limits.position)
    ends_of = f'lower="{lower!r}" upper="{upper!r}" ' if ended else ""
    effort, velocity = (_size(name, what, getattr(limits, what)) for what in ("effort", "velocity"))
    return [
        opened,
        ends,
        place,
        f'    <axis xyz="{numbers(joint.axis)}"/>{dynamics}{mimic}',
        f'    <limit {ends_of}effort="{effort!r}" velocity="{velocity!r}"/>',
        "  </joint>",
    ]


def _size(name: str, what: str, pair: tuple[float, float]) -> float:
    """A limit that is the same both ways, as URDF has them; a warning for another, which is left out."""
    if pair[0] != -pair[1]:
        text = f"URDF has one {what} limit for both ways: that of {name!r}, {pair[0]:g} to {pair[1]:g}, is left out"
        warnings.warn(text, MechanismWarning, stacklevel=5)
        return FAR_LIMIT
    return min(pair[1], FAR_LIMIT)


def _rpy(orientation: ArrayLike) -> Array:
    """Angles [rad] about the fixed x, then y, then z, that make the rotation.

    The angle about x is read off the rotation turned back about z, so that both fit each other where the pitch is near
    a quarter turn and each alone is hardly determined.
    """
    r = np.asarray(orientation)
    yaw = math.atan2(r[1, 0], r[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return np.array([roll, math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0])), yaw])
