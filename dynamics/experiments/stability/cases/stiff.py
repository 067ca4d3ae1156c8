"""Stiff cases: a spring pendulum up to k = 10^12, Van der Pol, Robertson, Prothero and Robinson."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import ATOL, Criterion, StabilityCase, case, conserved, energy_criterion, error_criterion

GRAVITY = 9.81  # m/s^2
RATIO = 10.0  # of damping to the critical one
STIFF: dict[str, Any] = {"stiff": True, "series": False}  # a series would take more than minutes


def spring_pendulum(stiffness: float, damping: float) -> System:
    """1 kg on a spring of rest length 1 m; q = (extension [m], angle [rad]). Damping [N s/m] along the spring."""

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        length = 1.0 + q[0]
        return [
            0.5 * (qd[0] ** 2 + (length * qd[1]) ** 2),
            GRAVITY * length * cg.cos(q[1]) - 0.5 * stiffness * q[0] ** 2,
        ]

    return System(lagrangian, ["extension", "angle"], damping=[damping, 0.0])


def _undamped(stiffness: float, growth: float | None) -> StabilityCase:
    angle, stretch = 1.0, GRAVITY / stiffness
    name = f"spring pendulum, k = {stiffness:g}"
    about = "a fast oscillation that nothing damps, hardly excited by the start"
    start = (GRAVITY * math.cos(angle) / stiffness, angle, 0.0, 0.0)
    size = (stretch, 1.0, math.sqrt(stiffness) * stretch, math.sqrt(GRAVITY))
    criteria = [energy_criterion(GRAVITY)]
    if growth is None:  # too many oscillations to follow; their mean is known
        why = "the rigid pendulum is the limit: its distance is of the order of the extension, m g / k"
        criteria.append(Criterion("error 1 3", 100.0 * GRAVITY / stiffness + 1e-6, why))
    more = {"stiff": stiffness > 1e6, "size": size, "growth": growth, "series": growth is not None}
    return case(name, about, spring_pendulum(stiffness, 0.0), start, 10.0, *criteria, **more)


def _damped(stiffness: float, growth: float) -> StabilityCase:
    angle, stretch = 1.0, GRAVITY / stiffness
    size = (stretch, 1.0, stretch * math.sqrt(GRAVITY), math.sqrt(GRAVITY))
    name = f"damped spring pendulum, k = {stiffness:g}"
    about = "a fast motion that dies out at once: stiff in the sense of implicit methods"
    model, start = spring_pendulum(stiffness, 2.0 * RATIO * math.sqrt(stiffness)), (2.0 * stretch, angle, 0.0, 0.0)
    error = error_criterion(growth, "the flow's growth: the fast error dies out")
    atol = tuple([ATOL * each for each in size])  # the extension may be as small as ATOL itself
    return case(name, about, model, start, 10.0, error, size=size, growth=growth, atol=atol, **STIFF)


def van_der_pol(mu: float, growth: float) -> StabilityCase:
    """y'' = mu^2 ((1 - y^2) y' - y), time in units of mu (Hairer and Wanner, "Solving ODEs II", section IV.1)."""

    def rate(x: Sequence[cg.Node], t: cg.Node, p: Mapping[str, cg.Node]) -> list[cg.Node]:
        return [x[1], p["mu"] * p["mu"] * ((1.0 - x[0] * x[0]) * x[1] - x[0])]

    name, about = f"Van der Pol, mu = {mu:g}", "slow arcs and jumps of width mu^-2, in the scaled time of the test set"
    model, start, size = OdeSystem(rate, ["y", "z"], {"mu": mu}), (2.0, 0.0), (2.0, 1.0)
    error = error_criterion(growth, "the flow's growth: errors across a slow arc die out, along it they stay")
    return case(name, about, model, start, 2.0, error, size=size, growth=growth, **STIFF)


def robertson() -> StabilityCase:
    """The reaction of Robertson (1966), to t = 10^11 as in the Test Set for IVP Solvers."""

    def rate(x: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [
            -0.04 * x[0] + 1e4 * x[1] * x[2],
            0.04 * x[0] - 1e4 * x[1] * x[2] - 3e7 * x[1] * x[1],
            3e7 * x[1] * x[1],
        ]

    about = "rates from 0.04 to 3e7 over sixteen decades of time; a negative concentration runs away"
    model, start, size = OdeSystem(rate, ["a", "b", "c"]), (1.0, 0.0, 0.0), (2e-8, 8e-14, 1.0)
    criteria = (
        error_criterion(2.1, "errors die out; sizes are those at the end, 2e-8, 8e-14 and 1"),
        Criterion("mass", 1e-12, "a + b + c is linear, and every Runge-Kutta method keeps it to rounding"),
    )
    more = {"size": size, "growth": 2.1, "invariants": conserved(mass=lambda x: x[0] + x[1] + x[2])}
    return case("Robertson, to 1e11", about, model, start, 1e11, *criteria, **more, **STIFF)


def prothero_robinson(rate: float) -> StabilityCase:
    """x' = -rate (x - cos t) - sin t, whose solution from 1 is cos t."""
    name, about = f"Prothero-Robinson, rate {rate:g}", "a smooth solution beside a fast decay: methods lose order here"
    model = OdeSystem(lambda x, t: [-rate * (x[0] - cg.cos(t)) - cg.sin(t)], ["x"])
    error = error_criterion(1.0, "errors die out")
    return case(name, about, model, (1.0,), 10.0, error, size=(1.0,), growth=0.0, **STIFF)


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    undamped = {1e2: 9.5, 1e4: 4.0, 1e6: 4.0, 1e8: None, 1e10: None, 1e12: None}
    damped = {1e2: 2.6, 1e4: 3.9, 1e6: 6.3, 1e8: 7.4, 1e10: 7.5, 1e12: 7.5}
    return [
        *[_undamped(k, growth) for k, growth in undamped.items()],
        *[_damped(k, growth) for k, growth in damped.items()],
        van_der_pol(1e3, 2.9),
        van_der_pol(1e6, 2.9),
        robertson(),
        prothero_robinson(1e6),
    ]
