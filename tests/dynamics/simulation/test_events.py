"""Events: instants at which a quantity is zero, by methods of every kind, against closed forms and one another."""

import math
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from tests.dynamics.planet import ECCENTRICITY, PERIHELION, planet, position
from tests.dynamics.step_options import step
from tests.slow import slow

KINDS = ["dop853", "rk4"]  # with dense output of their own, by Hermite
SHARP = 1e-12  # relative, of an instant found to the last bit
CROSSING = {1: 2e-2, 2: 2e-5}  # s, by the order of the method: the error of a motion at dt = 1 ms
CROSSING_FINE = 1e-8  # s, at order 4 and more, and for steps within 1e-11
TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-10}
EQUAL: dict[str, Any] = {"dt": 0.03}
MOTION = 1e-6  # s, of instants of a motion integrated with TIGHT, or by rk4 with EQUAL
CIRCLE = dyn.OdeSystem(lambda x, t: [x[1], -x[0]], ["x", "v"])  # x = cos t, v = -sin t from (1, 0)
TURN = math.acos(0.5)  # x = 1/2 at 2 pi k +- this


def circle(events: list[dyn.Event], t_end: float = 10.0, method: str = "dop853", **options: Any) -> dyn.Trajectory:
    chosen = TIGHT if METHODS[method].adaptive else EQUAL
    return dyn.simulate(CIRCLE, [1.0, 0.0], None, t_end, method, events=events, **{**chosen, **options})


@mark.parametrize("method", ["dop853", "radau", "verlet", *slow("taylor", "dopri5", "rodas", "rk4")])
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
        **step(method, 1e-3),
        **({"rtol": 1e-11, "atol": 1e-11} if METHODS[method].adaptive else {}),
        events=[crossing, upward, late],
    )
    tolerance = CROSSING.get(METHODS[method].order, CROSSING_FINE)
    assert run.events["axis"].t == approx(np.pi * np.arange(1, 4), abs=tolerance)
    assert run.events["upward"].t == approx([2 * np.pi], abs=tolerance)
    assert run.events["axis"].q[0] == approx([-1.0 - ECCENTRICITY, 0.0], abs=tolerance)
    assert (run.t[-1], run.stats.message) == (approx(11.0, rel=SHARP), "event 'late' at t = 11 s")
    assert run.q[-1] == approx(position(11.0 - 2 * np.pi), abs=tolerance)
    assert (run.stats.success, run.stats.status) == (True, 1)


GRAZING: dict[str, Any] = {
    "square": lambda x, t: (x[0] - 0.5) ** 2,
    "below": lambda x, t: -((x[0] - 0.5) ** 2),
    "fourth power": lambda x, t: (x[0] - 0.5) ** 4,
    "expanded": lambda x, t: x[0] ** 2 - x[0] + 0.25,
    "absolute value": lambda x, t: abs(x[0] - 0.5),
    "of a large number": lambda x, t: abs((x[0] + 1e6) - (0.5 + 1e6)),
    "small": lambda x, t: 1e-200 * (x[0] - 0.5) ** 2,
    "large": lambda x, t: 1e200 * (x[0] - 0.5) ** 2,
}
NEAR: dict[str, Any] = {
    "over": lambda x, t: (x[0] - 0.5) ** 2 + 1e-12,
    "under": lambda x, t: -((x[0] - 0.5) ** 2) - 1e-12,
    "corner": lambda x, t: abs(x[0] - 0.5) + 1e-9,
    "small": lambda x, t: 1e-200 * ((x[0] - 0.5) ** 2 + 1e-12),
}


@mark.parametrize("method", KINDS)
def test_a_touch_of_zero_is_an_event_of_both_directions_where_it_is_and_a_near_miss_is_none(method: str) -> None:
    touches = [dyn.Event(name, quantity) for name, quantity in GRAZING.items()]
    one_way = [dyn.Event(f"{name}{k}", GRAZING[name], direction=k) for name in ("square", "below") for k in (-1, 1)]
    near = [dyn.Event(f"near {name}", quantity) for name, quantity in NEAR.items()]
    events = circle([*touches, *one_way, *near], 8.0, method).events
    exact = [TURN, 2 * np.pi - TURN, 2 * np.pi + TURN]
    for event in touches:
        assert events[event.name].t == approx(exact, abs=1e-6 if "large number" in event.name else MOTION), event.name
    assert [len(events[event.name].t) for event in (*one_way, *near)] == [0] * 8


