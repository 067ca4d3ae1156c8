"""Gradients are of the default method of `simulate`, or of equal steps that say how far off they are."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph.util.caches import kept_results
from tests.dynamics.step_options import EQUAL
from tests.each_row import each_row
from tests.slow import slow

RIGHT = 1e-2  # relative: a slope that needs no word
USUAL = "euler rk4 verlet midpoint gauss4".split()


def said(run: Callable[[], Any]) -> tuple[Any, list[str]]:
    """A result, and its warnings, each of which is at the caller's line."""
    with warnings.catch_warnings(record=True, action="always") as caught:
        result = run()
    assert all(each.category is dyn.SimulationWarning for each in caught)
    assert all(each.filename == __file__ for each in caught)
    return result, [str(each.message) for each in caught]


SPRING = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 0.5 * p["w"] ** 2 * q[0] ** 2, ["x"], {"w": 2.0})


def end(q: Any, qd: Any, t: Any) -> Any:
    return q[0]


@mark.parametrize("form", ["velocity", "momentum"])
@mark.parametrize("method", [*USUAL, *slow(*[name for name in EQUAL if name not in USUAL])])
def test_no_equal_steps_have_wrong_slopes_in_silence(method: str, form: str) -> None:
    """A spring of any stiffness, in any unit, with torques of every step or without, alone and among others."""
    rng = np.random.default_rng(len(method))
    for _ in range(2):
        rate, unit = 10.0 ** rng.uniform(0.0, 4.0), 10.0 ** rng.uniform(-6.0, 6.0)
        given: dict[str, Any] = {"method": method, "form": form, "wrt": ["q", "tau"]}
        given["parameters"] = {"w": rate}
        given["t_end"], q, qd = 0.2, [unit], [0.0]
        equal: dict[str, Any] = {"dt": 2e-3}
        runs: list[Any] = [
            partial(dyn.gradient, SPRING, end, q, qd, **equal, **given),
            partial(dyn.gradient, SPRING, end, q, qd, tau=np.zeros((100, 1)), **given),
            partial(dyn.sensitivities, SPRING, q, qd, **equal, **given),
            partial(dyn.gradient_many, SPRING, end, [q] * 2, qd, **equal, **given),
        ]
        for k, run in enumerate(runs):
            try:
                result, words = said(run)
            except dyn.MotionError:  # which is heard
                continue
            by_q, by_tau = np.atleast_2d(result["q"][-1]), result["tau"][-1]
            by_tau = result["tau"].sum() if k == 1 else np.ravel(by_tau)[0]
            off = [np.ravel(by_q)[0] - np.cos(0.2 * rate), by_tau * rate**2 - (1.0 - np.cos(0.2 * rate))]
            assert np.abs(off).max() <= RIGHT or words, (k, rate, off)


def test_what_chosen_steps_say_is_what_simulate_says() -> None:
    """The steps and the words of `simulate`, also with parameters and events, and back in time."""
    stiff = dyn.OdeSystem(lambda x, t, p: [-p["k"] * (x[0] - cg.cos(t))], ["x"], {"k": 1e5})
    given: dict[str, Any] = {"t_end": 0.1, "method": "dopri5", "parameters": {"k": 2e5}}
    run, words = said(lambda: dyn.simulate(stiff, [1.0], None, **given))
    result, others = said(lambda: dyn.gradient(stiff, lambda x, t: x[0], [1.0], None, **given))
    assert (len(words), words == others, len(result.t)) == (1, True, len(run.t))
    up = dyn.Event("up", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.5 * qd[0]]))
    ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"])
    for method in ("dop853", "rk4"):
        thrown = dyn.gradient(ball, lambda q, qd, t: q[0], [1.0], [0.0], 1.2, method, events=up)
        moved = dyn.simulate(ball, [1.0], [0.0], 1.2, method, events=up)
        assert np.unique(moved.t) == approx(np.unique(thrown.t))
    back = dyn.gradient(ball, lambda q, qd, t: q[0], [1.0], [0.0], t_span=(1.0, 0.0))
    assert (back["q"], back["qd"]) == (approx([1.0]), approx([-1.0]))


def test_the_default_is_that_of_simulate_and_equal_steps_where_they_are_asked_for() -> None:
    model, start = SPRING, ([1.0], [0.0], 1.0)
    chosen = dyn.simulate(model, *start).t
    assert dyn.gradient(model, end, *start).t.tolist() == chosen.tolist()
    assert dyn.sensitivities(model, *start).t.tolist() == chosen.tolist()
    assert dyn.gradient_many(model, end, [[1.0], [2.0]], [0.0], 1.0).t.tolist() == [0.0, 1.0]
    for equal in ({"dt": 0.1}, {"tau": np.zeros((10, 1))}):
        one, named = (dyn.gradient(model, end, *start, *by, **equal) for by in ([], ["rk4"]))
        assert (len(one.t), one["q"].tolist()) == (11, named["q"].tolist())
    assert len(dyn.gradient_many(model, end, [1.0], [0.0], 1.0, tau=np.zeros((2, 10, 1))).t) == 11
    with raises(ValueError, match="method 'dop853' keeps the error of its steps"):
        dyn.gradient(model, end, *start, estimate_error=True)


def test_other_parameters_make_no_steps_anew() -> None:
    def slope(k: float) -> float:
        given: dict[str, Any] = {"parameters": {"w": k}, "tau": [k], "wrt": "w", "backend": "python"}
        one = dyn.gradient(SPRING, end, [1.0], [0.0], 1.0, **given)["w"]
        many = dyn.gradient_many(SPRING, end, [[1.0]], [0.0], 1.0, **given)["w"][0]
        assert many == approx(one, rel=1e-12)
        return float(one)

    first, made = slope(4.0), kept_results()
    assert slope(5.0) != first
    assert kept_results() == made


