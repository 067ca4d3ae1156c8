"""A method of a reader's own is one step: by equal steps and chosen ones, between their ends, and differentiated."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph.extend import Call
from dynamics import METHODS
from dynamics.integrators import Method, Problem, Step, call, each, measured
from tests.dynamics.planet import PERIHELION, planet, position
from tests.dynamics.step_options import ADAPTIVE
from tests.each_row import each_row

OWN, EQUAL = "own", "own, equal"
DRIVEN = dyn.OdeSystem(lambda x, t, p: [x[1], cg.cos(t) - p["k"] * cg.sin(x[0])], ["a", "b"], {"k": 2.0})
START = [0.5, 0.1]


def parabola(problem: Problem) -> Step:
    """x + h f + h^2/2 df/dt, the derivative along the motion; the error by the rate at the end."""
    along = cg.jvp(problem.rate, [*problem.states, "t"])
    return Step(
        start=[call(lambda: {"one": 1.0})],
        rates=[Call(problem.rate, ("x", "t", "p"), ("f",)), Call(along, ("x", "t", "p", "f", "one"), ("g",))],
        body=[each(lambda x, h, f, g: {"x_new": x + h * (f + 0.5 * h * g)})],
        error=[
            call(lambda t, h: {"later": t + h}),
            Call(problem.rate, ("x_new", "later", "p"), ("last",)),
            each(lambda h, f, g, last: {"missed": h * (last - f - h * g) / 3.0}),
            *measured("missed", problem.size),
        ],
        estimate=3,
        dense=[each(lambda h, f, g: {"dense1": h * f, "dense2": 0.5 * h * h * g})],
    )


@pytest.fixture(autouse=True)
def own() -> Iterator[None]:
    with patch.dict(METHODS, **{OWN: Method(2, parabola, adaptive=True), EQUAL: Method(2, parabola)}):
        yield


def exact(k: float = 2.0, start: Any = START) -> Any:
    return dyn.simulate(DRIVEN, start, None, 1.0, "dop853", rtol=1e-13, atol=1e-13, parameters={"k": k}).q[-1]


def test_equal_steps() -> None:
    errors = [
        abs(dyn.simulate(DRIVEN, START, None, 1.0, EQUAL, dt=dt).q[-1] - exact()).max() for dt in (0.02, 0.01, 0.005)
    ]
    assert [a / b for a, b in itertools.pairwise(errors)] == approx([4.0, 4.0], rel=0.1)
    assert dyn.simulate(DRIVEN, START, None, 1.0, EQUAL, dt=0.01, estimate_error=False).stats.nfev == 100


def test_chosen_steps_and_what_lies_between_them() -> None:
    times = np.linspace(0.0, 1.0, 14)
    rows = dyn.simulate(DRIVEN, START, None, 1.0, "dop853", rtol=1e-12, atol=1e-12, t_eval=times).q
    errors, steps = [], []
    for rtol in (1e-4, 1e-7):
        run = dyn.simulate(DRIVEN, START, None, 1.0, OWN, rtol=rtol, atol=rtol, t_eval=times)
        errors.append(abs(run.q - rows).max() / rtol)
        steps.append(run.stats.steps)
    assert max(errors) < 2.0 * max(steps)  # a tolerance a step
    assert steps[1] / steps[0] == approx(10.0, rel=0.2)  # the third root


@mark.parametrize("method", [OWN, EQUAL])
def test_derivatives(method: str) -> None:
    result = dyn.gradient(DRIVEN, lambda x, t: x[0] * x[0] + x[1], START, None, 1.0, method, rtol=1e-6, wrt=["q", "k"])

    def loss(x: Any) -> float:
        return float(x[0] * x[0] + x[1])

    d = 1e-4
    by_start = [
        (loss(exact(start=np.add(START, e))) - loss(exact(start=np.subtract(START, e)))) / (2 * d)
        for e in d * np.eye(2)
    ]
    assert result["q"] == approx(by_start, rel=1e-3)
    assert result["k"] == approx((loss(exact(2.0 + d)) - loss(exact(2.0 - d))) / (2 * d), rel=1e-3)


def test_without_dense_output_of_its_own_it_is_the_cubic_through_states_and_rates() -> None:
    method = Method(2, lambda problem: replace(parabola(problem), dense=()), adaptive=True)
    times = np.linspace(0.0, 1.0, 14)
    with patch.dict(METHODS, cubic=method):
        runs = [
            dyn.simulate(planet(), *PERIHELION, 1.0, name, rtol=1e-7, atol=1e-7, t_eval=times)
            for name in (OWN, "cubic")
        ]
    assert [run.stats.steps for run in runs] == [runs[0].stats.steps] * 2
    truth = np.array([position(t) for t in times])
    assert abs(runs[1].q - truth).max() < 1e-4
    assert abs(runs[1].q - runs[0].q)[1:-1].max() < 1e-4


NOTHING_NEW = [each(lambda x: {"x": x})]


@each_row(
    ("changes", "message", "adaptive"),
    [
        ({"error": ()}, "needs their error", True),
        ({"estimate": 0}, "needs their error", True),
        ({"body": []}, "a step has to write register 'x_new'", False),
        ({"body": NOTHING_NEW}, "a step has to write register 'x_new'", False),
        ({"lengths": {"status": 1}}, "a step cannot have a register 'status'", True),
        ({"lengths": {"count": 1}}, "a step cannot have a register 'count'", False),
    ],
)
def test_a_step_that_cannot_be_is_refused(changes: dict[str, Any], message: str, adaptive: bool) -> None:
    def wrong(problem: Problem) -> Step:
        right = parabola(problem)
        return replace(right, **changes)

    with patch.dict(METHODS, wrong=Method(2, wrong, adaptive)):
        for run in (dyn.simulate, lambda *given: dyn.gradient(given[0], lambda x, t: x[0], *given[1:])):
            with raises(ValueError, match=message):
                run(DRIVEN, START, None, 1.0, "wrong")


@mark.parametrize("name", ADAPTIVE)
def test_equal_steps_of_a_method_that_chooses_them(name: str) -> None:
    """Its order, of the one step; Taylor's method then takes the highest that it has."""
    given: dict[str, Any] = {"method": "equal", "estimate_error": False}
    with patch.dict(METHODS, equal=Method(METHODS[name].order, METHODS[name].step)):
        runs = [dyn.simulate(DRIVEN, START, None, 1.0, dt=dt, **given).q[-1] for dt in (0.25, 0.125)]
    errors = [abs(each - exact()).max() for each in runs]
    order = math.log2(errors[0] / errors[1]) if errors[1] > 1e-13 else math.inf
    assert order > METHODS[name].order - 0.5
    assert errors[1] < 1e-6


@mark.parametrize("name", [OWN, *ADAPTIVE])
def test_equal_steps_see_forces_that_change_between_them(name: str) -> None:
    """The slope at the end of a step is not the first of the next, whose forces are others."""
    arm = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + cg.cos(q[0]), ["a"])
    forces = {"tau": dyn.SampledController(lambda q, qd, t: [-40.0 * q[0] - 4.0 * qd[0]], 0.1)}
    exact = dyn.simulate(arm, [1.0], [0.0], 1.0, "dop853", rtol=1e-12, atol=1e-12, **forces).q[-1, 0]
    with patch.dict(METHODS, equal=Method(METHODS[name].order, METHODS[name].step)):
        run = dyn.simulate(arm, [1.0], [0.0], 1.0, "equal", dt=2e-3, estimate_error=False, **forces)
    assert run.q[-1, 0] == approx(exact, abs=1e-5)  # of a parabola; a slope from before the change is off by 1e-3
