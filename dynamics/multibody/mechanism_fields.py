"""The fields of a mechanism, as plain data, and in a few words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from .body import Body, MechanismError
from .forces.external_force import Force
from .forces.joint_force import JointForce
from .loops import Loop
from .parameter_values import used_names
from .parameters import Quantities, Quantity, entries, names_in
from .sweeps.link_cache import SharedParts

MOST = 6  # names that a repr shows of a kind


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


def summary(structure: Structure, coordinates: Sequence[str]) -> list[str]:
    """For a repr: bodies and coordinates, then what is locked, acts, closes, can be varied, and gravity."""
    parts = [f"{len(structure.bodies)} bodies, {len(coordinates)} coordinate(s) {_first(coordinates)}".rstrip()]
    parts[0] += ", ..." if len(coordinates) > MOST else ""
    named = {
        "locked": list(structure.locked),
        "forces on": [force.body for force in structure.forces],
        "loops": [loop.label for loop in structure.loops],
    }
    parts += [f"{what} {_first(names)}" for what, names in named.items() if names]
    parts += [f"parameters {', '.join(structure.parameter_values)}"] if structure.parameter_values else []
    return [*parts, f"gravity {', '.join([_shown(each) for each in entries(structure.gravity)])}"]


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST])


def _shown(number: Quantity) -> str:
    names = names_in([number])
    return f"({', '.join(names)})" if names else f"{float(number):g}"
