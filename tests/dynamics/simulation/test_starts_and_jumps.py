"""Runs with default arguments start from rest at 0 and pass jumps of a force in time, in any unit; poles stop them."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from tests.slow import slow

ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
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
    run = dyn.simulate(model, [0.0, 0.0], [0.0, 0.0], 2.0 * units[1], method, max_steps=3000)
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


def pole(rng: np.random.Generator) -> tuple[Any, list[float], list[float] | None, float]:
    """A model that runs into a singularity before t_end, with its start."""
    strength, power = rng.uniform(0.3, 3.0), float(rng.uniform(1.2, 3.0))
    second, length = (2.0 ** rng.integers(-20, 21, 2)).tolist()
    if rng.integers(2):

        def rate(x: list[cg.Node], t: cg.Node) -> list[cg.Node]:
            return [strength * length / second * (x[0] / length) ** power, (3.0 * x[0] - x[1]) / second]

        return dyn.OdeSystem(rate, ["x", "y"]), [length, 0.0], None, 20.0 * second / strength / (power - 1.0)

    def lagrangian(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> cg.Node:
        fall = 0.5 * (qd[0] * (second / length)) ** 2.0 + strength * (q[0] / length) ** -power
        total: cg.Node = fall + 0.5 * (qd[1] * second) ** 2.0 - 0.5 * q[1] ** 2.0
        return total

    start = [length, 1.0], [float(rng.choice([0.0, 0.3])) * length / second, 0.0]
    return dyn.System(lagrangian, ["r", "y"]), *start, 10.0 * second / math.sqrt(strength)


@mark.parametrize("seed", [*range(3), *slow(*range(3, 100))])
@mark.parametrize("method", ["dop853", "radau", *slow("dopri5", "rodas", "taylor")])
def test_poles_and_collisions_still_stop(method: str, seed: int) -> None:
    model, q, qd, t_end = pole(np.random.default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dyn.SimulationWarning)
        run = dyn.simulate(model, q, qd, t_end, method, max_steps=20000)
    assert not run.success
    assert run.stats.steps < 20000
    assert run.t[-1] < t_end


def test_ensembles_momenta_and_gradients_start_from_rest() -> None:
    def forces(q: list[cg.Node], qd: list[cg.Node], t: cg.Node, p: Any) -> list[cg.Node]:
        return [p["push"] * t, q[0]]

    model = dyn.System(
        lambda q, qd, t, p: 0.5 * (qd[0] ** 2.0 + qd[1] ** 2.0), ["a", "b"], parameters={"push": 2.0}, forces=forces
    )
    rest, end = ([0.0, 0.0], [0.0, 0.0]), np.array(places(1, 2.0))
    np.testing.assert_allclose(dyn.simulate(model, *rest, 2.0, form="momentum").q[-1], 2.0 * end, rtol=SMOOTH)
    many = dyn.simulate_many(model, [rest[0]] * 2, [rest[1]] * 2, 2.0, t_eval=[2.0])
    np.testing.assert_allclose(many.q[:, -1], [2.0 * end] * 2, rtol=SMOOTH)
    slope = dyn.gradient(model, lambda q, qd, t, p: q[1], *rest, 2.0, "dop853", wrt="push")
    assert slope["push"] == pytest.approx(end[1], rel=SMOOTH)
