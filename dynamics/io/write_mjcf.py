"""MJCF written: the text of a mechanism for MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from cgraph.extend import real_number

from ..multibody import spatial
from ..multibody.joints import AxialJoint
from ..multibody.mechanism import WORLD, Body, Mechanism, MechanismError, require_mechanism
from ..multibody.parameters import Quantities
from ..multibody.spatial import Array
from ..systems.model import Model

_SMALLEST = 1e-14  # kg, kg m^2: what stands for zero, since MuJoCo takes nothing up to its mjMINVAL of 1e-15
_ROUNDING = 2.0**-50  # of the largest moment of inertia: what is left of one that is zero


def to_mjcf(model: Model, timestep: float = 1e-3) -> str:
    """The bodies of a model as MJCF text: masses and inertias explicit, RK4, contacts off.

    Bodies that are welded on are merged into those that carry them; joints have the names of the coordinates, and of
    parameters there are the values.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.
    timestep : float
        MuJoCo's step [s].

    Returns
    -------
    str
        The text.

    Raises
    ------
    MechanismError
        For a model without bodies, and for forces on bodies: in MuJoCo they are state, `xfrc_applied`, and not the
        model's.

    Examples
    --------
    >>> import dynamics as dyn
    >>> text = dyn.to_mjcf(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]))
    >>> text.count("<joint")
    2
    """
    mechanism = require_mechanism(model, "MJCF").bind()
    if not 0.0 < real_number("timestep", timestep) < math.inf:
        raise ValueError(f"timestep must be positive and finite, got {timestep!r} s")
    return mjcf_text(mechanism, timestep)


def mjcf_text(
    mechanism: Mechanism, timestep: float, head: Sequence[str] = (), shapes: Mapping[str, Sequence[str]] | None = None
) -> str:
    """The text of a mechanism with more elements: `head` before the bodies, `shapes` in the bodies of those names."""
    if mechanism.forces:
        raise MechanismError(f"MJCF has no forces, there is one on body {mechanism.forces[0].body!r}")
    children: dict[str, list[Body]] = {}
    for body in mechanism.moving:
        children.setdefault(body.parent, []).append(body)
    lines = [
        '<mujoco model="mechanism">',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep!r}" integrator="RK4" gravity="{numbers(mechanism.gravity)}">',
        '    <flag contact="disable"/>',
        "  </option>",
        *[f"  {line}" for line in head],
        "  <worldbody>",
    ]
    indent = 2
    stack: list[Body | None] = [*reversed(children.get(WORLD, []))]  # None closes a body
    while stack:
        opened = stack.pop()
        if opened is None:
            indent -= 1
            lines.append("  " * indent + "</body>")
            continue
        inside = [f"  {line}" for line in (shapes or {}).get(opened.name, ())]
        lines += ["  " * indent + line for line in [*_body_lines(opened), *inside]]
        indent += 1
        stack += [None, *reversed(children.get(opened.name, []))]
    return "\n".join([*lines, "  </worldbody>", "</mujoco>"]) + "\n"


def _body_lines(body: Body) -> list[str]:
    joint = body.joint
    _require_joint(body)
    x, y, _ = np.asarray(joint.orientation).T
    spring = f'damping="{joint.damping!r}" armature="{joint.armature!r}"'
    if isinstance(joint.type, AxialJoint):
        spring = f'stiffness="{joint.stiffness!r}" springref="{joint.spring_reference!r}" {spring}'
        spring = f'axis="{numbers(joint.axis)}" {spring}'
    mass = body.mass or _SMALLEST  # one that is small stays: if MuJoCo refuses it, it says so
    place = f'pos="{numbers(joint.position)}" xyaxes="{numbers(np.concatenate([x, y]))}"'
    return [
        f"<body name={quoteattr(body.name)} {place}>",
        f'  <joint name={quoteattr(body.coordinate)} type="{joint.type.mjcf}" {spring}/>',
        f'  <inertial pos="{numbers(body.center)}" mass="{mass!r}" {_principal(np.asarray(body.inertia))}/>',
    ]


def _require_joint(body: Body) -> None:
    """Raises MechanismError for a joint that MJCF does not have, or has with other coordinates."""
    joint, where = body.joint, f"the joint of body {body.name!r}"
    if not joint.type.mjcf:
        raise MechanismError(f"MJCF has no joint of the kind {joint.kind!r}, as is {where}")
    if joint.type.mjcf == "free":
        if body.parent != WORLD:
            raise MechanismError(f"in MJCF a free body hangs on the world, and body {body.name!r} on {body.parent!r}")
        if np.any(np.asarray(joint.position)) or np.any(np.asarray(joint.orientation) != np.eye(3)):
            raise MechanismError(f"in MJCF a free joint has the axes and the origin of the world, and {where} has not")


def _principal(inertia: Array) -> str:
    """The inertia by its principal moments, more exact than what MuJoCo's own iteration finds."""
    moments, axes = np.diag(inertia), np.eye(3)
    if np.any(inertia - np.diag(moments)):
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    moments = np.where(moments > _ROUNDING * moments.max(), moments, _SMALLEST)
    largest = moments.argmax()  # of a plate it is the sum of the others, and may not be more by rounding
    moments[largest] = min(moments[largest], np.delete(moments, largest).sum() * (1.0 - 1e-15))
    return f'diaginertia="{numbers(moments)}" quat="{numbers(spatial.to_quaternion(axes))}"'


def numbers(values: Quantities) -> str:
    """Numbers as XML attributes have them, each exact."""
    return " ".join([repr(float(value)) for value in np.asarray(values)])
