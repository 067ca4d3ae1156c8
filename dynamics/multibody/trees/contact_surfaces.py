"""The spheres and planes of a mechanism's contacts as points of bodies, for a drawing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from ..algebra import spatial
from ..bodies.body import unit_axis
from ..forces.contact import Contact

_ALIKE = 12  # digits of places [m] and directions in which two surfaces are one
_MARK = np.full(3, 3.0**-0.5)  # from a sphere's center to its mark: seen to turn about every axis of its body


class Surfaces(NamedTuple):
    """Surfaces of contacts, each once.

    radii: of the spheres [m].  points: body and place in it of the center of each sphere, and of a mark on it; then of
    each plane a point, and those that are 1 m from it along two of its directions.
    """

    radii: tuple[float, ...]
    points: list[tuple[str, Array]]

    @property
    def centers(self) -> list[tuple[str, Array]]:
        """Body and place in it of the center of each sphere."""
        return self.points[: 2 * len(self.radii) : 2]


def contact_surfaces(forces: Iterable[object]) -> Surfaces:
    """The surfaces of the contacts that are among forces."""
    spheres: dict[tuple[str, tuple[float, ...], float], None] = {}
    planes: dict[tuple[str, tuple[float, ...], float], None] = {}
    for contact in [each for each in forces if isinstance(each, Contact)]:
        spheres[contact.body, _rounded(contact.at), float(contact.radius)] = None
        if contact.to_radius is not None:
            spheres[contact.to, _rounded(contact.to_at), float(contact.to_radius)] = None
            continue
        normal = unit_axis("normal", contact.normal)
        offset = float(np.dot(normal, np.asarray(contact.to_at, dtype=np.float64)))
        planes[contact.to, _rounded(normal), round(offset, _ALIKE)] = None
    points: list[tuple[str, Array]] = []
    for body, center, radius in spheres:
        points += [(body, np.array(center)), (body, np.array(center) + radius * _MARK)]
    for body, direction, offset in planes:
        normal = np.array(direction)
        first = np.eye(3)[1 if abs(normal[0]) > 0.9 else 0]
        u = spatial.snapped(unit_axis("direction", first - np.dot(first, normal) * normal))
        points += [(body, offset * normal + way) for way in (np.zeros(3), u, np.cross(normal, u))]
    return Surfaces(tuple([radius for *_, radius in spheres]), points)


def _rounded(numbers: object) -> tuple[float, ...]:
    return tuple([round(float(each), _ALIKE) + 0.0 for each in np.asarray(numbers, dtype=np.float64)])
