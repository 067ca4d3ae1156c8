"""Mechanisms: trees of rigid bodies joined by hinges, slides and welds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph.fold import Builder
from cgraph.label import building

from . import spatial
from .spatial import STILL, ZERO, Array, Triple
from .system import System

KINDS = ("revolute", "prismatic", "fixed")
WORLD = "world"


class MechanismError(ValueError):
    """A mechanism that cannot be: which body, what was given, and what was needed."""


@dataclass(frozen=True, eq=False)
class Joint:
    """How a body hangs on its parent.

    kind: "revolute" (turns about `axis`), "prismatic" (slides along it) or "fixed" (welded).
    axis: (3,) in the body's axes; need not have length 1.
    position: (3,) [m], orientation: (3, 3): the body's frame in its parent's at q = 0; the joint is at its origin.
    damping [N m s or N s/m], stiffness [N m/rad or N/m] towards `rest` [rad or m], armature [kg m^2 or kg]: >= 0.
    """

    kind: str
    axis: ArrayLike = (0.0, 0.0, 1.0)
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    armature: float = 0.0


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body and the joint that carries it.

    parent: another body's name, or "world".  mass [kg].  center: (3,) [m], centre of mass in the body's frame.
    inertia: (3, 3) or (3,) diagonal [kg m^2], about the centre of mass, in the body's axes.
    """

    name: str
    joint: Joint
    parent: str = WORLD
    mass: float = 0.0
    center: ArrayLike = (0.0, 0.0, 0.0)
    inertia: ArrayLike = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A tree of bodies under gravity. Coordinates are its moving joints, parents first, named by their bodies.

    bodies: in any order.  gravity: (3,) [m/s^2] in the world's axes.

    Raises MechanismError for an unknown parent, a cycle, a repeated name, numbers that are not finite or out of range,
    an inertia that no body can have, and a coordinate that moves no mass and has no armature.
    """

    bodies: Sequence[Body]
    gravity: ArrayLike = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        _vector("gravity", self.gravity)
        _ = self.moving

    @cached_property
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first, with all that is welded to them merged into their inertia."""
        checked = [_checked(body) for body in self.bodies]
        return _with_mass_to_move(_welded(_parents_first(checked)))

    @cached_property
    def system(self) -> System:
        """The Lagrangian system: one partial Lagrangian for each body, tagged with its name and energy."""
        if not self.moving:
            raise MechanismError("the mechanism has no joint that moves")
        return System(
            lambda q, qd, t: self._partial_lagrangians(q, qd),
            [body.name for body in self.moving],
            damping=[body.joint.damping for body in self.moving],
        )

    def _partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        gravity = _vector("gravity", self.gravity)
        pull = float(np.linalg.norm(gravity))
        up = spatial.constant(spatial.snapped(-gravity / pull)) if pull else STILL
        ground = _Motion(STILL, STILL, up, ZERO, np.eye(3))
        motions: dict[str, _Motion] = {WORLD: ground}
        partials = []
        with building(Builder()):
            for body, angle, rate in zip(self.moving, q, qd, strict=True):
                with cg.tag(body.name):
                    motion = motions[body.name] = _carried(motions[body.parent], body, angle, rate)
                    partials.append(_energy(motion, body, angle, rate, pull))
        return partials


@dataclass(frozen=True, eq=False)
class _Motion:
    """How a body's frame moves, in axes of its own whose z is the joint's axis."""

    omega: Triple  # angular velocity
    velocity: Triple  # of the origin
    up: Triple  # the direction against gravity
    height: Node  # of the origin along it
    axes: Array  # these axes in the body's, as columns


def _carried(parent: _Motion, body: Body, q: Node, qd: Node) -> _Motion:
    """The motion of a body from that of its parent."""
    joint = body.joint
    axes = spatial.to_z(np.asarray(joint.axis))
    turn = spatial.snapped(parent.axes.T @ np.asarray(joint.orientation) @ axes)  # our axes in the parent's, at q = 0
    place = spatial.constant(spatial.snapped(parent.axes.T @ np.asarray(joint.position)))
    if joint.kind == "prismatic":
        slide = spatial.constant(turn[:, 2])
        place = spatial.plus(place, (slide[0] * q, slide[1] * q, slide[2] * q))
    with cg.tag("kinetic"):
        omega = spatial.turned(turn, parent.omega)
        velocity = spatial.turned(turn, spatial.plus(parent.velocity, spatial.cross(parent.omega, place)))
    with cg.tag("potential"):
        up = spatial.turned(turn, parent.up)
        height = parent.height + spatial.dot(parent.up, place)
    if joint.kind == "prismatic":
        return _Motion(omega, (velocity[0], velocity[1], velocity[2] + qd), up, height, axes)
    c, s = cg.cos(q), cg.sin(q)
    with cg.tag("kinetic"):
        x, y, z = spatial.turned_about_z(c, s, omega)
        velocity = spatial.turned_about_z(c, s, velocity)
    with cg.tag("potential"):
        up = spatial.turned_about_z(c, s, up)
    return _Motion((x, y, z + qd), velocity, up, height, axes)


