"""simulate_many: every trajectory is its own, whoever runs it and whatever its neighbors do."""

import math
import warnings
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any
from unittest.mock import patch

import numpy as np
from hypothesis import given, strategies as st
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics import METHODS, System, as_system, simulate_many
from dynamics.simulation.ensembles import task
from dynamics.simulation.steps.equal_steps import even_steps
from tests.dynamics.models import arms, oscillator, random_arm, same
from tests.dynamics.simulation.test_lanes import COUNT, LANES
from tests.dynamics.simulation.test_simulate import runaway
from tests.dynamics.step_options import LIKE_OTHERS, step
from tests.early_end import stops
from tests.slow import slow

RK4_ERROR = 1e-11  # of a period at dt = 1 ms: (w dt)^4 w t / 120
VERLET_ERROR = 1e-6  # (w dt)^2 w t / 24
TOLERANCE_ERROR = 1e-6  # of steps chosen with rtol = 1e-8
ROUNDING = 1e-12  # of a thousand steps of an arm that swings
TURNS = 0.05  # relative, of iterations down to rounding: sines in vectors are rounded otherwise
SPACING = 1e-12  # relative, of differences of rounded times
INSTANT = 1e-14  # of sums of rounded times, relative
TIMES = [0.0, 0.1, 0.25, 1.0]


@mark.parametrize(
    ("method", "error"),
    [("rk4", RK4_ERROR), ("verlet", VERLET_ERROR), ("gauss4", RK4_ERROR), ("dopri5", TOLERANCE_ERROR)],
)
def test_starts_forces_and_parameters_are_each_trajectory_s_own(method: str, error: float) -> None:
    """m x'' = tau - k x, in closed form."""
    rng = np.random.default_rng(0)
    q, qd, tau, k = rng.normal(size=(4, 11, 1))
    k = 2.0 + np.abs(k[:, 0])
    result = simulate_many(oscillator(), q, qd, 1.0, method, tau=tau, parameters={"k": k, "m": 1.5}, t_eval=TIMES)
    w, middle, t = np.sqrt(k / 1.5)[:, None], tau / k[:, None], result.t
    assert result.q[:, :, 0] == approx(middle + (q - middle) * np.cos(w * t) + qd / w * np.sin(w * t), abs=error)
    assert result.qd[:, :, 0] == approx(-w * (q - middle) * np.sin(w * t) + qd * np.cos(w * t), abs=2 * error)
    assert (result.t.tolist(), result.q.shape) == (TIMES, (11, 4, 1))
    assert result.stats.success.all()
    assert set(result.stats.message) == {"reached t_end"}


@mark.parametrize(
    ("model", "method"),
    [
        *((oscillator(), method) for method in METHODS if method not in LIKE_OTHERS),
        *((random_arm(2), method) for method in ("rk4", "verlet", "dopri5")),
        *slow(*[(oscillator(), method) for method in LIKE_OTHERS]),
    ],
)
def test_every_method_gives_what_simulate_gives(model: Any, method: str) -> None:
    q, qd = np.random.default_rng(1).normal(size=(2, 9, len(as_system(model).coordinates)))
    result = simulate_many(model, q, qd, 0.3, method, **step(method, 0.01), t_eval=[0.1, 0.2, 0.3])
    for k in (0, 4, 8):  # the first and the last vector, and what is over
        one = dyn.simulate(model, q[k], qd[k], 0.3, method, **step(method, 0.01), t_eval=[0.1, 0.2, 0.3])
        assert np.hstack([result.q[k], result.qd[k]]) == approx(np.hstack([one.q, one.qd]), abs=ROUNDING)
        found = [int(each[k]) for each in (result.stats.steps, result.stats.rejected)]
        assert found == [one.stats.steps, one.stats.rejected]
        iterated = not METHODS[method].adaptive and method not in ("euler", "rk4")
        assert result.stats.nfev[k] == approx(one.stats.nfev, rel=TURNS if iterated else 0.0)
        assert result.stats.dt[k] == approx(one.stats.dt, rel=SPACING)


