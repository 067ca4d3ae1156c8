"""Limits of joints, as numbers: of position, velocity and effort. Nothing holds a motion to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from cgraph.extend import Array, real_array

Pair = tuple[float, float]
ANYTHING: Pair = (-math.inf, math.inf)


@dataclass(frozen=True)
class Limits:
    """Limits of one coordinate, as numbers for whoever asks: bounds of an optimization, ends of a slider.

    Nothing in the equations changes with them: a spring that holds a joint is a `JointLimit`, a motor that saturates an
    `Actuator`.

    Parameters
    ----------
    position : pair of floats
        Lower and upper end [rad or m]; infinite where there is none, as in the next two.
    velocity : pair of floats
        [rad/s or m/s]
    effort : pair of floats
        Of the force or torque that acts along the joint [N or N m].

    Raises
    ------
    TypeError, ValueError
        For what are no numbers, NaN, and a lower end above the upper.

    Examples
    --------
    >>> import dynamics as dyn
    >>> elbow = dyn.Joint("revolute", (0.0, 1.0, 0.0), limits=dyn.Limits((-0.5, 2.0), velocity=(-3.0, 3.0)))
    >>> arm = dyn.Mechanism([dyn.Body("elbow", elbow, mass=1.0, center=(0.0, 0.0, -0.5))])
    >>> arm.limits["elbow"]
    Limits(position=(-0.5, 2.0), velocity=(-3.0, 3.0), effort=(-inf, inf))
    """

    position: Pair = ANYTHING
    velocity: Pair = ANYTHING
    effort: Pair = ANYTHING

    def __post_init__(self) -> None:
        for each in fields(self):
            given = getattr(self, each.name)
            ends = real_array(f"limits: {each.name}", given)
            if ends.shape != (2,) or not ends[0] <= ends[1]:
                raise ValueError(f"limits: {each.name} must be (lower, upper), got {given!r:.60}")
            object.__setattr__(self, each.name, (float(ends[0]), float(ends[1])))


NO_LIMITS = Limits()


def beyond_limits(
    limits: Mapping[str, Limits], t: Array, columns: Mapping[str, Mapping[str, Array]], units: Mapping[str, str]
) -> list[str]:
    """A sentence on every limit that a motion has left in one of its rows: where first, and how far it went.

    t: (T,) [s].  columns: {"position" or "velocity": {coordinate: (T,)}}.  units: {coordinate: of its position}.
    """
    return [
        sentence
        for what, values in columns.items()
        for name, column in values.items()
        for sentence in _beyond(
            f"{what} of {name}", getattr(limits[name], what), t, column, units[name] + "/s" * (what == "velocity")
        )
    ]


def _beyond(what: str, ends: Pair, t: Array, values: Array, unit: str) -> list[str]:
    over = np.nan_to_num(np.maximum(ends[0] - values, values - ends[1]), nan=-math.inf)
    if not (over > 0.0).any():
        return []
    first, most = int(np.argmax(over > 0.0)), int(np.argmax(over))
    left = f"{what} leaves {ends[0]:.6g} to {ends[1]:.6g} {unit} at {t[first]:.4g} s"
    return [f"{left}, and is {values[most]:.6g} {unit} at {t[most]:.4g} s"]