def test_a_loss_that_is_no_number_is_said() -> None:
    def none(q: Any, qd: Any, t: Any) -> Any:
        return cg.sqrt(q[0] - 10.0)

    def running(q: Any, qd: Any, tau: Any, t: Any) -> Any:
        return cg.log(q[0] - 10.0)

    def root(q: Any, qd: Any, t: Any) -> Any:
        return cg.sqrt(q[0])

    for method in ("dop853", "rk4"):
        given: dict[str, Any] = {"t_end": 0.1, "backend": "python", "method": method}
        result, words = said(partial(dyn.gradient, SPRING, none, [0.5], [0.0], **given))
        assert (np.isnan(result.value), words) == (True, ["the loss is nan of a motion that is finite"])
        result, words = said(partial(dyn.gradient, SPRING, None, [0.5], [0.0], running=running, **given))
        assert (np.isnan(result.value), words) == (True, ["the loss is nan of a motion that is finite"])
        result, words = said(partial(dyn.gradient, SPRING, root, [0.0], [0.0], wrt="qd", **given))
        assert (result.value, words) == (0.0, ["the loss is 0, and its gradient by 'qd' is not finite"])
        many, words = said(partial(dyn.gradient_many, SPRING, root, [[0.5], [-0.5], [-0.6]], [0.0], **given))
        assert np.isnan(many.value).tolist() == [False, True, True]
        assert words == ["2 of 3 motions doubtful: motion 1: the loss is nan of a motion that is finite"]


@patch("dynamics.simulation.gradients.differentiated_run.PIECE", 16)
def test_a_motion_that_does_not_arrive_is_told_with_time_and_coordinate() -> None:
    """`gradient` raises, in the words of `simulate`; `gradient_many` gives NaN, and the others are as alone."""

    def end(x: Any, t: Any) -> Any:
        return x[0]

    model = dyn.OdeSystem(lambda x, t: [x[0] ** 2, 1.0], ["x", "clock"])
    steps = {"rk4": 1e-3, "gauss4": 1e-2}
    for method in ("rk4", "dop853", "radau", "gauss4"):
        given: dict[str, Any] = {"dt": steps[method], "estimate_error": False} if method in steps else {}
        for start in ([1.0, 0.0], [2.0, 0.0]):
            run, _ = said(partial(dyn.simulate, model, start, None, 2.0, method, **given))
            with raises(dyn.MotionError) as caught:
                dyn.gradient(model, end, start, None, 2.0, method, **given)
            assert not run.success
            if method != "gauss4":  # whose equations are solved more exactly here
                assert run.message in str(caught.value)
        starts = [[0.1, 0.0], [1.0, 0.0], [0.2, 0.0], [2.0, 0.0]]
        many, words = said(partial(dyn.gradient_many, model, end, starts, None, 2.0, method, **given))
        assert len(words) == 1
        assert words[0].startswith("2 of 4 motions stopped early: motion 1: the motion ")
        assert "stopped at t = " in words[0]
        for k in (0, 2):
            alone = dyn.gradient(model, end, starts[k], None, 2.0, method, **given)
            assert (many.value[k], many["q"][k].tolist()) == (approx(alone.value), approx(alone["q"].tolist()))
        for array in (many.value, many["q"], many.q):
            assert np.isnan(array[[1, 3]]).all()


@mark.parametrize("method", ["dop853", "rk4"])
@each_row("derive", [dyn.gradient, dyn.gradient_many, dyn.sensitivities])
def test_ctrl_c_is_a_keyboard_interrupt(derive: Any, method: str, ctrl_c: Any) -> None:
    loss = [] if derive is dyn.sensitivities else [end]
    start = [[1.0]] if derive is dyn.gradient_many else [1.0]
    events = {} if derive is dyn.gradient_many else {"events": dyn.Event("late", lambda q, qd, t: t - 500.0)}
    ctrl_c(0.3)
    with raises(KeyboardInterrupt):
        derive(SPRING, *loss, start, [0.0], 1e3 if method == "rk4" else 1e5, method, backend="python", **events)


@mark.parametrize("given", [{}, {"method": "rk4", "dt": 1e-3, "estimate_error": False}])
def test_a_gradient_that_grew_beyond_all_tolerances_is_said(given: dict[str, Any]) -> None:
    """Lorenz's equations for 60 s, of which no number is known; not for 3 s, nor a harmonic motion of any length."""
    rate = lambda x, t: [10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]]  # noqa: E731
    lorenz, loss, start = dyn.OdeSystem(rate, ["x", "y", "z"]), (lambda x, t: x[0]), [1.0, 1.0, 1.0]
    for t_end, chaotic in ((3.0, False), (60.0, True)):
        result, texts = said(lambda t_end=t_end: dyn.gradient(lorenz, loss, start, None, t_end, **given))
        assert any("the motion is chaotic, or nearly so" in text for text in texts) == chaotic
        assert (np.abs(result["q"]).max() > 1e12) == chaotic
        _, texts = said(lambda t_end=t_end: dyn.gradient_many(lorenz, loss, [start], None, t_end, **given))
        assert any("the motion is chaotic, or nearly so" in text for text in texts) == chaotic
    spring = dyn.OdeSystem(lambda x, t: [x[1], -x[0]], ["x", "v"])
    for running in (None, lambda x, t: x[0] ** 2):
        assert said(lambda r=running: dyn.gradient(spring, loss, [1e-6, 0.0], None, 60.0, running=r, **given))[1] == []
