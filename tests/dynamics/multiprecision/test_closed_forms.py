"""Systems whose motion is known in closed form: any Lagrangian, explicit time, damping, forces, parameters."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pytest import approx

import cgraph as cg
import dynamics as dyn
from dynamics.systems.system import System
from tests.dynamics.models import Array, oscillator
from tests.each_row import each_row

Form = Callable[[Array], Array]  # of time
TRUNCATION = 1e-10  # of RK4 at dt = 1 ms over 3 s: 3 (1e-3 w)^4 / 120 for w up to 3 rad/s, and rounding beside it
SLOPE = 1e-9  # of differences of the fourth order, with steps of 1 ms
T_END = 3.0  # s
M, K, C, F, W = 2.0, 3.0, 0.7, 1.5, 2.5  # kg, N/m, N s/m, N, rad/s
W0 = math.sqrt(K / M)


def damped(t: Array) -> Array:
    rate, w = C / (2 * M), math.sqrt(K / M - (C / (2 * M)) ** 2)
    return np.exp(-rate * t) * (np.cos(w * t) + rate / w * np.sin(w * t))


def driven(t: Array) -> Array:
    return F / M / (W0**2 - W**2) * (np.cos(W * t) - np.cos(W0 * t))


def harmonic(t: Array) -> Array:
    return 0.8 * np.cos(W0 * t) + 0.5 / W0 * np.sin(W0 * t)


A, SPEED, CIRCLE = 0.3, 1.2, 2.0 / 0.8  # m, of a shaking base; m/s, of light; rad/s
FREE = System(lambda q, qd, t: 0.5 * M * qd[0] ** 2 + 0.5 * qd[1] ** 2, ["x", "y"])
SPRINGS = System(
    lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - (q[0] ** 2 + q[1] ** 2) - 0.5 * K * (q[1] - q[0]) ** 2,
    ["left", "right"],
)
TOGETHER, AGAINST = math.sqrt(2.0), math.sqrt(2.0 + 2 * K)  # rad/s, of the springs' normal modes
FORCE = {"tau": [F, 0.0]}
# {motion: (system, q, qd, options of simulate, closed forms of the coordinates, energy)}; energy None: it is not kept.
MOTIONS: dict[str, tuple[System, list[float], list[float], dict[str, Any], list[Form], float | None]] = {
    "harmonic": (oscillator(), [0.8], [0.5], {}, [harmonic], 0.5 * M * 0.5**2 + 0.5 * K * 0.8**2),
    "other parameters": (oscillator(), [1.0], [0.0], {"parameters": {"k": 8.0}}, [lambda t: np.cos(2.0 * t)], 4.0),
    "damped": (oscillator(damping=C), [1.0], [0.0], {}, [damped], None),
    "damped by a force with a parameter": (
        oscillator(forces=lambda q, qd, t, p: [-p["c"] * qd[0]], parameters={"c": C}), [1.0], [0.0], {}, [damped], None
    ),
    "driven by a force": (oscillator(forces=lambda q, qd, t: [F * cg.cos(W * t)]), [0.0], [0.0], {}, [driven], None),
    "driven by a potential with time": (
        System(lambda q, qd, t: 0.5 * M * qd[0] ** 2 - 0.5 * K * q[0] ** 2 + F * cg.cos(W * t) * q[0], ["x"]),
        [0.0], [0.0], {}, [driven], None,
    ),
    "on a shaking base: dp/dt at fixed x counts, x'' + w0^2 x = a w^2 sin(w t) for a base a sin(w t)": (
        System(lambda q, qd, t: 0.5 * M * (qd[0] + A * W * cg.cos(W * t)) ** 2 - 0.5 * K * q[0] ** 2, ["x"]),
        [0.0], [0.0], {},
        [lambda t: A * W**2 / (W0**2 - W**2) * (np.sin(W * t) - W / W0 * np.sin(W0 * t))], None,
    ),
    "a shrinking mass exp(-t): p = m v is constant, so x = v0 (exp(t) - 1)": (
        System(lambda q, qd, t: 0.5 * cg.exp(-t) * qd[0] ** 2, ["x"]), [0.0], [0.2], {}, [lambda t: 0.2 * np.expm1(t)],
        None,
    ),
    "a charge in a field, m x'' = B y', m y'' = -B x', which does no work and is no part of E": (
        System(
            lambda q, qd, t, p: (
                0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2) + 0.5 * p["B"] * (q[0] * qd[1] - q[1] * qd[0])
            ),
            ["x", "y"], {"m": 0.8, "B": 2.0},
        ),
        [0.0, 0.0], [1.5, 0.0], {},
        [lambda t: 1.5 / CIRCLE * np.sin(CIRCLE * t), lambda t: 1.5 / CIRCLE * (np.cos(CIRCLE * t) - 1.0)],
        0.5 * 0.8 * 1.5**2,
    ),
    "relativistic, p = F t, so x = m c^2 / F (sqrt(1 + (F t / m c)^2) - 1), and E = m c^2 gamma - F x": (
        System(
            lambda q, qd, t, p: -p["m"] * SPEED**2 * cg.sqrt(1.0 - qd[0] ** 2 / SPEED**2) + p["F"] * q[0],
            ["x"], {"m": M, "F": F},
        ),
        [0.0], [0.0], {},
        [lambda t: M * SPEED**2 / F * (np.sqrt(1.0 + (F * t / (M * SPEED)) ** 2) - 1.0)], M * SPEED**2,
    ),
    "coupled springs in their normal modes": (
        SPRINGS, [1.0, 0.0], [0.0, 0.0], {},
        [
            lambda t: 0.5 * (np.cos(TOGETHER * t) + np.cos(AGAINST * t)),
            lambda t: 0.5 * (np.cos(TOGETHER * t) - np.cos(AGAINST * t)),
        ],
        1.0 + 0.5 * K,
    ),
    "a constant force": (
        FREE, [0.1, 0.0], [0.2, 0.0], FORCE, [lambda t: 0.1 + 0.2 * t + 0.5 * F / M * t**2, np.zeros_like], None
    ),
    "the same force on all": (
        FREE, [0.0, 0.0], [0.0, 0.0], {"tau": F}, [lambda t: 0.5 * F / M * t**2, lambda t: 0.5 * F * t**2], None
    ),
}  # fmt: skip


@each_row("name", MOTIONS)
def test_a_motion_is_that_of_the_closed_form_and_its_velocity_the_slope_of_it(name: str) -> None:
    system, q, qd, options, closed, energy = MOTIONS[name]
    result, h = dyn.simulate(system, q, qd, T_END, "rk4", dt=1e-3, **options), 1e-3
    assert result.stats.success
    for i, form in enumerate(closed):
        assert result.q[:, i] == approx(form(result.t), rel=0.0, abs=TRUNCATION)
        near, far = ((form(result.t + k * h) - form(result.t - k * h)) / (2 * k * h) for k in (1, 2))
        assert result.qd[:, i] == approx((4 * near - far) / 3, rel=0.0, abs=SLOPE)
    if energy is not None:
        assert result.energy == approx(energy, rel=TRUNCATION)
    if name.startswith("relativistic"):
        assert result.qd[-1, 0] > 0.8 * SPEED
