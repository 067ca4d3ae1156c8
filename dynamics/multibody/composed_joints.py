"""Bodies on composed joints, written as chains of massless bodies on the joints that these are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import require_mapping

from . import spatial
from .body import ROUNDING, Body, Joint, MechanismError, unit_axis, vector
from .joints import COMPOSITIONS
from .joints.composition import AXIS
from .spatial import Array

_NUMBERS = ("damping", "stiffness", "spring_reference", "armature")


def parts_of(body: Body) -> list[Body]:
    """The bodies that a body on a composed joint is, the first on its parent, the last itself; of others itself."""
    if not isinstance(body, Body) or not isinstance(body.joint, Joint) or body.joint.kind not in COMPOSITIONS:
        return [body]
    where, joint, chain = f"body {body.name!r}", body.joint, COMPOSITIONS[body.joint.kind]
    axes = _axes(where, joint)
    numbers = {name: _per_part(f"{where}: {name}", joint, getattr(joint, name)) for name in _NUMBERS}
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


def require_outer_parents(bodies: Sequence[Body]) -> None:
    """Raises MechanismError for a body that hangs inside of a composed joint: with this it would come and go."""
    inside = {_inner(body, i) for body in bodies for i in range(len(COMPOSITIONS.get(body.joint.kind, ())) - 1)}
    for body in bodies:
        if body.parent in inside:
            raise MechanismError(f"body {body.name!r} has the unknown parent {body.parent!r}")


def locked_parts(bodies: Sequence[Body], locked: Mapping[str, float | ArrayLike]) -> dict[str, float | ArrayLike]:
    """The coordinates where joints are locked, of composed ones part by part.

    Raises MechanismError for a body that is not there, and for another count than the joint has coordinates.
    """
    by_name = {body.name: body for body in bodies}
    result: dict[str, float | ArrayLike] = {}
    for name, value in require_mapping("locked", locked, "body: coordinate").items():
        if name not in by_name:
            raise MechanismError(f"there is no body {name!r:.80} to lock in the mechanism")
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
    if abs(second @ axis) > ROUNDING:
        raise MechanismError(
            f"{where}: second_axis must be at a right angle to axis, got {second.tolist()} beside {axis.tolist()}"
        )
    return joint.axis, joint.second_axis, spatial.snapped(np.cross(axis, second))


def _per_part(what: str, joint: Joint, value: Any) -> Sequence[Any]:
    """A number for each part, from one for all, or as many."""
    names = [part.name for part in COMPOSITIONS[joint.kind]]
    if not isinstance(value, tuple):
        return [value] * len(names)
    if len(value) != len(names):
        raise MechanismError(f"{what} must be one number, or {len(names)} for {', '.join(names)}, got {value!r:.80}")
    return value
