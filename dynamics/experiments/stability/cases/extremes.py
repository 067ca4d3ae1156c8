"""Extremes of a pendulum's state: upright, angles up to 10^15 rad, velocities from the smallest number to 10^8."""

import math

import cgraph as cg

from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, energy_criterion

STIFFNESS = 9.81  # 1/s^2, gravity over length
TINY = 5e-324  # the smallest positive float64
UNIT = 2.0**-53


def simple_pendulum(stiffness: float = STIFFNESS) -> System:
    """qdd = -stiffness sin(q)."""
    return System(lambda q, qd, t: [0.5 * qd[0] ** 2, stiffness * cg.cos(q[0])], ["angle"])


def upright(angle: float, name: str, t_end: float, growth: float) -> StabilityCase:
    """Let go at rest, at or next to the upright."""
    return StabilityCase(
        name=name,
        about="an unstable equilibrium: what is there at the start grows by e^(3.13 t)",
        model=simple_pendulum(),
        q=(angle,),
        qd=(0.0,),
        t_end=t_end,
        criteria=(energy_criterion(2.0 * STIFFNESS),),
        size=(math.pi, math.sqrt(STIFFNESS)),
        growth=growth,
    )


def large_angle(angle: float) -> StabilityCase:
    """A pendulum that has turned many times already."""
    ulp = math.ulp(angle)
    return StabilityCase(
        name=f"angle of {angle:g} rad",
        about=f"the angle itself can be told to {ulp:.2g} rad only; sine and cosine must reduce it exactly",
        model=simple_pendulum(),
        q=(angle,),
        qd=(0.0,),
        t_end=10.0,
        criteria=(
            Criterion("error 0", SLACK * max(UNIT, RTOL / angle), "the angle relative to its own size"),
            Criterion(
                "energy",
                max(SLACK * RTOL, 100.0 * ulp),
                "a rounding of the angle is a change of the potential"
                if ulp < 1e-3
                else "an ulp of the angle is 0.1 rad: nothing can be followed, but nothing may run away either",
                2.0 * STIFFNESS,
            ),
        ),
        size=(angle, math.sqrt(STIFFNESS)),
    )


def spinning(velocity: float, growth: float) -> StabilityCase:
    """A pendulum at a high speed, for a thousand radians."""
    return StabilityCase(
        name=f"velocity of {velocity:g} rad/s",
        about="gravity is a small change of a large speed",
        model=simple_pendulum(),
        q=(0.5,),
        qd=(velocity,),
        t_end=1e3 / velocity,
        criteria=(Criterion("energy", SLACK * RTOL, "nothing takes energy in or out", 0.5 * velocity**2),),
        size=(1e3, velocity),
        growth=growth,
    )


def creeping() -> StabilityCase:
    """The smallest velocity there is, without a force: the angle must neither jump nor be lost."""
    return StabilityCase(
        name="smallest velocity",
        about="products of the velocity vanish; the motion must still be uniform",
        model=simple_pendulum(0.0),
        q=(0.0,),
        qd=(TINY,),
        t_end=1024.0,
        criteria=(Criterion("error 1", 0.0, "no force acts: the velocity is exactly the start's"),),
        size=(1024.0 * TINY, TINY),
        growth=1.0,
    )


def hanging() -> StabilityCase:
    """The smallest velocity at the lower equilibrium."""
    return StabilityCase(
        name="smallest velocity, hanging",
        about="numbers that underflow everywhere must not become NaN or grow",
        model=simple_pendulum(),
        q=(0.0,),
        qd=(TINY,),
        t_end=10.0,
        criteria=(Criterion("error", RTOL, "nothing moves that can be told from rest; sizes are 1 rad and 1 rad/s"),),
        size=(1.0, 1.0),
        growth=1.0,
    )


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
