"""A method of a reader's own is one step: by equal steps and chosen ones, between their ends, and differentiated."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph.extend import Call, Map
from dynamics.integrators import METHODS, Method, Problem, Step, measured
from tests.dynamics.planet import PERIHELION, planet, position

OWN, EQUAL = "own", "own, equal"
DRIVEN = dyn.OdeSystem(lambda x, t, p: [x[1], cg.cos(t) - p["k"] * cg.sin(x[0])], ["a", "b"], {"k": 2.0})
START = [0.5, 0.1]
ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]


def parabola(problem: Problem) -> Step:
    """x + h f + h^2/2 df/dt, the derivative along the motion; the error by the rate at the end."""
    m, (x, h, f, g, last, t) = problem.size, cg.variables("x h f g last t")
    along = cg.jvp(problem.rate, [*problem.states, "t"])
    later = cg.Graph([t, h], {"later": t + h})
    arrival = cg.Graph([x, h, f, g], {"x_new": x + h * (f + 0.5 * h * g)})
    missed = cg.Graph([h, f, g, last], {"missed": h * (last - f - h * g) / 3.0})
    powers = cg.Graph([h, f, g], {"s": h * f, "s^2": 0.5 * h * h * g})
    return Step(
        lengths={**dict.fromkeys(("f", "g", "last", "missed"), m), "one": 1, "later": 1, "sum": 1},
        start=[Call(cg.Graph([], {"one": 1.0}), (), ("one",))],
        rates=[Call(problem.rate, ("x", "t", "p"), ("f",)), Call(along, ("x", "t", "p", "f", "one"), ("g",))],
        body=[Map(arrival, ("x", "h", "f", "g"), ("x_new",))],
        error=[
            Call(later, ("t", "h"), ("later",)),
            Call(problem.rate, ("x_new", "later", "p"), ("last",)),
            Map(missed, ("h", "f", "g", "last"), ("missed",)),
            *measured("missed", m),
        ],
        estimate=3,
        dense=[Map(powers, ("h", "f", "g"), ("dense1", "dense2"))],
    )


@pytest.fixture(autouse=True)
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, OWN, Method(2, parabola, adaptive=True, degree=2))
    monkeypatch.setitem(METHODS, EQUAL, Method(2, parabola))


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


def test_without_dense_output_of_its_own_it_is_the_cubic_through_states_and_rates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    method = Method(2, lambda problem: replace(parabola(problem), dense=()), adaptive=True)
    monkeypatch.setitem(METHODS, "cubic", method)
    times = np.linspace(0.0, 1.0, 14)
    runs = [
        dyn.simulate(planet(), *PERIHELION, 1.0, name, rtol=1e-7, atol=1e-7, t_eval=times) for name in (OWN, "cubic")
    ]
    assert [run.stats.steps for run in runs] == [runs[0].stats.steps] * 2
    truth = np.array([position(t) for t in times])
    assert abs(runs[1].q - truth).max() < 1e-4
    assert abs(runs[1].q - runs[0].q)[1:-1].max() < 1e-4


@mark.parametrize("lacking", [{"error": ()}, {"estimate": 0}])
def test_a_step_without_an_estimate_cannot_be_chosen(lacking: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "blind", Method(2, lambda problem: replace(parabola(problem), **lacking), True))
    with raises(ValueError, match="needs their error"):
        dyn.simulate(DRIVEN, START, None, 1.0, "blind")


@mark.parametrize("body", [[], [Map(cg.Graph([cg.variable("x")], {"y": cg.variable("x")}), ("x",), ("x",))]])
def test_a_step_that_does_not_make_x_new_is_refused(body: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, EQUAL, Method(2, lambda problem: replace(parabola(problem), body=body)))
    for run in (dyn.simulate, lambda *given: dyn.gradient(given[0], lambda x, t: x[0], *given[1:])):
        with raises(ValueError, match="a step has to write register 'x_new'"):
            run(DRIVEN, START, None, 1.0, EQUAL)


@mark.parametrize(("taken", "method"), [("status", OWN), ("count", EQUAL)])
def test_a_register_of_the_run_s_name_is_refused(taken: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def clash(problem: Problem) -> Step:
        step = parabola(problem)
        return replace(step, lengths={**step.lengths, taken: 1})

    monkeypatch.setitem(METHODS, method, replace(METHODS[method], step=clash))
    with raises(ValueError, match=f"a step cannot have a register '{taken}'"):
        dyn.simulate(DRIVEN, START, None, 1.0, method, dt=None if method == OWN else 0.1)


@mark.parametrize("name", ADAPTIVE)
def test_equal_steps_of_a_method_that_chooses_them(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its order, of the one step; Taylor's method then takes the highest that it has."""
    monkeypatch.setitem(METHODS, "equal", Method(METHODS[name].order, METHODS[name].step))
    runs = [dyn.simulate(DRIVEN, START, None, 1.0, "equal", dt=dt, estimate_error=False).q[-1] for dt in (0.25, 0.125)]
    errors = [abs(each - exact()).max() for each in runs]
    order = math.log2(errors[0] / errors[1]) if errors[1] > 1e-13 else math.inf
    assert order > METHODS[name].order - 0.5
    assert errors[1] < 1e-6


@mark.parametrize("name", [OWN, *ADAPTIVE])
def test_equal_steps_see_forces_that_change_between_them(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The slope at the end of a step is not the first of the next, whose forces are others."""
    monkeypatch.setitem(METHODS, "equal", Method(METHODS[name].order, METHODS[name].step))
    arm = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + cg.cos(q[0]), ["a"])
    forces = {"tau": dyn.SampledController(lambda q, qd, t: [-40.0 * q[0] - 4.0 * qd[0]], 0.1)}
    runs = [
        dyn.simulate(arm, [1.0], [0.0], 1.0, method, **options, **forces).q[-1, 0]
        for method, options in (
            ("dop853", {"rtol": 1e-12, "atol": 1e-12}),
            ("equal", {"dt": 2e-3, "estimate_error": False}),
        )
    ]
    assert runs[1] == approx(runs[0], abs=1e-5)  # of a parabola; a slope from before the change is off by 1e-3
