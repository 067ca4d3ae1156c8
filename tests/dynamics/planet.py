"""Two systems that integrators are tried on: a planet, whose motion is known, and a pendulum on a cart."""

import math
from functools import cache

import cgraph as cg
from dynamics import System

ECCENTRICITY = 0.3
PERIHELION = ([1.0 - ECCENTRICITY, 0.0], [0.0, math.sqrt((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY))])


@cache
def planet() -> System:
    return System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.sqrt(q[0] ** 2 + q[1] ** 2), ["x", "y"])


def position(t: float) -> list[float]:
    """Of the planet with period 2 pi, by Kepler's equation E - e sin E = t."""
    anomaly = t
    for _ in range(50):
        anomaly -= (anomaly - ECCENTRICITY * math.sin(anomaly) - t) / (1.0 - ECCENTRICITY * math.cos(anomaly))
    return [math.cos(anomaly) - ECCENTRICITY, math.sqrt(1.0 - ECCENTRICITY**2) * math.sin(anomaly)]


@cache
def cart() -> System:
    """A pendulum on a cart with friction between them: a mass matrix of q, and a force of the velocities."""
    return System(
        lambda q, qd, t: (
            qd[0] ** 2
            + 0.5 * (qd[0] + qd[1] * cg.cos(q[1])) ** 2
            + 0.5 * (qd[1] * cg.sin(q[1])) ** 2
            + 9.81 * cg.cos(q[1])
        ),
        ["cart", "angle"],
        damping=[0.1, 0.05],
    )
