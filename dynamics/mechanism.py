"""Mechanisms: trees of rigid bodies joined by hinges, slides and welds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.fold import Builder
from cgraph.label import building

from .body import WORLD, Body, Joint, MechanismError, checked, shape_of, vector
from .force import Force, Reach, check, generalized, reach
from .kinematic_tree import Carrier, locked, parents_first, welded, with_mass_to_move
from .link import Link, Motion, axes_of, carried, energy, ground, link, link_numbers, regrouped
from .spatial import ZERO, Array
from .subtree import Subtree, as_subtree, below, inserted
from .system import System, parameter_value

__all__ = ["WORLD", "Body", "Force", "Joint", "Mechanism", "MechanismError", "serial_arm", "tree"]


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A tree of bodies under gravity. Coordinates are its moving joints, parents first, named by their bodies.

    bodies: in any order.  gravity: (3,) [m/s^2] in the world's axes.
    forces: on bodies from outside, beside the joint forces tau; they enter the equations as J^T f.
    parameters: values of the parameters that forces name, {name: value}; one without a value is 0. As of any system,
        parameters are inputs of the graphs, and `simulate` binds them.
    locked: {body: coordinate [rad or m]} of joints that stand still: their bodies are welded on, see `lock`.

    Raises MechanismError for an unknown parent, a cycle, a repeated name, numbers that are not finite or out of range,
    an inertia that no body can have, a coordinate that moves no mass and has no armature, a force on an unknown body,
    and a parameter that no force uses.
    """

    bodies: Sequence[Body]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    forces: Sequence[Force] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    regroup: bool = False

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
        moving, carriers = welded(parents_first(locked(bodies, self.locked)))
        return with_mass_to_move(moving), carriers

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
        rest = ground(self.gravity)
        rest = self._made.setdefault(("ground", *[each.value for each in rest.up]), (rest, rest, ZERO))[0]
        motions = {WORLD: rest}
        partials = []
        with building(Builder()):
            for body, made_of, angle, rate in zip(self.moving, self.links, q, qd, strict=True):
                parent, kind = motions[body.parent], body.joint.kind
                key = (id(parent), body.name, kind, angle.name, *link_numbers(made_of))
                if key not in self._made:
                    with cg.tag(body.name):
                        motion = carried(parent, made_of, kind, angle, rate)
                        self._made[key] = parent, motion, energy(motion, made_of, angle, rate)
                _, motions[body.name], partial = self._made[key]
                partials.append(partial)
        return partials

    @cached_property
    def links(self) -> list[Link]:
        """What the motion and energy of each of the moving bodies is made of."""
        axes = {body.name: axes_of(body) for body in self.moving} | {WORLD: np.eye(3)}
        links = [link(body, axes[body.parent]) for body in self.moving]
        return regrouped(links, self.moving) if self.regroup else links

    @cached_property
    def _made(self) -> dict[tuple[Any, ...], tuple[Motion, Motion, Node]]:
        """Motions and partial Lagrangians of bodies, which mechanisms that come of this one by a change share."""
        return {}

    def _changed(self, **changes: Any) -> Mechanism:
        new = replace(self, **changes)
        new.__dict__["_made"] = self._made
        return new

    def lock(self, body: str, at: float = 0.0) -> Mechanism:
        """The mechanism with the joint of a body standing still at a coordinate [rad or m].

        The body and all that is welded to it become one inertia with its parent. Raises MechanismError for an unknown
        body or one without a joint, and a coordinate that is not finite.
        """
        return self._changed(locked={**self.locked, body: at})

    def unlock(self, body: str) -> Mechanism:
        """The mechanism with a locked joint free again. Raises MechanismError for one that is not locked."""
        if body not in self.locked:
            raise MechanismError(f"the joint of body {body!r:.80} is not locked")
        return self._changed(locked={name: at for name, at in self.locked.items() if name != body})

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
        return self._changed(
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
        return self._changed(
            bodies=tuple(inserted(tuple(self.bodies), bodies, given.places if back else ())),
            forces=(*self.forces, *given.forces),
            parameters={**self.parameters, **given.parameters},
            locked={**self.locked, **given.locked},
        )

    def state_of(self, other: Mechanism, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
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
