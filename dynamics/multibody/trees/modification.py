"""Modifications of a mechanism: joints locked and freed, subtrees taken off and hung on, states carried over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from numpy.typing import ArrayLike

from ..bodies.body import WORLD, Body, MechanismError
from ..forces.external_force import Force
from ..forces.joint_force import JointForce
from ..loops import Loop
from .structure import Structure, changed, used_names


@dataclass(frozen=True, eq=False)
class Subtree:
    """Bodies of which the first carries all others, as `Mechanism.subtree` takes them off and `attach` hangs them on.

    Parameters
    ----------
    bodies : tuple of Body
        The first carries the others.
    parent : str
        What the first hung on.
    places : tuple of int
        Where the bodies stood among the mechanism's, which orders coordinates.
    forces : tuple of Force and JointForce
        On these bodies and their joints.
    parameters : mapping
        The values that the bodies, their joints and the forces use.
    locked : mapping
        {body: coordinate [rad or m]} of their joints that are locked.
    loops : tuple of Loop
        Of these bodies, among one another and with others, which `attach` needs to be there.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5])
    >>> [body.name for body in arm.subtree("link 2").bodies]
    ['link 2', 'tip']
    """

    bodies: tuple[Body, ...]
    parent: str = WORLD
    places: tuple[int, ...] = ()
    forces: tuple[Force | JointForce, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float | ArrayLike] = field(default_factory=dict)
    loops: tuple[Loop, ...] = ()

    def with_parent(self, parent: str) -> tuple[Body, ...]:
        """The bodies, with the first on that parent."""
        if not isinstance(parent, str):
            raise MechanismError(f"a parent is named by a string, got {type(parent).__name__}: {parent!r:.60}")
        first, *others = self.bodies
        return replace(first, parent=parent), *others


def as_subtree(given: Subtree | Body | Iterable[Body]) -> Subtree:
    """A subtree of one body, or of several, parents first. Raises MechanismError for none."""
    if isinstance(given, Subtree):
        return given
    bodies = (given,) if isinstance(given, Body) else tuple(given) if isinstance(given, Iterable) else ()
    if not bodies or not isinstance(bodies[0], Body):
        raise MechanismError(f"a subtree is a body, or several with the one that carries them first, got {given!r:.60}")
    return Subtree(bodies, bodies[0].parent)


def descendants(bodies: Iterable[Body], root: str) -> set[str]:
    """Names of the body and of all that it carries. Raises MechanismError for an unknown body."""
    bodies = list(bodies)
    names = {body.name for body in bodies}
    if not isinstance(root, str) or root not in names:
        raise MechanismError(f"there is no body {root!r:.80} in the mechanism")
    children: dict[str, list[str]] = {}
    for body in bodies:
        children.setdefault(body.parent, []).append(body.name)
    found, waiting = set(), [root]
    while waiting:
        name = waiting.pop()
        found.add(name)
        waiting += children.get(name, [])
    return found


def inserted(bodies: tuple[Body, ...], new: tuple[Body, ...], places: tuple[int, ...]) -> list[Body]:
    """The bodies with the new ones at their places in the result; after all others where there are none."""
    if not places:
        return [*bodies, *new]
    result = list(bodies)
    for place, body in sorted(zip(places, new, strict=True), key=lambda each: each[0]):
        result.insert(place, body)
    return result


@dataclass(frozen=True, eq=False)
class ModifiableStructure(Structure):
    """A structure whose joints can be locked, and off and onto which subtrees can be taken; each gives a new one."""

    def lock(self, body: str, at: float | ArrayLike | None = None) -> Self:
        """The mechanism with the joint of a body standing still at a coordinate [rad or m], or several; by default 0.

        Of a ball or free joint the coordinates are as many as it has, by default neutral.
        The body and all that is welded to it become one inertia with its parent. Raises MechanismError for an unknown
        body or one without a joint, and a coordinate that is not finite.
        """
        _check_body(body)
        if at is None:
            known = [each.joint.neutral for each in self.bodies if each.name == body]
            at = known[0] if known and len(known[0]) != 1 else 0.0
        return replace(self, locked={**self.locked, body: at})

    def unlock(self, body: str) -> Self:
        """The mechanism with a locked joint free again. Raises MechanismError for one that is not locked."""
        _check_body(body)
        if body not in self.locked:
            raise MechanismError(f"the joint of body {body!r:.80} is not locked")
        return replace(self, locked={name: at for name, at in self.locked.items() if name != body})

    def subtree(self, body: str) -> Subtree:
        """A body and all that it carries, as `attach` takes it. Raises MechanismError for an unknown body."""
        names = descendants(self.bodies, body)
        bodies = {each.name: (place, each) for place, each in enumerate(self.bodies) if each.name in names}
        order = [body, *(name for name in bodies if name != body)]
        forces = tuple([force for force in self.forces if force.body in names])
        taken = tuple([bodies[name][1] for name in order])
        used = used_names(taken, (), forces)
        return Subtree(
            taken,
            bodies[body][1].parent,
            tuple([bodies[name][0] for name in order]),
            forces,
            {name: value for name, value in self.parameters.items() if name in used},
            {name: at for name, at in self.locked.items() if name in names},
            tuple([loop for loop in self.loops if not names.isdisjoint((loop.body, loop.to))]),
        )

    def detach(self, body: str) -> Self:
        """The mechanism without a body and all that it carries, and without the loops that held these.

        Raises MechanismError for an unknown body.
        """
        names = descendants(self.bodies, body)
        return changed(
            self,
            bodies=tuple([each for each in self.bodies if each.name not in names]),
            forces=tuple([force for force in self.forces if force.body not in names]),
            locked={name: at for name, at in self.locked.items() if name not in names},
            loops=tuple([loop for loop in self.loops if names.isdisjoint((loop.body, loop.to))]),
        )

    def attach(self, subtree: Subtree | Body | Iterable[Body], to: str | None = None) -> Self:
        """The mechanism with a subtree, a body, or several of which the first carries the others, hung on a body.

        to: a body's name or "world"; by default what the first names as its parent. A subtree that goes back where it
        was taken off gives the same mechanism again, with its loops after the others. Raises MechanismError as a
        Mechanism does, also for a loop of the subtree with a body that is not there.
        """
        given = as_subtree(subtree)
        if to is not None:
            _check_body(to)
        for name, value in given.parameters.items():
            if (known := self.parameters.get(name, value)) != value:
                raise MechanismError(
                    f"the parameter {name!r} is {known!r} in the mechanism and {value!r} in what it takes on"
                )
        back = to is None or to == given.parent
        bodies = given.with_parent(given.parent if to is None else to)
        return replace(
            self,
            bodies=tuple(inserted(tuple(self.bodies), bodies, given.places if back else ())),
            forces=(*self.forces, *given.forces),
            parameters={**self.parameters, **given.parameters},
            locked={**self.locked, **given.locked},
            loops=(*self.loops, *given.loops),
        )


def _check_body(body: object) -> None:
    if not isinstance(body, str):
        raise MechanismError(f"a body is named by a string, got {type(body).__name__}: {body!r:.60}")
