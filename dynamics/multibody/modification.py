"""Modifications of a mechanism: joints locked and freed, subtrees taken off and hung on, states carried over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, real_array

from .body import WORLD, Body, MechanismError
from .forces.external_force import Force
from .forces.joint_force import JointForce
from .joint_coordinates import coordinate_names, neutral, places, velocity_names
from .loops import Loop
from .structure import AnyStructure, Structure, changed, used_names


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


def lock_joint(structure: AnyStructure, body: str, at: float | ArrayLike | None) -> AnyStructure:
    """The structure with the joint of a body standing still at a coordinate [rad or m], or several."""
    _check_body(body)
    if at is None:
        known = [each.joint.neutral for each in structure.bodies if each.name == body]
        at = known[0] if known and len(known[0]) != 1 else 0.0
    return replace(structure, locked={**structure.locked, body: at})


def unlock_joint(structure: AnyStructure, body: str) -> AnyStructure:
    """The structure with a locked joint free again. Raises MechanismError for one that is not locked."""
    _check_body(body)
    if body not in structure.locked:
        raise MechanismError(f"the joint of body {body!r:.80} is not locked")
    return replace(structure, locked={name: at for name, at in structure.locked.items() if name != body})


def subtree_of(structure: Structure, body: str) -> Subtree:
    """A body and all that it carries. Raises MechanismError for an unknown body."""
    names = descendants(structure.bodies, body)
    bodies = {each.name: (place, each) for place, each in enumerate(structure.bodies) if each.name in names}
    order = [body, *(name for name in bodies if name != body)]
    forces = tuple([force for force in structure.forces if force.body in names])
    taken = tuple([bodies[name][1] for name in order])
    used = used_names(taken, (), forces)
    return Subtree(
        taken,
        bodies[body][1].parent,
        tuple([bodies[name][0] for name in order]),
        forces,
        {name: value for name, value in structure.parameters.items() if name in used},
        {name: at for name, at in structure.locked.items() if name in names},
        tuple([loop for loop in structure.loops if not names.isdisjoint((loop.body, loop.to))]),
    )


def detach_subtree(structure: AnyStructure, body: str) -> AnyStructure:
    """The structure without a body and all that it carries. Raises MechanismError for an unknown body."""
    names = descendants(structure.bodies, body)
    return changed(
        structure,
        bodies=tuple([each for each in structure.bodies if each.name not in names]),
        forces=tuple([force for force in structure.forces if force.body not in names]),
        locked={name: at for name, at in structure.locked.items() if name not in names},
        loops=tuple([loop for loop in structure.loops if names.isdisjoint((loop.body, loop.to))]),
    )


def attach_subtree(
    structure: AnyStructure, subtree: Subtree | Body | Iterable[Body], to: str | None = None
) -> AnyStructure:
    """The structure with a subtree hung on a body or the world; `to` is by default the subtree's own parent."""
    given = as_subtree(subtree)
    if to is not None:
        _check_body(to)
    for name, value in given.parameters.items():
        if (known := structure.parameters.get(name, value)) != value:
            raise MechanismError(
                f"the parameter {name!r} is {known!r} in the mechanism and {value!r} in what it takes on"
            )
    back = to is None or to == given.parent
    bodies = given.with_parent(given.parent if to is None else to)
    return replace(
        structure,
        bodies=tuple(inserted(tuple(structure.bodies), bodies, given.places if back else ())),
        forces=(*structure.forces, *given.forces),
        parameters={**structure.parameters, **given.parameters},
        locked={**structure.locked, **given.locked},
        loops=(*structure.loops, *given.loops),
    )


def map_state(
    moving: Sequence[Body],
    other: Sequence[Body],
    other_locked: Mapping[str, float | ArrayLike],
    q: ArrayLike,
    qd: ArrayLike,
) -> tuple[Array, Array]:
    """The state of the other moving bodies as one of these: joints of bodies of the same name keep theirs."""
    rows = [real_array(name, each) for name, each in (("q", q), ("qd", qd))]
    counts = len(coordinate_names(other)), len(velocity_names(other))
    for name, row, count in zip(("q", "qd"), rows, counts, strict=True):
        if row.shape != (count,):
            raise ValueError(f"{name} must have shape ({count},), one for each joint, got {row.shape}")
    theirs = {body.name: (rows[0][place.q], rows[1][place.u]) for body, place in zip(other, places(other), strict=True)}
    q_new, qd_new = np.array(neutral(moving)), np.zeros(len(velocity_names(moving)))
    for body, place in zip(moving, places(moving), strict=True):
        if body.name in theirs:
            q_new[place.q], qd_new[place.u] = theirs[body.name]
        elif body.name in other_locked:
            q_new[place.q] = other_locked[body.name]
    return q_new, qd_new


def _check_body(body: object) -> None:
    if not isinstance(body, str):
        raise MechanismError(f"a body is named by a string, got {type(body).__name__}: {body!r:.60}")
