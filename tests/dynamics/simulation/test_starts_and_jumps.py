"""Runs with default arguments start from rest at 0 and pass jumps of a force in time, in any unit."""

import math
from typing import Any

import numpy as np
from pytest import mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.step_options import ADAPTIVE
from tests.slow import slow

UNITS = [(1.0, 1.0), *slow(((2.0**20, 2.0**-20),), ((2.0**-20, 2.0**20),))]  # of length and time
SMOOTH, JUMPS = 1e-8, 1e-6  # relative: ten times rtol, and a thousand times where the force jumps
Push = Any


def pushed(push: Push, length: float = 1.0, second: float = 1.0) -> dyn.System:
    """Two masses: the first pushed, the second by where the first is, so that both begin at 0."""

    def forces(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [length / second**2.0 * push(t / second), q[0] / second**2.0]

    return dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2.0 + qd[1] ** 2.0), ["a", "b"], forces=forces)


def places(power: int, t: float) -> list[float]:
    """Where both are after a push of t^power from 0 on."""
    return [math.factorial(power) / math.factorial(power + k) * t ** (power + k) for k in (2, 4)]


@mark.parametrize("units", UNITS)
@mark.parametrize("power", [1, *slow(2, 3, 4)])
@mark.parametrize("method", ADAPTIVE)
def test_a_force_that_grows_from_0_moves_what_rests_at_0(method: str, power: int, units: tuple[float, float]) -> None:
    model = pushed(lambda t: t ** float(power), *units)
    for form in ("velocity", "momentum"):
        run = dyn.simulate(model, [0.0, 0.0], [0.0, 0.0], 2.0 * units[1], method, form=form, max_steps=3000)
        assert run.success, run.stats.message
        np.testing.assert_allclose(run.q[-1] / units[0], places(power, 2.0), rtol=SMOOTH)


@mark.parametrize("units", UNITS)
@mark.parametrize("power", [0, 1])
@mark.parametrize("method", ADAPTIVE)
def test_jumps_and_kinks_in_time_are_passed(method: str, power: int, units: tuple[float, float]) -> None:
    """A push, and where it jumps its end, of a system that rests till then and gives no sign of it."""

    def push(t: cg.Node) -> cg.Node:
        return cg.maximum(t - 1.0, 0.0) if power else cg.where(t > 1.0, 1.0, 0.0) - cg.where(t > 1.2, 1.0, 0.0)

    run = dyn.simulate(pushed(push, *units), [0.0, 0.0], [0.0, 0.0], 3.0 * units[1], method, max_steps=3000)
    assert run.success, run.stats.message
    end = np.array(places(power, 2.0)) - (0.0 if power else np.array(places(power, 1.8)))
    np.testing.assert_allclose(run.q[-1] / units[0], end, rtol=JUMPS)


@mark.parametrize("before", [-1.0, *slow(0.0, 0.5, 0.9, 3.0)])
@mark.parametrize("span", [1.0, *slow(-1.0, 1e-2, 1e5)])
@mark.parametrize("t0", [1.0, *slow(0.0, -3.0)])
@mark.parametrize("method", ADAPTIVE)
def test_a_force_that_jumps_as_the_run_starts_is_passed(method: str, t0: float, span: float, before: float) -> None:
    """As a square wave does: one value at t0 itself, another right after."""

    def push(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [cg.where((t - t0) * span > 0.0, 1.0, before) / span**2.0]

    model = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2.0, ["x"], forces=push)
    run = dyn.simulate(model, [0.0], [0.0], t0 + span, method, t0=t0, max_steps=3000)
    assert run.success, run.stats.message
    np.testing.assert_allclose(run.q[-1], 0.5, rtol=JUMPS)


@mark.parametrize("n", [6, *slow(20)])
@mark.parametrize("method", ADAPTIVE)
def test_a_chain_of_decays_begins_in_one_component(method: str, n: int) -> None:
    def rate(x: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [-x[0], *[x[k - 1] - x[k] for k in range(1, n)]]

    model = dyn.OdeSystem(rate, [f"x{k}" for k in range(n)])
    run = dyn.simulate(model, [1.0, *[0.0] * (n - 1)], None, 5.0, method, max_steps=8000)
    assert run.success, run.stats.message
    exact = [5.0**k / math.factorial(k) * math.exp(-5.0) for k in range(n)]
    np.testing.assert_allclose(run.q[-1], exact, rtol=SMOOTH)
