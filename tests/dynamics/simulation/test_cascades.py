"""Events at one instant: cascades of resets, contacts that rest, what is due and what is not; by all methods."""

import math
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from tests.slow import slow
from tests.trust.cascades import CASCADES, KINDS, judge_balls, random_balls
from tests.trust.trust import RIGHT, SILENT

G = 9.81  # m/s^2
QUICK = ["dop853", "rk4", *slow("dopri5", "rodas", "radau", "taylor", "euler", "verlet", "gauss6")]
EXACT = 1e-9  # free motion, by every method


def free(n: int) -> dyn.System:
    return dyn.System(lambda q, qd, t: sum(0.5 * v * v for v in qd), [f"x{i}" for i in range(n)])


def contact(i: int, direction: int = -1, e: float = 1.0) -> dyn.Event:
    """Equal balls i and i + 1 meet."""

    def reset(q: Any, qd: Any, t: Any) -> Any:
        mean, half = 0.5 * (qd[i] + qd[i + 1]), 0.5 * e * (qd[i + 1] - qd[i])
        return q, [*qd[:i], mean + half, mean - half, *qd[i + 2 :]]

    return dyn.Event(f"contact {i}", lambda q, qd, t: q[i + 1] - q[i], direction, reset=reset)


def wall(i: int, direction: int = -1, e: float = 1.0) -> dyn.Event:
    return dyn.Event(
        f"wall {i}", lambda q, qd, t: q[i], direction, reset=lambda q, qd, t: (q, [*qd[:i], -e * qd[i], *qd[i + 1 :]])
    )


def moved(q: list[float], qd: list[float], events: Any, t_end: float, method: str = "dop853") -> dyn.Trajectory:
    equal: dict[str, Any] = {"dt": 0.05} if method in METHODS and not METHODS[method].adaptive else {}
    return dyn.simulate(free(len(q)), q, qd, t_end, method, events=events, **equal)


@mark.parametrize("method", QUICK)
@mark.parametrize("direction", [-1, 0])
def test_newton_s_cradle_a_triple_collision_and_a_corner(method: str, direction: int) -> None:
    contacts = [contact(0, direction), contact(1, direction)]
    cradle = moved([0.0, 0.5, 0.5], [1.0, 0.0, 0.0], contacts, 2.0, method)
    assert cradle.q[-1] == approx([0.5, 0.5, 2.0], abs=EXACT)
    assert [len(each.t) for each in cradle.events.values()] == [1, 1]
    triple = moved([-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], contacts, 2.0, method)
    assert triple.q[-1] == approx([-1.0, 0.0, 1.0], abs=EXACT)
    corner = moved([1.0, 2.0], [-1.0, -2.0], [wall(0, direction), wall(1, direction)], 2.0, method)
    assert corner.q[-1] == approx([1.0, 2.0], abs=EXACT)
    assert cradle.stats.warnings == triple.stats.warnings == corner.stats.warnings == ()


@mark.parametrize("number", range(len(KINDS)))
@mark.parametrize(("method", "many"), [(None, False), ("rk4", True)])
def test_random_cascades_end_where_exact_fractions_do(number: int, method: str | None, many: bool) -> None:
    verdict = judge_balls(number + 4, method, many=many)
    assert verdict.verdict == RIGHT, (verdict, random_balls(number + 4))


@mark.slow
@mark.timeout(3600)
@mark.parametrize("method", [None, *METHODS])
def test_no_cascade_is_wrong(method: str | None) -> None:
    judged = [judge_balls(number, method, many=number % 5 == 0 and method is not None) for number in range(CASCADES)]
    assert [each for each in judged if each.verdict == SILENT] == []
    assert [each for each in judged if each.verdict != RIGHT] == []


@mark.filterwarnings("ignore:the (state is off|error is unknown):dynamics.SimulationWarning")  # of equal steps
@mark.parametrize("balls", [1, 2, *slow(3)])
@mark.parametrize("method", ["dop853", *slow("dopri5", "rk4", "radau", "verlet")])
def test_pendulums_that_touch_swing_at_the_ends_alone(balls: int, method: str) -> None:
    """Contacts rest, and move together, for ten swings: rounding does not bring them apart or through one another."""
    n = 5
    pendulums = dyn.System(
        lambda q, qd, t: sum(0.5 * v * v + G * cg.cos(a) for a, v in zip(q, qd, strict=True)),
        [f"a{i}" for i in range(n)],
    )
    equal: dict[str, Any] = {} if METHODS[method].adaptive else {"dt": 0.01}
    start = [-0.5] * balls + [0.0] * (n - balls)
    contacts = [contact(i) for i in range(n - 1)]
    run = dyn.simulate(pendulums, start, [0.0] * n, 10.0, method, events=contacts, **equal)
    alone = dyn.simulate(pendulums, start, [0.0] * n, 10.0, method, **equal)
    assert run.stats.success
    assert np.diff(run.q, axis=1).min() > -1e-12
    error = 1e-4 if method == "verlet" else 1e-6  # events part its steps of 0.01 s, which are off by 1e-3
    assert run.q[-1].sum() == approx(alone.q[-1].sum(), abs=error)  # equal ones pass through one another
    assert np.abs(run.q[:, balls : n - balls]).max(initial=0.0) < 1e-12


