"""Limits that a motion leaves are found between its rows, as its solution at very many instants has them."""

import re
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from dynamics.verification.limits_left import Pair, limits_left

NUMBER = r"(-?[\d.e+-]+)"
SAID = re.compile(rf"(\w+) of (\w+) leaves .* at {NUMBER} s, and is {NUMBER} .* at {NUMBER} s")
FINE = 200_001  # instants
READ = 2e-3  # of a figure in a sentence, which has four digits, and of the longest way between two instants


def arm() -> Any:
    return dyn.planar_arm([1.0, 0.8], [1.0, 0.5])


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
@pytest.mark.parametrize(("method", "form"), [("dop853", "velocity"), ("rodas", "momentum"), ("rk4", "velocity")])
def test_limits_are_left_where_the_solution_leaves_them(method: str, form: str) -> None:
    dt = 0.02 if method == "rk4" else None
    run = dyn.simulate(arm(), [1.5, 0.5], [0.0, 0.0], 3.0, method, dense_output=True, form=form, dt=dt)
    names = {name: f"j{k}" for k, name in enumerate(run.coordinates)}
    t = np.linspace(0.0, 3.0, FINE)
    limits: dict[str, dict[str, Pair]] = {"position": {}, "velocity": {}}
    expected: dict[tuple[str, str], tuple[float, float, float]] = {}
    for kind, table in zip(limits, run.solution(t), strict=True):
        for name, column in zip(names, table.T, strict=True):
            upper = limits[kind][name] = (-np.inf, float(column.max()) - 1e-3)
            over = column - upper[1]
            expected[kind, name] = t[np.argmax(over > 0.0)], column[np.argmax(over)], t[np.argmax(over)]
    said = limits_left(run, limits, dict.fromkeys(names, "rad"))
    assert len(said) == len(expected)
    for sentence, ((kind, name), figures) in zip(said, expected.items(), strict=True):
        found = SAID.match(sentence.replace(name, names[name]))
        assert found is not None
        assert found.group(1) == kind
        assert [float(each) for each in found.groups()[2:]] == pytest.approx(figures, rel=READ, abs=READ)


def test_a_bounce_leaves_no_limit_at_the_floor_and_rows_alone_may_miss_the_top() -> None:
    ball = dyn.Mechanism([dyn.Body("ball", dyn.Joint("prismatic", (0.0, 0.0, 1.0)), mass=1.0)])
    floor = dyn.Event("floor", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.5 * qd[0]]))

    def left(upper: float, **options: Any) -> list[str]:
        run = dyn.simulate(ball, [0.0], [9.81], 2.9, events=floor, **options)
        return limits_left(run, {"position": {"ball": (-1e-9, upper)}}, {"ball": "m"})

    top = 0.5 * 9.81  # after one second
    assert left(top * (1.0 + 1e-9), dense_output=True) == []
    assert left(top - 1e-6, dense_output=True) == [
        f"position of ball leaves -1e-09 to 4.905 m at {1.0 - (2e-6 / 9.81) ** 0.5:.4g} s, and is 4.905 m at 1 s"
    ]
    assert left(top - 1e-6, t_eval=[0.0, 0.9, 1.1, 2.9]) == []


def test_a_motion_that_starts_at_a_limit_and_goes_inward_keeps_it() -> None:
    run = dyn.simulate(arm(), [0.7, 0.0], [0.0, 0.0], 0.3, dense_output=True)
    assert limits_left(run, {"position": {"joint 1": (-1.0, 0.7)}}, {"joint 1": "rad"}) == []


@pytest.mark.parametrize("metre", [1.0, 1e6, 1e-6])
def test_what_is_beyond_a_limit_by_rounding_alone_has_not_left_it(metre: float) -> None:
    """Of the largest coordinate of its unit, in any unit: a finger that rests at its stop beside one that moves."""
    fingers = dyn.Mechanism([dyn.Body(name, dyn.Joint("prismatic"), mass=1.0) for name in ("left", "right")], (0, 0, 0))
    for beyond, told in ((2e-33, 0), (1e-14, 0), (1e-3, 1)):
        run = dyn.simulate(fingers, [-beyond * metre, 0.0], [0.0, metre], 1.0)
        said = limits_left(run, {"position": {"left": (0.0, metre)}}, dict.fromkeys(("left", "right"), "m"))
        assert len(said) == told
