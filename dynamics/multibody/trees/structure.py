"""The structure of a mechanism: its fields as plain data, which of its numbers are parameters, and what is shared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph.extend import kept_by_first

from ..algebra import spatial
from ..bodies.body import BODY_QUANTITIES, JOINT_QUANTITIES, Body, MechanismError, checked, quantities
from ..bodies.composed_joints import parts_of
from ..forces.external_force import Force
from ..forces.joint_force import JointForce
from ..loops import Loop
from ..parameters import Quantities, bound, entries, evaluated, names_in
from ..sweeps.links import Link, LinkState, axes_of, link
from ..sweeps.outward import Motion, energy, propagate_motion


class Moved(NamedTuple):
    """The motions of a body's parent and of the body, and its partial Lagrangian."""

    parent: Motion
    motion: Motion
    partial: Node


class SharedParts:
    """Bodies checked, their links, motions and energies. Bodies are not to be altered."""

    def __init__(self) -> None:
        self._bodies: WeakKeyDictionary[Body, tuple[Body, ...]] = WeakKeyDictionary()
        self._links: WeakKeyDictionary[Body, tuple[Body | None, Link]] = WeakKeyDictionary()  # with the parent
        self._grounds: dict[tuple[object, ...], Motion] = {}
        self._moved: dict[tuple[object, ...], Moved] = {}

    def __reduce__(self) -> tuple[type[SharedParts], tuple[()]]:
        return SharedParts, ()  # a copy in another process computes its own

    def parts(self, body: Body) -> tuple[Body, ...]:
        """The bodies that a body is, one but for a composed joint, checked; the last is itself."""
        known = self._bodies.get(body) if isinstance(body, Body) else None
        if known is None:
            known = tuple([checked(part) for part in parts_of(body)])
            self._bodies[body] = known
        return known

    def link(self, body: Body, parent: Body | None) -> Link:
        """The link of a checked body."""
        known = self._links.get(body)
        if known is None or known[0] is not parent:
            with cg.tag(body.name):
                known = self._links[body] = parent, link(body, axes_of(parent) if parent else np.eye(3))
        return known[1]

    def ground(self, rest: Motion) -> Motion:
        """The world at rest, the same object for equal motions."""
        return self._grounds.setdefault((rest.strength, *[spatial.plain(each) for each in rest.vertical]), rest)

    def moved(self, parent: Motion, at: LinkState) -> Moved:
        """The motion and energy of a link whose parent moves so. `parent` is one of these motions, or the ground's."""
        known = [node.name for node in (*at.q, *at.u)]
        key = (id(parent), at.name, at.joint, at.link.angle, *known, *at.link.numbers)
        if key not in self._moved:
            with cg.tag(at.name):
                motion = propagate_motion(parent, at)
                self._moved[key] = Moved(parent, motion, energy(motion, at))
        return self._moved[key]


