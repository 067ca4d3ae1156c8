"""A prepared motion: to the bit what `simulate` gives, its end alone, and its steps one by one; from threads, too."""

import math
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import mark

import dynamics as dyn
from dynamics import METHODS
from tests.dynamics.models import oscillator
from tests.dynamics.simulation.test_simulate import ARGUMENTS
from tests.dynamics.step_options import ADAPTIVE
from tests.each_row import each_row
from tests.slow import slow

EQUAL = ["rk4", "euler", "gauss4", "verlet"]
ARM = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
START = [1.0, 0.5], [0.2, -0.1]
SPAN = 0.4
WITHIN = 1e-7  # relative, of steps that are cut, at tolerances of 1e-9


def options_of(method: str) -> dict[str, Any]:
    return {} if METHODS[method].adaptive else {"dt": 0.01, "estimate_error": False}


def same(one: dyn.Trajectory, other: dyn.Trajectory) -> None:
    for name in ("t", "q", "qd", "energy"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    counts = ("steps", "rejected", "nfev", "dt", "message", "warnings")
    assert [getattr(one.stats, name) for name in counts] == [getattr(other.stats, name) for name in counts]


@mark.parametrize("method", [*ADAPTIVE, *EQUAL])
@mark.parametrize("backend", ["auto", *slow("python")])
def test_its_rows_its_end_and_its_steps_are_those_of_simulate(method: str, backend: str) -> None:
    options = {**options_of(method), "backend": backend}
    motion = dyn.prepare(ARM, method, **options)
    for t0, t_end in ((0.0, SPAN), (1.5, 1.5 - SPAN)):
        run = dyn.simulate(ARM, *START, t_end, method, t0=t0, **options)
        same(motion(*START, t_end, t0), run)
        times = np.linspace(t0, t_end, 5)
        same(
            motion(*START, t_end, t0, t_eval=times),
            dyn.simulate(ARM, *START, t_end, method, t0=t0, t_eval=times, **options),
        )
        for kind in (list, np.array):  # twice: a memory that is used is as a new one
            end = motion.end(kind(START[0]), kind(START[1]), t_end, t0)
            assert end.t == run.t[-1] == t_end
            np.testing.assert_array_equal(end.q, run.q[-1])
            np.testing.assert_array_equal(end.qd, run.qd[-1])
        going = motion.start(*START, t_end, t0)
        states = [np.concatenate([going.q, going.qd])]
        for t in run.t[1:]:
            going.step()
            states.append(np.concatenate([going.q, going.qd]))
            assert going.t == t
        np.testing.assert_array_equal(states, np.concatenate([run.q, run.qd], axis=1))
        with pytest.raises(ValueError, match=f"the motion is there, at t = {t_end:g} s"):
            going.step()


@mark.parametrize("method", [*ADAPTIVE, *EQUAL])
def test_instants_cut_its_steps(method: str) -> None:
    motion = dyn.prepare(ARM, method, **options_of(method))
    going, times = motion.start(*START), np.linspace(0.05, SPAN, 8)
    first = motion.end(*START, float(times[0]))
    for t in times.tolist():
        going.propagate_until(t)
        assert going.t == t
        if t == times[0]:
            np.testing.assert_array_equal(going.q, first.q)  # as of a motion that ends there
    error = 0.1 if method == "euler" else 1e-4 if method == "verlet" else WITHIN
    np.testing.assert_allclose(going.q, motion.end(*START, SPAN).q, rtol=error)
    where = going.q
    going.propagate_until(SPAN)  # it is there
    np.testing.assert_array_equal(going.q, where)
    with pytest.raises(ValueError, match=r"the motion is at t = 0\.4 s and does not go back to t = 0\.1 s"):
        going.propagate_until(0.1)


@mark.parametrize(
    "options",
    [
        {"dense_output": True},
        {"events": dyn.Event("low", lambda q, qd, t: q[0] - 0.9)},
        {"events": dyn.Event("low", lambda q, qd, t: q[0] - 0.9, terminal=True)},
        {"events": dyn.Event("kick", lambda q, qd, t: q[0] - 0.9, reset=lambda q, qd, t: (q, [-qd[0], qd[1]]))},
        {"tau": lambda q, qd, t: [-3.0 * qd[0], 0.1 * t]},
        {"tau": dyn.SampledController(lambda q, qd, t: -2.0 * qd, period=0.05)},
        {"tau": [0.1, 0.2], "form": "momentum"},
        {"method": "rk4", "dt": 0.01},
        {"max_steps": 5},
    ],
    ids=" ".join,
)
def test_whatever_is_fixed(options: dict[str, Any]) -> None:
    motion = dyn.prepare(ARM, **options)
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        run = dyn.simulate(ARM, *START, SPAN, **options)
        same(motion(*START, SPAN), run)
        assert {name: each.t.tolist() for name, each in run.events.items()} == {
            name: each.t.tolist() for name, each in motion(*START, SPAN).events.items()
        }
        if not run.success:
            with pytest.raises(dyn.MotionError, match=f"the motion did not reach t_end, {run.message}"):
                motion.end(*START, SPAN)
            return
        end = motion.end(*START, SPAN)
    assert end.t == run.t[-1]
    np.testing.assert_array_equal(end.q, run.q[-1])
    np.testing.assert_array_equal(end.qd, run.qd[-1])


@mark.parametrize("method", ADAPTIVE)
@mark.parametrize(
    "options",
    [
        {},
        {"max_steps": 9},
        {"rtol": 1e-17, "atol": 1e-30},
        {"tau": dyn.SampledController(lambda q, qd, t: -2.0 * qd, period=0.05)},
    ],
    ids=" ".join,
)
def test_ends_alone_are_those_of_all_steps(method: str, options: dict[str, Any]) -> None:
    """Such a run records no step; it is one of as many steps, and stops and warns in the same words."""
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        ends = dyn.simulate(ARM, *START, SPAN, method, t_eval=[0.0, SPAN], **options)
        whole = dyn.simulate(ARM, *START, SPAN, method, **options)
    assert (ends.t.tolist(), ends.q.tolist()) == (whole.t[[0, -1]].tolist(), whole.q[[0, -1]].tolist())
    counts = ("steps", "rejected", "nfev", "njev", "nlu", "dt", "message", "warnings")
    assert [getattr(ends.stats, name) for name in counts] == [getattr(whole.stats, name) for name in counts]


def test_a_linkage_goes_on_step_by_step() -> None:
    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1]

    rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": 0.5 * (q[0] ** 2 + q[1] ** 2 - 1.0)})
    run = dyn.simulate(rod, [1.0, 0.0], [0.0, 0.0], 1.0)
    going = dyn.prepare(rod).start([1.0, 0.0], [0.0, 0.0], 1.0)
    for q in run.q[1:]:
        going.step()
        np.testing.assert_array_equal(going.q, q)
    np.testing.assert_array_equal(dyn.prepare(rod).end([1.0, 0.0], [0.0, 0.0], 1.0).q, run.q[-1])


