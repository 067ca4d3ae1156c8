"""Resets: runs that go on from the state that an event leaves, against closed forms, by methods of every kind."""

import math
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics import METHODS
from tests.early_end import stops

G = 9.81  # m/s^2
FALL = math.sqrt(2.0 / G)  # s, from 1 m
BALL = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - G * q[0], ["height"])
PARABOLA = 1e-9  # m and s: every method is exact on a parabola, to its tolerance
METHOD_KINDS = ["dop853", "rk4", "verlet", "rodas"]


def bounce(e: float, floor: float = 0.0) -> dyn.Event:
    return dyn.Event("bounce", lambda q, qd, t: q[0] - floor, -1, reset=lambda q, qd, t: (q, [-e * qd[0]]))


def fall(event: dyn.Event, t_end: float, method: str = "dop853", **options: Any) -> dyn.Trajectory:
    steps = {"dt": 0.05} if not METHODS[method].adaptive else {"rtol": 1e-11, "atol": 1e-11}
    return dyn.simulate(BALL, [1.0], [0.0], t_end, method, events=event, **{**steps, **options})


@mark.parametrize("method", METHOD_KINDS)
def test_a_ball_bounces_where_a_ball_does(method: str) -> None:
    run = fall(bounce(0.8), 2.5, method)
    flights = FALL * np.array([1.0, 2 * 0.8, 2 * 0.8**2, 2 * 0.8**3])
    crossings = run.events["bounce"]
    assert (run.stats.success, run.t[-1]) == (True, 2.5)
    assert crossings.t == approx(np.cumsum(flights)[: len(crossings.t)], abs=1e-6)
    assert len(crossings.t) == 4
    assert crossings.qd[:, 0] == approx(-G * FALL * 0.8 ** np.arange(4), abs=1e-6)
    assert run.q.min() > -PARABOLA
    before = np.flatnonzero(np.diff(run.t) == 0.0)  # rows before and after, at the same instant
    assert run.t[before].tolist() == crossings.t.tolist()
    assert run.q[before].tolist() == run.q[before + 1].tolist() == crossings.q.tolist()
    assert run.qd[before + 1] == approx(-0.8 * run.qd[before], rel=1e-15)


def test_rows_at_t_eval_lie_on_the_bounces() -> None:
    times = np.linspace(0.0, 0.9, 10)
    since = times - FALL
    heights = np.where(since < 0.0, 1.0 - 0.5 * G * times**2, 0.5 * G * FALL * since - 0.5 * G * since**2)
    for method in ("dop853", "rk4"):
        run = fall(bounce(0.5), 0.9, method, t_eval=times)
        assert run.t.tolist() == times.tolist()
        assert run.q[:, 0] == approx(heights, abs=1e-7)
        assert run.energy == approx(np.where(since < 0.0, G, 0.25 * G), abs=1e-6)


@stops
@mark.parametrize("method", ["dop853", "rk4", "rodas"])
@mark.parametrize(("e", "floor"), [(0.0, 0.0), (0.3, 0.5)])
def test_infinitely_many_bounces_end_with_a_sentence_above_the_floor(method: str, e: float, floor: float) -> None:
    run = fall(bounce(e, floor), 8.0, method)
    assert "event 'bounce' resets the state again and again at this instant" in run.stats.message
    assert (run.stats.success, run.stats.status) == (False, -1)
    assert run.t[-1] == approx(math.sqrt(2.0 * (1.0 - floor) / G) * (1.0 + 2.0 * e / (1.0 - e)), rel=1e-3)
    assert run.q.min() > floor - PARABOLA


def test_a_crossing_that_its_reset_does_not_turn_back_counts_once() -> None:
    kick = dyn.Event("kick", lambda q, qd, t: q[0] - 0.5, reset=lambda q, qd, t: (q, [qd[0] - 1.0]))
    assert fall(kick, 0.4).events["kick"].qd[:, 0] == approx([-math.sqrt(G)], abs=1e-7)


@stops
def test_a_first_order_system_parameters_time_and_limits() -> None:
    heater = dyn.OdeSystem(lambda x, t, p: [x[1] * p["power"] - 1.0, 0.0 * x[0]], ["T", "on"], {"power": 3.0})
    events = [
        dyn.Event("cold", lambda x, t, p: x[0] - 1.0, -1, reset=lambda x, t, p: [x[0], 1.0]),
        dyn.Event("warm", lambda x, t: x[0] - 2.0, 1, reset=lambda x, t: [x[0], 0.0]),
    ]
    run = dyn.simulate(heater, [1.5, 0.0], None, 4.2, "dop853", events=events)
    assert run.events["cold"].t == approx([0.5, 2.0, 3.5], abs=1e-9)
    assert run.events["warm"].t == approx([1.0, 2.5, 4.0], abs=1e-9)
    few = dyn.simulate(heater, [1.5, 0.0], None, 4.0, "dop853", events=events, max_step=0.1, max_steps=12)
    assert few.stats.message.endswith("after max_steps = 12 steps")
    assert (few.stats.success, few.t[-1] < 2.0, few.stats.steps) == (False, True, 12)


@stops
def test_what_a_reset_has_to_be() -> None:
    def run(reset: Any) -> dyn.Trajectory:
        return fall(dyn.Event("bounce", lambda q, qd, t: q[0], reset=reset), 1.0)

    with raises(ValueError, match=r"the reset of event 'bounce' must be \(1 coordinates, 1 velocities\)"):
        run(lambda q, qd, t: (q, [qd[0], qd[0]]))
    with raises(TypeError, match="the reset of event 'bounce' must be"):
        run(lambda q, qd, t: 3.0)
    with raises(TypeError, match=r"the reset of event 'bounce' must take \(q, qd, t\)"):
        run(lambda q: q)
    result = run(lambda q, qd, t: (q, [qd[0] * 1e308 * 1e308]))
    assert "velocity of 'height' is -inf after the reset of event 'bounce'" in result.stats.message
    assert np.isfinite(result.qd[:-1]).all()
