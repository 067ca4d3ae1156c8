"""MJCF written: a mechanism as a specification of MuJoCo's, and the text that MuJoCo writes of it.

The smallest mass and moment of inertia that MuJoCo takes stand for zero, and are read as zero again.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array, real_number

from ..multibody.algebra import spatial
from ..multibody.algebra.spatial import SNAP
from ..multibody.bodies.body import ANYTHING, NO_LIMITS
from ..multibody.loops import Loop
from ..multibody.quantities.frames import of_bodies
from ..multibody.trees.mechanism import WORLD, Body, Mechanism, MechanismError, MechanismWarning, require_mechanism
from ..systems.model import Model
from .left_out import listed, present
from .mujoco_module import mujoco, text_of

if TYPE_CHECKING:
    from mujoco import MjSpec

_DEGREE = 4  # of MJCF's polycoef
_OF_SITES = {"point": "CONNECT", "weld": "WELD"}
SMALLEST = 1e-15  # kg, kg m^2: of a body that moves MuJoCo takes nothing below its mjMINVAL
STAND_IN = math.nextafter(SMALLEST, 1.0)  # what nobody else writes
INERTIA_ROUNDING = 2.0**-50  # of the largest moment of inertia: what is left of one that is zero
_NEGLIGIBLE = 2.0**-30  # of what moves with it: a stand-in above this would be seen in MuJoCo's motion


@of_bodies
def to_mjcf(model: Model, timestep: float = 1e-3) -> str:
    """The bodies of a model as MJCF text: masses and inertias explicit, RK4, contacts and limits off.

    MuJoCo writes it. `load_mjcf` reads the same bodies from it, those that one carries before the next. Names,
    positions, centers, masses and coefficients are the same to the last bit; axes, orientations and inertias to a few
    roundings, which quaternions and principal axes cost. Joints have the names of the coordinates; one that is locked
    is a weld. MuJoCo takes no zero for the mass and moments of a body that moves: 1e-15 stands for it there, and is
    zero again when it is read. Of parameters the values are written. Of loops, points and welds are equality
    constraints of sites, and couplings those of joints: MuJoCo has them soft.

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
    ImportError
        Without MuJoCo.

    Examples
    --------
    >>> import dynamics as dyn
    >>> text = dyn.to_mjcf(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]))
    >>> text.count("<joint")
    2
    """
    spec = mujoco_spec(require_mechanism(model, "MJCF").bind(), timestep)
    spec.compile()
    return text_of(spec)


def mujoco_spec(mechanism: Mechanism, timestep: float) -> MjSpec:
    """MuJoCo's specification of a mechanism without parameters. Raises what `to_mjcf` does."""
    if not 0.0 < real_number("timestep", timestep) < math.inf:
        raise ValueError(f"timestep must be positive and finite, got {timestep!r} s")
    if mechanism.forces:
        raise MechanismError(f"MJCF has no forces, there is one on body {mechanism.forces[0].body!r}")
    bodies = mechanism.parts
    _tell_left_out(bodies)
    moments = {body.name: _principal(body) for body in bodies}
    inertial = with_stand_ins(bodies, moments)
    module = mujoco()
    spec = module.MjSpec()
    spec.modelname, spec.compiler.degree = "mechanism", False
    spec.compiler.inertiafromgeom = module.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.option.timestep, spec.option.gravity = timestep, np.asarray(mechanism.gravity, np.float64)
    spec.option.integrator = module.mjtIntegrator.mjINT_RK4
    spec.option.disableflags = module.mjtDisableBit.mjDSBL_CONTACT | module.mjtDisableBit.mjDSBL_LIMIT
    made = {WORLD: spec.worldbody}
    for body in bodies:
        mass, values = inertial[body.name]
        made[body.name] = made[body.parent].add_body(
            name=body.name,
            **_place(body.joint.position, body.joint.orientation),
            mass=mass,
            ipos=np.asarray(body.center, np.float64),
            iquat=spatial.to_quaternion(moments[body.name][1]),
            inertia=values,
            explicitinertial=True,
            gravcomp=float(body.gravity_compensation),
        )
        if body.joint.type.moves:
            made[body.name].add_joint(**_joint(body))
    for loop in mechanism.loops:
        _add_equality(spec, made, mechanism, loop)
    return spec


