"""Orbits: Kepler's problem with large eccentricity over many turns."""

import math

import cgraph as cg

from ....systems.system import System
from ...accuracy_task import RTOL, SLACK, Criterion, StabilityCase, conserved, energy_criterion


def kepler(eccentricity: float, orbits: float, growth: float) -> StabilityCase:
    """A unit mass about a unit centre, semi-major axis 1 m, from the pericentre."""
    start = (1.0 - eccentricity, 0.0, 0.0, math.sqrt((1.0 + eccentricity) / (1.0 - eccentricity)))
    return StabilityCase(
        name=f"Kepler, e = {eccentricity:g}",
        about=f"{orbits:g} orbits with a close passage each: the step must change by (1 - e)^1.5",
        model=System(lambda q, qd, t: [0.5 * (qd[0] ** 2 + qd[1] ** 2), 1.0 / cg.hypot(q[0], q[1])], ["x", "y"]),
        q=start[:2],
        qd=start[2:],
        t_end=2.0 * math.pi * orbits,
        criteria=(
            energy_criterion(0.5),
            Criterion("angular momentum", SLACK * RTOL, "the force is central", math.sqrt(1.0 - eccentricity**2)),
        ),
        size=(2.0, 1.0, 1.0, 1.0),
        growth=growth,
        invariants=conserved(**{"angular momentum": lambda q, qd: q[0] * qd[1] - q[1] * qd[0]}),
    )


def cases() -> list[StabilityCase]:
    """The rows of this file. All end near the apocentre, where the phase matters least."""
    return [kepler(0.9, 100.5, 1.0e4), kepler(0.99, 100.5, 9.5e4), kepler(0.999, 20.5, 1.9e5)]