def test_parameters_are_those_of_the_call() -> None:
    pendulum = dyn.System(
        lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["stiffness"] * q[0] ** 2, ["angle"], parameters={"stiffness": 1.0}
    )
    motion = dyn.prepare(pendulum)
    for value in (None, 1.0, 4.0, 1.0):
        parameters = None if value is None else {"stiffness": value}
        run = dyn.simulate(pendulum, [0.1], [0.0], 1.0, parameters=parameters)
        same(motion([0.1], [0.0], 1.0, parameters=parameters), run)
        np.testing.assert_array_equal(motion.end([0.1], [0.0], 1.0, parameters=parameters).q, run.q[-1])
    for wrong in ({"stifness": 1.0}, {"stiffness": "much"}, [1.0]):
        with pytest.raises((TypeError, ValueError), match="parameter"):
            motion.end([0.1], [0.0], 1.0, parameters=wrong)  # type: ignore[arg-type]


@mark.parametrize(
    "options", [{}, {"method": "rk4", "dt": 0.01, "estimate_error": False}, {"form": "momentum"}], ids=str
)
def test_varied_parameters_stay_open(options: dict[str, Any]) -> None:
    pendulum = dyn.System(
        lambda q, qd, t, p: 0.5 * p["inertia"] * qd[0] ** 2 - p["stiffness"] * q[0] ** 2,
        ["angle"],
        parameters={"stiffness": 1.0, "inertia": 1.0},
    )

    def servo(q: Any, qd: Any, t: Any, p: Any) -> Any:
        return [-p["gain"] * qd[0]]

    low = dyn.Event("low", lambda q, qd, t, p: q[0] - 0.01 * p["stiffness"])
    motion = dyn.prepare(pendulum, varied=["stiffness", "gain"], tau=servo, **options)
    watched = dyn.prepare(pendulum, varied=["stiffness", "gain"], tau=servo, events=low, dense_output=True, **options)
    for k, gain in ((1.0, 0.1), (4.0, 0.2), (1.0, 0.1)):
        parameters = {"stiffness": k, "gain": gain, "inertia": 2.0}
        run = dyn.simulate(pendulum, [0.1], [0.0], 1.0, tau=servo, parameters=parameters, events=low, **options)
        other = watched([0.1], [0.0], 1.0, parameters=parameters)
        for name in ("q", "qd", "energy", "forces"):
            np.testing.assert_allclose(getattr(other, name)[-1], getattr(run, name)[-1], rtol=WITHIN, err_msg=name)
        np.testing.assert_allclose(other.events["low"].t, run.events["low"].t, rtol=WITHIN)
        np.testing.assert_allclose(other.solution(0.5)[1], watched([0.1], [0.0], 0.5, parameters=parameters).qd[-1])
        alone = motion([0.1], [0.0], 1.0, parameters=parameters)
        np.testing.assert_array_equal(motion.end([0.1], [0.0], 1.0, parameters=parameters).q, alone.q[-1])
    for wrong, sentence in (
        ({"stiffness": 1.0}, "'gain' of the controller needs"),
        ({"gain": math.nan}, "finite number"),
    ):
        for call in (motion, motion.end):
            with pytest.raises(ValueError, match=sentence):
                call([0.1], [0.0], 1.0, parameters=wrong)
    with pytest.raises(ValueError, match="no parameter"):
        dyn.prepare(pendulum, varied=["mass"]).end([0.1], [0.0], 1.0)


