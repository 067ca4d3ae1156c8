"""Forces on bodies: from outside, and of contact.

Contact is of a point or sphere of a body with a plane or a sphere of another, compliant and with friction.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph._shared import is_finite
from cgraph.extend import as_node

from ..algebra import spatial
from ..algebra.spatial import Triple, cross, dot, plus, scaled
from ..bodies.body import WORLD, MechanismError, quantity, unit_axis, unknown_body, vector
from ..parameters import Quantity, names_in, symbol, vanishes
from ..sweeps.kinematic_chain import KinematicChain

FORCE = "force"  # tag
FRAMES = ("world", "body")
Component = Node | float | str


class HasParameters:
    """Base of forces: what of them may be parameters, and the names of these.

    quantities: fields that may be parameters, and the checks of their values.
    """

    quantities: ClassVar[Mapping[str, Callable[[str, object], object]]] = MappingProxyType({})

    @property
    def components(self) -> tuple[Component, ...]:
        """Names of the parameters that it uses, and that are 0 without a value; of one of your own what it reads."""
        return ()

    @property
    def names(self) -> set[str]:
        """Set of the names of its parameters and variables."""
        return set(names_in([*self.components, *[getattr(self, name) for name in self.quantities]]))


@dataclass(frozen=True, eq=False)
class Force(HasParameters):
    """A force on a body at a point, and a torque on the body, from outside the mechanism.

    Parameters
    ----------
    body : str
        Name of the body.
    value, torque : sequence of 3
        Force [N] and torque [N m] in the axes of `frame`. A component is a number, a parameter's name, or a node over
        q0.., qd0.., t and parameters.
    at : array_like, (3,)
        The point, in the body's frame [m].
    frame : str
        "world", or "body": force and torque then turn with the body.

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> pushed = dyn.Mechanism([cart], forces=[dyn.Force("cart", ("push", 0.0, 0.0))])
    >>> dyn.forward_dynamics(pushed).evaluate({"q0": 0.0, "qd0": 0.0, "tau0": 0.0, "push": 4.0})
    {'qdd0': 2.0}
    """

    body: str
    value: Sequence[Component] = (0.0, 0.0, 0.0)
    at: ArrayLike = (0.0, 0.0, 0.0)
    frame: str = "world"
    torque: Sequence[Component] = (0.0, 0.0, 0.0)

    @property
    def components(self) -> tuple[Component, ...]:
        """The six components, force first."""
        return (*self.value, *self.torque)


def check_force(force: Force, bodies: Collection[str]) -> None:
    """Raises MechanismError unless the force is three and three components at a point of one of `bodies`."""
    if not isinstance(force.body, str) or force.body not in bodies:
        raise unknown_body(f"there is a force on the unknown body {force.body!r:.80}", force.body, bodies)
    where = f"the force on body {force.body!r}"
    vector(f"{where}: at", force.at)
    if force.frame not in FRAMES:
        raise MechanismError(f"{where}: frame must be one of {', '.join(FRAMES)}, got {force.frame!r}")
    given: Any
    for what, given in (("value", force.value), ("torque", force.torque)):
        if isinstance(given, str | Node) or not isinstance(given, Sequence | np.ndarray) or len(given) != 3:
            raise MechanismError(f"{where}: {what} must have three components, got {given!r:.80}")
        for each in given:
            finite = isinstance(each, numbers.Real) and math.isfinite(each)
            if not (finite or isinstance(each, str | Node)):
                raise MechanismError(
                    f"{where}: a component of {what} must be a finite number, a parameter's name or a node, "
                    f"got {each!r:.60}"
                )


def powers(force: Force, chain: KinematicChain, parameters: Mapping[str, Node]) -> list[tuple[Node, Node]]:
    """Components of v and w of the body, and those of force and torque on them: virtual power is f . v + torque . w."""
    value, torque = (_nodes(each, parameters) for each in (force.value, force.torque))
    if force.frame == "body":
        value, torque = chain.direction(value), chain.direction(torque)
    motion = chain.motion(force.at)
    return list(zip((*motion.velocity, *motion.omega), (*value, *torque), strict=True))


def _nodes(components: Sequence[Component], parameters: Mapping[str, Node]) -> Triple:
    x, y, z = (
        parameters[each] if isinstance(each, str) else each if isinstance(each, Node) else cg.constant(float(each))
        for each in components
    )
    return x, y, z


def _positive(what: str, value: object) -> float | Node:
    number = quantity(what, value)
    if not isinstance(number, Node) and number == 0.0:
        raise MechanismError(f"{what} must be positive where spheres rub, and as a parameter, got {value!r}")
    return number


CONTACT_QUANTITIES: dict[str, Callable[[str, object], Any]] = {
    "stiffness": quantity,
    "dissipation": quantity,
    "friction": quantity,
    "velocity": _positive,
}


@dataclass(frozen=True, eq=False)
class Contact(HasParameters):
    """Compliant contact of a point or sphere of a body with a plane, or with a sphere, of another or the world.

    With the depth x, how far the surfaces would go through each other, and the velocity v of the body against the
    other where they touch, v_n along the normal n and v_t across it, the force on the body is N n - F:

        N = stiffness x^(3/2) max(0, 1 + dissipation dx/dt) for x > 0, else 0
        F = friction N v_t / sqrt(v_t^2 + velocity^2)

    N is Hertz's law with the damping of Hunt and Crossley (J. Applied Mechanics 1975). It never pulls, and N and its
    slope are continuous at the touch. F is smooth dry friction. It is less than `friction` N, and it creeps where
    true friction sticks: under a load of s friction N, s < 1, with s / sqrt(1 - s^2) of `velocity`.

    With velocity 0, on a plane, friction sticks: F = friction N (sign(v_1) t_1 + sign(v_2) t_2) with v_t along two
    tangents. Of these t_1 is the axis of `to` nearest to the plane, put into it, and t_2 = n x t_1: x and y for a
    normal z. It is a pyramid in place of the cone: right in motions along a tangent, all plane ones in the planes of
    axes among them, and up to sqrt(2) too large between. Motions rest and break away as with `JointFriction`.

    Parameters
    ----------
    body, to : str
        Names of the bodies; `to` may be "world", and the other force of the pair, -N n + F, acts on it.
    at : array_like, (3,)
        The point of the body, or the center of its sphere, in its frame [m].
    to_at : array_like, (3,)
        A point of the plane, or the center of the sphere, in the frame of `to` [m].
    normal : array_like, (3,)
        Of the plane, out of the ground, in the axes of `to`; need not have length 1. Two spheres do not use it.
    radius : float
        Of the sphere of the body [m]; 0 is a point.
    to_radius : float, optional
        Of the sphere of `to` [m]. None, the default, is a plane.
    stiffness : float or parameter
        At least 0 [N/m^(3/2)]. A weight W sinks by (W / stiffness)^(2/3). Of two elastic spheres it is
        4/3 E sqrt(R), with 1/R = 1/radius + 1/to_radius and 1/E = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2.
    dissipation : float or parameter
        d, at least 0 [s/m]. A body that arrives with the speed v leaves with e v, where
        d v (1 + e) = log((1 + d v) / (1 - d e v)); for small d v that is e = 1 - 2/3 d v.
    friction : float or parameter
        Coefficient of friction, at least 0.
    velocity : float or parameter
        The speed [m/s] at which 0.71 of the friction acts; 0, the default, is friction that sticks. It must be
        positive for two spheres, and of a parameter.

    Notes
    -----
    The last four numbers may be parameters, as those of a `Body`; each needs a value in `parameters`.

    The force acts at the point of the body, or at that of the line between the centers that divides it as the radii;
    on a plane it is the lowest point of the sphere. Where the centers of two spheres coincide there is no normal, and
    the force is NaN. The force is one of the `forces` of a mechanism and no potential: `energy` is without what the
    contact stores, which `Mechanism.contact` tells.

    There is no rigid contact, and no rolling or torsional friction. Bodies touch where they have a `Contact` and
    nowhere else.

    Examples
    --------
    A ball of 2 kg rests where its weight is stiffness x^(3/2).

    >>> import dynamics as dyn
    >>> ball = dyn.Body("ball", dyn.Joint("prismatic", (0.0, 0.0, 1.0)), mass=2.0)
    >>> ground = dyn.Contact("ball", radius=0.1, stiffness=1e5)
    >>> resting = dyn.Mechanism([ball], (0.0, 0.0, -10.0), forces=[ground])
    >>> depth = (2.0 * 10.0 / 1e5) ** (2 / 3)
    >>> abs(dyn.forward_dynamics(resting).evaluate({"q0": 0.1 - depth, "qd0": 0.0, "tau0": 0.0})["qdd0"]) < 1e-9
    True
    """

    quantities = CONTACT_QUANTITIES

    body: str
    to: str = WORLD
    _: KW_ONLY
    at: ArrayLike = (0.0, 0.0, 0.0)
    to_at: ArrayLike = (0.0, 0.0, 0.0)
    normal: ArrayLike = (0.0, 0.0, 1.0)
    radius: float = 0.0
    to_radius: float | None = None
    stiffness: Quantity
    dissipation: Quantity = 0.0
    friction: Quantity = 0.0
    velocity: Quantity = 0.0

    @property
    def label(self) -> str:
        """What errors call it."""
        return f"contact of body {self.body!r} with {self.to!r}"


def _sticks(contact: Contact) -> bool:
    return contact.to_radius is None and vanishes(contact.velocity)


def check_contact(contact: Contact, bodies: Collection[str]) -> None:
    """Raises MechanismError for a contact on a body that is not among `bodies`, and for numbers out of range."""
    for name in (contact.body, contact.to):
        if not isinstance(name, str) or (name not in bodies and (name != WORLD or name is contact.body)):
            raise unknown_body(f"there is a contact on the unknown body {name!r:.80}", name, bodies)
    where = contact.label
    if contact.body == contact.to:
        raise MechanismError(f"{where}: a contact needs two bodies")
    vector(f"{where}: at", contact.at)
    vector(f"{where}: to_at", contact.to_at)
    if contact.to_radius is None:
        unit_axis(f"{where}: normal", contact.normal)
    radii = {"radius": contact.radius, "to_radius": contact.to_radius}
    for what, value in radii.items():
        if value is not None and not (is_finite(value) and value >= 0.0):
            raise MechanismError(f"{where}: {what} must be finite and at least 0, got {value!r:.60} m")
    if contact.radius == contact.to_radius == 0.0:
        raise MechanismError(f"{where}: two points do not touch, one of radius and to_radius must be positive")
    for name, check in CONTACT_QUANTITIES.items():
        if name != "velocity" or not (vanishes(contact.friction) or _sticks(contact)):
            check(f"{where}: {name}", getattr(contact, name))


class Touch(NamedTuple):
    """A contact in a state, in the world's axes."""

    depth: Node  # [m], negative where the bodies are apart
    point: Triple  # where the force acts [m]
    velocity: Triple  # of the body there against the other, linear in qd [m/s]
    normal: Node  # N [N]
    force: Triple  # on the body, friction and all [N]
    energy: Node  # stored, 2/5 stiffness x^(5/2) [J]

    def outputs(self) -> dict[str, Node]:
        """The outputs of `Mechanism.contact`."""
        triples = {"": self.point, "v": self.velocity, "f": self.force}
        named = {f"{prefix}{axis}": each[i] for prefix, each in triples.items() for i, axis in enumerate("xyz")}
        return {"depth": self.depth, "normal": self.normal, **named, "energy": self.energy}


