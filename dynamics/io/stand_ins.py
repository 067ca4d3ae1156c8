"""Stand-ins for zero: the smallest mass and moment of inertia that MuJoCo takes, which are read as zero again."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from cgraph._shared import Array

from ..multibody.algebra.spatial import SNAP
from ..multibody.trees.mechanism import WORLD, Body, MechanismError

SMALLEST = 1e-15  # kg, kg m^2: of a body that moves MuJoCo takes nothing below its mjMINVAL
STAND_IN = math.nextafter(SMALLEST, 1.0)  # what nobody else writes
INERTIA_ROUNDING = 2.0**-50  # of the largest moment of inertia: what is left of one that is zero
_NEGLIGIBLE = 2.0**-30  # of what moves with it: a stand-in above this would be seen in MuJoCo's motion


def zeros_again(values: Array) -> Array:
    """Masses or moments with the stand-ins as the zeros that they stand for."""
    return np.where(values == STAND_IN, 0.0, values)


def with_stand_ins(
    bodies: Sequence[Body], moments: Mapping[str, tuple[Array, Array]]
) -> dict[str, tuple[float, Array]]:
    """Mass and principal moments that MuJoCo takes for the bodies that move; bodies have their parents first.

    moments: principal moments and axes of every body, as columns in its own. Raises MechanismError for what MuJoCo does
    not take, and where a stand-in is not negligible.
    """
    masses, inertias = _carried(bodies, moments)
    turning = _turning(bodies)
    result: dict[str, tuple[float, Array]] = {}
    for body in bodies:
        values, axes = moments[body.name]
        if not body.joint.type.moves:
            result[body.name] = float(body.mass), values
            continue
        if 0.0 < float(body.mass) <= STAND_IN:
            _refuse(body, f"has a mass of {body.mass!r} kg")
        if small := [moment for moment in values.tolist() if 0.0 < moment <= STAND_IN]:
            _refuse(body, f"has a moment of inertia of {small[0]!r} kg m^2")
        spin, turned = turning[body.name]
        zeros = [axis for moment, axis in zip(values, axes.T, strict=True) if not moment]
        seen = [axis for axis in zeros if spin is None or abs(float(spin @ axis)) > SNAP]
        if seen and turned and _NEGLIGIBLE * inertias[turned] < STAND_IN:
            _refuse(body, f"has a moment of inertia of 0, where {inertias[turned]:.3g} kg m^2 turn")
        if not body.mass and 0.0 < _NEGLIGIBLE * masses[body.name] < STAND_IN:
            _refuse(body, f"has no mass, where {masses[body.name]:.3g} kg move")
        result[body.name] = float(body.mass) or STAND_IN, np.where(values == 0.0, STAND_IN, values)
    return result


def _refuse(body: Body, what: str) -> None:
    raise MechanismError(f"MuJoCo takes no mass or moment of inertia below {SMALLEST:g}, and body {body.name!r} {what}")


def _carried(
    bodies: Sequence[Body], moments: Mapping[str, tuple[Array, Array]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Mass of each body with all that it carries, and what its inertia about the joint is when stretched out."""
    mass, first, second = ({body.name: 0.0 for body in bodies} | {WORLD: 0.0} for _ in range(3))
    for body in reversed(bodies):
        name, parent = body.name, body.parent
        lever, away = (float(np.linalg.norm(np.asarray(each))) for each in (body.center, body.joint.position))
        mass[name] += float(body.mass)
        first[name] += float(body.mass) * lever
        second[name] += float(moments[name][0].max()) + float(body.mass) * lever**2
        mass[parent] += mass[name]
        first[parent] += first[name] + away * mass[name]
        second[parent] += second[name] + 2.0 * away * first[name] + away**2 * mass[name]
    return mass, second


def _turning(bodies: Sequence[Body]) -> dict[str, tuple[Array | None, str]]:
    """Axis that each body always turns about, None for several, and the nearest body that a joint turns.

    The axis is in the body's axes; it is zero, and there is no such body, where no joint on the way turns.
    """
    result: dict[str, tuple[Array | None, str]] = {WORLD: (np.zeros(3), "")}
    for body in bodies:
        spin, nearest = result[body.parent]
        spin = None if spin is None else np.asarray(body.joint.orientation).T @ spin
        if body.joint.type.turns:
            axis = np.asarray(body.joint.axis)
            alone = (
                body.joint.type.has_axis and spin is not None and float(np.linalg.norm(np.cross(spin, axis))) <= SNAP
            )
            spin, nearest = axis if alone else None, body.name
        result[body.name] = spin, nearest
    return result
