"""Limits: the reason of every row of the stability table that is known not to meet its bound."""

from __future__ import annotations

_CLOSE = (
    "At the pericentre the energy is a difference of terms 2 / (1 - e) times as large; a step's error of 1e-9 there "
    "counts so many times, at each of the passages. A tolerance of 1e-11 meets the bound."
)
_COARSE = (
    "The angle can be told to 0.125 rad only, and increments below half of that are lost when they are added to it, so "
    "the energy wanders. A method that keeps what rounding takes off each sum (verlet, midpoint, gauss4, gauss6) meets "
    "the bound; so does an angle from which whole turns are taken."
)
_SMALL = (
    "The extension is below the absolute tolerance of 1e-12 m or not far above it, so that it may be wrong by a large "
    "part of its size. An absolute tolerance of 1e-16 meets the bound."
)
_LIGHT = (
    "Elimination from the tip to the base subtracts what the heavy or long part holds to leave the inertia of the light "
    "or short one, which rounding then takes digits from. Angles, torques and graph are right; rows that are {} apart "
    "in inertia need more than float64 in this order of elimination."
)
_LONG = (
    "Rounding errors of the links add up along a chain of 50; measured, they stay within some ten times the bound, and "
    "do not grow with the ratio."
)

# (section, case, method), where an empty case or method stands for every one: why the bound is not met.
LIMITS: dict[tuple[str, str, str], str] = {
    ("Cases", "Kepler, e = 0.99", "dop853"): _CLOSE,
    ("Cases", "Kepler, e = 0.999", "dop853"): _CLOSE,
    ("Cases", "Kepler, e = 0.999", "dopri5"): _CLOSE,
    ("Cases", "angle of 1e+15 rad", "dop853"): _COARSE,
    ("Cases", "angle of 1e+15 rad", "dopri5"): _COARSE,
    ("Cases", "damped spring pendulum, k = 1e+10", "rodas"): _SMALL,
    ("Cases", "damped spring pendulum, k = 1e+12", "rodas"): _SMALL,
    ("Single evaluations", "forward dynamics, last mass 1e12", ""): _LIGHT.format("12 decades"),
    ("Single evaluations", "forward dynamics, every other length 1e6", ""): _LIGHT.format("12 decades and more"),
    ("Single evaluations", "forward dynamics, every other length 1e-6", ""): _LONG,
    ("Single evaluations", "forward dynamics, every other mass 1e12", ""): _LONG,
    ("Single evaluations", "forward dynamics, velocities of 1e-310 rad/s", ""): _LONG,
}


def reason(section: str, case: str, method: str) -> str:
    """The known reason why a row may be beyond its bound; empty if there is none."""
    for key in ((section, case, method), (section, case, ""), (section, "", method)):
        if key in LIMITS:
            return LIMITS[key]
    return ""