def test_starts_on_zero_ends_on_zero_and_quantities_that_stay_zero() -> None:
    names: dict[str, tuple[Any, int]] = {
        "starts there": (lambda x, t: x[1], 0),
        "starts there, to rounding": (lambda x, t: x[0] + 0.1 + 0.2 - 1.3, 0),
        "always": (lambda x, t: 0.0 * x[0], 0),
        "arrives and stays": (lambda x, t: cg.maximum(2.0 - t, 0.0), 0),
        "arrives downward": (lambda x, t: cg.maximum(2.0 - t, 0.0), -1),
        "arrives upward": (lambda x, t: cg.maximum(2.0 - t, 0.0), 1),
        "leaves": (lambda x, t: cg.maximum(t - 2.0, 0.0), 0),
        "rests in between": (lambda x, t: cg.maximum(abs(t - 2.0) - 1.0, 0.0), 0),
        "jumps": (lambda x, t: cg.where(cg.less(t, 2.0), -1.0, 1.0), 0),
        "at the end": (lambda x, t: t - 4.0, 0),
        "touches the end": (lambda x, t: (t - 4.0) ** 2, 0),
        "at a step": (lambda x, t: (t - 2.0) ** 2, 0),
        "through a step": (lambda x, t: (t - 2.0) ** 3, 1),
        "touches a step": (lambda x, t: (t - 2.0) ** 2, -1),
    }
    expected = [[np.pi], [], [], [2.0], [2.0], [], [], [1.0], [2.0], [4.0], [4.0], [2.0], [2.0], []]
    events = [dyn.Event(name, quantity, direction=k) for name, (quantity, k) in names.items()]
    for method, options in (
        ("rk4", {"dt": 0.25}),
        ("dop853", {}),
    ):
        found = circle(events, 4.0, method, **options).events
        for name, instants in zip(names, expected, strict=True):
            assert found[name].t == approx(instants, abs=1e-2 if instants == [np.pi] else 1e-9), (name, method, options)


def test_many_crossings_in_a_step_are_all_found_or_a_warning_says_so() -> None:
    """Steps of 0.4 s: some hundred crossings in each; of the fastest too many to look for."""
    rng = np.random.default_rng(7)
    rates = [1000.0, *np.exp(rng.uniform(np.log(10.0), np.log(1000.0), 6)).tolist()]
    for w in rates:
        run = circle([dyn.Event("fast", lambda x, t, *, w=w: cg.sin(w * t + 0.5))], 5.0, rtol=1e-6, atol=1e-6)
        expected = (np.pi * np.arange(1, 1 + int((5.0 * w + 0.5) / np.pi)) - 0.5) / w
        assert (run.stats.warnings, len(run.events["fast"].t)) == ((), len(expected)), w
        assert run.events["fast"].t == approx(expected, abs=SHARP)
    with pytest.warns(
        dyn.SimulationWarning, match="event 'fast' may have been missed, .*shorter steps .max_step or dt"
    ):
        circle([dyn.Event("fast", lambda x, t: cg.sin(1e6 * t + 0.5))], 1.0)


def _oscillations(a: float, w: float, c: float) -> tuple[Any, Any]:
    """a sin(w t + c), and a cos(t + c) as a quantity of the state."""
    return lambda x, t: a * cg.sin(w * t + c), lambda x, t: a * (x[0] * math.cos(c) + x[1] * math.sin(c))


@mark.parametrize("method", KINDS)
def test_random_oscillations_cross_zero_where_they_do(method: str) -> None:
    """Number, instants and directions, of quantities of the time and of the state, by closed forms."""
    rng, count = np.random.default_rng(len(method)), 40 if method == "dop853" else 10
    amplitude, phase = 10.0 ** rng.uniform(-12, 12, count), rng.uniform(0.1, 3.0, count)
    rate, directions = np.exp(rng.uniform(-1.0, 4.0, count)), rng.integers(-1, 2, count)
    events = []
    for k, (a, w, c) in enumerate(zip(amplitude.tolist(), rate.tolist(), phase.tolist(), strict=True)):
        of_time, of_state = _oscillations(a, w, c)
        events.append(dyn.Event(f"{k}", of_state if k % 2 else of_time, direction=int(directions[k])))
    found = circle(events, 9.0, method).events
    for k, (w, c) in enumerate(zip(rate, phase, strict=True)):
        turns = np.arange(-3, 400)  # cos(t + c) is zero at pi / 2 - c + pi n and falls there for even n
        zeros = (np.pi * turns - c) / w if k % 2 == 0 else np.pi * (turns + 0.5) - c
        falls = (turns % 2 == 1) if k % 2 == 0 else (turns % 2 == 0)
        keep = (zeros > 0.0) & (zeros < 9.0) & (directions[k] != np.where(falls, 1, -1))
        assert found[f"{k}"].t == approx(zeros[keep], abs=SHARP if k % 2 == 0 else MOTION), k


def test_instants_do_not_depend_on_the_rows_the_engine_or_the_company_of_other_events() -> None:
    ask = dyn.Event("ask", lambda x, t: (x[0] - 0.5) * (x[1] - 0.25) ** 2)
    other = dyn.Event("other", lambda x, t: cg.sin(40.0 * t))
    alone = circle([ask])
    assert len(alone.events["ask"].t) == 6
    for method in ("dop853", "rk4"):
        first = circle([ask], method=method).events["ask"].t
        assert first == approx(alone.events["ask"].t, abs=MOTION)
        choices: list[dict[str, Any]] = [
            {"t_eval": np.linspace(0.0, 10.0, 41)},
            {"backend": "python"},
            {"t_eval": [5.0]},
        ]
        for options in choices:
            if method == "rk4" and "t_eval" in options:
                continue  # other steps
            assert circle([ask], method=method, **options).events["ask"].t == approx(first, rel=SHARP)
        assert circle([ask, other], method=method).events["ask"].t == approx(first, rel=SHARP)


def test_an_event_is_what_it_says() -> None:
    with raises(ValueError, match="direction must be 1, -1 or 0, got 2"):
        dyn.Event("e", lambda q, qd, t: q[0], direction=2)
    with raises(ValueError, match="event 'e': a run that ends there goes on from no reset state"):
        dyn.Event("e", lambda q, qd, t: q[0], terminal=True, reset=lambda q, qd, t: (q, qd))
