"""The places of a mechanism's joints, and of the surfaces of its contacts, along a motion, for a drawing in a plane."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, real_array

from ..algebra import spatial
from ..bodies.body import Body, unit_axis
from ..bodies.joint_coordinates import coordinate_names, places
from ..forces.contact import Contact
from .structure import Structure

_SEEN = 1e-6  # of the way that points go: how near to the plane of the picture they turn
_FLAT = 1e-9  # of the largest extent: a direction in which nothing moves or lies
_ALIKE = 12  # digits of places [m] and directions in which two surfaces are one
_MARK = np.full(3, 3.0**-0.5)  # from a sphere's center to its mark: seen to turn about every axis of its body


class Skeleton(NamedTuple):
    """points: (T, k, 2) [m], x to the right, y up.  parents: (k,), the earlier point each hangs on, or -1.

    graph: the points at any q, and then those of surfaces, outputs x0, y0, x1, ..
    joints: for every velocity the point where its joint is.
    turns: for every velocity, whether it turns what hangs on it in the plane that is seen, 1 counterclockwise, -1 the
    other way, or 0.
    radii: of the spheres of contacts [m].  surfaces: (T, m, 2), points of spheres and planes, see `contact_surfaces`.
    """

    points: Array
    parents: tuple[int, ...]
    graph: Graph
    joints: tuple[int, ...]
    turns: tuple[int, ...]
    radii: tuple[float, ...] = ()
    surfaces: Array | None = None


def skeleton(mechanism: Structure, q: ArrayLike) -> Skeleton:
    """Places of joints and tips for q, (T, n).

    A tip is a body without mass that is welded to the last moving one, or a point where a loop holds it or a contact
    is, or else the center of mass of that one.
    A mechanism that moves in a plane of two axes is seen at a right angle to it, any other from above and one side.
    """
    q, n = np.atleast_2d(real_array("q", q)), len(coordinate_names(mechanism.moving))
    if q.ndim != 2 or q.shape[1] != n:
        raise ValueError(f"q must have shape (T, {n}) or ({n},), one for each coordinate, got {q.shape}")
    values = {f"q{i}": q[:, i] for i in range(q.shape[1])}
    points: list[Array] = []
    nodes: list[Sequence[Node]] = []
    marks, touching = drawn_points(mechanism), contact_surfaces(mechanism.forces)
    for body, at in [*[(body, at) for body, at, _ in marks], *touching.points]:
        graph = mechanism.position(body, at)
        place = graph.evaluate({name: values[name] for name in graph.input_names})
        nodes.append([graph.outputs[axis] for axis in "xyz"])
        points.append(np.stack([np.broadcast_to(place[axis], len(q)) for axis in "xyz"], axis=-1))
    in_space = np.stack(points, axis=1)
    k = len(marks)
    axes, parents = view(in_space[:, :k]), tuple([parent for _, _, parent in marks])
    shown = {
        f"{name}{i}": axis @ np.array(point)
        for i, point in enumerate(nodes)
        for name, axis in zip("xy", axes, strict=True)
    }
    found = cg.simplify(Graph(cg.variables([f"q{i}" for i in range(n)]), shown))
    joints = [i for i, place in enumerate(places(mechanism.moving)) for _ in range(place.u.stop - place.u.start)]
    turns = _turns(mechanism.moving, found, q[0], parents)
    joints_and_tips, surfaces = np.split(in_space @ axes.T, [k], axis=1)
    return Skeleton(
        joints_and_tips, parents, found, tuple(joints), turns, touching.radii, surfaces if touching.points else None
    )


def drawn_points(mechanism: Structure) -> list[tuple[str, ArrayLike, int]]:
    """Body and place in it of joints and tips, and the number of the earlier one that each hangs on, or -1."""
    index = {body.name: i for i, body in enumerate(mechanism.moving)}
    above = _above(mechanism)
    joints = [(body.name, (0.0, 0.0, 0.0), index.get(above[body.name], -1)) for body in mechanism.moving]
    return [*joints, *[(body, at, index.get(body, index.get(above[body], -1))) for body, at in _tips(mechanism)]]


def _turns(bodies: Sequence[Body], graph: Graph, q: Array, parents: Sequence[int]) -> tuple[int, ...]:
    """Signs of the joints' quarter turns as seen in the picture, one for every velocity; 0 for others."""

    def points(at: Array) -> Array:
        values = graph.evaluate({f"q{i}": float(value) for i, value in enumerate(at)})
        return np.array(list(values.values())).reshape(-1, 2)

    turns: list[int] = []
    before = points(q)
    for i, place in enumerate(places(bodies)):
        sign = 0
        if place.q.stop - place.q.start == 1 and bodies[i].joint.type.units == ("rad",):
            turned = q.copy()
            turned[place.q] += 0.5 * np.pi
            after, hung = points(turned), _hung(parents, i)
            (x, y), seen = (before[hung] - before[i]).T, after[hung] - after[i]
            off = [np.abs(seen - way * np.stack([-y, x], axis=1)).max() for way in (1, -1)]
            sign = int(np.sign(off[1] - off[0])) if min(off) <= _SEEN * max(off) else 0
        turns += [sign] * (place.u.stop - place.u.start)
    return tuple(turns)


def _hung(parents: Sequence[int], root: int) -> list[int]:
    """The points that hang on one, and it."""
    found = {root}
    for i, parent in enumerate(parents):
        if parent in found:
            found.add(i)
    return sorted(found)


def _above(mechanism: Structure) -> dict[str, str]:
    """Nearest moving body inwards of each body; the world's name where there is none."""
    parents = {body.name: body.parent for body in mechanism.bodies}
    moving = {body.name for body in mechanism.moving}
    result = {body.name: body.parent for body in mechanism.moving}
    for name, parent in parents.items():
        while parent in parents and parent not in moving:
            parent = parents[parent]
        result.setdefault(name, parent)
    return result


def _tips(mechanism: Structure) -> Iterator[tuple[str, ArrayLike]]:
    """Body and place in it of each tip, in the order of the moving bodies that have them."""
    above, carrying = _above(mechanism), {body.parent for body in mechanism.bodies}
    moving = {body.name for body in mechanism.moving}
    holding = {above[name] for name in moving}
    marks: dict[str, list[str]] = {}
    for body in mechanism.bodies:
        if body.name not in moving | carrying and not body.mass and not np.any(np.asarray(body.inertia)):
            marks.setdefault(above[body.name], []).append(body.name)
    pins: dict[str, list[tuple[str, ArrayLike]]] = {}
    held = [loop for loop in mechanism.loops if loop.kind != "coupling"]
    ends = [end for loop in held for end in zip(loop.bodies, (loop.at, loop.to_at), strict=True)]
    for name, at in [*ends, *contact_surfaces(mechanism.forces).centers]:
        pins.setdefault(name if name in moving else above.get(name, name), []).append((name, at))
    for body in mechanism.moving:
        yield from pins.get(body.name, [])
        if body.name not in holding:
            if body.name not in marks and body.name not in pins:
                yield body.name, np.asarray(body.center)
            for name in marks.get(body.name, []):
                yield name, (0.0, 0.0, 0.0)


def view(points: Array) -> Array:
    """Directions of the picture among points, (.., 3): (2, 3), its right and its up."""
    extent = np.ptp(points.reshape(-1, 3), axis=0)
    flat = extent <= _FLAT * extent.max()
    for across in (1, 0, 2):
        if flat[across]:
            return np.delete(np.eye(3), across, axis=0)
    return np.array([[-0.45, 0.9, 0.0], [-0.25, -0.12, 1.0]])


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
