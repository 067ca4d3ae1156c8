"""Trees of bodies put in order: parents first, welds merged, each coordinate seen to move something."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, is_finite
from cgraph.extend import Builder, building

from ..algebra import spatial
from ..bodies.body import WORLD, Body, Joint, MechanismError, vector
from ..parameters import entries, names_in, vanishes
from .links import MergedBody, axes_of, inertia_in


@dataclass(frozen=True, eq=False)
class Carrier:
    """Placement of a body's frame in that of the moving body that carries it, itself if it moves."""

    name: str  # of the moving body, or "world"
    position: Array  # (3,) [m]
    orientation: Array  # (3, 3)


_OWN = (np.zeros(3), np.eye(3))


def parents_first(bodies: Sequence[Body]) -> list[Body]:
    """The bodies in an order in which each follows its parent, which is there. Raises MechanismError for none."""
    by_name = {body.name: body for body in bodies}
    if len(by_name) < len(bodies):
        twice = next(b.name for b in bodies if sum(b.name == other.name for other in bodies) > 1)
        raise MechanismError(f"two bodies have the name {twice!r}")
    placed = {WORLD}
    order: list[Body] = []
    for body in bodies:
        path: dict[str, Body] = {}
        at = body
        while at.name not in placed:
            path[at.name] = at
            placed.add(at.name)
            if at.parent in path:
                raise MechanismError(f"body {at.name!r} is its own ancestor, by way of {at.parent!r}")
            at = by_name[at.parent] if at.parent != WORLD else at
        order.extend(reversed(path.values()))
    return order


def lock_joints(bodies: Sequence[Body], at: Mapping[str, float | ArrayLike]) -> list[Body]:
    """The bodies, with the joints named in `at` welded where they stand at that coordinate [rad or m], or at several.

    Raises MechanismError for a body that has no joint to lock, and a coordinate that is not finite.
    """
    by_name = {body.name: body for body in bodies}
    welds: dict[str, Joint] = {}
    for name, value in at.items():
        joint = by_name[name].joint
        if not joint.type.moves:
            raise MechanismError(f"body {name!r} is welded on and has no joint to lock")
        orientation, axis, position = (np.asarray(each) for each in (joint.orientation, joint.axis, joint.position))
        turn, shift = joint.type.placement(axis, locked_at(by_name[name], value))
        place = spatial.placed(position, orientation, shift)
        welds[name] = Joint("fixed", position=place, orientation=spatial.snapped(orientation @ turn))
    return [replace(body, joint=welds[body.name]) if body.name in welds else body for body in bodies]


def locked_at(body: Body, value: Any) -> Array:
    """Coordinates of a body's joint, (nq,). Raises MechanismError unless it is a finite number, or as many as it has.

    A quaternion needs a length; only its direction counts.
    """
    where, count = f"joint of body {body.name!r}", len(body.joint.type.coordinates)
    if count == 1:
        if not is_finite(value):
            raise MechanismError(f"{where}: it can be locked at a finite number, got {value!r:.80}")
        return np.array([float(value)])
    at = vector(f"{where}: the coordinates where it is locked", value, (count,))
    groups = np.array(body.joint.type.groups)
    for group in {*groups.tolist()}:  # the entries of a quaternion are one
        if (groups == group).sum() > 1 and not np.any(at[groups == group]):
            raise MechanismError(f"{where}: a quaternion must not be zero, got {value!r:.80}")
    return at


def merge_fixed_bodies(bodies: Sequence[Body]) -> tuple[list[Body], dict[str, Carrier]]:
    """The bodies that move and what carries each body of all: a welded body's mass and children are its carrier's."""
    with building(Builder()), np.errstate(all="ignore"):  # `require_inertia` says what is beyond float64
        carriers = {WORLD: Carrier(WORLD, *_OWN)}
        merged: dict[str, Body] = {}
        for body in bodies:
            parent = carriers[body.parent]
            position = spatial.placed(parent.position, parent.orientation, np.asarray(body.joint.position))
            orientation = spatial.snapped(parent.orientation @ np.asarray(body.joint.orientation))
            if body.joint.type.moves:
                carriers[body.name] = Carrier(body.name, *_OWN)
                merged[body.name] = body
                if parent.name != body.parent:
                    joint = replace(body.joint, position=position, orientation=orientation)
                    merged[body.name] = replace(body, parent=parent.name, joint=joint)
                continue
            carriers[body.name] = Carrier(parent.name, position, orientation)
            if parent.name != WORLD and not (vanishes(body.mass) and vanishes(body.inertia)):
                center = spatial.placed(position, orientation, np.asarray(body.center))
                inertia = spatial.product(orientation, np.asarray(body.inertia), orientation.T)
                other = replace(body, center=center, inertia=inertia)
                merged[parent.name] = _joined(merged[parent.name], other)
        return list(merged.values()), carriers


def _joined(body: Body, other: Body) -> Body:
    """The body with another, in its frame, fixed to it.

    Where there are parameters both are kept: a sum of masses to divide by may be zero.
    """
    if _has_parameters(body) or _has_parameters(other):
        welded = body.welded if isinstance(body, MergedBody) else ()
        return MergedBody(
            body.name, body.joint, body.parent, body.mass, body.center, body.inertia, welded=(*welded, other)
        )
    (mass, here), (more, there) = ((float(each.mass), np.asarray(each.center)) for each in (body, other))
    both = mass + more
    reduced = mass * (more / both) if both else 0.0
    inertia = spatial.added(np.asarray(body.inertia), np.asarray(other.inertia))
    middle = spatial.added(mass * here, more * there) / both if both else here
    return replace(body, mass=both, center=middle, inertia=spatial.parallel_axis(inertia, reduced, there - here))


def _has_parameters(body: Body) -> bool:
    return bool(names_in([*entries(body.mass), *entries(body.center), *entries(body.inertia)]))


def require_inertia(bodies: Sequence[Body]) -> None:
    """Raises MechanismError for a body without inertia along its coordinate: its own, its armature's, or further out.

    Masses further out are taken to move: whether they do, the equations of motion look at.
    """
    carries: set[str] = set()
    for body in reversed(bodies):
        if not (body.name in carries or body.joint.armature or resists(body)):
            lacks = "no mass" if not body.mass else "no inertia about its axis"
            raise MechanismError(f"body {body.name!r} has {lacks}, carries no mass, and its joint has no armature")
        if body.name in carries or not (vanishes(body.mass) and vanishes(body.inertia)):
            carries.add(body.parent)


def resists(body: Body) -> bool:
    """Whether the body alone has inertia along all velocities of its joint.

    Raises MechanismError for more than float64 has.
    """
    with np.errstate(all="ignore"):
        mass, _, inertia = inertia_in(axes_of(body), body)
    if not (math.isfinite(float(mass)) and np.isfinite(inertia).all()):
        raise MechanismError(
            f"body {body.name!r}: its inertia about the joint is beyond float64, with all welded to it"
        )
    return body.joint.type.resists(float(mass), inertia)
