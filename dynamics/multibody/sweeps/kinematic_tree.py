"""Trees of bodies put in order: parents first, welds merged, each coordinate seen to move something."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, is_finite
from cgraph.extend import Builder, building

from ..algebra import spatial
from ..bodies.body import WORLD, Body, Joint, MechanismError, vector
from ..parameters import entries, names_in, vanishes
from .links import MergedBody, inertia_in


@dataclass(frozen=True, eq=False)
class Carrier:
    """Placement of a body's frame in that of the moving body that carries it, itself if it moves."""

    name: str  # of the moving body, or "world"
    position: Array  # (3,) [m]
    orientation: Array  # (3, 3)


class Place(NamedTuple):
    """Place of a body in a tree.  at: where its joint is locked, if it is.  part: the body, on a weld if it is locked.

    onto: the moving body that it is welded to, if any.  moving: the body that moves, with all merged up to this one.
    """

    at: tuple[float, ...]
    parent: Carrier
    onto: Body | None
    part: Body
    carrier: Carrier
    moving: Body | None


_OWN = (np.zeros(3), np.eye(3))
GROUND = Carrier(WORLD, *_OWN)


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


def locked_at(body: Body, value: Any) -> tuple[float, ...]:
    """Coordinates of a body's joint. Raises MechanismError unless it is a finite number, or as many as it has.

    Also for a body that has no joint to lock. A quaternion needs a length; only its direction counts.
    """
    where, count = f"joint of body {body.name!r}", len(body.joint.type.coordinates)
    if not body.joint.type.moves:
        raise MechanismError(f"body {body.name!r} is welded on and has no joint to lock")
    if count == 1:
        if not is_finite(value):
            raise MechanismError(f"{where}: it can be locked at a finite number, got {value!r:.80}")
        return (float(value),)
    at = vector(f"{where}: the coordinates where it is locked", value, (count,))
    groups = np.array(body.joint.type.groups)
    for group in {*groups.tolist()}:  # the entries of a quaternion are one
        if (groups == group).sum() > 1 and not np.any(at[groups == group]):
            raise MechanismError(f"{where}: a quaternion must not be zero, got {value!r:.80}")
    return tuple(at.tolist())


def placed_bodies(
    bodies: Sequence[Body], at: Mapping[str, float | ArrayLike], before: Mapping[Body, Place]
) -> tuple[dict[Body, Place], tuple[Body, ...]]:
    """The places of bodies, parents first, and those that move: a welded body's mass and children are its carrier's.

    at: the coordinates [rad or m] of joints that are locked.  before: places, taken where a body hangs on the same.
    Raises MechanismError as `locked_at` and `parents_first`.
    """
    by_name = {body.name: body for body in bodies}
    locked = {name: locked_at(by_name[name], value) for name, value in at.items()}
    places: dict[Body, Place] = {}
    carriers = {WORLD: GROUND}
    merged: dict[str, Body | None] = {}
    with building(Builder()), np.errstate(all="ignore"):  # `require_inertia` says what is beyond float64
        for body in parents_first(bodies):
            parent, still = carriers[body.parent], locked.get(body.name, ())
            onto = None if body.joint.type.moves and not still else merged.get(parent.name)
            found = before.get(body)
            if found is None or found.parent is not parent or found.onto is not onto or found.at != still:
                found = _place(body, still, parent, onto, found)
            places[body], carriers[body.name], merged[found.carrier.name] = found, found.carrier, found.moving
    return places, tuple([body for body in merged.values() if body])


def _place(body: Body, at: tuple[float, ...], parent: Carrier, onto: Body | None, before: Place | None) -> Place:
    joint = body.joint
    if at:
        turn, shift = joint.type.placement(np.asarray(joint.axis), np.array(at))
        position, orientation = np.asarray(joint.position), np.asarray(joint.orientation)
        place = spatial.placed(position, orientation, shift)
        joint = Joint("fixed", position=place, orientation=spatial.snapped(orientation @ turn))
    part = replace(body, joint=joint) if at else body
    if joint.type.moves:
        own = before.carrier if before and not before.at else Carrier(body.name, *_OWN)
        if parent.name == body.parent:
            return Place(at, parent, onto, part, own, part)
    position = spatial.placed(parent.position, parent.orientation, np.asarray(joint.position))
    orientation = spatial.snapped(parent.orientation @ np.asarray(joint.orientation))
    if joint.type.moves:
        joint = replace(joint, position=position, orientation=orientation)
        return Place(at, parent, onto, part, own, replace(body, parent=parent.name, joint=joint))
    moving = onto
    if onto and not (vanishes(body.mass) and vanishes(body.inertia)):
        center = spatial.placed(position, orientation, np.asarray(body.center))
        inertia = spatial.product(orientation, np.asarray(body.inertia), orientation.T)
        moving = _joined(onto, replace(part, center=center, inertia=inertia))
    return Place(at, parent, onto, part, Carrier(parent.name, position, orientation), moving)


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
        mass, _, inertia = inertia_in(body, body.joint)
    if not (math.isfinite(float(mass)) and np.isfinite(inertia).all()):
        raise MechanismError(
            f"body {body.name!r}: its inertia about the joint is beyond float64, with all welded to it"
        )
    return body.joint.type.resists(float(mass), inertia)