def test_many_steps_come_in_many_blocks() -> None:
    """Also of a force with a kink, across which all steps are looked at."""
    bent = System(lambda q, qd, t: 0.5 * qd[0] ** 2 - abs(q[0]) - 0.1 * q[0], ["x"])
    runs = [(*arms(9), times) for times in (None, [0.05, 0.2], [0.15, 0.2])] + [(bent, np.ones((9, 1)), [-9.0], [0.2])]
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        whole = [simulate_many(*run, 0.2, "rk4", t_eval=times) for *run, times in runs]
        with patch.multiple(task, PASSES=3, ROWS=200):
            blocks = [simulate_many(*run, 0.2, "rk4", t_eval=times) for *run, times in runs]
    assert all(map(same, whole, blocks))
    for one, other in zip(whole, blocks, strict=True):
        np.testing.assert_array_equal(one.stats.error, other.stats.error)


# What can go wrong on the way


@stops
@mark.parametrize(
    ("method", "count"),
    [*((method, 17) for method in ("rk4", "euler", "midpoint", "dopri5")), *product(LANES, (COUNT,))],
)
def test_one_that_leaves_the_numbers_is_nan_from_there_and_says_where(method: str, count: int) -> None:
    """v' = v^2 leaves at t = 1 / v, and is not felt by the others; so many go in lanes, whose rows are to the bit."""
    q, qd = np.random.default_rng(0).normal(size=(count, 2)), np.zeros((count, 2))
    options: dict[str, Any] = {"t_eval": np.linspace(0.0, 2.0, 21)} | (step(method, 0.01) if count == 17 else {})
    calm = simulate_many(runaway(), q, qd, 2.0, method, **options)
    wild = {4: 1.0, 9: 2.0, count - 1: 3.0}
    qd[[*wild], 1] = [*wild.values()]
    result = simulate_many(runaway(), q, qd, 2.0, method, **options)
    others = [k for k in range(count) if k not in wild]
    assert result.stats.success.tolist() == [k in others for k in range(count)]
    assert (result.q[others] == calm.q[others]).all()
    assert (result.qd[others] == calm.qd[others]).all()
    for k, v in wild.items():
        one = dyn.simulate(runaway(), q[k], qd[k], 2.0, method, **options)
        stats, rows = result.stats, int((result.t <= one.t[-1]).sum())
        found = (stats.message[k], stats.steps[k], stats.nfev[k], stats.status[k])
        assert found == (one.stats.message, one.stats.steps, one.stats.nfev, -1)
        assert ("'wild'" if method != "midpoint" else "did not converge") in one.message
        assert result.q[k, :rows] == approx(one.q[:rows], abs=ROUNDING if count == 17 else 0.0)
        assert np.isnan(result.q[k, rows:]).all()
        assert v * one.t[-1] == approx(1.0, rel=0.5 if count == 17 else 1e-6)


@stops
def test_max_steps() -> None:
    for method in ("rk4", "dop853"):
        result = simulate_many(*arms(3), 5.0, method, t_eval=[0.0, 5.0], max_steps=4)
        assert all("after max_steps = 4 steps" in each for each in result.stats.message)
        assert np.isnan(result.q[:, 1]).all()
        assert result.stats.steps.max() <= 4


Q = np.zeros((4, 2))


