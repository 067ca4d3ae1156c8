"""Stiff cases: a spring pendulum up to k = 10^12, Van der Pol, Robertson, Prothero and Robinson."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....systems.ode_system import OdeSystem
from ....systems.system import System
from ...accuracy_task import ATOL, Criterion, StabilityCase, conserved_states, energy_criterion, error_criterion

GRAVITY = 9.81  # m/s^2
RATIO = 10.0  # of damping to the critical one


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
    angle = 1.0
    limit = 100.0 * GRAVITY / stiffness + 1e-6
    criteria = [energy_criterion(GRAVITY)]
    if growth is None:  # too many oscillations to follow; their mean is known
        why = "the rigid pendulum is the limit: its distance is of the order of the extension, m g / k"
        criteria.append(Criterion("error 1 3", limit, why))
    stretch = GRAVITY / stiffness
    return StabilityCase(
        name=f"spring pendulum, k = {stiffness:g}",
        about="a fast oscillation that nothing damps, hardly excited by the start",
        model=spring_pendulum(stiffness, 0.0),
        q=(GRAVITY * math.cos(angle) / stiffness, angle),
        qd=(0.0, 0.0),
        t_end=10.0,
        criteria=tuple(criteria),
        stiff=stiffness > 1e6,
        size=(stretch, 1.0, math.sqrt(stiffness) * stretch, math.sqrt(GRAVITY)),
        growth=growth,
        series=growth is not None,
    )


def _damped(stiffness: float, growth: float) -> StabilityCase:
    angle, stretch = 1.0, GRAVITY / stiffness
    size = (stretch, 1.0, stretch * math.sqrt(GRAVITY), math.sqrt(GRAVITY))
    damping = 2.0 * RATIO * math.sqrt(stiffness)
    return StabilityCase(
        name=f"damped spring pendulum, k = {stiffness:g}",
        about="a fast motion that dies out at once: stiff in the sense of implicit methods",
        model=spring_pendulum(stiffness, damping),
        q=(2.0 * stretch, angle),
        qd=(0.0, 0.0),
        t_end=10.0,
        criteria=(error_criterion(growth, "the flow's growth: the fast error dies out"),),
        stiff=True,
        size=size,
        atol=tuple([ATOL * each for each in size]),  # the extension may be as small as ATOL itself
        growth=growth,
        series=False,
    )


def van_der_pol(mu: float, growth: float) -> StabilityCase:
    """y'' = mu^2 ((1 - y^2) y' - y), time in units of mu (Hairer and Wanner, "Solving ODEs II", section IV.1)."""
    return StabilityCase(
        name=f"Van der Pol, mu = {mu:g}",
        about="slow arcs and jumps of width mu^-2, in the scaled time of the test set",
        model=OdeSystem(
            lambda x, t, p: [x[1], p["mu"] * p["mu"] * ((1.0 - x[0] * x[0]) * x[1] - x[0])], ["y", "z"], {"mu": mu}
        ),
        q=(2.0, 0.0),
        qd=(),
        t_end=2.0,
        criteria=(error_criterion(growth, "the flow's growth: errors across a slow arc die out, along it they stay"),),
        stiff=True,
        size=(2.0, 1.0),
        growth=growth,
        series=False,
    )


def robertson() -> StabilityCase:
    """The reaction of Robertson (1966), to t = 10^11 as in the Test Set for IVP Solvers."""
    return StabilityCase(
        name="Robertson, to 1e11",
        about="rates from 0.04 to 3e7 over sixteen decades of time; a negative concentration runs away",
        model=OdeSystem(
            lambda x, t: [
                -0.04 * x[0] + 1e4 * x[1] * x[2],
                0.04 * x[0] - 1e4 * x[1] * x[2] - 3e7 * x[1] * x[1],
                3e7 * x[1] * x[1],
            ],
            ["a", "b", "c"],
        ),
        q=(1.0, 0.0, 0.0),
        qd=(),
        t_end=1e11,
        criteria=(
            error_criterion(2.1, "errors die out; sizes are those at the end, 2e-8, 8e-14 and 1"),
            Criterion("mass", 1e-12, "a + b + c is linear, and every Runge-Kutta method keeps it to rounding"),
        ),
        stiff=True,
        size=(2e-8, 8e-14, 1.0),
        growth=2.1,
        invariants=conserved_states(mass=lambda x: x[0] + x[1] + x[2]),
        series=False,
    )


def prothero_robinson(rate: float) -> StabilityCase:
    """x' = -rate (x - cos t) - sin t, whose solution from 1 is cos t."""
    return StabilityCase(
        name=f"Prothero-Robinson, rate {rate:g}",
        about="a smooth solution beside a fast decay: methods lose order here",
        model=OdeSystem(lambda x, t: [-rate * (x[0] - cg.cos(t)) - cg.sin(t)], ["x"]),
        q=(1.0,),
        qd=(),
        t_end=10.0,
        criteria=(error_criterion(1.0, "errors die out"),),
        stiff=True,
        size=(1.0,),
        growth=0.0,
        series=False,
    )


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
