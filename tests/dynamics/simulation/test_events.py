"""Events: instants at which a quantity passes through zero, by methods of every kind."""

import math

import numpy as np
import pytest
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics.integrators import METHODS
from dynamics.systems.system import System
from tests.dynamics.planet import ECCENTRICITY, PERIHELION, planet, position
from tests.dynamics.step_options import step

FIXED = [name for name, method in METHODS.items() if not method.adaptive]
ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
SHARP = 1e-12  # relative, of an instant found by halving
CROSSING = {1: 2e-2, 2: 2e-5}  # s, by the order of the method: the error of a motion at dt = 1 ms
CROSSING_FINE = 1e-8  # s, at order 4 and more, and for steps within 1e-11
EQUAL_CROSSING = 2e-4  # s: crossings are where the cubic of a step of 0.1 or 0.2 s has them
CHOSEN_CROSSING = 1e-6  # s: steps within 1e-9


@mark.parametrize("method", [*ADAPTIVE, "rk4", "verlet"])
def test_events_are_found_where_they_are(method: str) -> None:
    pytest.importorskip("llvmlite")
    crossing = dyn.Event("axis", lambda q, qd, t: q[1])
    upward = dyn.Event("upward", lambda q, qd, t: q[1], direction=1)
    late = dyn.Event("late", lambda q, qd, t: t - 11.0, terminal=True)
    run = dyn.simulate(
        planet(),
        *PERIHELION,
        20.0,
        method,
        **step(method, 1e-3, rtol=1e-11, atol=1e-11),
        events=[crossing, upward, late],
    )
    tolerance = CROSSING.get(METHODS[method].order, CROSSING_FINE)
    assert run.events["axis"].t == approx(np.pi * np.arange(1, 4), abs=tolerance)
    assert run.events["upward"].t == approx([2 * np.pi], abs=tolerance)
    assert run.events["axis"].q[0] == approx([-1.0 - ECCENTRICITY, 0.0], abs=tolerance)
    assert (run.t[-1], run.stats.message) == (approx(11.0, rel=SHARP), "event 'late' at t = 11 s")
    assert run.q[-1] == approx(position(11.0 - 2 * np.pi), abs=tolerance)
    assert (run.success, run.status) == (True, 1)


def test_an_event_between_the_times_asked_for() -> None:
    ground = dyn.Event("ground", lambda q, qd, t, p: q[0] - p["floor"], terminal=True)
    ball = System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"], {"floor": 0.5})
    for method in ("rk4", "dop853"):
        run = dyn.simulate(ball, [1.0], [0.0], 1.0, method, **step(method, 0.01), t_eval=[0.0, 0.3, 0.9], events=ground)
        assert run.t.tolist() == [0.0, 0.3, run.events["ground"].t[0]]
        assert run.q[-1].tolist() == run.events["ground"].q[0].tolist()
        assert run.events["ground"].t == approx([math.sqrt(2 * 0.5 / 9.81)], rel=SHARP)
        assert run.events["ground"].qd[0] == approx([-math.sqrt(2 * 9.81 * 0.5)], rel=SHARP)


@mark.parametrize("method", ["dop853", "dopri5", "rk4", "radau", "gauss6"])
def test_two_crossings_in_one_step_are_both_found(method: str) -> None:
    """x = sin t touches 0.999 and goes back 0.09 s later; steps are longer."""
    circle = dyn.OdeSystem(lambda x, t: [x[1], -x[0]], ["x", "v"])
    over = dyn.Event("over", lambda x, t: x[0] - 0.99)
    options = step(method, {"rk4": 0.1, "gauss6": 0.2}.get(method, 10.0), rtol=1e-9, atol=1e-9)
    run = dyn.simulate(circle, [0.0, 1.0], None, 10.0, method, **options, events=[over])
    peak = np.arccos(0.99)
    expected = [turn * 2.0 * np.pi + 0.5 * np.pi + side * peak for turn in (0, 1) for side in (-1, 1)]
    assert run.events["over"].t == approx(expected, abs=EQUAL_CROSSING if method in FIXED else CHOSEN_CROSSING)


def test_an_event_is_what_it_says() -> None:
    with raises(TypeError, match="an event needs a name, a function, and True or False for `terminal`, got 'e', 1"):
        dyn.Event("e", 1)  # type: ignore[arg-type]
    with raises(TypeError, match="True or False for `terminal`"):
        dyn.Event("e", lambda q, qd, t: q[0], terminal="no")  # type: ignore[arg-type]
