"""URDF written: the text of a mechanism for other programs."""

from __future__ import annotations

import math
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from ..multibody.mechanism import Body, MechanismError, require_mechanism
from ..multibody.spatial import Array
from ..systems.model import Model
from .write_mjcf import numbers

_FAR = 1e9  # m, N, m/s: URDF asks each slide for its limits


def to_urdf(model: Model) -> str:
    """The moving bodies of a model as URDF text, those welded to them merged in; the root link is "world".

    URDF has no gravity: who reads it chooses. Of parameters the values are written.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.

    Returns
    -------
    str
        The text. Joints have the names of the coordinates.

    Raises
    ------
    MechanismError
        For a model without bodies, and for what URDF has not: a spring, an armature, a force.

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
    lines = ['<?xml version="1.0"?>', '<robot name="mechanism">', '  <link name="world"/>']
    for body in mechanism.moving:
        lines += [*_link_lines(body), *_joint_lines(body)]
    return "\n".join([*lines, "</robot>"]) + "\n"


def _link_lines(body: Body) -> list[str]:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(body.inertia).tolist()
    moments = f'ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"'
    if not body.mass and not np.any(np.asarray(body.inertia)):
        return [f"  <link name={quoteattr(body.name)}/>"]
    mass = f'<origin xyz="{numbers(body.center)}"/><mass value="{body.mass!r}"/><inertia {moments}/>'
    return [
        f"  <link name={quoteattr(body.name)}>",
        f"    <inertial>{mass}</inertial>",
        "  </link>",
    ]


def _joint_lines(body: Body) -> list[str]:
    joint = body.joint
    for what in ("stiffness", "armature"):
        if getattr(joint, what):
            raise MechanismError(f"URDF has no {what}, body {body.name!r} has {getattr(joint, what)!r}")
    limits = f'lower="{-_FAR!r}" upper="{_FAR!r}" ' if joint.type.limited else ""
    return [
        f'  <joint name={quoteattr(body.coordinate)} type="{joint.type.urdf}">',
        f"    <parent link={quoteattr(body.parent)}/><child link={quoteattr(body.name)}/>",
        f'    <origin xyz="{numbers(joint.position)}" rpy="{numbers(_rpy(joint.orientation))}"/>',
        f'    <axis xyz="{numbers(joint.axis)}"/><dynamics damping="{joint.damping!r}"/>',
        f'    <limit {limits}effort="{_FAR!r}" velocity="{_FAR!r}"/>',
        "  </joint>",
    ]


def _rpy(orientation: ArrayLike) -> Array:
    """Angles [rad] about the fixed x, then y, then z, that make the rotation; about z none where x could do it."""
    r = np.asarray(orientation)
    cosine = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], cosine)
    if cosine < 1e-9:
        return np.array([math.atan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])])