def test_threads_have_a_memory_each() -> None:
    motion = dyn.prepare(ARM, "taylor")
    starts = [[0.1 * k, -0.05 * k] for k in range(1, 40)]
    alone = [motion.end(q, [0.0, 0.0], SPAN).q.tolist() for q in starts]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda q: motion.end(q, [0.0, 0.0], SPAN).q.tolist(), starts))
    assert together == alone


@mark.parametrize("named", [{}, {"events": dyn.Event("low", lambda q, qd, t: q[0] + 9.0)}, {"varied": ["k"]}])
def test_prepare_makes_the_machine_code(named: dict[str, Any]) -> None:
    spring = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2, "x", {"k": 1.0})
    motion = dyn.prepare(spring, **named)
    with patch("dynamics.simulation.steps.step_program.runner", side_effect=AssertionError("compiled in a call")):
        end = motion.end([1.0], [0.0], 1.0, parameters={"k": 4.0} if "varied" in named else None)
        assert motion([1.0], [0.0], 1.0, parameters={"k": 4.0} if "varied" in named else None).success
    assert end.q[0] == pytest.approx(np.cos(2.0 if "varied" in named else 1.0))


@mark.parametrize("method", ["dop853", "rk4"])
def test_ctrl_c_ends_a_long_run(method: str, ctrl_c: Any) -> None:
    motion = dyn.prepare(ARM, method, **options_of(method))
    end = motion.end(*START, SPAN)
    ctrl_c(0.3)
    with pytest.raises(KeyboardInterrupt):
        motion.end(*START, 1e7)
    np.testing.assert_array_equal(motion.end(*START, SPAN).q, end.q)  # the memory is as good as before


@each_row(
    ("method", "given", "message"),
    [
        (method, given, message)
        for method in ("dop853", "rk4")
        for given, message in ARGUMENTS
        if set(given) <= {"q", "qd", "t_end", "t0"} and given.get("t_end", 1.0) is not None
    ],
)
def test_wrong_starts_are_refused_in_the_words_of_simulate(method: str, given: dict[str, Any], message: str) -> None:
    motion = dyn.prepare(oscillator(), method, **options_of(method))
    start = {"q": [1.0], "qd": [0.0], "t_end": 1.0, "t0": 0.0} | given
    for call in (motion, motion.end, motion.start):
        with pytest.raises((TypeError, ValueError), match=message):
            call(**start)


@mark.parametrize("method", [*ADAPTIVE, "rk4"])
def test_an_end_that_is_not_reached_is_an_error_in_the_words_of_simulate(method: str) -> None:
    runaway = dyn.OdeSystem(lambda x, t: [x[0] * x[0]], ["x"])
    motion = dyn.prepare(runaway, method, **options_of(method))
    with pytest.warns(dyn.SimulationWarning):
        message = dyn.simulate(runaway, [1.0], None, 2.0, method, **options_of(method)).message
    with pytest.raises(dyn.MotionError) as caught:
        motion.end([1.0], None, 2.0)
    assert str(caught.value) == f"the motion did not reach t_end, {message}"
    going = motion.start([1.0], None)
    with pytest.raises(dyn.MotionError) as caught:
        going.propagate_until(2.0)
    assert str(caught.value) == f"the motion {message}"
    assert math.isfinite(going.q[0])
    assert motion.end([1.0], None, 0.5).t == 0.5  # the memory is as good as before


def test_single_steps_are_of_plain_motions() -> None:
    refused: list[dict[str, Any]] = [{"max_steps": 3}, {"form": "momentum"}]
    for options in refused:
        with pytest.raises(ValueError, match="single steps are of motions without"):
            dyn.prepare(ARM, **options).start(*START)
    with pytest.raises(ValueError, match="was started without one"):
        dyn.prepare(ARM).start(*START).step()
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="t must be finite"):
            dyn.prepare(ARM).start(*START).propagate_until(wrong)


FIXED = {"method", "dt", "rtol", "max_steps", "max_step", "first_step"}
SHORT = (1e-17, 1e-13)  # beside the span of a run, which is not known yet
OWN: list[tuple[dict[str, Any], str]] = [
    ({"varied": ["unknown"]}, "varied: the system has no parameter 'unknown'; it has "),
]


@each_row(
    ("given", "message"), [row for row in ARGUMENTS if {*row[0]} <= FIXED and row[0].get("dt") not in SHORT] + OWN
)
def test_what_is_fixed_is_checked_at_once(given: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        dyn.prepare(oscillator(), **{"method": "rk4", "dt": 0.1} | given)
