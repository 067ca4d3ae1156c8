"""A mechanism in a few words, for its repr."""

from __future__ import annotations

from collections.abc import Sequence

from .mechanism_fields import Structure
from .parameters import Quantity, entries, names_in

MOST = 6  # names that are shown of a kind


def summary(structure: Structure, coordinates: Sequence[str]) -> list[str]:
    """How many bodies and which coordinates, then what is locked, acts, closes, can be varied, and gravity."""
    parts = [f"{len(structure.bodies)} bodies, {len(coordinates)} coordinate(s) {_listed(coordinates)}".rstrip()]
    parts[0] += ", ..." if len(coordinates) > MOST else ""
    named = {
        "locked": list(structure.locked),
        "forces on": [force.body for force in structure.forces],
        "loops": [loop.label for loop in structure.loops],
    }
    parts += [f"{what} {_listed(names)}" for what, names in named.items() if names]
    parts += [f"parameters {', '.join(structure.parameter_values)}"] if structure.parameter_values else []
    return [*parts, f"gravity {', '.join([_shown(each) for each in entries(structure.gravity)])}"]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST])


def _shown(number: Quantity) -> str:
    names = names_in([number])
    return f"({', '.join(names)})" if names else f"{float(number):g}"
