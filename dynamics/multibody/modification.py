"""Modifications of a mechanism: joints locked and freed, subtrees taken off and hung on, states carried over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, real_array

from .body import Body, MechanismError
from .joint_coordinates import coordinate_names, neutral, places, velocity_names
from .structure import AnyStructure, Structure, changed, used_names
from .subtree import Subtree, as_subtree, descendants, inserted


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
