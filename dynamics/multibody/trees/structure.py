"""The structure of a mechanism: its fields, which of its numbers are parameters, and modified copies.

These have joints locked and freed, and subtrees taken off and hung on.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph._shared import Array, HoldsNodes, kept_by_first, require_mapping

from ..bodies.body import (
    BODY_QUANTITIES,
    JOINT_QUANTITIES,
    WORLD,
    Body,
    MechanismError,
    body_name,
    checked,
    moment_rounding,
    quantities,
)
from ..bodies.composed_joints import parts_of
from ..forces.contact import Contact
from ..forces.joint_force import AnyForce, JointForce
from ..loops import Loop, coupled
from ..parameters import Quantities, bound, entries, evaluated, names_in


@kept_by_first
def checked_parts(body: Body) -> tuple[Body, ...]:
    """The bodies that a body is, one but for a composed joint, checked; the last is itself."""
    return tuple([checked(part) for part in parts_of(body)])


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
    forces : tuple of Force, JointForce and Contact
        On these bodies and their joints, and between these bodies and others, which `attach` needs to be there.
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
    forces: tuple[AnyForce, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float | ArrayLike] = field(default_factory=dict)
    loops: tuple[Loop, ...] = ()

    def with_parent(self, parent: str) -> tuple[Body, ...]:
        """The bodies, with the first on that parent."""
        if not isinstance(parent, str):
            raise MechanismError(f"a parent is named by a string, got {type(parent).__name__}: {parent!r:.60}")
        first, *others = self.bodies
        return first if parent == first.parent else replace(first, parent=parent), *others


@dataclass(frozen=True, eq=False)
class Structure(HoldsNodes, ABC):
    """The fields of a `Mechanism`, see there, and copies with joints locked or freed, or with other subtrees."""

    bodies: Sequence[Body]
    gravity: Quantities = (0.0, 0.0, -9.81)
    forces: Sequence[AnyForce] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float | ArrayLike] = field(default_factory=dict)
    base_parameters: bool = False
    left_out: tuple[str, ...] = ()
    loops: Sequence[Loop] = ()
    starts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    @abstractmethod
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first."""

    @abstractmethod
    def position(self, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
        """Position of a point of a body: outputs x, y, z."""

    @property
    def parameter_values(self) -> dict[str, float]:
        """Values of the parameters: those that forces name are 0 where nothing else is said."""
        names = [each for force in self.forces for each in force.components if isinstance(each, str)]
        return dict.fromkeys(names, 0.0) | dict(self.parameters)

    @property
    def standing(self) -> dict[str, float | ArrayLike]:
        """Coordinates of joints that are locked, and of those that couplings hold to them."""
        locked = require_mapping("locked", self.locked, "body: coordinate")
        if not all([isinstance(name, str) for name in locked]):
            raise MechanismError(f"locked names bodies by strings, got {[*locked]!r:.60}")
        standing = {body_name(self.bodies, name, "to lock "): at for name, at in locked.items()}
        for _ in self.loops:
            for loop in self.loops:
                standing |= coupled(loop, standing)
        return standing

    def _with(self, **changes: Any) -> Self:
        """A copy with other fields, which takes what is merged of numbers of bodies that hang on the same as before."""
        result = copy(self)
        vars(result).update(changes if self.parameters else {**changes, "_before": vars(self)["_tree"][0]})
        result.__post_init__()  # type: ignore[attr-defined]  # the checks of `Mechanism`
        return result

    def lock(self, body: str, at: float | ArrayLike | None = None) -> Self:
        """The mechanism with the joint of a body standing still at a coordinate [rad or m], or several; by default 0.

        body: its name, or its joint's, as in `unlock`, `subtree`, `detach` and `attach`.
        Of a ball or free joint the coordinates are as many as it has, by default neutral.
        The body and all that is welded to it become one inertia with its parent. A joint that a coupling holds to it
        stands still, too, and loops that then hold nothing are checked. Raises MechanismError for an unknown
        body or one without a joint, and a coordinate that is not finite.
        """
        body = body_name(self.bodies, body, "to lock ")
        if at is None:
            known = [each.joint.neutral for each in self.bodies if each.name == body]
            at = known[0] if known and len(known[0]) != 1 else 0.0
        return self._with(locked={**self.locked, body: at})

    def unlock(self, body: str) -> Self:
        """The mechanism with a locked joint free again. Raises MechanismError for one that is not locked."""
        body = body_name(self.bodies, body, "to unlock ")
        if body not in self.locked:
            raise MechanismError(f"the joint of body {body!r:.80} is not locked")
        return self._with(locked={name: at for name, at in self.locked.items() if name != body})

    def with_body(self, body: Body) -> Self:
        """The mechanism with a body in place of the one of its name. Raises MechanismError where there is none."""
        name = body_name(self.bodies, str(getattr(body, "name", body)))
        return replace(self, bodies=tuple([body if each.name == name else each for each in self.bodies]))

    def subtree(self, body: str) -> Subtree:
        """A body and all that it carries, as `attach` takes it. Raises MechanismError for an unknown body."""
        body = body_name(self.bodies, body)
        names = descendants(self.bodies, body)
        bodies = {each.name: (place, each) for place, each in enumerate(self.bodies) if each.name in names}
        order = [body, *(name for name in bodies if name != body)]
        forces = tuple([force for force in self.forces if not names.isdisjoint(held(force))])
        taken = tuple([bodies[name][1] for name in order])
        used = used_names(taken, (), forces)
        return Subtree(
            taken,
            bodies[body][1].parent,
            tuple([bodies[name][0] for name in order]),
            forces,
            {name: value for name, value in self.parameters.items() if name in used},
            {name: at for name, at in self.locked.items() if name in names},
            tuple([loop for loop in self.loops if not names.isdisjoint(loop.bodies)]),
        )

    def detach(self, body: str) -> Self:
        """The mechanism without a body and all that it carries, and without the loops that held these.

        Raises MechanismError for an unknown body.
        """
        names = descendants(self.bodies, body_name(self.bodies, body))
        return changed(
            self,
            bodies=tuple([each for each in self.bodies if each.name not in names]),
            forces=tuple([force for force in self.forces if names.isdisjoint(held(force))]),
            locked={name: at for name, at in self.locked.items() if name not in names},
            loops=tuple([loop for loop in self.loops if names.isdisjoint(loop.bodies)]),
        )

    def attach(self, subtree: Subtree | Body | Iterable[Body], to: str | None = None) -> Self:
        """The mechanism with a subtree, a body, or several of which the first carries the others, hung on a body.

        to: a body's name or "world"; by default what the first names as its parent. A subtree that goes back where it
        was taken off gives the same mechanism again, with its loops after the others. Raises MechanismError as a
        Mechanism does, also for a loop of the subtree with a body that is not there.
        """
        given = as_subtree(subtree)
        if not isinstance(to, str | None):
            raise MechanismError(f"to must be a body's name, got {type(to).__name__}: {to!r:.60}")
        if to not in (None, WORLD) and any(to in (each.name, each.joint.name) for each in self.bodies):
            to = body_name(self.bodies, to)
        for name, value in given.parameters.items():
            if (known := self.parameters.get(name, value)) != value:
                raise MechanismError(
                    f"the parameter {name!r} is {known!r} in the mechanism and {value!r} in what it takes on"
                )
        back = to is None or to == given.parent
        bodies = given.with_parent(given.parent if to is None else to)
        return self._with(
            bodies=tuple(inserted(tuple(self.bodies), bodies, given.places if back else ())),
            forces=(*self.forces, *given.forces),
            parameters={**self.parameters, **given.parameters},
            locked={**self.locked, **given.locked},
            loops=(*self.loops, *given.loops),
        )


def as_subtree(given: Subtree | Body | Iterable[Body]) -> Subtree:
    """A subtree of one body, or of several, parents first. Raises MechanismError for none."""
    if isinstance(given, Subtree):
        return given
    bodies = (given,) if isinstance(given, Body) else tuple(given) if isinstance(given, Iterable) else ()
    if not bodies or not isinstance(bodies[0], Body):
        raise MechanismError(f"a subtree is a body, or several with the one that carries them first, got {given!r:.60}")
    return Subtree(bodies, bodies[0].parent)


def descendants(bodies: Iterable[Body], root: str) -> set[str]:
    """Names of the body and of all that it carries."""
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


def held(force: AnyForce) -> set[str]:
    """Names of the bodies that a force is on."""
    if isinstance(force, JointForce):
        return {*force.shares}
    return {force.body, force.to} if isinstance(force, Contact) else {force.body}


AnyStructure = TypeVar("AnyStructure", bound=Structure)


def changed(
    structure: AnyStructure, values: Mapping[str, float] = MappingProxyType({}), **changes: Any
) -> AnyStructure:
    """The structure with other fields; of its parameters, those that it then still has, some with other values."""
    result = {name: changes.get(name, getattr(structure, name)) for name in ("bodies", "gravity", "forces")}
    used = used_names(*result.values()) if structure.parameters or values else {}
    parameters = {name: value for name, value in {**structure.parameters, **values}.items() if name in used}
    return structure._with(parameters=parameters, **changes)


def listed(what: str, kinds: tuple[type, ...], given: object) -> tuple[Any, ...]:
    """The entries of a field. Raises MechanismError for what is no sequence, and for entries of another type."""
    *others, last = [kind.__name__ for kind in kinds]
    names = f"{', '.join(others)} or {last}" if others else last
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MechanismError(f"{what} must be a sequence of {names}, got {type(given).__name__}: {given!r:.60}")
    values = tuple(given)
    for each in values:
        if not isinstance(each, kinds):
            raise MechanismError(f"{what} must be of the type {names}, got {type(each).__name__}: {each!r:.60}")
    return values


Check = Callable[[str, object], object]
Use = tuple[str, object, dict[str, None], Check]  # a quantity: what it is, its value, its parameters and its check


def uses(bodies: Sequence[Body], gravity: Quantities, forces: Iterable[AnyForce]) -> Iterator[Use]:
    """The quantities of bodies, their joints, gravity and contacts in which there are parameters."""
    if names := names_in(entries(gravity)):
        yield "gravity", gravity, names, quantities
    for force in [each for each in forces if isinstance(each, Contact | JointForce)]:
        yield from _uses_in(force.label, force, force.quantities)
    for body in bodies:
        yield from _uses_of(body)


@kept_by_first
def _uses_of(body: Body) -> tuple[Use, ...]:
    where = f"body {body.name!r}"
    return (*_uses_in(where, body, BODY_QUANTITIES), *_uses_in(where, body.joint, JOINT_QUANTITIES))


def _uses_in(where: str, owner: object, checks: Mapping[str, Check]) -> Iterator[Use]:
    for name, check in checks.items():
        if type(value := getattr(owner, name)) is not float and (names := names_in(entries(value))):
            yield f"{where}: {name}", value, names, check


def used_names(bodies: Sequence[Body], gravity: Quantities, forces: Sequence[AnyForce]) -> dict[str, None]:
    """The names that occur in forces, and then those in bodies and gravity."""
    result = dict.fromkeys([name for force in forces for name in force.names])
    return result | {name: None for _, _, names, _ in uses(bodies, gravity, forces) for name in names}


def require_values(
    bodies: Sequence[Body], gravity: Quantities, forces: Sequence[AnyForce], values: Mapping[str, ArrayLike]
) -> None:
    """Raises MechanismError for a parameter without value, and for a value, or one of N, that makes no body or joint.

    A parameter of a `Force` is 0 by default; a mass or stiffness that is would be another mechanism.
    """
    for what, value, names, check in uses(bodies, gravity, forces):
        if missing := [name for name in names if name not in values]:
            raise MechanismError(f"{what} has the parameter {missing[0]!r}, which needs a value in `parameters`")
        at = {name: np.asarray(values[name], dtype=np.float64) for name in names}
        rows = evaluated(value, at)
        varied, looked_at = any([each.ndim for each in at.values()]), [0]
        if varied:
            looked_at = unsure(check, rows)
        for k in looked_at:
            row = rows[k] if varied else rows
            try:
                check(what, row.item() if row.ndim == 0 else row)
            except MechanismError as error:
                shown = {name: each[k] if each.ndim else each for name, each in at.items()}
                listed = ", ".join([f"{name} = {float(number)!r}" for name, number in shown.items()])
                of = f" of trajectory {k}" if varied else ""
                raise MechanismError(f"{error}, where {listed}{of}") from None


def bound_body(body: Body, values: Mapping[str, float]) -> Body:
    """The body with numbers in place of these parameters; itself where it has none of them."""
    if not any([names.keys() & values.keys() for _, _, names, _ in _uses_of(body)]):
        return body
    own = {name: bound(getattr(body, name), values) for name in BODY_QUANTITIES}
    joint = {name: bound(getattr(body.joint, name), values) for name in JOINT_QUANTITIES}
    return replace(body, joint=replace(body.joint, **joint), **own)


def bound_force(force: AnyForce, values: Mapping[str, float]) -> AnyForce:
    """The force likewise; an input of one along a joint stays, and then has that value."""
    if not force.names & values.keys():
        return force
    if isinstance(force, Contact | JointForce):
        numbers = {name: bound(getattr(force, name), values) for name in force.quantities}
        return replace(force, **numbers) if numbers else force
    value, torque = ([bound(each, values) for each in three] for three in (force.value, force.torque))
    return replace(force, value=value, torque=torque)


Flags = np.ndarray[Any, np.dtype[np.bool_]]
LARGEST = np.finfo(float).max / 4.0  # entry of an inertia, so that sums of moments are finite


def unsure(check: Callable[[str, object], Any], rows: Array) -> list[int]:
    """Which of many values, (N, ..), to look at one by one: the first, whose shape is that of all, and any in doubt."""
    surely = SURELY.get(check)
    if surely is None:  # a check of its own kind
        return list(range(len(rows)))
    flags = surely(rows)
    flags[:1] = False
    which: list[int] = np.flatnonzero(~flags).tolist()
    return which


def _finite(rows: Array) -> Flags:
    return np.asarray(np.isfinite(rows).reshape(len(rows), -1).all(axis=1))


def _not_negative(rows: Array) -> Flags:
    return np.asarray(_finite(rows) & (rows >= 0.0))


def _inertial(rows: Array) -> Flags:
    """Of inertias, (N, 3) or (N, 3, 3): symmetric, and with the moments of a body."""
    good = (np.abs(rows) < LARGEST).reshape(len(rows), -1).all(axis=1)
    if rows.ndim == 3:
        good &= (rows == rows.transpose(0, 2, 1)).all(axis=(1, 2))
    known = rows.copy()
    known[~good] = 0.0
    moments = np.linalg.eigvalsh(known) if rows.ndim == 3 else np.sort(known, axis=1)
    rounding = moment_rounding(1.0, 0.0) * np.abs(known).reshape(len(rows), -1).max(axis=1)
    flags: Flags = good & (moments[:, 0] >= -rounding) & (moments[:, 2] <= moments[:, 0] + moments[:, 1] + rounding)
    return flags


# For each check of a number, or of an array of them, which of many values it takes without a word.
SURELY: dict[Callable[[str, object], Any], Callable[[Array], Flags]] = {
    BODY_QUANTITIES["mass"]: _not_negative,
    BODY_QUANTITIES["center"]: _finite,
    BODY_QUANTITIES["inertia"]: _inertial,
    JOINT_QUANTITIES["damping"]: _not_negative,
    JOINT_QUANTITIES["spring_reference"]: _finite,
}