def test_a_contact_that_closes_at_the_start_is_reset_and_one_that_rests_pressed_stops_the_run() -> None:
    assert moved([0.0, 0.0], [1.0, 0.0], contact(0), 1.0).q[-1] == approx([0.0, 1.0], abs=EXACT)
    assert moved([0.0], [-2.0], wall(0, e=0.5), 1.0).q[-1] == approx([1.0], abs=EXACT)
    ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - G * q[0], ["height"])
    with pytest.warns(dyn.SimulationWarning, match="event 'wall 0' resets the state again and again"):
        dyn.simulate(ball, [0.0], [0.0], 1.0, events=wall(0, e=0.5))
    for q, qd in (([0.0], [0.0]), ([0.0], [3.0]), ([0.0], [-3.0])):
        with pytest.warns(dyn.SimulationWarning, match="event 'wall 0' starts at zero and leaves it at t = 0 s"):
            dyn.simulate(ball, q, qd, 0.1, events=wall(0, direction=0))


def test_what_another_reset_turns_back_is_no_event_what_it_lets_through_is_one_and_a_clock_strikes_once() -> None:
    seen = dyn.Event("seen", lambda q, qd, t: q[0], -1)
    back = dyn.Event("back", lambda q, qd, t: q[0], 1)
    touch = dyn.Event("touch", lambda q, qd, t: q[0] ** 2)
    later = dyn.Event("later", lambda q, qd, t: 2.0 * q[0], -1, reset=lambda q, qd, t: (q, [9.0 * qd[0]]))
    run = moved([1.0], [-1.0], [wall(0), seen, back, touch, later], 1.5)
    assert [len(each.t) for each in run.events.values()] == [1, 1, 0, 1, 0]
    end = dyn.Event("end", lambda q, qd, t: q[2] - q[1], -1, terminal=True)
    stopped = moved([0.0, 0.5, 0.5], [1.0, 0.0, 0.0], [contact(0), end], 2.0)
    assert (stopped.stats.status, stopped.t[-1]) == (1, approx(0.5, abs=EXACT))
    assert stopped.qd[-1] == approx([0.0, 1.0, 0.0], abs=EXACT)
    clock = dyn.Event("clock", lambda q, qd, t: t - 0.5, 1, reset=lambda q, qd, t: (q, [qd[0] + 1.0]))
    assert moved([0.0], [0.0], clock, 1.5).q[-1] == approx([1.0], abs=EXACT)


@mark.filterwarnings("ignore:the error is unknown:dynamics.SimulationWarning")  # other steps take another course
@mark.parametrize("method", ["dop853", "rk4"])
def test_three_balls_that_are_squeezed_without_restitution_come_to_rest(method: str) -> None:
    run = moved([-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [contact(0, e=0.0), contact(1, e=0.0)], 1.5, method)
    assert (run.stats.success, len(run.events["contact 0"].t) > 10) == (True, True)
    assert run.q[-1] == approx([0.0, 0.0, 0.0], abs=EXACT)


ORDERS = [
    ("rk4", 0.2),
    ("gauss6", 0.4),
    *slow(("yoshida6", 0.1), ("kahan_li8", 0.2)),
]


@mark.parametrize(("method", "dt"), ORDERS)
def test_instants_of_equal_steps_are_as_exact_as_the_method(method: str, dt: float) -> None:
    """Off by no more than its state is at a step's end nearby; a cubic is off by 1e-4 in steps of 0.5."""
    spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2, ["x"])
    half = dyn.Event("half", lambda q, qd, t: q[0] - 0.5)
    turned = dyn.Event("half", half.value, -1, reset=lambda q, qd, t: (q, [-qd[0]]))
    turn = math.acos(0.5)
    for event, expected, t_end in ((half, [turn, 2.0 * math.pi - turn], 6.0), (turned, [turn, 3.0 * turn], 4.0)):
        options: dict[str, Any] = {"dt": dt, "estimate_error": False, "dense_output": True}
        run = dyn.simulate(spring, [1.0], [0.0], t_end, method, events=event, **options)
        plain = dyn.simulate(spring, [1.0], [0.0], t_end, method, **options)
        error = np.abs(plain.q[:, 0] - np.cos(plain.t)).max() + 1e-14
        assert run.events["half"].t == approx(expected, abs=4.0 * error)
        times = np.linspace(0.0, expected[0], 50)
        assert run.solution(times)[0][:, 0] == approx(np.cos(times), abs=4.0 * error)