@mark.parametrize(
    ("q", "qd", "options", "message"),
    [
        (np.zeros((4, 3)), Q, {}, r"q must have shape \(N, 2\), or \(2,\) for all trajectories, got \(4, 3\)"),
        (Q, 0.0, {}, r"qd must have shape \(N, 2\), or \(2,\) for all trajectories, got \(\)"),
        (Q, None, {}, r"qd must have shape \(N, 2\), or \(2,\) for all trajectories, got None"),
        (Q, Q[:3], {}, "must have the same number of trajectories, got: q has 4, qd has 3"),
        (Q, Q, {"tau": np.zeros((5, 2))}, "got: q has 4, qd has 4, tau has 5"),
        (Q, Q, {"tau": [1.0]}, "tau needs one number for each of .*: 2, got 1"),
        (Q, Q, {"tau": np.full((4, 2), math.inf)}, "tau must be finite, got inf at index 0 of trajectory 0"),
        (Q + [0.0, math.nan], Q, {}, "q must be finite, got nan at index 1 of trajectory 0"),
        (Q[0], Q[0], {}, "how many trajectories"),
        (Q[:0], Q, {}, "got: q has 0, qd has 4"),
        (Q[:0], Q[:0], {}, "there must be at least one trajectory, got 0"),
        (Q, Q, {"parameters": {"k": 1.0}}, r"the system has no parameter k \(it has none\)"),
        (Q, Q, {"method": "dopri5"}, "'dopri5' chooses the steps of each trajectory: t_eval must say"),
        (Q, Q, {"dt": 1e-13}, r"4 trajectories of 9999999999991 rows of 4 numbers take 1.19e\+06 GiB, and .* free"),
        (
            Q,
            Q,
            {"workers": ThreadPoolExecutor},
            "workers must be .* or a function like map, got <class .*ThreadPoolEx",
        ),
        (Q, Q, {"workers": lambda f, each: []}, "a result for each item, as map does: of 4 trajectories came back 0"),
    ],
)
def test_what_does_not_fit_is_refused(q: Any, qd: Any, options: dict[str, Any], message: str) -> None:
    with raises((ValueError, MemoryError), match=message):
        simulate_many(random_arm(2), q, qd, 1.0, **{"method": "rk4", **options})


@mark.parametrize(
    ("value", "message"),
    [
        (np.ones(3), "got: q has 4, parameter 'k' has 3"),
        (np.ones((4, 1)), r"parameter 'k' must be a number or have shape \(N,\), got \(4, 1\)"),
        ([1.0, 1.0, math.nan, 1.0], "parameter 'k' must be finite, got nan for trajectory 2"),
        (math.inf, "parameter 'k' must be a finite number, got inf"),
    ],
)
def test_a_parameter_that_does_not_fit_is_refused(value: Any, message: str) -> None:
    with raises(ValueError, match=message):
        simulate_many(oscillator(), np.zeros((4, 1)), [0.0], 1.0, "rk4", parameters={"k": value})


@given(
    gaps=st.lists(st.sampled_from([0.1, 0.1, 0.1, 0.25, 1e-3, 7.0 / 3.0]), min_size=1, max_size=12),
    dt=st.floats(1e-2, 3.0),
)
def test_grids_meet_every_instant_in_steps_of_at_most_dt(gaps: list[float], dt: float) -> None:
    instants = np.array([0.0, *np.cumsum(gaps).tolist()])
    (grids, numbers), ends = even_steps(instants.tolist(), dt), [0.0]
    for grid in grids:
        assert grid.begin == approx(ends[-1], rel=INSTANT, abs=INSTANT)
        assert grid.h <= dt * (1 + 10.0 * SPACING)
        ends += (grid.begin + grid.h * np.arange(1.0, grid.steps + 1.0)).tolist()
    assert (np.diff(numbers) > 0).all()
    assert np.array(ends)[numbers] == approx(instants, rel=INSTANT)
    assert len(even_steps(np.linspace(0.0, 3.0, 1001).tolist(), dt)[0]) == 1


@mark.parametrize("method", ["midpoint", "gauss6", "verlet"])
def test_the_errors_of_an_ensemble_are_those_of_its_runs_when_the_first_of_them_fails(method: str) -> None:
    arm, starts = dyn.planar_arm([1.0, 0.8], [1.0, 0.8]), [[2.0, 0.5], *[[0.01 * k, 0.0] for k in range(1, 9)]]
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        fan = simulate_many(arm, starts, [0.0, 0.2], 2.0, method, dt=0.2)
        alone = [dyn.simulate(arm, start, [0.0, 0.2], 2.0, method, dt=0.2) for start in starts]
    assert fan.stats.status.tolist() == [-1, *[0] * 8]
    assert fan.stats.message == tuple([run.message for run in alone])
    np.testing.assert_array_equal(fan.stats.error[1:], [run.stats.error for run in alone[1:]])
    for states, run in zip(fan.q, alone, strict=True):
        np.testing.assert_array_equal(states[: len(run.q)], run.q)
