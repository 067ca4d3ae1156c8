"""The places of a mechanism's joints along a motion, for a drawing of sticks in a plane."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import real_array

from .body import Body
from .joint_coordinates import coordinate_names, places
from .loops import Loop
from .spatial import Array

_FLAT = 1e-9  # of the largest extent: a direction in which nothing moves or lies


class Bodies(Protocol):
    """What a mechanism has that is needed here."""

    @property
    def bodies(self) -> Sequence[Body]:
        """All bodies."""

    @property
    def moving(self) -> Sequence[Body]:
        """Those that move, parents first."""

    @property
    def loops(self) -> Sequence[Loop]:
        """What closes the tree."""

    def position(self, body: str, at: ArrayLike = ...) -> Graph:
        """Where a point of a body is: outputs x, y, z."""


class Skeleton(NamedTuple):
    """points: (T, k, 2) [m], x to the right, y up.  parents: (k,), the earlier point each hangs on, or -1.

    graph: the points at any q, outputs x0, y0, x1, ..  joints: for every velocity the point where its joint is.
    """

    points: Array
    parents: tuple[int, ...]
    graph: Graph
    joints: tuple[int, ...]


def skeleton(mechanism: Bodies, q: ArrayLike) -> Skeleton:
    """Places of joints and tips for q, (T, n).

    A tip is a body without mass that is welded to the last moving one, or a point where a loop holds it, or else the
    center of mass of that one.
    A mechanism that moves in a plane of two axes is seen at a right angle to it, any other from above and one side.
    """
    q, n = np.atleast_2d(real_array("q", q)), len(coordinate_names(mechanism.moving))
    if q.ndim != 2 or q.shape[1] != n:
        raise ValueError(f"q must have shape (T, {n}) or ({n},), one for each coordinate, got {q.shape}")
    values = {f"q{i}": q[:, i] for i in range(q.shape[1])}
    points: list[Array] = []
    nodes: list[Sequence[Node]] = []
    spots: list[tuple[str, ArrayLike]] = [(body.name, (0.0, 0.0, 0.0)) for body in mechanism.moving]
    for body, at in [*spots, *_tips(mechanism)]:
        graph = mechanism.position(body, at)
        place = graph.evaluate({name: values[name] for name in graph.input_names})
        nodes.append([graph.outputs[axis] for axis in "xyz"])
        points.append(np.stack([np.broadcast_to(place[axis], len(q)) for axis in "xyz"], axis=-1))
    index = {body.name: i for i, body in enumerate(mechanism.moving)}
    above = _above(mechanism)
    parents = [index.get(above[body.name], -1) for body in mechanism.moving]
    parents += [index.get(body, index.get(above[body], -1)) for body, _ in _tips(mechanism)]
    in_space = np.stack(points, axis=1)
    axes = _axes(in_space)
    shown = {
        f"{name}{i}": axis @ np.array(point)
        for i, point in enumerate(nodes)
        for name, axis in zip("xy", axes, strict=True)
    }
    joints = [i for i, place in enumerate(places(mechanism.moving)) for _ in range(place.u.stop - place.u.start)]
    inputs = cg.variables([f"q{i}" for i in range(n)])
    return Skeleton(in_space @ axes.T, tuple(parents), cg.simplify(Graph(inputs, shown)), tuple(joints))


def _above(mechanism: Bodies) -> dict[str, str]:
    """For each body the nearest one inwards that moves; the world's name where there is none."""
    parents = {body.name: body.parent for body in mechanism.bodies}
    moving = {body.name for body in mechanism.moving}
    result = {body.name: body.parent for body in mechanism.moving}
    for name, parent in parents.items():
        while parent in parents and parent not in moving:
            parent = parents[parent]
        result.setdefault(name, parent)
    return result


def _tips(mechanism: Bodies) -> Iterator[tuple[str, ArrayLike]]:
    """Body and place in it of each tip, in the order of the moving bodies that have them."""
    above, carrying = _above(mechanism), {body.parent for body in mechanism.bodies}
    moving = {body.name for body in mechanism.moving}
    holding = {above[name] for name in moving}
    marks: dict[str, list[str]] = {}
    for body in mechanism.bodies:
        if body.name not in moving | carrying and not body.mass and not np.any(np.asarray(body.inertia)):
            marks.setdefault(above[body.name], []).append(body.name)
    pins: dict[str, list[tuple[str, ArrayLike]]] = {}
    for loop in mechanism.loops:
        ends = ((loop.body, loop.at), (loop.to, loop.to_at)) if loop.kind != "coupling" else ()
        for name, at in ends:
            pins.setdefault(name if name in moving else above.get(name, name), []).append((name, at))
    for body in mechanism.moving:
        yield from pins.get(body.name, [])
        if body.name not in holding:
            if body.name not in marks and body.name not in pins:
                yield body.name, np.asarray(body.center)
            for name in marks.get(body.name, []):
                yield name, (0.0, 0.0, 0.0)


def _axes(points: Array) -> Array:
    """What is drawn to the right and up, (2, 3), of points (T, k, 3): their plane, or a view from above and a side."""
    extent = np.ptp(points.reshape(-1, 3), axis=0)
    flat = extent <= _FLAT * extent.max()
    x, y, z = np.eye(3)
    if flat[1]:
        return np.stack([x, z])
    if flat[0]:
        return np.stack([y, z])
    if flat[2]:
        return np.stack([x, y])
    return np.stack([0.9 * y - 0.45 * x, z - 0.25 * x - 0.12 * y])