def _place(position: Any, orientation: Any) -> dict[str, Array]:
    return {
        "pos": np.asarray(position, np.float64),
        "quat": spatial.to_quaternion(np.asarray(orientation, np.float64)),
    }


def _joint(body: Body) -> dict[str, Any]:
    """Fields of MuJoCo's joint. Raises MechanismError for one that MJCF has not, or with other coordinates."""
    joint, where = body.joint, f"the joint of body {body.name!r}"
    if not joint.type.mjcf:
        raise MechanismError(f"MJCF has no joint of the kind {joint.kind!r}, as is {where}")
    if joint.type.mjcf == "free":
        if body.parent != WORLD:
            raise MechanismError(f"in MJCF a free body hangs on the world, and body {body.name!r} on {body.parent!r}")
        if np.any(np.asarray(joint.position)) or np.any(np.asarray(joint.orientation) != np.eye(3)):
            raise MechanismError(f"in MJCF a free joint has the axes and the origin of the world, and {where} has not")
    kind = getattr(mujoco().mjtJoint, f"mjJNT_{joint.type.mjcf.upper()}")
    fields = {"name": body.coordinate, "type": kind, "damping": joint.damping, "armature": joint.armature}
    if joint.type.has_axis:
        fields["axis"] = np.asarray(joint.axis, np.float64)
    springs = {"stiffness": joint.stiffness, "springref": joint.spring_reference}
    fields |= {name: value for name, value in springs.items() if value}
    limits = joint.limits or NO_LIMITS
    for field, ends in (("range", limits.position), ("actfrcrange", limits.effort)):
        if ends != ANYTHING and ends[0] < ends[1]:  # by a range of no length MuJoCo means none
            fields[field] = ends
    return fields


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
        warnings.warn(f"MJCF has no {' and no '.join(left_out)}: left out", MechanismWarning, stacklevel=4)


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


def _add_equality(spec: MjSpec, made: dict[str, Any], mechanism: Mechanism, loop: Loop) -> None:
    """Add the equality constraint of a loop, and its sites. Raises MechanismError for a loop that MJCF has not."""
    module = mujoco()
    if loop.kind == "coupling":
        names = _coupled(mechanism, loop)
        if any(map(float, loop.coefficients[_DEGREE + 1 :])):
            raise MechanismError(f"MJCF has couplings of degree {_DEGREE} at most, and loop {loop.label!r} is of more")
        data = [*map(float, loop.coefficients), *[0.0] * _DEGREE][: _DEGREE + 1]
        kind, held = "JOINT", module.mjtObj.mjOBJ_JOINT
    elif loop.kind in _OF_SITES:
        kind, held, data = _OF_SITES[loop.kind], module.mjtObj.mjOBJ_SITE, [0.0] * 10 + [1.0]  # torquescale of a weld
        names = [f"{loop.label} at", f"{loop.label} to"]
        turn = loop.orientation if loop.kind == "weld" else np.eye(3)
        body, to = loop.bodies
        made[body].add_site(name=names[0], **_place(loop.at, np.eye(3)))
        made[to].add_site(name=names[1], **_place(loop.to_at, turn))
    else:
        raise MechanismError(f"MJCF has no loop of the kind {loop.kind!r}, as is {loop.label!r}")
    equality = spec.add_equality(name=loop.label, type=getattr(module.mjtEq, f"mjEQ_{kind}"), objtype=held)
    equality.name1, equality.name2 = [*names, ""][:2]
    equality.data[: len(data)] = data


def _coupled(mechanism: Mechanism, loop: Loop) -> list[str]:
    """Names of the joints of a coupling."""
    parts = {body.name: body for body in mechanism.parts}
    if len(loop.bodies) > 2:
        raise MechanismError(f"MJCF couples two joints, and loop {loop.label!r} {len(loop.bodies)}")
    bodies = [parts[name] for name in loop.bodies if name != WORLD]
    for body in bodies:
        if not body.joint.type.moves:
            raise MechanismError(
                f"MJCF has a locked joint as a weld, and loop {loop.label!r} couples that of {body.name!r}"
            )
    return [body.coordinate for body in bodies]