@dataclass(frozen=True, eq=False)
class Structure:
    """The fields of a `Mechanism`, see there."""

    bodies: Sequence[Body]
    gravity: Quantities = (0.0, 0.0, -9.81)
    forces: Sequence[Force | JointForce] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float | ArrayLike] = field(default_factory=dict)
    base_parameters: bool = False
    left_out: tuple[str, ...] = ()
    loops: Sequence[Loop] = ()
    shared: SharedParts = field(default_factory=SharedParts, repr=False, kw_only=True)

    def __getstate__(self) -> dict[str, object]:
        """The fields alone: what was derived from them is derived again where it is needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def parameter_values(self) -> dict[str, float]:
        """Values of the parameters: those that forces name are 0 where nothing else is said."""
        names = [each for force in self.forces for each in force.components if isinstance(each, str)]
        return dict.fromkeys(names, 0.0) | dict(self.parameters)


AnyStructure = TypeVar("AnyStructure", bound=Structure)


def changed(
    structure: AnyStructure, values: Mapping[str, float] = MappingProxyType({}), **changes: Any
) -> AnyStructure:
    """The structure with other fields; of its parameters, those that it then still has, some with other values."""
    result = {"bodies": structure.bodies, "gravity": structure.gravity, "forces": structure.forces} | changes
    used = used_names(result["bodies"], result["gravity"], result["forces"])
    parameters = {name: value for name, value in {**structure.parameters, **values}.items() if name in used}
    return replace(structure, parameters=parameters, **changes)


def listed(what: str, kinds: tuple[type, ...], given: object) -> tuple[Any, ...]:
    """The entries of a field. Raises MechanismError for what is no sequence, and for entries of another type."""
    names = " or ".join([kind.__name__ for kind in kinds])
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MechanismError(f"{what} must be a sequence of {names}, got {type(given).__name__}: {given!r:.60}")
    values = tuple(given)
    for each in values:
        if not isinstance(each, kinds):
            raise MechanismError(f"{what} must be of the type {names}, got {type(each).__name__}: {each!r:.60}")
    return values


class Use(NamedTuple):
    """A number, or an array of numbers, that is made of parameters."""

    what: str
    value: object
    names: dict[str, None]
    check: Callable[[str, object], object]


def uses(bodies: Sequence[Body], gravity: Quantities) -> Iterator[Use]:
    """The quantities of bodies, their joints and gravity in which there are parameters."""
    yield from _of_parameters([("gravity", gravity, quantities)])
    for body in bodies:
        yield from _uses_of(body)


@kept_by_first
def _uses_of(body: Body) -> tuple[Use, ...]:
    tables = (body, BODY_QUANTITIES), (body.joint, JOINT_QUANTITIES)
    rows = [
        (f"body {body.name!r}: {name}", getattr(owner, name), check)
        for owner, table in tables
        for name, check in table.items()
    ]
    return tuple(_of_parameters(rows))


def _of_parameters(rows: Iterable[tuple[str, object, Callable[[str, object], object]]]) -> Iterator[Use]:
    for what, value, check in rows:
        if names := names_in(entries(value)):
            yield Use(what, value, names, check)


def used_names(bodies: Sequence[Body], gravity: Quantities, forces: Iterable[Force | JointForce]) -> dict[str, None]:
    """The names that occur in forces, and then those in bodies and gravity."""
    result = dict.fromkeys([name for force in forces for name in force.names])
    return result | {name: None for use in uses(bodies, gravity) for name in use.names}


def require_values(bodies: Sequence[Body], gravity: Quantities, values: Mapping[str, ArrayLike]) -> None:
    """Raises MechanismError for a parameter without value, and for a value, or one of N, that makes no body or joint.

    A parameter of a force is 0 by default; a mass or length that is would be another mechanism.
    """
    for use in uses(bodies, gravity):
        if missing := [name for name in use.names if name not in values]:
            raise MechanismError(f"{use.what} has the parameter {missing[0]!r}, which needs a value in `parameters`")
        at = {name: np.asarray(values[name], dtype=np.float64) for name in use.names}
        rows = evaluated(use.value, at)
        varied = any([each.ndim for each in at.values()])
        for k, row in enumerate(rows if varied else [rows]):
            try:
                use.check(use.what, row.item() if row.ndim == 0 else row)
            except MechanismError as error:
                shown = {name: each[k] if each.ndim else each for name, each in at.items()}
                listed = ", ".join([f"{name} = {float(value)!r}" for name, value in shown.items()])
                raise MechanismError(f"{error}, where {listed}") from None


def bound_body(body: Body, values: Mapping[str, float]) -> Body:
    """The body with numbers in place of these parameters; itself where it has none of them."""
    if not any([use.names.keys() & values.keys() for use in _uses_of(body)]):
        return body
    own = {name: bound(getattr(body, name), values) for name in BODY_QUANTITIES}
    joint = {name: bound(getattr(body.joint, name), values) for name in JOINT_QUANTITIES}
    return replace(body, joint=replace(body.joint, **joint), **own)


def bound_force(force: Force | JointForce, values: Mapping[str, float]) -> Force | JointForce:
    """The force likewise; one along a joint keeps its input, which then has that value."""
    if isinstance(force, JointForce) or not force.names & values.keys():
        return force
    value, torque = ([bound(each, values) for each in three] for three in (force.value, force.torque))
    return replace(force, value=value, torque=torque)
