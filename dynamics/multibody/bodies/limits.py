"""Limits of joints, as numbers: of position, velocity and effort. Nothing holds a motion to them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from cgraph._shared import real_array

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
