"""Events of ensembles: what each trajectory has alone, whoever runs it."""

from typing import Any

import numpy as np
from pytest import approx, mark

import dynamics as dyn

STARTS = np.array([[0.5], [1.0], [2.0], [30.0]])
WEIGHT = np.array([9.81, 3.0, 9.81, 9.81])
BALL = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["g"] * q[0], ["height"], {"g": 9.81})
GROUND = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
BOUNCE = dyn.Event("bounce", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.9 * qd[0]]))
HALF = dyn.Event("half", lambda q, qd, t, p: q[0] - 0.1 * p["g"])
TIMES = np.linspace(0.0, 1.5, 7)


@mark.parametrize(("method", "steps"), [("dop853", {}), ("rk4", {"dt": 0.05})])
@mark.parametrize("events", [[GROUND, HALF], [BOUNCE, HALF]])
def test_every_trajectory_has_the_events_that_it_has_alone(method: str, steps: dict[str, Any], events: Any) -> None:
    fan = dyn.simulate_many(
        BALL,
        STARTS,
        [0.0],
        1.5,
        method,
        t_eval=TIMES,
        events=events,
        parameters={"g": WEIGHT},
        workers=2,
        chunk=1,
        **steps,
    )
    for k, (start, g) in enumerate(zip(STARTS, WEIGHT, strict=True)):
        parameters = {"g": float(g)}
        alone = dyn.simulate(
            BALL, start, [0.0], 1.5, method, t_eval=TIMES, events=events, parameters=parameters, **steps
        )
        stats = fan.stats
        assert (stats.message[k], stats.status[k]) == (alone.stats.message, alone.stats.status)
        assert stats.success[k]
        rows = int(np.isfinite(fan.q[k, :, 0]).sum())
        assert rows == (alone.t[-1] >= TIMES).sum()
        assert fan.q[k, :rows] == approx(alone.q[:rows], abs=1e-9)
        for event in events:
            assert fan.events[event.name][k].t == approx(alone.events[event.name].t, abs=1e-9)
            assert fan.events[event.name][k].qd == approx(alone.events[event.name].qd, abs=1e-7)


def test_rows_of_equal_steps_are_at_the_times_that_they_have_without_events() -> None:
    plain = dyn.simulate_many(BALL, STARTS, [0.0], 0.2, "rk4", dt=0.05)
    watched = dyn.simulate_many(BALL, STARTS, [0.0], 0.2, "rk4", dt=0.05, events=[GROUND])
    assert watched.t.tolist() == plain.t.tolist()
    assert watched.q == approx(plain.q, abs=1e-12)
