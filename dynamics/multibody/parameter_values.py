"""Values of a mechanism's parameters: which of its numbers use them, checked, and put in for them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import kept_by_first

from .body import BODY_QUANTITIES, JOINT_QUANTITIES, Body, MechanismError, quantities
from .forces.external_force import Force
from .forces.joint_force import JointForce
from .parameters import Quantities, bound, entries, evaluated, names_in


class Use(NamedTuple):
    """A number, or an array of numbers, that is made of parameters."""

    what: str
    value: object
    names: dict[str, None]
    check: Callable[[str, object], object]


def uses(bodies: Sequence[Body], gravity: Quantities) -> Iterator[Use]:
    """The quantities of bodies, their joints and gravity in which there are parameters."""
    yield from _of_parameters([("gravity", gravity, quantities)])
    for body in bodies:
        yield from _uses_of(body)


@kept_by_first
def _uses_of(body: Body) -> tuple[Use, ...]:
    tables = (body, BODY_QUANTITIES), (body.joint, JOINT_QUANTITIES)
    rows = [
        (f"body {body.name!r}: {name}", getattr(owner, name), check)
        for owner, table in tables
        for name, check in table.items()
    ]
    return tuple(_of_parameters(rows))


def _of_parameters(rows: Iterable[tuple[str, object, Callable[[str, object], object]]]) -> Iterator[Use]:
    for what, value, check in rows:
        if names := names_in(entries(value)):
            yield Use(what, value, names, check)


def used_names(bodies: Sequence[Body], gravity: Quantities, forces: Iterable[Force | JointForce]) -> dict[str, None]:
    """The names that occur in forces, and then those in bodies and gravity."""
    result = dict.fromkeys([name for force in forces for name in force.names])
    return result | {name: None for use in uses(bodies, gravity) for name in use.names}


def require_values(bodies: Sequence[Body], gravity: Quantities, values: Mapping[str, ArrayLike]) -> None:
    """Raises MechanismError for a parameter without value, and for a value, or one of N, that makes no body or joint.

    A parameter of a force is 0 by default; a mass or length that is would be another mechanism.
    """
    for use in uses(bodies, gravity):
        if missing := [name for name in use.names if name not in values]:
            raise MechanismError(f"{use.what} has the parameter {missing[0]!r}, which needs a value in `parameters`")
        at = {name: np.asarray(values[name], dtype=np.float64) for name in use.names}
        rows = evaluated(use.value, at)
        varied = any([each.ndim for each in at.values()])
        for k, row in enumerate(rows if varied else [rows]):
            try:
                use.check(use.what, row.item() if row.ndim == 0 else row)
            except MechanismError as error:
                shown = {name: each[k] if each.ndim else each for name, each in at.items()}
                listed = ", ".join([f"{name} = {float(value)!r}" for name, value in shown.items()])
                raise MechanismError(f"{error}, where {listed}") from None


def bound_body(body: Body, values: Mapping[str, float]) -> Body:
    """The body with numbers in place of these parameters; itself where it has none of them."""
    if not any([use.names.keys() & values.keys() for use in _uses_of(body)]):
        return body
    own = {name: bound(getattr(body, name), values) for name in BODY_QUANTITIES}
    joint = {name: bound(getattr(body.joint, name), values) for name in JOINT_QUANTITIES}
    return replace(body, joint=replace(body.joint, **joint), **own)


def bound_force(force: Force | JointForce, values: Mapping[str, float]) -> Force | JointForce:
    """The force likewise; one along a joint keeps its input, which then has that value."""
    if isinstance(force, JointForce) or not force.names & values.keys():
        return force
    value, torque = ([bound(each, values) for each in three] for three in (force.value, force.torque))
    return replace(force, value=value, torque=torque)
