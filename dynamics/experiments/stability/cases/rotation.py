"""Rotation: Kepler's orbits of large eccentricity, a free body about its middle axis, and the heavy top.

Euler angles stay away from their singularity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, case, conserved, energy_criterion

INERTIA = (1.0, 2.0, 3.0)  # kg m^2, principal
OMEGA = (0.001, 1.0, 0.002)  # rad/s in the body's axes: about the middle axis, and a little aside
HEAVY = (0.05, 0.05, 0.02)  # kg m^2, of the top about its tip
PULL = 1.0  # N m, m g l of the top


def kepler(eccentricity: float, orbits: float, growth: float) -> StabilityCase:
    """A unit mass about a unit centre, semi-major axis 1 m, from the pericentre."""
    name, momentum = f"Kepler, e = {eccentricity:g}", math.sqrt(1.0 - eccentricity**2)
    about = f"{orbits:g} orbits with a close passage each: the step must change by (1 - e)^1.5"
    model = System(lambda q, qd, t: [0.5 * (qd[0] ** 2 + qd[1] ** 2), 1.0 / cg.hypot(q[0], q[1])], ["x", "y"])
    start = (1.0 - eccentricity, 0.0, 0.0, math.sqrt((1.0 + eccentricity) / (1.0 - eccentricity)))
    kept = energy_criterion(0.5), Criterion("angular momentum", SLACK * RTOL, "the force is central", momentum)
    more = {"size": (2.0, 1.0, 1.0, 1.0), "growth": growth}
    more["invariants"] = conserved(**{"angular momentum": lambda q, qd: q[0] * qd[1] - q[1] * qd[0]})
    return case(name, about, model, start, 2.0 * math.pi * orbits, *kept, **more)


def spin(q: Sequence[cg.Node], qd: Sequence[cg.Node]) -> tuple[cg.Node, cg.Node, cg.Node]:
    """Angular velocity in the body's axes, of Euler angles (precession, tilt, spin) about z, x', z''."""
    sine, cosine, tilt = cg.sin(q[2]), cg.cos(q[2]), cg.sin(q[1])
    return (
        qd[0] * tilt * sine + qd[1] * cosine,
        qd[0] * tilt * cosine - qd[1] * sine,
        qd[0] * cg.cos(q[1]) + qd[2],
    )


def rotor(inertia: Sequence[float], pull: float) -> System:
    """A body with a fixed point. pull: weight times the distance of the centre of mass, along the third axis [N m]."""

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        parts = [0.5 * (moment * omega**2) for moment, omega in zip(inertia, spin(q, qd), strict=True)]
        return [*parts, -pull * cg.cos(q[1])] if pull else parts

    return System(lagrangian, ["precession", "tilt", "spin"])


def _start(inertia: Sequence[float], omega: Sequence[float]) -> tuple[float, ...]:
    """Euler angles and their rates with the angular momentum along z, where the tilt of a free body stays off 0 and pi.

    The tilt is the angle between the angular momentum and the third axis, and the body never turns about that.
    """
    x, y, z = (a * b for a, b in zip(inertia, omega, strict=True))
    tilt, angle = math.atan2(math.hypot(x, y), z), math.atan2(x, y)
    across = omega[0] * math.sin(angle) + omega[1] * math.cos(angle)
    precession = across / math.sin(tilt)
    tilting = omega[0] * math.cos(angle) - omega[1] * math.sin(angle)
    return 0.0, tilt, angle, precession, tilting, omega[2] - precession * math.cos(tilt)


def _total(w: Sequence[cg.Node]) -> cg.Node:
    """The square of the angular momentum of the free body at an angular velocity."""
    x, y, z = ((moment * omega) ** 2 for moment, omega in zip(INERTIA, w, strict=True))
    return x + y + z


def euler_equations() -> StabilityCase:
    """Euler's equations alone: angular velocity in the body's axes."""

    def rate(w: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        i = INERTIA
        return [
            ((i[1] - i[2]) / i[0]) * (w[1] * w[2]),
            ((i[2] - i[0]) / i[1]) * (w[2] * w[0]),
            ((i[0] - i[1]) / i[2]) * (w[0] * w[1]),
        ]

    name = "free body about its middle axis, Euler's equations"
    about = "long rests next to an unstable rotation, and sudden flips"
    kept = energy_criterion(1.0, "no torque does work"), Criterion("momentum", SLACK * RTOL, "no torque", 4.0)
    invariants = conserved(
        energy=lambda w: 0.5 * (INERTIA[0] * w[0] ** 2 + INERTIA[1] * w[1] ** 2 + INERTIA[2] * w[2] ** 2),
        momentum=_total,
    )
    more = {"size": (1.0, 1.0, 1.0), "growth": 1.0, "invariants": invariants}
    return case(name, about, OdeSystem(rate, ["w1", "w2", "w3"]), OMEGA, 100.0, *kept, **more)


def middle_axis() -> StabilityCase:
    """Motion of the middle axis as a Lagrangian system of three Euler angles."""
    name = "free body about its middle axis, Euler angles"
    about = "the same flips, with a mass matrix that depends on the angles"
    kept = energy_criterion(1.0), Criterion("momentum", SLACK * RTOL, "no torque", 4.0)
    invariants = conserved(momentum=lambda q, qd: _total(spin(q, qd)))
    more = {"size": (100.0, 1.0, 10.0, 1.0, 1.0, 1.0), "growth": 18.0, "invariants": invariants}
    return case(name, about, rotor(INERTIA, 0.0), _start(INERTIA, OMEGA), 100.0, *kept, **more)


def heavy_top() -> StabilityCase:
    """Lagrange's top, fast, let go without precession: its axis nods with cusps."""

    def precession(q: Sequence[cg.Node], qd: Sequence[cg.Node]) -> cg.Node:
        x, y, z = (moment * omega for moment, omega in zip(HEAVY, spin(q, qd), strict=True))
        return cg.sin(q[1]) * (x * cg.sin(q[2]) + y * cg.cos(q[2])) + z * cg.cos(q[1])

    name, about = "heavy top", "a fast spin and a slow nod; three integrals of the motion"
    start, size = (0.0, 0.5, 0.0, 0.0, 0.0, 50.0), (10.0, 0.5, 500.0, 2.0, 1.0, 50.0)
    kept = (
        energy_criterion(PULL),
        Criterion("spin momentum", SLACK * RTOL, "the top is symmetric"),
        Criterion("vertical momentum", SLACK * RTOL, "gravity has no moment about the vertical"),
    )
    others = {"spin momentum": lambda q, qd: HEAVY[2] * spin(q, qd)[2], "vertical momentum": precession}
    more = {"size": size, "growth": 110.0, "invariants": conserved(**others)}
    return case(name, about, rotor(HEAVY, PULL), start, 10.0, *kept, **more)


def cases() -> list[StabilityCase]:
    """The rows of this file. Orbits end near the apocentre, where the phase matters least."""
    orbits = [kepler(0.9, 100.5, 1.0e4), kepler(0.99, 100.5, 9.5e4), kepler(0.999, 20.5, 1.9e5)]
    return [*orbits, euler_equations(), middle_axis(), heavy_top()]
