"""Extremes of a pendulum's state: upright, angles up to 10^15 rad, velocities from the smallest number to 10^8."""

import math

import cgraph as cg

from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, case, energy_criterion

STIFFNESS = 9.81  # 1/s^2, gravity over length
TINY = 5e-324  # the smallest positive float64
UNIT = 2.0**-53


def simple_pendulum(stiffness: float = STIFFNESS) -> System:
    """qdd = -stiffness sin(q)."""
    return System(lambda q, qd, t: [0.5 * qd[0] ** 2, stiffness * cg.cos(q[0])], ["angle"])


def upright(angle: float, name: str, t_end: float, growth: float) -> StabilityCase:
    """Let go at rest, at or next to the upright."""
    about = "an unstable equilibrium: what is there at the start grows by e^(3.13 t)"
    size, kept = (math.pi, math.sqrt(STIFFNESS)), energy_criterion(2.0 * STIFFNESS)
    return case(name, about, simple_pendulum(), (angle, 0.0), t_end, kept, size=size, growth=growth)


def large_angle(angle: float) -> StabilityCase:
    """A pendulum that has turned many times already."""
    name, ulp = f"angle of {angle:g} rad", math.ulp(angle)
    about = f"the angle itself can be told to {ulp:.2g} rad only; sine and cosine must reduce it exactly"
    why = (
        "a rounding of the angle is a change of the potential"
        if ulp < 1e-3
        else "an ulp of the angle is 0.1 rad: nothing can be followed, but nothing may run away either"
    )
    error = Criterion("error 0", SLACK * max(UNIT, RTOL / angle), "the angle relative to its own size")
    kept = Criterion("energy", max(SLACK * RTOL, 100.0 * ulp), why, 2.0 * STIFFNESS)
    size = (angle, math.sqrt(STIFFNESS))
    return case(name, about, simple_pendulum(), (angle, 0.0), 10.0, error, kept, size=size)


def spinning(velocity: float, growth: float) -> StabilityCase:
    """A pendulum at a high speed, for a thousand radians."""
    name, about = f"velocity of {velocity:g} rad/s", "gravity is a small change of a large speed"
    start, t_end, size, kept = (0.5, velocity), 1e3 / velocity, (1e3, velocity), energy_criterion(0.5 * velocity**2)
    return case(name, about, simple_pendulum(), start, t_end, kept, size=size, growth=growth)


def creeping() -> StabilityCase:
    """The smallest velocity there is, without a force: the angle must neither jump nor be lost."""
    about = "products of the velocity vanish; the motion must still be uniform"
    exact, size = Criterion("error 1", 0.0, "no force acts: the velocity is exactly the start's"), (1024.0 * TINY, TINY)
    model, start = simple_pendulum(0.0), (0.0, TINY)
    return case("smallest velocity", about, model, start, 1024.0, exact, size=size, growth=1.0)


def hanging() -> StabilityCase:
    """The smallest velocity at the lower equilibrium."""
    about = "numbers that underflow everywhere must not become NaN or grow"
    error = Criterion("error", RTOL, "nothing moves that can be told from rest; sizes are 1 rad and 1 rad/s")
    name, start, size = "smallest velocity, hanging", (0.0, TINY), (1.0, 1.0)
    return case(name, about, simple_pendulum(), start, 10.0, error, size=size, growth=1.0)


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    return [
        upright(math.pi, "at the upright", 3.0, 1.9e4),
        upright(math.pi - 1e-8, "next to the upright", 10.0, 2.5e4),
        large_angle(1e8),
        large_angle(1e15),
        spinning(1e4, 1.0),
        spinning(1e8, 1.0),
        creeping(),
        hanging(),
    ]
