"""Mechanisms: trees of rigid bodies joined by hinges, slides and welds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Integral
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building

from ..systems.system import BiasForce, BodySystem, System, parameter_value
from . import newton_euler, spatial
from .base_parameters import regrouped
from .body import WORLD, Body, Joint, MechanismError, checked, shape_of, vector
from .external_force import Force, Reach, check, generalized, reach
from .kinematic_tree import Carrier, locked, parents_first, welded, with_mass_to_move
from .link import Link, Motion, axes_of, carried, energy, ground, link
from .spatial import ZERO, Array
from .subtree import Subtree, as_subtree, below, inserted

__all__ = ["WORLD", "Body", "Force", "Joint", "Mechanism", "MechanismError", "serial_arm", "tree"]


class _Made:
    """What mechanisms that come of one another by a change share, each made once; bodies are not to be altered."""

    def __init__(self) -> None:
        self.bodies: WeakKeyDictionary[Body, Body] = WeakKeyDictionary()  # checked
        self.links: WeakKeyDictionary[Body, tuple[Body | None, Link]] = WeakKeyDictionary()  # with the parent
        self.partials: dict[tuple[Any, ...], _Moved] = {}

    def __reduce__(self) -> tuple[type[_Made], tuple[()]]:
        return _Made, ()  # a copy in another process makes its own


class _Moved(NamedTuple):
    """A body's parent's motion, its own, and its partial Lagrangian."""

    parent: Motion
    motion: Motion
    partial: Node


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A tree of bodies under gravity. Coordinates are its moving joints, parents first, named by their bodies.

    bodies: in any order.  gravity: (3,) [m/s^2] in the world's axes.
    forces: on bodies from outside, beside the joint forces tau; they enter the equations as J^T f.
    parameters: values of the parameters that forces name, {name: value}; one without a value is 0. As of any system,
        parameters are inputs of the graphs, and `simulate` binds them.
    locked: {body: coordinate [rad or m]} of joints that stand still: their bodies are welded on, see `lock`.
    base_parameters: written with the fewest inertial numbers (`base_parameters.py`). Smaller graphs of the same
        motion; but a partial Lagrangian is then not the energy of its body.

    Raises MechanismError for an unknown parent, a cycle, a repeated name, numbers that are not finite or out of range,
    an inertia that no body can have, a coordinate that moves no mass and has no armature, a force on an unknown body,
    and a parameter that no force uses.
    """

    bodies: Sequence[Body]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    forces: Sequence[Force] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    base_parameters: bool = False
    _made: _Made = field(default_factory=_Made, repr=False, kw_only=True)

    def __post_init__(self) -> None:
        vector("gravity", self.gravity)
        for what, kind in (("bodies", Body), ("forces", Force)):  # kept, so that an iterator is read once
            object.__setattr__(self, what, _listed(what, kind, getattr(self, what)))
        bodies = set(self._carriers) - {WORLD}
        for force in self.forces:
            check(force, bodies)
        used = {name for force in self.forces for name in force.names}
        for name in self.parameters:
            if name not in used:
                raise MechanismError(f"the mechanism has no force that uses the parameter {name!r}")
        for name, value in self._values.items():
            parameter_value(name, value)

    def __repr__(self) -> str:
        moving = [body.name for body in self.moving]
        parts = [f"{len(self.bodies)} bodies, {len(moving)} coordinate(s) {', '.join(moving[:6])}"]
        parts[0] += ", ..." if len(moving) > 6 else ""
        parts += [f"locked {', '.join(list(self.locked)[:6])}"] if self.locked else []
        parts += [f"forces on {', '.join([force.body for force in self.forces[:6]])}"] if self.forces else []
        parts += [f"parameters {', '.join(self._values)}"] if self._values else []
        parts += [f"gravity {', '.join([f'{each:g}' for each in np.asarray(self.gravity)])}"]
        return f"<Mechanism of {'; '.join(parts)}>"

    @property
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first, with all that is welded to them merged into their inertia."""
        return self._merged[0]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the moving bodies, one for each coordinate."""
        return tuple([body.name for body in self.moving])

    @property
    def ode(self) -> None:
        """None: a mechanism has a Lagrangian, see `Model`."""
        return None

    @property
    def _carriers(self) -> dict[str, Carrier]:
        return self._merged[1]

    @cached_property
    def _merged(self) -> tuple[tuple[Body, ...], dict[str, Carrier]]:
        bodies = [self._checked(body) for body in self.bodies]
        moving, carriers = welded(parents_first(locked(bodies, self.locked)))
        return with_mass_to_move(moving), carriers

    def _checked(self, body: Body) -> Body:
        known = self._made.bodies.get(body) if isinstance(body, Body) else None
        if known is None:
            known = checked(body)
            self._made.bodies[body] = known
        return known

    @property
    def _named(self) -> list[str]:
        return [each for force in self.forces for each in force.components if isinstance(each, str)]

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
        return BodySystem(
            self._bias_forces,
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
        moves = self.motion(body, at)
        return Graph(self.system.q, {name: moves.outputs[name] for name in ("x", "y", "z")})

    def motion(self, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
        """How a body moves in the world: inputs q0.., qd0.., outputs in the world's axes.

        x, y, z [m] and vx, vy, vz [m/s] of a point; wx, wy, wz [rad/s], the body's angular velocity; R_0_0, R_0_1, ..
        row by row, its axes as columns.
        at: (3,) [m], the point, in the body's frame. Raises MechanismError for an unknown body.
        """
        if not isinstance(body, str) or body not in self._carriers:
            raise MechanismError(f"there is no body {body!r:.80} in the mechanism")
        system = self.system
        point = vector(f"position on body {body!r}: at", at)
        with building(Builder()), cg.tag(body):
            way = self._reach(body, system.q, system.qd)
            moves = way.motion(point)
            columns = [way.direction(spatial.constant(each)) for each in np.eye(3)]
        outputs = dict(zip(("x", "y", "z"), moves.position, strict=True))
        outputs |= dict(zip(("vx", "vy", "vz"), moves.velocity, strict=True))
        outputs |= dict(zip(("wx", "wy", "wz"), moves.omega, strict=True))
        outputs |= {f"R_{i}_{j}": columns[j][i] for i in range(3) for j in range(3)}
        return cg.simplify(Graph([*system.q, *system.qd], outputs))

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
        with building(Builder()):
            moved = self._moved(q, qd)
            partials = [each.partial for each in moved]
            if self.base_parameters:
                with cg.tag("potential"):
                    partials[0] = partials[0] - spatial.dot(self._ground.up, spatial.constant(self._links[1]))
        return partials

    @property
    def _ground(self) -> Motion:
        rest = ground(self.gravity)
        return self._made.partials.setdefault(
            ("ground", *[each.value for each in rest.up]), _Moved(rest, rest, ZERO)
        ).motion

    def _moved(self, q: Sequence[Node], qd: Sequence[Node]) -> list[_Moved]:
        made, rest = self._made.partials, self._ground
        motions = {WORLD: rest}
        found = []
        for body, made_of, angle, rate in zip(self.moving, self.links, q, qd, strict=True):
            parent, kind = motions[body.parent], body.joint.kind
            key = (id(parent), body.name, kind, angle.name, *made_of.numbers)
            if key not in made:
                with cg.tag(body.name):
                    motion = carried(parent, made_of, kind, angle, rate)
                    made[key] = _Moved(parent, motion, energy(motion, made_of, angle, rate))
            found.append(made[key])
            motions[body.name] = made[key].motion
        return found

    def _bias_forces(self, q: Sequence[Node], qd: Sequence[Node]) -> list[BiasForce]:
        found = []
        with building(Builder()):
            accelerations = {WORLD: newton_euler.at_rest(self._ground)}
            moved = self._moved(q, qd)
            for body, made_of, moves, angle, rate in zip(self.moving, self.links, moved, q, qd, strict=True):
                with cg.tag(body.name):
                    acceleration = accelerations[body.name] = newton_euler.accelerated(
                        accelerations[body.parent], moves.parent, moves.motion, made_of, body.joint.kind, angle, rate
                    )
                    found += newton_euler.forces(acceleration, moves.motion, made_of, angle, rate)
        return found

    @property
    def links(self) -> list[Link]:
        """What the motion and energy of each of the moving bodies is made of."""
        return self._links[0]

    @cached_property
    def _links(self) -> tuple[list[Link], Array]:
        """The links, and the first moment of what of their inertia is the world's."""
        by_name: dict[str, Body | None] = {body.name: body for body in self.moving} | {WORLD: None}
        links = [self._link(body, by_name[body.parent]) for body in self.moving]
        if self.base_parameters:
            return regrouped(links, [body.joint.kind for body in self.moving], self.parents)
        return links, np.zeros(3)

    def _link(self, body: Body, parent: Body | None) -> Link:
        known = self._made.links.get(body)
        if known is None or known[0] is not parent:
            known = self._made.links[body] = parent, link(body, axes_of(parent) if parent else np.eye(3))
        return known[1]

    @property
    def parents(self) -> list[int]:
        """For each of the moving bodies the index of the one that carries it, -1 for the world."""
        index = {body.name: i for i, body in enumerate(self.moving)}
        return [index.get(body.parent, -1) for body in self.moving]

    def lock(self, body: str, at: float = 0.0) -> Mechanism:
        """The mechanism with the joint of a body standing still at a coordinate [rad or m].

        The body and all that is welded to it become one inertia with its parent. Raises MechanismError for an unknown
        body or one without a joint, and a coordinate that is not finite.
        """
        return replace(self, locked={**self.locked, body: at})

    def unlock(self, body: str) -> Mechanism:
        """The mechanism with a locked joint free again. Raises MechanismError for one that is not locked."""
        if body not in self.locked:
            raise MechanismError(f"the joint of body {body!r:.80} is not locked")
        return replace(self, locked={name: at for name, at in self.locked.items() if name != body})

    def subtree(self, body: str) -> Subtree:
        """A body and all that it carries, as `attach` takes it. Raises MechanismError for an unknown body."""
        names = below(self.bodies, body)
        bodies = {each.name: (place, each) for place, each in enumerate(self.bodies) if each.name in names}
        order = [body, *(name for name in bodies if name != body)]
        forces = tuple([force for force in self.forces if force.body in names])
        used = {name for force in forces for name in force.names}
        return Subtree(
            tuple([bodies[name][1] for name in order]),
            bodies[body][1].parent,
            tuple([bodies[name][0] for name in order]),
            forces,
            {name: value for name, value in self.parameters.items() if name in used},
            {name: at for name, at in self.locked.items() if name in names},
        )

    def detach(self, body: str) -> Mechanism:
        """The mechanism without a body and all that it carries. Raises MechanismError for an unknown body."""
        names = below(self.bodies, body)
        forces = tuple([force for force in self.forces if force.body not in names])
        used = {name for force in forces for name in force.names}
        return replace(
            self,
            bodies=tuple([each for each in self.bodies if each.name not in names]),
            forces=forces,
            parameters={name: value for name, value in self.parameters.items() if name in used},
            locked={name: at for name, at in self.locked.items() if name not in names},
        )

    def attach(self, subtree: Subtree | Body | Iterable[Body], to: str | None = None) -> Mechanism:
        """The mechanism with a subtree, a body, or several of which the first carries the others, hung on a body.

        to: a body's name or "world"; by default what the first names as its parent. A subtree that goes back where it
        was taken off gives the same mechanism again. Raises MechanismError as a Mechanism does.
        """
        given = as_subtree(subtree)
        back = to is None or to == given.parent
        bodies = given.hung_on(given.parent if to is None else to)
        return replace(
            self,
            bodies=tuple(inserted(tuple(self.bodies), bodies, given.places if back else ())),
            forces=(*self.forces, *given.forces),
            parameters={**self.parameters, **given.parameters},
            locked={**self.locked, **given.locked},
        )

    def map_state_from(self, other: Mechanism, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """The state (q, qd) of another mechanism as one of this: joints of the same name keep theirs.

        A joint that was locked stands where it was locked, one that is new at 0, both still. Raises ValueError for
        states of another shape.
        """
        rows = [np.asarray(each, dtype=np.float64) for each in (q, qd)]
        theirs = [body.name for body in other.moving]
        for name, row in zip(("q", "qd"), rows, strict=True):
            if row.shape != (len(theirs),):
                raise ValueError(f"{name} must have shape ({len(theirs)},), one for each joint, got {row.shape}")
        positions = {**other.locked, **dict(zip(theirs, rows[0].tolist(), strict=True))}
        rates = dict(zip(theirs, rows[1].tolist(), strict=True))
        names = [body.name for body in self.moving]
        return np.array([positions.get(n, 0.0) for n in names]), np.array([rates.get(n, 0.0) for n in names])


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
