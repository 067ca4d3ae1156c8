"""Spheres and planes of contacts as lines of a picture: rings with a mark, and lines, or grids seen from above."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

EDGE_ON = 0.05  # of a plane's square: how little of it is seen where a line stands for the plane
_RING = np.linspace(0.0, 2.0 * np.pi, 49)


class Lines(NamedTuple):
    """Lines through points (k, 2) [m]: rings and marks of spheres, planes seen from the edge, and lines of others."""

    spheres: list[tuple[Array, Array]]
    edges: list[Array]
    grids: list[Array]


def surfaces(points: Array, radii: Sequence[float], center: Array, half: float, step: float) -> Lines:
    """Lines of surfaces in a picture of so much around its center.

    points: (m, 2) [m], the center and mark of each sphere, then of each plane a point and those 1 m along it.
    step: between the lines of a grid [m].
    """
    balls, planes = np.split(points, [2 * len(radii)])
    ring = np.stack([np.cos(_RING), np.sin(_RING)], axis=1)
    lines = Lines([], [], [])
    for radius, place in zip(radii, balls.reshape(-1, 2, 2), strict=True):
        lines.spheres.append((place[0] + (radius or half / 80.0) * ring, place))
    for origin, *ends in planes.reshape(-1, 3, 2):
        ways = np.array(ends) - origin
        if abs(np.linalg.det(ways)) > EDGE_ON:
            lines.grids.extend(grid(origin, ways, center, half, step))
        else:
            way = max(ways, key=np.linalg.norm)
            way = way / (np.linalg.norm(way) or 1.0)
            middle = origin + np.dot(center - origin, way) * way
            lines.edges.append(np.stack([middle - 2.0 * half * way, middle + 2.0 * half * way]))
    return lines


def grid(origin: Array, ways: Array, center: Array, half: float, step: float) -> list[Array]:
    """Lines of a plane, a step of its ways apart, around its place behind the middle of the picture."""
    around = np.round(np.linalg.solve(ways.T, center - origin) / step)
    many = math.ceil(3.0 * half / step)
    shifts, ends = np.arange(-many, many + 1), np.array([-many, many])
    along = [np.stack([ends, np.full(2, shift)], axis=1) for shift in shifts]
    return [origin + step * (around + each) @ ways for each in [*along, *[line[:, ::-1] for line in along]]]
