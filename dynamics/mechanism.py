"""Mechanisms: trees of rigid bodies joined by hinges, slides and welds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.fold import Builder
from cgraph.label import building
from cgraph.order import topological

from . import spatial
from .body import WORLD, Body, Joint, MechanismError, checked, shape_of, vector
from .force import Force, Reach, check, generalized, reach
from .kinematic_tree import Carrier, parents_first, welded, with_mass_to_move
from .spatial import STILL, ZERO, Array, Triple
from .system import System, parameter_value

__all__ = ["WORLD", "Body", "Force", "Joint", "Mechanism", "MechanismError", "serial_arm", "tree"]


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A tree of bodies under gravity. Coordinates are its moving joints, parents first, named by their bodies.

    bodies: in any order.  gravity: (3,) [m/s^2] in the world's axes.
    forces: on bodies from outside, beside the joint forces tau; they enter the equations as J^T f.
    parameters: values of the parameters that forces name, {name: value}; one without a value is 0. As of any system,
        parameters are inputs of the graphs, and `simulate` binds them.

    Raises MechanismError for an unknown parent, a cycle, a repeated name, numbers that are not finite or out of range,
    an inertia that no body can have, a coordinate that moves no mass and has no armature, a force on an unknown body,
    and a parameter that no force uses.
    """

    bodies: Sequence[Body]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    forces: Sequence[Force] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        vector("gravity", self.gravity)
        for what, kind in (("bodies", Body), ("forces", Force)):  # kept, so that an iterator is read once
            object.__setattr__(self, what, _listed(what, kind, getattr(self, what)))
        bodies = set(self._carriers) - {WORLD}
        for force in self.forces:
            check(force, bodies)
        used = {*self._named, *(str(node.name) for node in topological(self._nodes_of_forces) if node.name)}
        for name in self.parameters:
            if name not in used:
                raise MechanismError(f"the mechanism has no force that uses the parameter {name!r}")
        for name, value in self._values.items():
            parameter_value(name, value)

    @property
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first, with all that is welded to them merged into their inertia."""
        return self._merged[0]

    @property
    def _carriers(self) -> dict[str, Carrier]:
        return self._merged[1]

    @cached_property
    def _merged(self) -> tuple[tuple[Body, ...], dict[str, Carrier]]:
        bodies = [checked(body) for body in self.bodies]
        moving, carriers = welded(parents_first(bodies))
        return with_mass_to_move(moving), carriers

    @property
    def _named(self) -> list[str]:
        return [each for force in self.forces for each in force.components if isinstance(each, str)]

    @property
    def _nodes_of_forces(self) -> list[Node]:
        return [each for force in self.forces for each in force.components if isinstance(each, Node)]

    @property
    def _values(self) -> dict[str, float]:
        return dict.fromkeys(self._named, 0.0) | dict(self.parameters)

    @cached_property
    def system(self) -> System:
        """The Lagrangian system: one partial Lagrangian for each body, tagged with its name and energy.

        Of forces it has the generalized forces, tagged with "force" and the body.
        """
        if not self.moving:
            raise MechanismError("the mechanism has no joint that moves")
        return System(
            lambda q, qd, t: self._partial_lagrangians(q, qd),
            [body.name for body in self.moving],
            self._values,
            forces=self._generalized_forces if self.forces else None,
            damping=[body.joint.damping for body in self.moving],
        )

    def position(self, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
        """Where a point of a body is in the world. Inputs q0.., outputs x, y, z [m].

        at: (3,) [m], the point, in the body's frame. Raises MechanismError for an unknown body.
        """
        if not isinstance(body, str) or body not in self._carriers:
            raise MechanismError(f"there is no body {body!r:.80} in the mechanism")
        system = self.system
        point = vector(f"position on body {body!r}: at", at)
        with building(Builder()), cg.tag(body):
            x, y, z = self._reach(body, system.q, system.qd).motion(point).position
        return cg.simplify(Graph(system.q, {"x": x, "y": y, "z": z}))

    def _reach(self, body: str, q: Sequence[Node], qd: Sequence[Node]) -> Reach:
        names = [each.name for each in self.moving]
        return reach(
            self._carriers[body],
            dict(zip(names, self.moving, strict=True)),
            dict(zip(names, q, strict=True)),
            dict(zip(names, qd, strict=True)),
        )

    def _generalized_forces(self, q: list[Node], qd: list[Node], t: Node, p: dict[str, Node]) -> list[Node]:
        return generalized([(force, self._reach(force.body, q, qd)) for force in self.forces], qd, p)

    def _partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        gravity = vector("gravity", self.gravity)
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
    turn, place = spatial.hung(parent.axes, joint.orientation, joint.position, axes)
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


def _listed(what: str, kind: type, given: Any) -> tuple[Any, ...]:
    if not isinstance(given, Iterable):
        raise MechanismError(f"{what} must be a sequence of {kind.__name__}, got {type(given).__name__}: {given!r:.60}")
    return tuple(given)


def serial_arm(links: Sequence[dict[str, Any]], gravity: ArrayLike = (0.0, 0.0, -9.81)) -> Mechanism:
    """A chain of bodies "link 1", "link 2", ..., each on the one before: `tree` without branches."""
    return tree(range(-1, len(links) - 1), links, gravity=gravity)


def tree(
    parents: Sequence[int],
    links: Sequence[dict[str, Any]] | None = None,
    *,
    axes: ArrayLike = (0.0, 1.0, 0.0),
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A tree of bodies "link 1", "link 2", ...: `tree([(i - 1) // 2 for i in range(15)])` is a binary one.

    parents: for each body the index of the one that carries it, counted from 0, -1 for the world.
    links: keyword arguments of `Body` without `name` and `parent`, for each body. By default each is a slender rod of
        1 kg and 1 m along -z, turning about its upper end, its children at its lower end.
    axes: of the default's hinges, (3,) for all or (n, 3).

    Raises MechanismError where the counts differ, for an index out of range, and as `Mechanism` does.
    """
    n = len(parents)
    for i, parent in enumerate(parents):
        if not isinstance(parent, Integral) or not -1 <= parent < n:
            raise MechanismError(f"parents must be indices from -1 to {n - 1}, got {parent!r:.60} for link {i + 1}")
    given = (
        [_rod(axis, parent) for axis, parent in zip(_axes(axes, n), parents, strict=True)] if links is None else links
    )
    if len(given) != n:
        raise MechanismError(f"a tree needs a link for each of its {n} parents, got {len(given)}")
    names = [f"link {i + 1}" for i in range(n)]
    bodies = [
        Body(name, parent=WORLD if parent < 0 else names[parent], **link)
        for name, parent, link in zip(names, parents, given, strict=True)
    ]
    return Mechanism(bodies, gravity)


def _rod(axis: Array, parent: int) -> dict[str, Any]:
    joint = Joint("revolute", axis, (0.0, 0.0, 0.0 if parent < 0 else -1.0))
    return {"joint": joint, "mass": 1.0, "center": (0.0, 0.0, -0.5), "inertia": (1.0 / 12.0, 1.0 / 12.0, 0.0)}


def _axes(given: ArrayLike, n: int) -> Array:
    each = shape_of(given) == (n, 3)
    return vector("axes", given, (n, 3)) if each else np.tile(vector("axes", given), (n, 1))