def _energy(motion: _Motion, body: Body, q: Node, qd: Node, pull: float) -> Node:
    """L_i = K_i - P_i with the first moment m c and the inertia J about the joint, without the centre's velocity.

    K = m v.v / 2 + m c . (v x w) + w . J w / 2,  P = g (m h + u . m c) + spring.
    """
    center = motion.axes.T @ np.asarray(body.center)
    moment = spatial.constant(spatial.snapped(body.mass * center))
    inertia = spatial.about(motion.axes.T @ np.asarray(body.inertia) @ motion.axes, body.mass, center)
    inertia = np.where(np.abs(inertia) <= spatial.SNAP * np.abs(inertia).max(initial=0.0), 0.0, inertia)
    omega, v = motion.omega, motion.velocity
    with cg.tag("kinetic"):
        terms = [0.5 * body.mass * spatial.dot(v, v)]
        terms.append(spatial.dot(spatial.cross(v, omega), moment))  # of the orders, the one with fewest nodes
        terms.append(0.5 * spatial.total([float(inertia[i, i]) * (omega[i] * omega[i]) for i in range(3)]))
        terms += [float(inertia[i, j]) * (omega[i] * omega[j]) for i in range(3) for j in range(i)]
        terms.append(0.5 * body.joint.armature * (qd * qd))
        kinetic = spatial.total(terms)
    with cg.tag("potential"):
        stretch = q - body.joint.rest
        potential = pull * (body.mass * motion.height + spatial.dot(motion.up, moment))
        potential = potential + 0.5 * body.joint.stiffness * (stretch * stretch)
    return kinetic - potential


def _vector(what: str, value: ArrayLike, shape: tuple[int, ...] = (3,)) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise MechanismError(f"{what} must be {shape} finite numbers, got {np.asarray(value).tolist()!r:.80}")
    return array


def _checked(body: Body) -> Body:
    """The body with its numbers as arrays, its axis of length 1, each checked."""
    where, joint = f"body {body.name!r}", body.joint
    if not isinstance(body.name, str) or not body.name or body.name == WORLD:
        raise MechanismError(f"a body needs a name, and not {WORLD!r}; got {body.name!r}")
    if joint.kind not in KINDS:
        raise MechanismError(f"{where}: joint must be one of {', '.join(KINDS)}, got {joint.kind!r}")
    for what in ("damping", "stiffness", "armature", "rest"):
        value = getattr(joint, what)
        if not math.isfinite(value) or (value < 0 and what != "rest"):
            raise MechanismError(f"{where}: {what} must be finite and at least 0, got {value!r}")
    axis = _vector(f"{where}: axis", joint.axis)
    length = float(np.linalg.norm(axis))
    if not length:
        raise MechanismError(f"{where}: axis must not be zero")
    orientation = _vector(f"{where}: orientation", joint.orientation, (3, 3))
    if np.abs(orientation.T @ orientation - np.eye(3)).max() > 1e-9 or np.linalg.det(orientation) < 0:
        raise MechanismError(f"{where}: orientation must be a rotation matrix")
    if not (math.isfinite(body.mass) and body.mass >= 0.0):
        raise MechanismError(f"{where}: mass must be finite and at least 0, got {body.mass!r} kg")
    inertia = np.asarray(body.inertia, dtype=np.float64)
    inertia = _vector(f"{where}: inertia", np.diag(inertia) if inertia.shape == (3,) else inertia, (3, 3))
    _check_inertia(where, inertia)
    return replace(
        body,
        mass=float(body.mass),
        center=_vector(f"{where}: center", body.center),
        inertia=inertia,
        joint=replace(
            joint,
            axis=spatial.snapped(axis / length),
            position=_vector(f"{where}: position", joint.position),
            orientation=spatial.snapped(orientation),
        ),
    )


