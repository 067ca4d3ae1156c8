"""Integrators: their orders, their errors beside the tolerance, what they conserve, and how they stop."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS, System
from dynamics.integrators.step_control import LARGEST_FACTOR
from dynamics.integrators.tableau import PARTITIONED
from tests.dynamics.planet import PERIHELION, cart, planet, position
from tests.dynamics.scipy_motion import scipy_states
from tests.dynamics.step_options import ADAPTIVE, EQUAL, EVERY_METHOD, step
from tests.early_end import stops

TIGHT = 1e-13  # relative tolerance of a run that others are measured against
MANY_TOLERANCES = 200.0  # errors of accepted steps add up, and the flow makes them grow
WASTED = 1e-4  # of a tolerance: an error below it means steps far shorter than asked for
RESOLVED = 1e-4  # of an amplitude: what steps within 1e-6 of it leave
INSIDE = 30.0  # times the error at the ends of steps: an interpolant of lower order
SAME_STEPS = 1e-13  # forty steps in other rounding
MOVED_STEPS = 1e-6  # an estimate is a difference of nearly equal numbers: rounding moves the steps a little
SAME_END = 1e-10  # steps that moved a little end at the same place within their error
TURNS = 30  # evaluations: rounding decides when an iteration ends
FROM_REST = 2e-10  # steps within 1e-11 and what the pendulum makes of their errors in 0.2 s
FIRST_STEP = 1e-11  # one step within its tolerance
SHARP = 1e-12  # relative, of an instant found by halving
AT_1_MS = {1: 2e-3, 2: 1e-5}  # error at dt = 1 ms by the order of the method
FITTED_ORDER = 0.1  # of a fitted order: what the next order adds at these steps


# Steps, from few to many, by the order of the method: errors between what the next order adds and rounding.
STEPS = {1: (4000, 32000), 2: (400, 1600), 3: (400, 1600), 4: (200, 800), 5: (80, 240), 6: (40, 104), 8: (32, 64)}


@mark.parametrize("method", EQUAL)
@mark.parametrize("system", ["planet", "cart"])
def test_the_fitted_order_is_the_declared_one(method: str, system: str) -> None:
    pytest.importorskip("llvmlite")  # minutes otherwise
    few, many = STEPS[METHODS[method].order]
    counts = 8 * np.unique(np.geomspace(few / 8, many / 8, 5).astype(int))
    if system == "planet":
        model, start, t_end = planet(), PERIHELION, 3.0
        times = np.linspace(0.0, t_end, 9)
        exact = np.array([position(t) for t in times])
    else:
        model, start, t_end = cart(), ([0.1, 1.0], [0.0, 0.5]), 2.0
        times = np.linspace(0.0, t_end, 9)
        exact = scipy_states(model, np.concatenate(start), times, TIGHT)[:, :2]
    steps = [step(method, t_end / n) for n in counts.tolist()]
    runs = [dyn.simulate(model, *start, t_end, method, t_eval=times, **options) for options in steps]
    errors = [np.linalg.norm(run.q - exact) for run in runs]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == approx(METHODS[method].order, abs=FITTED_ORDER)


@mark.parametrize("method", ADAPTIVE)
def test_the_error_follows_the_tolerance(method: str) -> None:
    pytest.importorskip("llvmlite")
    errors = []
    for tolerance in (1e-5, 1e-8, 1e-11):
        run = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=tolerance, atol=tolerance)
        assert run.stats.success
        errors.append(np.abs(run.q[-1] - position(2.5)).max() / tolerance)
    assert max(errors) < MANY_TOLERANCES
    assert errors[-1] > WASTED


@mark.parametrize("method", ADAPTIVE)
def test_each_state_may_have_an_absolute_tolerance_of_its_own(method: str) -> None:
    """A small state that oscillates is only resolved by a tolerance of its own."""
    small = 1e-9
    system = dyn.OdeSystem(lambda x, t: [cg.cos(t), small * cg.cos(40.0 * t) + 0.0 * x[0]], ["x", "y"])

    def error(atol: Any) -> float:
        run = dyn.simulate(system, [0.0, 0.0], None, 3.0, method, rtol=1e-30, atol=atol)
        return float(abs(run.q[-1, 1] / small - math.sin(120.0) / 40.0))

    assert error([1e-6, 1e-6 * small]) < RESOLVED
    assert error([1e-6, 1e-6]) > RESOLVED


@mark.parametrize("method", ADAPTIVE)
def test_dense_output_is_as_good_as_the_steps(method: str) -> None:
    pytest.importorskip("llvmlite")
    times = np.linspace(0.0, 2.5, 301)
    run = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=1e-9, atol=1e-9, t_eval=times)
    plain = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=1e-9, atol=1e-9)
    assert run.t.tolist() == times.tolist()
    assert run.stats.steps == plain.stats.steps
    error = np.abs(run.q - [position(t) for t in times]).max()
    at_steps = np.abs(plain.q - [position(t) for t in plain.t]).max()
    assert error < INSIDE * at_steps + 1e-9
    assert run.q[-1].tolist() == plain.q[-1].tolist()


@mark.parametrize("method", EVERY_METHOD)
def test_both_back_ends_take_the_same_steps(method: str) -> None:
    pytest.importorskip("llvmlite")
    options: dict[str, Any] = {"rtol": 1e-5} if METHODS[method].adaptive else step(method, 0.05)
    runs = [
        dyn.simulate(cart(), [0.1, 1.0], [0.0, 0.5], 0.5, method, backend=each, **options)
        for each in ("llvm", "python")
    ]
    assert runs[0].stats.steps == runs[1].stats.steps
    assert runs[0].q == approx(runs[1].q, abs=SAME_STEPS if not METHODS[method].adaptive else MOVED_STEPS)
    assert runs[0].q[-1] == approx(runs[1].q[-1], abs=SAME_END)
    assert runs[0].stats.nfev == approx(runs[1].stats.nfev, abs=TURNS)


def test_a_start_from_rest_does_not_fool_the_first_step() -> None:
    """By symmetry in time some estimates vanish there; two half steps against the whole one do not."""
    pytest.importorskip("llvmlite")
    scene = dyn.scenes.load("triple_pendulum")
    reference = dyn.simulate(scene, scene.q, scene.qd, 0.2, "gauss6", dt=1e-4)
    for method in ADAPTIVE:
        run = dyn.simulate(scene, scene.q, scene.qd, 0.2, method, rtol=1e-11, atol=1e-11)
        assert run.q[-1] == approx(reference.q[-1], abs=FROM_REST)
        first = dyn.simulate(scene, scene.q, scene.qd, float(run.t[1]), "gauss6", dt=1e-4)
        assert run.q[1] == approx(first.q[-1], abs=FIRST_STEP)


@stops
def test_a_start_whose_rate_is_no_number() -> None:
    root = dyn.OdeSystem(lambda x, t: [1.0, cg.log(x[1])], ["a", "b"])
    run = dyn.simulate(root, [0.0, -1.0], None, 1.0, "dopri5")
    assert (len(run.t), run.stats.message) == (
        1,
        "stopped at t = 0 s: the rate of state 'b' is not finite at the start",
    )


@stops
@mark.parametrize("method", ["rk4", "dopri5", "rodas"])
def test_max_steps_ends_a_run(method: str) -> None:
    run = dyn.simulate(planet(), *PERIHELION, 50.0, method, **step(method, 0.01), max_steps=17)
    assert (len(run.t), run.stats.steps, run.stats.success) == (
        18 - run.stats.rejected,
        17 - run.stats.rejected,
        False,
    )
    assert run.stats.message.endswith("after max_steps = 17 steps")


@mark.parametrize("method", ADAPTIVE)
def test_max_step_is_the_longest_step_and_the_end_is_met(method: str) -> None:
    run = dyn.simulate(planet(), *PERIHELION, 1.0, method, max_step=0.13)
    assert np.diff(run.t).max() <= 0.13 * (1 + 1e-12)
    assert run.stats.dt <= 0.13
    assert run.t[-1] == 1.0


def test_systems_of_first_order() -> None:
    turning = dyn.OdeSystem(lambda x, t, p: [p["w"] * x[1], -p["w"] * x[0]], ["a", "b"], {"w": 2.0})
    in_turn = [name for name, method in PARTITIONED.items() if method.a is not method.b]
    for method in [name for name in METHODS if name not in in_turn]:
        run = dyn.simulate(turning, [1.0, 0.0], None, 1.0, method, **step(method, 1e-3))
        assert run.q[-1] == approx([math.cos(2.0), -math.sin(2.0)], abs=AT_1_MS.get(METHODS[method].order, 1e-5))
        assert run.qd.shape == (len(run.t), 0)
        assert np.isnan(run.energy).all()
    for method in in_turn:
        with raises(ValueError, match="which a system of first order, "):
            dyn.simulate(turning, [1.0, 0.0], None, 1.0, method)
    with raises(ValueError, match="qd must be None for a system of first order"):
        dyn.simulate(turning, [1.0, 0.0], [], 1.0)
    with raises(ValueError, match=r"tau must be 0 for a system of first order, which no force acts on, got 2\.0"):
        dyn.simulate(turning, [1.0, 0.0], None, 1.0, tau=2.0)


def test_a_momentum_that_is_not_linear_in_the_velocity() -> None:
    """A relativistic oscillator, L = -sqrt(1 - v^2) - x^2 / 2: p = v / sqrt(1 - v^2)."""
    pytest.importorskip("llvmlite")
    system = System(lambda q, qd, t: -cg.sqrt(1.0 - qd[0] ** 2) - 0.5 * q[0] ** 2, ["x"])
    fine = dyn.simulate(system, [3.0], [0.0], 8.0, "dop853", rtol=10.0 * TIGHT, atol=10.0 * TIGHT)
    for method, tolerance in (("gauss6", 1e-9), ("gauss4", 1e-7), ("verlet", 1e-3), ("midpoint", 1e-3)):
        run = dyn.simulate(system, [3.0], [0.0], 8.0, method, dt=0.01, estimate_error=False)
        assert run.q[-1] == approx(fine.q[-1], abs=tolerance)
        assert np.ptp(run.energy) < 30 * tolerance


def test_steps_grow_and_shrink_within_limits() -> None:
    run = dyn.simulate(planet(), *PERIHELION, 10.0, "dopri5")
    ratios = [after / before for before, after in itertools.pairwise(np.diff(run.t)[:-2])]
    assert max(ratios) <= LARGEST_FACTOR * (1 + SHARP)
