"""Subtree: bodies taken off a mechanism, with all that is needed to put them back or on another one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from numpy.typing import ArrayLike

from .body import WORLD, Body, MechanismError
from .forces.external_force import Force
from .forces.joint_force import JointForce
from .loops import Loop


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