def touch(contact: Contact, body: KinematicChain, to: KinematicChain) -> Touch:
    """The contact of bodies that are so placed and move so.  body, to: the joints between each and the world."""
    ours, theirs = body.motion(contact.at), to.motion(contact.to_at)
    gap = plus(ours.position, scaled(-1.0, theirs.position))
    if contact.to_radius is None:
        along = to.direction(spatial.constant(unit_axis("normal", contact.normal)))
        depth = contact.radius - dot(along, gap)
        arm = scaled(-float(contact.radius), along)
    else:
        distance = cg.sqrt(dot(gap, gap))
        along = scaled(1.0 / distance, gap)
        depth = (contact.radius + contact.to_radius) - distance
        arm = scaled(-contact.radius / (contact.radius + contact.to_radius), gap)
    velocity = plus(ours.velocity, cross(ours.omega, arm))
    there = plus(theirs.velocity, cross(theirs.omega, plus(gap, arm)))
    velocity = plus(velocity, scaled(-1.0, there))
    rate = dot(along, velocity)  # -dx/dt
    stiffness, dissipation, friction, slow = (as_node(symbol(getattr(contact, name))) for name in CONTACT_QUANTITIES)
    touching = cg.less(0.0, depth)
    inside = cg.where(touching, depth, 1.0)  # apart, the slope of the root of 0 would be infinite
    # a step that leaves the surface has stages beyond it, where the law goes on; its slope at the surface is 0
    pressed = cg.where(touching, stiffness * cg.hypot(inside, 0.0) ** 1.5, 0.0)
    energy = 0.4 * pressed * inside
    if not vanishes(contact.dissipation):
        pressed = pressed * cg.maximum(1.0 - dissipation * rate, 0.0)
    force = scaled(pressed, along)
    if not vanishes(contact.friction) and _sticks(contact):
        for line in spatial.to_z(unit_axis("normal", contact.normal)).T[:2]:
            across = to.direction(spatial.constant(line))
            speed = cg.where(touching, dot(across, velocity), 1.0)  # apart there is no surface to search
            force = plus(force, scaled(-friction * pressed * cg.sign(speed), across))
    elif not vanishes(contact.friction):
        slip = plus(velocity, scaled(-rate, along))
        share = friction * pressed / cg.sqrt(dot(slip, slip) + slow * slow)
        force = plus(force, scaled(-share, slip))
    return Touch(depth, plus(ours.position, arm), velocity, pressed, force, energy)
