"""Bodies and the joints that carry them, checked."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import check_name, is_finite

from . import spatial
from .joints import TYPES, JointType
from .spatial import Array

WORLD = "world"
_ROUNDING = 1e-9  # of the largest entry: what is left of an inertia or a rotation that came through text


class MechanismError(ValueError):
    """A mechanism that cannot be: which body, what was given, and what was needed."""


class MechanismWarning(UserWarning):
    """What a mechanism has not of the file that it was read from, or a body that cannot be, but can be calculated with.

    Examples
    --------
    >>> import warnings
    >>> import dynamics as dyn
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", dyn.MechanismWarning)  # a model that lacks something is no model
    """


@dataclass(frozen=True, eq=False)
class Joint:
    """How a body hangs on its parent; the joint is at the origin of the body's frame.

    Parameters
    ----------
    kind : str
        "revolute" (turns about `axis`), "prismatic" (slides along it), "fixed" (welded), "ball" (turns about a point:
        a unit quaternion (w, x, y, z), and the angular velocity in the body's axes), "free" (moves as it likes: the
        place of its origin and a quaternion; the rates of that place, and the angular velocity in the body's axes), or
        "free (body axes)" (the linear velocity in the body's axes, too).
    axis : array_like, (3,)
        In the body's axes; need not have length 1. Of "ball" and "free" it has no meaning.
    position : array_like, (3,)
        Origin of the body's frame in its parent's at q = 0 [m].
    orientation : array_like, (3, 3)
        Axes of the body's frame, as columns in its parent's, at q = 0. Entries up to 1e-14 are zero: a quarter turn in
        text, or by the cosine of pi / 2, is one.
    damping : float
        Viscous coefficient, at least 0 [N m s or N s/m].
    stiffness, spring_reference : float
        Spring constant, at least 0 [N m/rad or N/m], and the coordinate where it pulls nowhere [rad or m]. A ball's
        spring turns the body back to the joint by the shortest way, k times the angle, and has no reference; free
        joints have no springs.
    armature : float
        Inertia of the coordinate itself, such as a rotor's, at least 0 [kg m^2 or kg].
    name : str
        What the coordinate is called; by default as the body. Of several coordinates it goes before what they are,
        as in "base.x".

    Raises
    ------
    MechanismError
        For an unknown kind; for other fields when a mechanism is made of it.

    Examples
    --------
    >>> import dynamics as dyn
    >>> hinge = dyn.Joint("revolute", axis=(0.0, -1.0, 0.0), damping=0.1)
    >>> dyn.Mechanism([dyn.Body("rod", hinge, mass=1.0, center=(0.0, 0.0, -0.5))]).coordinates
    ('rod',)
    """

    kind: str
    axis: ArrayLike = (0.0, 0.0, 1.0)
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    damping: float = 0.0
    stiffness: float = 0.0
    spring_reference: float = 0.0
    armature: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in TYPES:
            raise MechanismError(f"a joint must be one of {', '.join(TYPES)}, got {self.kind!r:.60}")

    @property
    def type(self) -> JointType:
        """What the library knows of joints of this kind."""
        return TYPES[self.kind]


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body and the joint that carries it.

    Parameters
    ----------
    name : str
        Unlike any other body's; not "world".
    joint : Joint
        How it hangs on its parent.
    parent : str
        Another body's name, or "world".
    mass : float
        At least 0 [kg].
    center : array_like, (3,)
        Center of mass in the body's frame [m].
    inertia : array_like, (3, 3) or (3,)
        About the center of mass, in the body's axes, whole or its diagonal [kg m^2].

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Body("rotor", dyn.Joint("revolute"), inertia=(0.1, 0.1, 0.2))
    >>> dyn.mass_matrix(dyn.Mechanism([rotor])).evaluate({"q0": 0.0, "qd0": 0.0})
    {'M_0_0': 0.2}
    """

    name: str
    joint: Joint
    parent: str = WORLD
    mass: float = 0.0
    center: ArrayLike = (0.0, 0.0, 0.0)
    inertia: ArrayLike = (0.0, 0.0, 0.0)

    @property
    def coordinate(self) -> str:
        """What the coordinate of its joint is called."""
        return self.joint.name or self.name


def vector(what: str, value: Any, shape: tuple[int, ...] = (3,)) -> Array:
    """The value as an array of that shape. Raises MechanismError, naming `what`, unless it is finite numbers."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        given = value.tolist() if isinstance(value, np.ndarray) else value
        raise MechanismError(f"{what} must be {shape} finite numbers, got {given!r:.80}")
    return array


def shape_of(value: Any) -> tuple[int, ...]:
    """The shape of an array or of nested sequences; () for rows of unlike length."""
    try:
        return np.shape(value)
    except ValueError:
        return ()


def _number(what: str, value: Any, unit: str = "", minimum: float = 0.0) -> float:
    if is_finite(value) and float(value) >= minimum:
        return float(value)
    bound = " and at least 0" if minimum == 0.0 else ""
    raise MechanismError(f"{what} must be finite{bound}, got {value!r:.80}{unit}")


def checked(body: Body) -> Body:
    """The body with its numbers as arrays and floats, its axis of length 1. Raises MechanismError for what is wrong."""
    if not isinstance(body, Body):
        raise MechanismError(f"bodies must be of the type Body, got {type(body).__name__}: {body!r:.60}")
    _check_name("a body", body.name)
    if body.name == WORLD:
        raise MechanismError(f"a body needs a name other than {WORLD!r}")
    where, joint = f"body {body.name!r}", body.joint
    if not isinstance(body.parent, str):
        raise MechanismError(f"{where}: parent must be the name of a body or {WORLD!r}, got {body.parent!r:.80}")
    mass, center = _number(f"{where}: mass", body.mass, " kg"), vector(f"{where}: center", body.center)
    return replace(
        body,
        mass=mass,
        center=center,
        inertia=_inertia(where, body.inertia, mass * float(center @ center)),
        joint=_checked_joint(where, joint),
    )


def _checked_joint(where: str, joint: Joint) -> Joint:
    if not isinstance(joint, Joint):
        raise MechanismError(f"{where}: joint must be of the type Joint, got {type(joint).__name__}: {joint!r:.60}")
    if joint.name != "":
        _check_name(f"the joint of {where}", joint.name)
    axis = vector(f"{where}: axis", joint.axis)
    if not axis.any():
        raise MechanismError(f"{where}: axis must not be zero")
    orientation = vector(f"{where}: orientation", joint.orientation, (3, 3))
    if np.abs(orientation.T @ orientation - np.eye(3)).max() > _ROUNDING or np.linalg.det(orientation) < 0:
        raise MechanismError(f"{where}: orientation must be a rotation matrix")
    stiffness = _number(f"{where}: stiffness", joint.stiffness)
    if stiffness and not joint.type.sprung:
        raise MechanismError(f"{where}: a joint of the kind {joint.kind!r} has no spring, got stiffness {stiffness!r}")
    armature = _number(f"{where}: armature", joint.armature)
    if armature and not joint.type.geared:
        raise MechanismError(f"{where}: a joint of the kind {joint.kind!r} has no armature, got {armature!r}")
    return Joint(
        joint.kind,
        axis=spatial.snapped(spatial.unit(axis)),
        position=vector(f"{where}: position", joint.position),
        orientation=spatial.snapped(orientation),
        damping=_number(f"{where}: damping", joint.damping),
        stiffness=stiffness,
        spring_reference=_number(f"{where}: spring_reference", joint.spring_reference, minimum=-math.inf),
        armature=armature,
        name=joint.name,
    )


def _check_name(what: str, name: str) -> None:
    try:
        check_name(what, name)
    except (TypeError, ValueError) as error:
        raise MechanismError(str(error)) from None


def _inertia(where: str, given: ArrayLike, beside: float) -> Array:
    """Symmetric, and with principal moments that are not negative; a warning where no rigid body has them.

    Kinetic energy is positive all the same, so that all equations of a tree hold.
    beside: the inertia of the mass about the joint, beside which a moment may be rounding.
    """
    diagonal = shape_of(given) == (3,)
    inertia = vector(f"{where}: inertia", given, (3,) if diagonal else (3, 3))
    inertia = np.diag(inertia) if diagonal else inertia
    scale = np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > _ROUNDING * scale:
        raise MechanismError(f"{where}: inertia must be symmetric")
    moments = np.linalg.eigvalsh(inertia)
    rounding = _ROUNDING * scale + spatial.SNAP * beside
    if moments[0] < -rounding:
        raise MechanismError(f"{where}: inertia must not be negative, its principal moments are {moments.tolist()}")
    if moments[2] > moments[0] + moments[1] + rounding:
        text = f"{where}: no body has principal moments {moments.tolist()}: the largest exceeds the sum of the others"
        warnings.warn(text, MechanismWarning, stacklevel=2)
    return 0.5 * (inertia + inertia.T)