def _check_inertia(where: str, inertia: Array) -> None:
    """Symmetric, and with principal moments that are not negative and obey the triangle inequality."""
    scale = np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > 1e-9 * scale:
        raise MechanismError(f"{where}: inertia must be symmetric")
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] < -1e-9 * scale:
        raise MechanismError(f"{where}: inertia must not be negative, its principal moments are {moments.tolist()}")
    if moments[2] > moments[0] + moments[1] + 1e-9 * scale:
        raise MechanismError(
            f"{where}: no body has principal moments {moments.tolist()}: the largest exceeds the sum of the others"
        )


def _parents_first(bodies: Sequence[Body]) -> list[Body]:
    by_name = {body.name: body for body in bodies}
    if len(by_name) < len(bodies):
        twice = next(b.name for b in bodies if sum(b.name == other.name for other in bodies) > 1)
        raise MechanismError(f"two bodies have the name {twice!r}")
    for body in bodies:
        if body.parent != WORLD and body.parent not in by_name:
            raise MechanismError(f"body {body.name!r} has the unknown parent {body.parent!r}")
    placed = {WORLD}
    order: list[Body] = []
    for body in bodies:
        path: dict[str, Body] = {}
        at = body
        while at.name not in placed:
            path[at.name] = at
            placed.add(at.name)
            if at.parent in path:
                raise MechanismError(f"body {at.name!r} is its own ancestor, by way of {at.parent!r}")
            at = by_name[at.parent] if at.parent != WORLD else at
        order.extend(reversed(path.values()))
    return order


def _welded(bodies: Sequence[Body]) -> list[Body]:
    """The bodies without welds: a welded body's mass is its carrier's, and its children hang on the carrier."""
    carrier: dict[str, tuple[str, Array, Array]] = {WORLD: (WORLD, np.zeros(3), np.eye(3))}  # name, place, orientation
    merged: dict[str, Body] = {}
    for body in bodies:
        name, place, turn = carrier[body.parent]
        position = place + turn @ np.asarray(body.joint.position)
        orientation = spatial.snapped(turn @ np.asarray(body.joint.orientation))
        if body.joint.kind != "fixed":
            joint = replace(body.joint, position=position, orientation=orientation)
            merged[body.name] = replace(body, parent=name, joint=joint)
            carrier[body.name] = (body.name, np.zeros(3), np.eye(3))
            continue
        carrier[body.name] = (name, position, orientation)
        if name != WORLD and (body.mass or np.any(body.inertia)):
            center = position + orientation @ np.asarray(body.center)
            inertia = orientation @ np.asarray(body.inertia) @ orientation.T
            merged[name] = _joined(merged[name], body.mass, center, inertia)
    return list(merged.values())


def _joined(body: Body, mass: float, center: Array, inertia: Array) -> Body:
    """The body with another mass fixed to it, given in its frame."""
    both = body.mass + mass
    middle = (body.mass * np.asarray(body.center) + mass * center) / both if both else np.asarray(body.center)
    own = spatial.about(np.asarray(body.inertia), body.mass, np.asarray(body.center) - middle)
    return replace(body, mass=both, center=middle, inertia=own + spatial.about(inertia, mass, center - middle))


def _with_mass_to_move(bodies: Sequence[Body]) -> tuple[Body, ...]:
    """The bodies, once each is seen to have inertia along its coordinate, its own or further out."""
    heavy: set[str] = set()
    for body in reversed(bodies):
        if body.mass or np.any(body.inertia):
            heavy.add(body.name)
        if body.name in heavy:
            heavy.add(body.parent)
        elif not body.joint.armature:
            raise MechanismError(f"body {body.name!r} has no mass, carries none, and its joint has no armature")
    return tuple(bodies)


def serial_arm(links: Sequence[dict[str, Any]], gravity: ArrayLike = (0.0, 0.0, -9.81)) -> Mechanism:
    """A chain of bodies, each on the one before. links: keyword arguments of `Body` without `name` and `parent`."""
    names = [f"link {i + 1}" for i in range(len(links))]
    parents = [WORLD, *names]
    bodies = [Body(name, parent=parent, **link) for name, parent, link in zip(names, parents, links, strict=False)]
    return Mechanism(bodies, gravity)
