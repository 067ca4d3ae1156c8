"""MJCF written: the text of a mechanism for MuJoCo."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from cgraph._shared import Array, real_number

from ..multibody.algebra import spatial
from ..multibody.bodies.limits import ANYTHING, NO_LIMITS, Pair
from ..multibody.quantities.body_quantity import of_bodies
from ..multibody.trees.mechanism import WORLD, Body, MechanismError, MechanismWarning, require_mechanism
from ..systems.model import Model
from .left_out import listed, present
from .stand_ins import INERTIA_ROUNDING, with_stand_ins
from .write_loops import equality_lines, numbers, site_lines


@of_bodies
def to_mjcf(model: Model, timestep: float = 1e-3) -> str:
    """The bodies of a model as MJCF text: masses and inertias explicit, RK4, contacts and limits off.

    `load_mjcf` reads the same bodies from it, those that one carries before the next. Names, positions, centers, masses
    and coefficients are the same to the last bit; axes, orientations and inertias to a few roundings, which quaternions
    and principal axes cost. Joints have the names of the coordinates; one that is locked is a weld. MuJoCo takes no
    zero for the mass and moments of a body that moves: 1e-15 stands for it there, and is zero again when it is read.
    Of parameters the values are written. Of loops, points and welds are equality constraints of sites, and couplings
    those of joints: MuJoCo has them soft.

    Limits of position are the joints' `range`, those of effort their `actuatorfrcrange`. As in the model, they are
    numbers and hold no motion, by `<flag limit="disable">`; without it MuJoCo holds them. MJCF has no limits
    of velocity, nor such whose ends are one number; a warning names those that are left out.

    Parameters
    ----------
    timestep : float
        MuJoCo's step [s].

    Returns
    -------
    str
        The text.

    Raises
    ------
    MechanismError
        For a model without bodies; for what MuJoCo does not take: moments that no rigid body has, a body that moves of
        less than 1e-15 kg or kg m^2, zeros where 1e-15 is more than 1e-9 of what moves with them, and free joints other
        than on the world, in its axes and at its origin; for loops of other kinds, couplings of more than degree 4 and
        those of locked joints; and for forces on bodies: in MuJoCo they are state, `xfrc_applied`, and not the model's.

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
    if mechanism.forces:
        raise MechanismError(f"MJCF has no forces, there is one on body {mechanism.forces[0].body!r}")
    bodies = mechanism.parts
    _tell_left_out(bodies)
    moments = {body.name: _principal(body) for body in bodies}
    inertial = {
        name: (mass, _diagonal(values, moments[name][1]))
        for name, (mass, values) in with_stand_ins(bodies, moments).items()
    }
    children: dict[str, list[Body]] = {}
    for body in bodies:
        children.setdefault(body.parent, []).append(body)
    lines = [
        '<mujoco model="mechanism">',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep!r}" integrator="RK4" gravity="{numbers(mechanism.gravity)}">',
        '    <flag contact="disable" limit="disable"/>',
        "  </option>",
        "  <worldbody>",
    ]
    sites = site_lines(mechanism.loops)
    lines += [f"    {line}" for line in sites.get(WORLD, ())]
    indent = 2
    stack: list[Body | None] = [*reversed(children.get(WORLD, []))]  # None closes a body
    while stack:
        opened = stack.pop()
        if opened is None:
            indent -= 1
            lines.append("  " * indent + "</body>")
            continue
        inside = [f"  {line}" for line in sites.get(opened.name, ())]
        lines += ["  " * indent + line for line in [*_body_lines(opened, *inertial[opened.name]), *inside]]
        indent += 1
        stack += [None, *reversed(children.get(opened.name, []))]
    return "\n".join([*lines, "  </worldbody>", *equality_lines(mechanism), "</mujoco>"]) + "\n"


def _body_lines(body: Body, mass: float, moments: str) -> list[str]:
    joint = body.joint
    x, y, _ = np.asarray(joint.orientation).T
    place = f'pos="{numbers(joint.position)}" xyaxes="{numbers(np.concatenate([x, y]))}"'
    lines = [f"<body name={quoteattr(body.name)} {place}>"]
    if joint.type.moves:
        _require_joint(body)
        spring = f'damping="{joint.damping!r}" armature="{joint.armature!r}"'
        if joint.type.has_axis:
            spring = f'springref="{joint.spring_reference!r}" axis="{numbers(joint.axis)}" {spring}'
        if joint.type.sprung:
            spring = f'stiffness="{joint.stiffness!r}" {spring}'
        limits = joint.limits or NO_LIMITS
        for attribute, ends in (("range", limits.position), ("actuatorfrcrange", limits.effort)):
            if _ranged(ends):
                spring += f' {attribute}="{numbers(ends)}"'
        lines.append(f'  <joint name={quoteattr(body.coordinate)} type="{joint.type.mjcf}" {spring}/>')
    lines.append(f'  <inertial pos="{numbers(body.center)}" mass="{mass!r}" {moments}/>')
    return lines


def _ranged(ends: Pair) -> bool:
    """Whether MuJoCo takes a limit for one: by a range of which both ends are the same it means none."""
    return ends != ANYTHING and ends[0] < ends[1]


def _tell_left_out(bodies: Sequence[Body]) -> None:
    """A warning with the names of coordinates whose limits MJCF has not."""
    limits = {body.coordinate: body.joint.limits or NO_LIMITS for body in bodies if body.joint.type.moves}
    fast = [name for name, each in limits.items() if each.velocity != ANYTHING]
    narrow = [name for name, each in limits.items() if not all([a < b for a, b in (each.position, each.effort)])]
    what = {
        f"limits of velocity ({listed(fast)})": fast,
        f"limits whose ends are one number ({listed(narrow)})": narrow,
    }
    if left_out := present(what):
        warnings.warn(f"MJCF has no {' and no '.join(left_out)}: left out", MechanismWarning, stacklevel=3)


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


def _principal(body: Body) -> tuple[Array, Array]:
    """Principal moments and axes of a body, more exact than what MuJoCo's own iteration finds.

    Raises MechanismError for moments that no rigid body has, by more than rounding, which MuJoCo does not take.
    """
    inertia = np.asarray(body.inertia)
    moments, axes = np.diag(inertia), np.eye(3)
    if np.any(inertia - np.diag(moments)):
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
        moments = np.where(np.abs(moments) <= INERTIA_ROUNDING * moments.max(), 0.0, moments)
    largest = int(moments.argmax())  # of a plate it is the sum of the others, and may not be more by rounding
    most = float(np.delete(moments, largest).sum())
    if moments.min() < 0.0 or moments[largest] - most > INERTIA_ROUNDING * moments[largest]:
        raise MechanismError(
            f"MuJoCo takes no body with principal moments {moments.tolist()}, as {body.name!r} has them"
        )
    moments = moments.copy()
    moments[largest] = min(moments[largest], most)
    return moments, axes


def _diagonal(moments: Array, axes: Array) -> str:
    return f'diaginertia="{numbers(moments)}" quat="{numbers(spatial.to_quaternion(axes))}"'
