"""Bodies, the joints that carry them and their limits, checked."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array, check_name, is_finite, kept_by_first, nearest, or_nearest, real_array

from ..algebra import spatial
from ..joints import COMPOSITIONS, TYPES, JointType
from ..joints.joint_type import contradiction
from ..parameters import Quantities, Quantity, entries, evaluated, names_in, symbol, vanishes

Pair = tuple[float, float]
ANYTHING: Pair = (-math.inf, math.inf)


@dataclass(frozen=True)
class Limits:
    """Limits of one coordinate, as numbers for whoever asks: bounds of an optimization, ends of a slider.

    Nothing in the equations changes with them: a spring that holds a joint is a `JointLimit`, a motor that saturates an
    `Actuator`.

    Parameters
    ----------
    position : pair of floats
        Lower and upper end [rad or m]; infinite where there is none, as in the next two.
    velocity : pair of floats
        [rad/s or m/s]
    effort : pair of floats
        Of the force or torque that acts along the joint [N or N m].

    Raises
    ------
    TypeError, ValueError
        For what are no numbers, NaN, and a lower end above the upper.

    Examples
    --------
    >>> import dynamics as dyn
    >>> elbow = dyn.Joint("revolute", (0.0, 1.0, 0.0), limits=dyn.Limits((-0.5, 2.0), velocity=(-3.0, 3.0)))
    >>> arm = dyn.Mechanism([dyn.Body("elbow", elbow, mass=1.0, center=(0.0, 0.0, -0.5))])
    >>> arm.limits["elbow"]
    Limits(position=(-0.5, 2.0), velocity=(-3.0, 3.0), effort=(-inf, inf))
    """

    position: Pair = ANYTHING
    velocity: Pair = ANYTHING
    effort: Pair = ANYTHING

    def __post_init__(self) -> None:
        for each in fields(self):
            given = getattr(self, each.name)
            ends = real_array(f"limits: {each.name}", given)
            if ends.shape != (2,) or not ends[0] <= ends[1]:
                raise ValueError(f"limits: {each.name} must be (lower, upper), got {given!r:.60}")
            object.__setattr__(self, each.name, (float(ends[0]), float(ends[1])))


NO_LIMITS = Limits()


WORLD = "world"
PLAIN = (float, type(None))
NUMBERS = frozenset((float, int))
TEXT_ROUNDING = 1e-9  # of the largest entry: what is left of an inertia or a rotation that came through text


class MechanismError(ValueError):
    """A mechanism that cannot be: which body, what was given, and what was needed."""


class MechanismWarning(UserWarning):
    """A mechanism lacks something of the file it was read from, or has a body that cannot be but can be calculated.

    Examples
    --------
    >>> import warnings
    >>> import dynamics as dyn
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", dyn.MechanismWarning)  # a model that lacks something is no model
    """


@dataclass(frozen=True, eq=False)
class Joint:
    """Joint of a body to its parent, at the origin of the body's frame.

    `position` and all that is said to be a float may have parameters in place of numbers, see `Body`.

    Parameters
    ----------
    kind : str
        "revolute" (turns about `axis`), "prismatic" (slides along it), "screw" (turns about it and slides
        by `pitch`), "fixed" (welded), "ball" (turns about a point:
        a unit quaternion (w, x, y, z), and the angular velocity in the body's axes), "free" (moves as it likes: the
        place of its origin and a quaternion; the rates of that place, and the angular velocity in the body's axes), or
        "free (body axes)" (the linear velocity in the body's axes, too). Several joints one after another, with
        massless bodies between, are "cylindrical" (shift along `axis`, angle about it), "universal" (angle1 about
        `axis`, which stays with the parent, then angle2 about `second_axis`, which stays with the body) and "planar" (x
        along `second_axis`, y along axis x second_axis, both with the parent, then angle about `axis`).
    axis : array_like, (3,)
        In the body's axes at q = 0; need not have length 1. Of "ball" and "free" it has no meaning.
    second_axis : array_like, (3,), optional
        Of "universal" and "planar", at a right angle to `axis`. By default the axis of x, y or z that is least along
        `axis`, the first of them, turned to a right angle: of z it is x.
    position : array_like, (3,)
        Origin of the body's frame in its parent's at q = 0 [m].
    orientation : array_like, (3, 3)
        Axes of the body's frame, as columns in its parent's, at q = 0. Entries up to 1e-14 are zero: a quarter turn in
        text, or by the cosine of pi / 2, is one.
    damping : float
        Viscous coefficient, at least 0 [N m s or N s/m]. This and the next three, of a joint that is several, are one
        number for all its coordinates, or a sequence of one for each.
    stiffness, spring_reference : float
        Spring constant, at least 0 [N m/rad or N/m], and the coordinate where it pulls nowhere [rad or m]. A ball's
        spring turns the body back to the joint by the shortest way, k times the angle, and has no reference; free
        joints have no springs.
    armature : float
        Inertia of the coordinate itself, such as a rotor's, at least 0 [kg m^2 or kg].
    pitch : float
        Of "screw", how far a radian moves the body along the axis, positive for a right-handed thread [m/rad].
    name : str
        What the coordinate is called; by default as the body. Of several coordinates it goes before what they are,
        as in "base.x".
    limits : Limits, optional
        Of position, velocity and effort, as numbers: nothing holds the joint to them. Of a joint that is several, one
        for all its coordinates, or a sequence of one for each. Ball and free joints have none.

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
    position: Quantities = (0.0, 0.0, 0.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    damping: Any = 0.0  # a Quantity, or of a composed joint one for each coordinate; the next three, too
    stiffness: Any = 0.0
    spring_reference: Any = 0.0
    armature: Any = 0.0
    pitch: float = 0.0
    second_axis: ArrayLike | None = None
    name: str = ""
    limits: Any = None  # Limits, or of a composed joint one for each coordinate

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or (self.kind not in TYPES and self.kind not in COMPOSITIONS):
            raise MechanismError(f"a joint must be one of {', '.join([*TYPES, *COMPOSITIONS])}, got {self.kind!r:.60}")
        for name in ("damping", "stiffness", "spring_reference", "armature", "limits"):
            value = getattr(self, name)
            if type(value) not in PLAIN and isinstance(value, Sequence | np.ndarray) and not isinstance(value, str):
                object.__setattr__(self, name, tuple(value))

    @property
    def type(self) -> JointType:
        """Type of joints of this kind and pitch. Raises MechanismError for a joint that is several."""
        if self.kind in COMPOSITIONS:
            raise MechanismError(f"a joint of the kind {self.kind!r} is several, and each of these has a type")
        return TYPES[self.kind].with_pitch(self.pitch)

    @property
    def moves(self) -> bool:
        """Whether the joint has a coordinate."""
        return self.kind in COMPOSITIONS or self.type.moves

    @property
    def neutral(self) -> tuple[float, ...]:
        """The coordinates where the body stands at the joint."""
        parts = COMPOSITIONS.get(self.kind)
        return (0.0,) * len(parts) if parts else self.type.neutral


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body and the joint that carries it.

    In place of a number of these but the joint's may stand a parameter: its name, or a node over `cg.variable`s.
    Its value is in the mechanism's `parameters`, and it is an input of the graphs.

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
    gravity_compensation : float
        The share of its weight that something balances, at its center of mass: 1 leaves it weightless (`gravcomp` of
        MJCF). Energies are with it.

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Body("rotor", dyn.Joint("revolute"), inertia=(0.1, 0.1, 0.2))
    >>> dyn.mass_matrix(dyn.Mechanism([rotor])).evaluate({"q0": 0.0, "qd0": 0.0})
    {'M_0_0': 0.2}
    >>> load = dyn.Body("load", dyn.Joint("prismatic"), mass="m")
    >>> dyn.mass_matrix(dyn.Mechanism([load], parameters={"m": 3.0})).evaluate({"q0": 0.0, "qd0": 0.0, "m": 4.0})
    {'M_0_0': 4.0}
    """

    name: str
    joint: Joint
    parent: str = WORLD
    mass: Quantity = 0.0
    center: Quantities = (0.0, 0.0, 0.0)
    inertia: Quantities = (0.0, 0.0, 0.0)
    gravity_compensation: Quantity = 0.0

    @property
    def coordinate(self) -> str:
        """Name of the coordinate of its joint."""
        return self.joint.name or self.name


def vector(what: str, value: object, shape: tuple[int, ...] = (3,)) -> Array:
    """The value as an array of that shape. Raises MechanismError, naming `what`, unless it is finite numbers."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not all(map(math.isfinite, array.ravel().tolist())):
        given = value.tolist() if isinstance(value, np.ndarray) else value
        raise MechanismError(f"{what} must be {shape} finite numbers, got {given!r:.80}")
    return array


def checked_rotation(what: str, value: object) -> Array:
    """The value as a rotation, (3, 3). Raises MechanismError, naming `what`, unless it is one."""
    matrix = vector(what, value, (3, 3))
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    lengths = (a * a + d * d + g * g - 1.0, b * b + e * e + h * h - 1.0, c * c + f * f + i * i - 1.0)
    across = (a * b + d * e + g * h, b * c + e * f + h * i, a * c + d * f + g * i)
    determinant = a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
    if determinant < 0 or max(map(abs, lengths + across)) > TEXT_ROUNDING:
        raise MechanismError(f"{what} must be a rotation matrix")
    return matrix


def shape_of(value: Any) -> tuple[int, ...]:
    """The shape of an array or of nested sequences; () for rows of unlike length."""
    try:
        return np.shape(value)
    except ValueError:
        return ()


def quantities(what: str, value: object, shape: tuple[int, ...] = (3,)) -> Array:
    """Array of floats as `vector` gives it, or of floats and nodes, as objects, where there are parameters."""
    if type(value) is tuple and NUMBERS.issuperset(map(type, value)):
        return vector(what, value, shape)
    known = entries(value)
    if not any([isinstance(each, str | Node) for each in known if type(each) is not float]):
        return vector(what, value, shape)
    if np.shape(np.asarray(value, dtype=object)) != shape:
        raise MechanismError(f"{what} must be {shape} finite numbers, got {value!r:.80}")
    array = np.empty(len(known), dtype=object)
    array[:] = [quantity(what, each, minimum=-math.inf) for each in known]
    return array.reshape(shape) if names_in(known) else array.astype(np.float64).reshape(shape)


def quantity(what: str, value: Any, unit: str = "", minimum: float = 0.0) -> float | Node:
    """The number, or the node of a parameter."""
    if type(value) is float and math.isfinite(value) and value >= minimum:
        return value
    if isinstance(value, Node) and not names_in([value]):
        value = evaluated(value, {}).item()
    if isinstance(value, str | Node):
        for name in names_in([value]):
            checked_name(f"a parameter of {what}", name, spaces=False)
        return symbol(value)
    if is_finite(value) and float(value) >= minimum:
        return float(value)
    bound = " and at least 0" if minimum == 0.0 else ""
    raise MechanismError(f"{what} must be finite{bound}, got {value!r:.80}{unit}")


def checked(body: Body) -> Body:
    """The body with its numbers as arrays and floats, its axis of length 1. Raises MechanismError for what is wrong.

    Parameters are nodes, among the floats of arrays of objects; what their values must be is not seen here.
    """
    checked_name("a body", body.name)
    if body.name == WORLD:
        raise MechanismError(f"a body needs a name other than {WORLD!r}")
    where, joint = f"body {body.name!r}", body.joint
    if not isinstance(body.parent, str):
        raise MechanismError(f"{where}: parent must be the name of a body or {WORLD!r}, got {body.parent!r:.80}")
    mass, center = quantity(f"{where}: mass", body.mass, " kg"), quantities(f"{where}: center", body.center)
    beside = 0.0 if isinstance(mass, Node) or center.dtype == object else mass * sum([x * x for x in center.tolist()])
    inertia = _inertia(f"{where}: inertia", body.inertia, beside)
    share = BODY_QUANTITIES["gravity_compensation"](f"{where}: gravity_compensation", body.gravity_compensation)
    if not isinstance(joint, Joint):
        raise MechanismError(f"{where}: joint must be of the type Joint, got {type(joint).__name__}: {joint!r:.60}")
    joint = checked_joint(joint, where)
    return replace(body, mass=mass, center=center, inertia=inertia, gravity_compensation=share, joint=joint)


def unit_axis(what: str, value: object) -> Array:
    """The value at length 1. Raises MechanismError, naming `what`, unless it is three finite numbers and not zero."""
    axis = vector(what, value)
    known = axis.tolist()
    if known.count(0.0) == 2:  # along x, y or z
        return np.array([math.copysign(1.0, x) if x else 0.0 for x in known])
    if not any(known):
        raise MechanismError(f"{what} must not be zero")
    return spatial.snapped(spatial.unit(axis))


@kept_by_first
def checked_joint(joint: Joint, where: str) -> Joint:
    """The joint likewise."""
    if not isinstance(joint.name, str) or joint.name:
        checked_name(f"the joint of {where}", joint.name)
    axis = unit_axis(f"{where}: axis", joint.axis)
    if joint.second_axis is not None:
        raise MechanismError(f"{where}: a joint of the kind {joint.kind!r} has no second axis")
    orientation = spatial.snapped(checked_rotation(f"{where}: orientation", joint.orientation))
    pitch = _pitch(where, joint)
    if joint.type.moves and (wrong := contradiction(joint.type)):
        raise MechanismError(f"{where}: the type of joints of the kind {joint.kind!r} contradicts itself: {wrong}")
    given = {name: check(f"{where}: {name}", getattr(joint, name)) for name, check in JOINT_QUANTITIES.items()}
    no = f"{where}: a joint of the kind {joint.kind!r} has no"
    if not (joint.type.sprung or vanishes(given["stiffness"])):
        raise MechanismError(f"{no} spring, got stiffness {joint.stiffness!r}")
    if not (joint.type.geared or vanishes(given["armature"])):
        raise MechanismError(f"{no} armature, got {joint.armature!r}")
    limits = check_limits(f"{where}: limits", joint.limits)
    if limits not in (None, NO_LIMITS) and len(joint.type.coordinates) != 1:
        raise MechanismError(f"{no} limits, got {limits!r:.80}")
    return Joint(joint.kind, axis=axis, orientation=orientation, pitch=pitch, name=joint.name, limits=limits, **given)


def check_limits(what: str, limits: object) -> Limits | None:
    """The limits of one coordinate. Raises MechanismError for what are none."""
    if limits is None or isinstance(limits, Limits):
        return limits
    raise MechanismError(f"{what} must be of the type Limits, got {type(limits).__name__}: {limits!r:.60}")


def _pitch(where: str, joint: Joint) -> float:
    kind, pitch = joint.kind, joint.pitch
    if not is_finite(pitch):
        raise MechanismError(f"{where}: pitch must be finite, got {pitch!r:.80} m/rad")
    if bool(pitch) != TYPES[kind].pitched:
        needs = f"only a screw has a pitch, not {kind!r}" if pitch else f"a joint of the kind {kind!r} needs a pitch"
        raise MechanismError(f"{where}: {needs}, got {pitch!r} m/rad")
    return float(pitch)


def unknown_body(sentence: str, name: object, known: Iterable[str]) -> MechanismError:
    """The error of a name that is no body's: the sentence, and names that are near, if any are."""
    near = nearest(str(name), known)
    return MechanismError(f"{sentence}; {or_nearest(str(name), near)}" if near else sentence)


def body_name(bodies: Sequence[Body], given: str, what: str = "") -> str:
    """Name of the body that is called so, or whose joint is. Raises MechanismError where there is none.

    what: it is looked for, such as "to lock ".
    """
    if not isinstance(given, str):
        raise MechanismError(f"a body is named by a string, got {type(given).__name__}: {given!r:.60}")
    if given in (names := [body.name for body in bodies]):
        return given
    known = {body.coordinate: body.name for body in bodies} | {name: name for name in names}
    if given not in known:
        raise unknown_body(f"there is no body {given!r:.80} {what}in the mechanism", given, known)
    return known[given]


def checked_name(what: str, name: str, *, spaces: bool = True) -> None:
    """Raises MechanismError for what is no name."""
    try:
        check_name(what, name, spaces=spaces)
    except (TypeError, ValueError) as error:
        raise MechanismError(str(error)) from None


def _inertia(what: str, given: object, beside: float = 0.0) -> Array:
    """Symmetric, and with principal moments that are not negative; a warning where no rigid body has them.

    Kinetic energy is positive all the same, so that all equations of a tree hold.
    beside: the inertia of the mass about the joint, beside which a moment may be rounding.
    """
    diagonal = shape_of(given) == (3,)
    inertia = quantities(what, given, (3,) if diagonal else (3, 3))
    if diagonal:
        a, b, c = inertia.tolist()
        inertia = np.array([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]], dtype=inertia.dtype)
    if inertia.dtype == object:
        return inertia
    (a, b, c), (d, e, f), (g, h, i) = inertia.tolist()
    scale = max(map(abs, (a, b, c, d, e, f, g, h, i)))
    if not math.isfinite(3.0 * scale + beside):
        given = f"{scale:g} kg m^2 about its center and {beside:g} kg m^2 by that of its mass"
        raise MechanismError(f"{what} about the joint is beyond float64, with {given}")
    if max(abs(b - d), abs(c - g), abs(f - h)) > TEXT_ROUNDING * scale:
        raise MechanismError(f"{what} must be symmetric")
    moments = np.linalg.eigvalsh(inertia).tolist() if any((b, c, d, f, g, h)) else sorted((a, e, i))
    rounding = moment_rounding(scale, beside)
    if moments[0] < -rounding:
        raise MechanismError(f"{what} must not be negative, its principal moments are {moments}")
    if moments[2] > moments[0] + moments[1] + rounding:
        text = f"no body has principal moments {moments}: the largest exceeds the sum of the others"
        warnings.warn(f"{what.removesuffix(': inertia')}: {text}", MechanismWarning, stacklevel=2)
    return inertia if diagonal else 0.5 * (inertia + inertia.T)


def moment_rounding(scale: float, beside: float) -> float:
    """Rounding of a principal moment, beside the largest entry and the inertia of the mass about the joint."""
    return TEXT_ROUNDING * scale + spatial.SNAP * beside


BODY_QUANTITIES: dict[str, Callable[[str, object], Any]] = {
    "mass": partial(quantity, unit=" kg"),
    "center": quantities,
    "inertia": _inertia,
    "gravity_compensation": partial(quantity, minimum=-math.inf),
}
JOINT_QUANTITIES: dict[str, Callable[[str, object], Any]] = {
    "position": quantities,
    "damping": quantity,
    "stiffness": quantity,
    "spring_reference": partial(quantity, minimum=-math.inf),
    "armature": quantity,
}
