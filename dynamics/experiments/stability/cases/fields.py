"""Lagrangians that are not K(qd) - P(q): fields, relativity, explicit time, growing mass."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, case, energy_criterion, error_criterion

GRAVITY = 9.81  # m/s^2


def charged_particle() -> StabilityCase:
    """A charge in a uniform magnetic field: terms linear in the velocity, which do no work."""
    frequency = 10.0

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [0.5 * (qd[0] ** 2 + qd[1] ** 2), 0.5 * frequency * (q[0] * qd[1] - q[1] * qd[0])]

    name = "charge in a magnetic field"
    about = "a force across the velocity, from terms linear in it: a thousand radians of circles"
    model, start, size = System(lagrangian, ["x", "y"]), (0.0, 0.0, 1.0, 0.5), (0.1, 0.1, 1.0, 1.0)
    kept = energy_criterion(0.625, "a magnetic field does no work")
    return case(name, about, model, start, 100.0, kept, size=size, growth=1.0)


def relativistic_oscillator() -> StabilityCase:
    """L = -sqrt(1 - v^2) - x^2/2 with m = c = k = 1, from rest where the energy is ten times the rest energy."""
    name, about = "relativistic oscillator", "a kinetic energy that is not quadratic, and speeds up to 0.995 c"
    model = System(lambda q, qd, t: [-cg.sqrt(1.0 - qd[0] ** 2), -0.5 * q[0] ** 2], ["x"])
    kept = Criterion("energy", 1e2 * SLACK * RTOL, "near c an error of the speed counts by the cube of gamma", 10.0)
    return case(name, about, model, (math.sqrt(18.0), 0.0), 100.0, kept, growth=21.0)


def driven_pendulum() -> StabilityCase:
    """Kapitza's pendulum, 1 m: its pivot shakes up and down 5 cm at 150 rad/s, which holds it upright."""
    height, frequency = 0.05, 150.0

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        pivot = -height * frequency * cg.sin(frequency * t)
        return [0.5 * qd[0] ** 2 + qd[0] * pivot * cg.sin(q[0]), GRAVITY * cg.cos(q[0])]

    name, about = "Kapitza's pendulum", "explicit time, a fast drive, and a slow motion that exists by it alone"
    return case(name, about, System(lagrangian, ["angle"]), (3.0, 0.0), 10.0, growth=7.4)


def growing_mass() -> StabilityCase:
    """Caldirola and Kanai's Lagrangian, L = e^(c t) (qd^2 - k q^2) / 2: a damped oscillator without damping."""
    damping, stiffness, growth = 0.5, 4.0, 3.5e-5
    name = "damping by a growing mass"
    about = "explicit time in every term; the mass grows to e^20 while the motion dies out"
    model = System(lambda q, qd, t: cg.exp(damping * t) * (0.5 * qd[0] ** 2 - 0.5 * stiffness * q[0] ** 2), ["x"])
    error = error_criterion(growth, "the motion dies out, and its errors with it")
    return case(name, about, model, (1.0, 0.0), 40.0, error, size=(1.0, 2.0), growth=growth)


def exponential(name: str, rate: float, size: float, why: str) -> StabilityCase:
    """xdot = rate x over fifty time constants."""
    about = "fifty time constants: the result is of another size than the start"
    model, error = OdeSystem(lambda x, t: [rate * x[0]], ["x"]), error_criterion(1.0, why)
    return case(name, about, model, (1.0,), 50.0, error, size=(size,), growth=1.0)


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    return [
        charged_particle(),
        relativistic_oscillator(),
        driven_pendulum(),
        growing_mass(),
        exponential("exponential growth", 1.0, math.exp(50.0), "relative errors add up"),
        exponential("exponential decay", -1.0, 1.0, "errors die out; the size is that of the start"),
    ]
