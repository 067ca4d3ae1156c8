"""Lagrangians that are not K(qd) - P(q): fields, relativity, explicit time, growing mass."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, energy_criterion, error_criterion

GRAVITY = 9.81  # m/s^2


def charged_particle(growth: float) -> StabilityCase:
    """A charge in a uniform magnetic field: terms linear in the velocity, which do no work."""
    frequency, start = 10.0, (0.0, 0.0, 1.0, 0.5)

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [0.5 * (qd[0] ** 2 + qd[1] ** 2), 0.5 * frequency * (q[0] * qd[1] - q[1] * qd[0])]

    return StabilityCase(
        name="charge in a magnetic field",
        about="a force across the velocity, from terms linear in it: a thousand radians of circles",
        model=System(lagrangian, ["x", "y"]),
        q=start[:2],
        qd=start[2:],
        t_end=100.0,
        criteria=(energy_criterion(0.625, "a magnetic field does no work"),),
        size=(0.1, 0.1, 1.0, 1.0),
        growth=growth,
    )


def relativistic_oscillator(growth: float) -> StabilityCase:
    """L = -sqrt(1 - v^2) - x^2/2 with m = c = k = 1, from rest where the energy is ten times the rest energy."""
    return StabilityCase(
        name="relativistic oscillator",
        about="a kinetic energy that is not quadratic, and speeds up to 0.995 c",
        model=System(lambda q, qd, t: [-cg.sqrt(1.0 - qd[0] ** 2), -0.5 * q[0] ** 2], ["x"]),
        q=(math.sqrt(18.0),),
        qd=(0.0,),
        t_end=100.0,
        criteria=(
            Criterion("energy", 1e2 * SLACK * RTOL, "near c an error of the speed counts by the cube of gamma", 10.0),
        ),
        growth=growth,
    )


def driven_pendulum(growth: float) -> StabilityCase:
    """Kapitza's pendulum, 1 m: its pivot shakes up and down 5 cm at 150 rad/s, which holds it upright."""
    height, frequency = 0.05, 150.0

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        pivot = -height * frequency * cg.sin(frequency * t)
        return [0.5 * qd[0] ** 2 + qd[0] * pivot * cg.sin(q[0]), GRAVITY * cg.cos(q[0])]

    return StabilityCase(
        name="Kapitza's pendulum",
        about="explicit time, a fast drive, and a slow motion that exists by it alone",
        model=System(lagrangian, ["angle"]),
        q=(3.0,),
        qd=(0.0,),
        t_end=10.0,
        growth=growth,
    )


def growing_mass(growth: float) -> StabilityCase:
    """Caldirola and Kanai's Lagrangian, L = e^(c t) (qd^2 - k q^2) / 2: a damped oscillator without damping."""
    damping, stiffness = 0.5, 4.0
    return StabilityCase(
        name="damping by a growing mass",
        about="explicit time in every term; the mass grows to e^20 while the motion dies out",
        model=System(lambda q, qd, t: cg.exp(damping * t) * (0.5 * qd[0] ** 2 - 0.5 * stiffness * q[0] ** 2), ["x"]),
        q=(1.0,),
        qd=(0.0,),
        t_end=40.0,
        criteria=(error_criterion(growth, "the motion dies out, and its errors with it"),),
        size=(1.0, 2.0),
        growth=growth,
    )


def exponential(name: str, rate: float, size: float, why: str) -> StabilityCase:
    """xdot = rate x over fifty time constants."""
    return StabilityCase(
        name=name,
        about="fifty time constants: the result is of another size than the start",
        model=OdeSystem(lambda x, t: [rate * x[0]], ["x"]),
        q=(1.0,),
        qd=(),
        t_end=50.0,
        criteria=(Criterion("error", SLACK * RTOL, why),),
        size=(size,),
        growth=1.0,
    )


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    return [
        charged_particle(1.0),
        relativistic_oscillator(21.0),
        driven_pendulum(7.4),
        growing_mass(3.5e-5),
        exponential("exponential growth", 1.0, math.exp(50.0), "relative errors add up"),
        exponential("exponential decay", -1.0, 1.0, "errors die out; the size is that of the start"),
    ]