def zeros_again(values: Array) -> Array:
    """Masses or moments with the stand-ins as the zeros that they stand for."""
    return np.where(values == STAND_IN, 0.0, values)


def with_stand_ins(
    bodies: Sequence[Body], moments: Mapping[str, tuple[Array, Array]]
) -> dict[str, tuple[float, Array]]:
    """Mass and principal moments that MuJoCo takes for the bodies that move; bodies have their parents first.

    moments: principal moments and axes of every body, as columns in its own. Raises MechanismError for what MuJoCo does
    not take, and where a stand-in is not negligible.
    """
    masses, inertias = _carried(bodies, moments)
    turning = _turning(bodies)
    result: dict[str, tuple[float, Array]] = {}
    for body in bodies:
        values, axes = moments[body.name]
        if not body.joint.type.moves:
            result[body.name] = float(body.mass), values
            continue
        if 0.0 < float(body.mass) <= STAND_IN:
            _refuse(body, f"has a mass of {body.mass!r} kg")
        if small := [moment for moment in values.tolist() if 0.0 < moment <= STAND_IN]:
            _refuse(body, f"has a moment of inertia of {small[0]!r} kg m^2")
        spin, turned = turning[body.name]
        zeros = [axis for moment, axis in zip(values, axes.T, strict=True) if not moment]
        seen = [axis for axis in zeros if spin is None or abs(float(spin @ axis)) > SNAP]
        if seen and turned and _NEGLIGIBLE * inertias[turned] < STAND_IN:
            _refuse(body, f"has a moment of inertia of 0, where {inertias[turned]:.3g} kg m^2 turn")
        if not body.mass and 0.0 < _NEGLIGIBLE * masses[body.name] < STAND_IN:
            _refuse(body, f"has no mass, where {masses[body.name]:.3g} kg move")
        result[body.name] = float(body.mass) or STAND_IN, np.where(values == 0.0, STAND_IN, values)
    return result


def _refuse(body: Body, what: str) -> None:
    raise MechanismError(f"MuJoCo takes no mass or moment of inertia below {SMALLEST:g}, and body {body.name!r} {what}")


def _carried(
    bodies: Sequence[Body], moments: Mapping[str, tuple[Array, Array]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Mass of each body with all that it carries, and what its inertia about the joint is when stretched out."""
    mass, first, second = ({body.name: 0.0 for body in bodies} | {WORLD: 0.0} for _ in range(3))
    for body in reversed(bodies):
        name, parent = body.name, body.parent
        lever, away = (float(np.linalg.norm(np.asarray(each))) for each in (body.center, body.joint.position))
        mass[name] += float(body.mass)
        first[name] += float(body.mass) * lever
        second[name] += float(moments[name][0].max()) + float(body.mass) * lever**2
        mass[parent] += mass[name]
        first[parent] += first[name] + away * mass[name]
        second[parent] += second[name] + 2.0 * away * first[name] + away**2 * mass[name]
    return mass, second


def _turning(bodies: Sequence[Body]) -> dict[str, tuple[Array | None, str]]:
    """Axis that each body always turns about, None for several, and the nearest body that a joint turns.

    The axis is in the body's axes; it is zero, and there is no such body, where no joint on the way turns.
    """
    result: dict[str, tuple[Array | None, str]] = {WORLD: (np.zeros(3), "")}
    for body in bodies:
        spin, nearest = result[body.parent]
        spin = None if spin is None else np.asarray(body.joint.orientation).T @ spin
        if body.joint.type.turns:
            axis = np.asarray(body.joint.axis)
            alone = body.joint.type.has_axis and spin is not None and np.linalg.norm(np.cross(spin, axis)) <= SNAP
            spin, nearest = axis if alone else None, body.name
        result[body.name] = spin, nearest
    return result
