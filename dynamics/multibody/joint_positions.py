"""The places of a mechanism's joints along a motion, for a drawing of sticks in a plane."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..systems.model import Model
from .mechanism import Mechanism
from .planar_arm import PlanarArm

Array = np.ndarray[Any, np.dtype[np.float64]]
_FLAT = 1e-9  # of the largest extent: a direction in which nothing moves or lies


class Skeleton(NamedTuple):
    """points: (T, k, 2) [m], x to the right, y up.  parents: (k,), the earlier point each hangs on, or -1."""

    points: Array
    parents: tuple[int, ...]


def skeleton(model: Model, q: ArrayLike) -> Skeleton | None:
    """Places of joints and tips for q, (T, n); None for a model that has none, such as a bare System.

    A mechanism that moves in a plane of two axes is seen at a right angle to it, any other from above and one side.
    """
    q = np.atleast_2d(np.asarray(q, dtype=np.float64))
    if isinstance(model, PlanarArm):
        joints = model.joint_positions(q)
        return Skeleton(joints, tuple(range(-1, joints.shape[1] - 1)))
    if not isinstance(model, Mechanism):
        return None
    values = {f"q{i}": q[:, i] for i in range(q.shape[1])}
    bodies = {body.name: body for body in model.bodies}
    places: dict[str, int] = {}
    points: list[Array] = []
    parents: list[int] = []

    def add(body: str, parent: int, at: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        graph = model.position(body, at)
        found = graph.evaluate({name: values[name] for name in graph.input_names})
        points.append(np.stack([np.broadcast_to(found[axis], len(q)) for axis in "xyz"], axis=-1))
        parents.append(parent)

    for body in model.moving:
        above = body.parent
        while above in bodies and above not in places:  # welded ones have no joint
            above = bodies[above].parent
        add(body.name, places.get(above, -1))
        places[body.name] = len(points) - 1
    for body in model.moving:
        if places[body.name] not in parents:
            add(body.name, places[body.name], body.center)
    return Skeleton(_seen(np.stack(points, axis=1)), tuple(parents))


def _seen(points: Array) -> Array:
    """Points (T, k, 3) as (T, k, 2)."""
    extent = np.ptp(points.reshape(-1, 3), axis=0)
    flat = extent <= _FLAT * max(extent.max(), 1e-300)
    x, y, z = np.moveaxis(points, -1, 0)
    if flat[1]:
        return np.stack([x, z], axis=-1)
    if flat[0]:
        return np.stack([y, z], axis=-1)
    if flat[2]:
        return np.stack([x, y], axis=-1)
    return np.stack([0.9 * y - 0.45 * x, z - 0.25 * x - 0.12 * y], axis=-1)
