"""Rotation: a free body about its middle axis, and the heavy top, in Euler angles away from their singularity."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, conserved, conserved_states, energy_criterion

INERTIA = (1.0, 2.0, 3.0)  # kg m^2, principal
OMEGA = (0.001, 1.0, 0.002)  # rad/s in the body's axes: about the middle axis, and a little aside
HEAVY = (0.05, 0.05, 0.02)  # kg m^2, of the top about its tip
PULL = 1.0  # N m, m g l of the top


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


def euler_equations(growth: float) -> StabilityCase:
    """Euler's equations alone: angular velocity in the body's axes."""

    def rate(w: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        i = INERTIA
        return [
            ((i[1] - i[2]) / i[0]) * (w[1] * w[2]),
            ((i[2] - i[0]) / i[1]) * (w[2] * w[0]),
            ((i[0] - i[1]) / i[2]) * (w[0] * w[1]),
        ]

    return StabilityCase(
        name="free body about its middle axis, Euler's equations",
        about="long rests next to an unstable rotation, and sudden flips",
        model=OdeSystem(rate, ["w1", "w2", "w3"]),
        q=OMEGA,
        qd=(),
        t_end=100.0,
        criteria=(
            Criterion("energy", SLACK * RTOL, "no torque does work", 1.0),
            Criterion("momentum", SLACK * RTOL, "no torque", 4.0),
        ),
        size=(1.0, 1.0, 1.0),
        growth=growth,
        invariants=conserved_states(
            energy=lambda w: 0.5 * (INERTIA[0] * w[0] ** 2 + INERTIA[1] * w[1] ** 2 + INERTIA[2] * w[2] ** 2),
            momentum=_total,
        ),
    )


def middle_axis(growth: float) -> StabilityCase:
    """Motion of the middle axis as a Lagrangian system of three Euler angles."""
    start = _start(INERTIA, OMEGA)
    return StabilityCase(
        name="free body about its middle axis, Euler angles",
        about="the same flips, with a mass matrix that depends on the angles",
        model=rotor(INERTIA, 0.0),
        q=start[:3],
        qd=start[3:],
        t_end=100.0,
        criteria=(energy_criterion(1.0), Criterion("momentum", SLACK * RTOL, "no torque", 4.0)),
        size=(100.0, 1.0, 10.0, 1.0, 1.0, 1.0),
        growth=growth,
        invariants=conserved(momentum=lambda q, qd: _total(spin(q, qd))),
    )


def heavy_top(growth: float) -> StabilityCase:
    """Lagrange's top, fast, let go without precession: its axis nods with cusps."""

    def precession(q: Sequence[cg.Node], qd: Sequence[cg.Node]) -> cg.Node:
        x, y, z = (moment * omega for moment, omega in zip(HEAVY, spin(q, qd), strict=True))
        return cg.sin(q[1]) * (x * cg.sin(q[2]) + y * cg.cos(q[2])) + z * cg.cos(q[1])

    return StabilityCase(
        name="heavy top",
        about="a fast spin and a slow nod; three integrals of the motion",
        model=rotor(HEAVY, PULL),
        q=(0.0, 0.5, 0.0),
        qd=(0.0, 0.0, 50.0),
        t_end=10.0,
        size=(10.0, 0.5, 500.0, 2.0, 1.0, 50.0),
        criteria=(
            energy_criterion(PULL),
            Criterion("spin momentum", SLACK * RTOL, "the top is symmetric", 1.0),
            Criterion("vertical momentum", SLACK * RTOL, "gravity has no moment about the vertical", 1.0),
        ),
        growth=growth,
        invariants=conserved(
            **{"spin momentum": lambda q, qd: HEAVY[2] * spin(q, qd)[2], "vertical momentum": precession}
        ),
    )


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    return [euler_equations(1.0), middle_axis(18.0), heavy_top(110.0)]
