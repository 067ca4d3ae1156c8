"""Bodies on composed joints, written as chains of massless bodies on the joints that these are made of."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, is_finite, require_mapping

from ..algebra import spatial
from ..joints import COMPOSITIONS
from ..joints.axial import AXIS
from .body import (
    JOINT_QUANTITIES,
    TEXT_ROUNDING,
    WORLD,
    Body,
    Joint,
    MechanismError,
    body_name,
    check_limits,
    checked_name,
    checked_rotation,
    quantities,
    unit_axis,
    unknown_body,
    vector,
)

_NUMBERS = {name: JOINT_QUANTITIES[name] for name in ("damping", "stiffness", "spring_reference", "armature")}
_PER_PART: dict[str, Callable[[str, object], Any]] = {**_NUMBERS, "limits": check_limits}


def parts_of(body: Body) -> list[Body]:
    """The bodies that a body on a composed joint is, the first on its parent, the last itself; of others itself."""
    if not isinstance(body.joint, Joint) or body.joint.kind not in COMPOSITIONS:
        return [body]
    where, joint, chain = f"body {body.name!r}", body.joint, COMPOSITIONS[body.joint.kind]
    _check_placement(where, joint)
    axes = _axes(where, joint)
    numbers = {name: _per_part(where, body, name) for name in _PER_PART}
    placed: dict[str, Any] = {"position": joint.position, "orientation": joint.orientation}
    bodies: list[Body] = []
    for i, part in enumerate(chain):
        own = {name: values[i] for name, values in numbers.items()}
        name = f"{body.coordinate}.{part.name}"
        single = Joint(part.kind, axes[part.along], pitch=joint.pitch, name=name, **placed, **own)
        parent = bodies[-1].name if bodies else body.parent
        last = i + 1 == len(chain)
        bodies.append(replace(body, joint=single, parent=parent) if last else Body(_inner(body, i), single, parent))
        placed = {}
    return bodies


def require_parents(bodies: Sequence[Body]) -> None:
    """Raises MechanismError for a parent that is no body, such as what is inside of a composed joint."""
    known = {WORLD, *[body.name for body in bodies]}
    for body in bodies:
        if body.parent not in known:
            raise unknown_body(f"body {body.name!r} has the unknown parent {body.parent!r}", body.parent, known)


@contextmanager
def outer_names(bodies: Sequence[Body]) -> Iterator[None]:
    """Within, a MechanismError on a part of a composed joint names the body, and the coordinate of the part."""
    try:
        yield
    except MechanismError as error:
        text = str(error)
        for body in bodies:
            for i, part in enumerate(COMPOSITIONS.get(body.joint.kind, ())[:-1]):
                owner = f"body {body.name!r}, coordinate {f'{body.coordinate}.{part.name}'!r}"
                text = text.replace(f"body {_inner(body, i)!r}", owner)
        raise MechanismError(text) from None


def locked_parts(bodies: Sequence[Body], locked: Mapping[str, float | ArrayLike]) -> dict[str, float | ArrayLike]:
    """The coordinates where joints are locked, of composed ones part by part.

    Raises MechanismError for a body that is not there, and for another count than the joint has coordinates.
    """
    by_name = {body.name: body for body in bodies}
    result: dict[str, float | ArrayLike] = {}
    for given, value in require_mapping("locked", locked, "body: coordinate").items():
        name = body_name(bodies, given, "to lock ")
        count = len(COMPOSITIONS.get(by_name[name].joint.kind, ()))
        if not count:
            result[name] = value
            continue
        at = vector(f"joint of body {name!r}: the coordinates where it is locked", value, (count,))
        names = [*[_inner(by_name[name], i) for i in range(count - 1)], name]
        result |= dict(zip(names, at.tolist(), strict=True))
    return result


def _inner(body: Body, i: int) -> str:
    """The name of a massless body."""
    return f"{body.name}.{COMPOSITIONS[body.joint.kind][i].name}"


def _axes(where: str, joint: Joint) -> tuple[ArrayLike, ArrayLike, Array]:
    """The axis and the second axis, of any length, and the third, which are all at right angles."""
    axis = unit_axis(f"{where}: axis", joint.axis)
    x, y, _ = spatial.to_z(axis).T
    if joint.second_axis is None:
        return joint.axis, x, y
    if all(part.along == AXIS for part in COMPOSITIONS[joint.kind]):
        raise MechanismError(f"{where}: a joint of the kind {joint.kind!r} has no second axis")
    second = unit_axis(f"{where}: second_axis", joint.second_axis)
    if abs(second @ axis) > TEXT_ROUNDING:
        raise MechanismError(
            f"{where}: second_axis must be at a right angle to axis, got {second.tolist()} beside {axis.tolist()}"
        )
    return joint.axis, joint.second_axis, spatial.snapped(np.cross(axis, second))


def _check_placement(where: str, joint: Joint) -> None:
    """Raises MechanismError for what the parts have not apart: a place, a name, and a pitch, which none has."""
    quantities(f"{where}: position", joint.position)
    checked_rotation(f"{where}: orientation", joint.orientation)
    if not isinstance(joint.name, str) or joint.name:
        checked_name(f"the joint of {where}", joint.name)
    if not is_finite(joint.pitch) or joint.pitch:
        raise MechanismError(f"{where}: only a screw has a pitch, not {joint.kind!r}, got {joint.pitch!r:.80} m/rad")


def _per_part(where: str, body: Body, quantity: str) -> Sequence[Any]:
    """A number for each part, from one for all, or as many."""
    what, value = f"{where}: {quantity}", getattr(body.joint, quantity)
    names = [part.name for part in COMPOSITIONS[body.joint.kind]]
    if not isinstance(value, tuple):
        value = (value,) * len(names)
    if len(value) != len(names):
        raise MechanismError(f"{what} must be one number, or {len(names)} for {', '.join(names)}, got {value!r:.80}")
    for name, number in zip(names, value, strict=True):
        _PER_PART[quantity](f"{what} of the coordinate {f'{body.coordinate}.{name}'!r}", number)
    return value
