"""The error of equal steps is told with the result, in every unit, and a warning says where it is too large."""

import itertools
import math
import warnings
from functools import cache
from typing import Any

import numpy as np
from hypothesis import given, strategies as st
from pytest import approx, mark, raises, warns

import cgraph as cg
import dynamics as dyn
from dynamics.simulation.error_estimate import runs_beside
from dynamics.simulation.steps.equal_steps import equal_steps, sampled_numbers
from tests.dynamics.models import random_arm
from tests.dynamics.step_options import EQUAL, LIKE_OTHERS
from tests.slow import slow

LOOSE = 1e6  # a bound that no estimate of these runs exceeds
FACTOR = 2.0  # of an error, by which an estimate may miss it
ROUNDING = 1e-14  # below it an error is no power of the step
GRIDS = [None, [3.0], [1.0, 2.0, 2.001, 10.0], np.linspace(0.0, 10.0, 101), np.geomspace(1e-3, 10.0, 30)]


@cache
def spring() -> dyn.System:
    return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2, ["x"])


PAIRS = [(grid, method) for grid in range(len(GRIDS)) for method in EQUAL]
FEW = [
    (grid, method)
    for grid, method in PAIRS
    if (grid == EQUAL.index(method) % len(GRIDS) and method not in LIKE_OTHERS) or method == "rk4"
]


@mark.parametrize(("grid", "method"), FEW + slow(*[pair for pair in PAIRS if pair not in FEW]))
def test_the_estimate_is_the_error(grid: int, method: str) -> None:
    """Also where the times to record cut steps to all lengths, and in an ensemble."""
    options: dict[str, Any] = {"dt": 0.02, "t_eval": GRIDS[grid], "rtol": LOOSE}
    run = dyn.simulate(spring(), [1.0], [0.0], 10.0, method, **options)
    t, x = run.t, np.hstack([run.q, run.qd])
    off = np.abs(x - np.stack([np.cos(t), -np.sin(t)], axis=1))
    assert run.stats.error is not None
    assert off.max() / FACTOR - ROUNDING <= run.stats.error
    if t[-1] == 10.0:  # else the end is no row, and its error counts too
        assert run.stats.error <= off.max() * FACTOR + ROUNDING
        assert off[-1].max() / FACTOR - ROUNDING <= run.stats.error_at_end <= off[-1].max() * FACTOR + ROUNDING
    many = dyn.simulate_many(spring(), [[1.0], [-3.0]], [0.0], 10.0, method, **options)
    assert many.stats.error == approx(run.stats.error, rel=0.01, abs=ROUNDING)
    assert many.stats.error_at_end == approx(run.stats.error_at_end, rel=0.01, abs=ROUNDING)


@mark.parametrize("method", EQUAL)
def test_an_estimate_changes_no_row(method: str) -> None:
    for t_eval in (None, [0.1, 0.3]):
        options: dict[str, Any] = {"dt": 0.01, "t_eval": t_eval}
        plain = dyn.simulate(spring(), [1.0], [0.0], 0.3, method, estimate_error=False, **options)
        run = dyn.simulate(spring(), [1.0], [0.0], 0.3, method, rtol=LOOSE, **options)
        assert (run.q == plain.q).all()
        assert (run.stats.nfev, run.stats.steps) == (plain.stats.nfev, plain.stats.steps)
        assert (plain.stats.error, plain.stats.error_at_end) == (None, None)


@mark.parametrize("seed", range(12))
def test_no_equal_steps_are_wrong_in_silence(seed: int) -> None:
    """x' = A x, of rates to far beyond what steps of 1 ms resolve: right to the bound, or not without a word."""
    rng = np.random.default_rng(seed)
    a = 10.0 ** rng.uniform(0.0, 4.0) * rng.normal(size=(3, 3))
    model = dyn.OdeSystem(lambda x, t: [sum(a[i, j] * x[j] for j in range(3)) for i in range(3)], ["x", "y", "z"])
    values, vectors = np.linalg.eig(a)
    t_end = min(1.0, 20.0 / max(values.real.max(), 1e-3))
    with warnings.catch_warnings(record=True, action="always") as caught:
        run = dyn.simulate(model, [1.0, 0.5, -0.5], None, t_end, "rk4")
    exact = (vectors * np.exp(values * t_end)) @ np.linalg.solve(vectors, [1.0, 0.5, -0.5])
    right = run.success and np.abs(run.q[-1] - exact).max() <= 1e-2 * np.abs(run.q).max()
    assert right or not run.success or run.stats.warnings
    early = [] if run.success else [f"the run {run.message}"]
    assert [str(warning.message) for warning in caught] == [*early, *run.stats.warnings]
    assert all(warning.category is dyn.SimulationWarning for warning in caught)
    assert all(warning.filename == __file__ for warning in caught)


def test_what_is_warned_of_is_what_was_asked_for() -> None:
    dyn.simulate(spring(), [1.0], [0.0], 1.0, "rk4", dt=0.1)  # no warning
    said = r"the state is off by an estimated 7.6e-07 of the size of coordinate .*; rtol = 1e-08 allows less: .* 0.1 s"
    with warns(dyn.SimulationWarning, match=said):
        run = dyn.simulate(spring(), [1.0], [0.0], 1.0, "rk4", dt=0.1, rtol=1e-8)
    assert len(run.stats.warnings) == 1
    assert f"reached t_end; warning: {run.stats.warnings[0]}>" in repr(run)
    dyn.simulate(spring(), [1.0], [0.0], 1.0, "rk4", dt=0.1, rtol=1e-8, atol=[1e-5, 1e-5])
    with warns(dyn.SimulationWarning, match="coordinate 'x'"):
        dyn.simulate(spring(), [1.0], [0.0], 1.0, "rk4", dt=0.1, rtol=1e-8, atol=[0.0, 1e-5])
    with warns(
        dyn.SimulationWarning, match="1 of 2 trajectories has a warning: trajectory 1: the state is off by an estimated"
    ):
        many = dyn.simulate_many(
            spring(), [[1e-3], [1.0]], [0.0], 1.0, "rk4", dt=0.1, rtol=1e-12, atol=1e-7, backend="python"
        )
    assert [len(texts) for texts in many.stats.warnings] == [0, 1]
    assert many.stats.status.tolist() == [0, 0]


@mark.parametrize("exponent", [-200, -40, 0, 40, 200])
def test_an_error_has_no_units(exponent: int) -> None:
    """In other units of length, powers of two, all is the same to the last bit, and rounding is no error."""
    unit = 2.0**exponent
    noise = dyn.OdeSystem(lambda x, t: [x[1], -x[0], ((x[0] + 0.3 * x[1]) - x[0]) - 0.3 * x[1]], ["x", "v", "noise"])
    run = dyn.simulate(noise, [unit, 0.0, 0.0], None, 2.0, "rk4", dt=0.01)
    assert 0.0 < np.abs(run.q[:, 2]).max() < 1e-14 * unit
    assert run.stats.error == dyn.simulate(noise, [1.0, 0.0, 0.0], None, 2.0, "rk4", dt=0.01).stats.error
    assert run.stats.error < 1e-4


def test_a_second_run_that_fails_says_that_nothing_is_known() -> None:
    """Steps that are just short enough to get through, and a pulse that only one of two runs sees."""
    blow = dyn.OdeSystem(lambda x, t: [x[0] * x[0] * (1.0 - t)], ["x"])
    with warns(
        dyn.SimulationWarning, match="the state is off|the error is unknown: beside it a run of other steps stops"
    ):
        run = dyn.simulate(blow, [1.9], None, 1.0, "rk4", dt=0.25)
    assert run.stats.error > 1e-3
    stiff = dyn.OdeSystem(lambda x, t: [-1000.0 * x[0] ** 3], ["x"])
    with warns(dyn.SimulationWarning, match="the error is unknown: beside it a run of other steps stops at t = 0.01"):
        run = dyn.simulate(stiff, [1.0], None, 1.0, "rk4", dt=1.5e-3)
    assert (run.stats.error, run.success) == (math.inf, True)


@given(
    gaps=st.lists(st.sampled_from([0.1, 0.1, 0.25, 1e-3, 1e-9, 7.0 / 3.0]), min_size=1, max_size=12),
    dt=st.floats(1e-2, 3.0),
    direction=st.sampled_from([1.0, -1.0]),
)
def test_runs_beside_have_other_steps_that_meet_those_of_the_run(
    gaps: list[float], dt: float, direction: float
) -> None:
    instants = (direction * np.cumsum([0.0, *gaps])).tolist()
    first = equal_steps(instants, dt)
    longest, _, _, beside, numbers, t = runs_beside(first, 4)
    assert longest == max(abs(part.h) for part in first)
    for times, (steps, done) in zip((1.0, 2.0, 4.0), [(first, numbers), *beside], strict=False):
        assert (steps[0].begin, steps[-1].end) == (0.0, instants[-1])
        assert all(part.end == after.begin for part, after in itertools.pairwise(steps))
        assert all(0.0 < direction * part.h <= 2.0 * times * longest * (1.0 + 1e-9) for part in steps)
        ends = [part.begin + part.h * np.arange(1.0, part.steps + 1.0) for part in steps]
        assert np.concatenate([[0.0], *ends])[done] == approx(t, rel=1e-12, abs=1e-12)
    assert (t[0], t[-1]) == (0.0, instants[-1])
    few = sampled_numbers(numbers[-1], 4, 4)
    assert len(few) <= 6
    assert (few[1:-1] % 4 == 0).all()


def test_an_error_is_seen_however_the_instants_of_comparison_lie() -> None:
    """Of a run of whole periods, and of one that an event ends long before its time."""
    turn = 2.0 * math.pi
    wave = dyn.OdeSystem(lambda x, t: [turn * cg.cos(turn * t)], ["x"])
    run = dyn.simulate(wave, [0.0], None, 1200.0, "rk4", dt=1.0 / 64.0, rtol=LOOSE)
    off = np.abs(run.q[:, 0] - np.sin(turn * run.t)).max()
    assert off / FACTOR <= run.stats.error <= FACTOR * off
    end = dyn.Event("end", lambda q, qd, t: t - 1.0, terminal=True)
    short, early = [
        dyn.simulate(spring(), [1.0], [0.0], t_end, "rk4", dt=1e-3, events=events, rtol=LOOSE).stats.error
        for t_end, events in ((1.0, ()), (3000.0, end))
    ]
    assert early == approx(short, rel=0.1)


def test_the_estimate_does_not_compare_momenta_with_coordinates() -> None:
    """However heavy what moves is: all momenta are larger, and not the errors of the coordinates."""
    errors = []
    for mass in (1.0, 1e150):
        heavy = dyn.System(
            lambda q, qd, t, p: p["m"] * (0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2), ["x"], parameters={"m": mass}
        )
        how: dict[str, Any] = {"dt": 0.01, "form": "momentum", "rtol": LOOSE, "backend": "python"}
        run = dyn.simulate(heavy, [1.0], [0.0], math.pi, "symplectic_euler", **how)
        errors.append(run.stats.error)
    assert errors[1] == approx(errors[0], rel=1e-6)


def of(lagrangian: Any) -> dyn.System:
    return dyn.System(lagrangian, ["x"])


TURNS: list[Any] = [
    lambda t: cg.maximum(t - 0.6, 0.0),
    lambda t: cg.minimum(0.6, t),
    lambda t: cg.abs(t - 0.6),
    lambda t: cg.sign(t - 0.6),
    lambda t: cg.floor(t + 0.4),
    lambda t: cg.where(t < 0.6, 1.0, 2.0),
    lambda t: cg.fmod(t, 0.6),
]


@mark.parametrize("force", TURNS)
@mark.parametrize("method", ["rk4", *slow("euler", "verlet", "gauss4")])
def test_across_a_jump_or_a_kink_the_error_is_estimated(force: Any, method: str) -> None:
    """Alone and in an ensemble: steps end there, so that the error has the order of the method."""
    pushed = of(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2 - q[0] * force(t))
    options: dict[str, Any] = {"dt": 0.01, "rtol": LOOSE}
    run, true = dyn.simulate(pushed, [1.0], [0.0], 1.0, method, **options), dyn.simulate(pushed, [1.0], [0.0], 1.0)
    many = dyn.simulate_many(pushed, [[1.0]], [0.0], 1.0, method, t_eval=[1.0], **options)
    error = np.abs(np.append(run.q[-1] - true.q[-1], run.qd[-1] - true.qd[-1])).max()
    assert many.stats.error[0] == run.stats.error
    assert 0.1 * error <= run.stats.error <= 20.0 * error + 1e-9


@mark.filterwarnings("ignore::dynamics.SimulationWarning")
@mark.parametrize(("dt", "aside"), [(0.1, 1e-10), *slow((0.05, 1e-8), (0.05, 1e-10), (0.1, 1e-8), (0.1, 1e-11))])
def test_what_roundings_grow_to_near_a_separatrix_is_part_of_the_error(dt: float, aside: float) -> None:
    """A pendulum let go so near upright that roundings tell when it falls again: it is off by a turn."""
    pendulum = of(lambda q, qd, t: 0.5 * qd[0] ** 2 + cg.cos(q[0]))
    run = dyn.simulate(pendulum, [math.pi - aside], [0.0], 80.0, "gauss6", dt=dt)
    assert run.stats.error > 0.1
    assert run.stats.warnings


def test_no_error_is_estimated_where_events_reset_the_state() -> None:
    wall = dyn.Event("wall", lambda q, qd, t: q[0] - 0.5, 1, reset=lambda q, qd, t: (q, [-qd[0]]))
    run = dyn.simulate(spring(), [0.0], [1.0], 7.0, "rk4", dt=0.02, events=wall)
    assert (run.stats.error, run.stats.error_at_end, run.stats.warnings) == (None, None, ())


@mark.parametrize("method", ["rk4", *slow("euler", "verlet", "gauss6")])
@mark.parametrize("turns", [16.0, 16.37])
def test_a_force_that_steps_cannot_see_is_said(method: str, turns: float) -> None:
    """sin(w t), of 16 turns in a step, is another force to every run that takes these steps, or none."""
    rate, dt = 2.0 * math.pi * turns / 1e-3, 1e-3
    pushed = of(lambda q, qd, t: 0.5 * qd[0] ** 2 + q[0] * cg.cos(rate * t))
    said = rf"the error is unknown: a sine or cosine of the equations turns at {rate:.3g} rad/s".replace("+", r"\+")
    with warns(dyn.SimulationWarning, match=said):
        run = dyn.simulate(pushed, [0.0], [0.0], 0.1, method, dt=dt)
    with warns(dyn.SimulationWarning, match=said):
        many = dyn.simulate_many(pushed, [[0.0]], [0.0], 0.1, method, dt=dt)
    assert run.stats.error == many.stats.error[0] == math.inf
    slower = of(lambda q, qd, t: 0.5 * qd[0] ** 2 + q[0] * cg.cos(100.0 * t))
    assert dyn.simulate(slower, [0.0], [0.0], 0.1, method, dt=dt, rtol=LOOSE).stats.error < 1.0


@mark.parametrize("method", ["rk4", "gauss6"])
def test_no_error_is_said_to_be_below_rounding(method: str) -> None:
    """Both methods are exact on a parabola."""
    fall = of(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0])
    run = dyn.simulate(fall, [1.0], [0.0], 0.4, method, dt=0.01)
    assert 2.0**-52 * math.sqrt(40.0) <= run.stats.error <= 1e-13
    assert dyn.simulate_many(fall, [[1.0]], [0.0], 0.4, method, dt=0.01).stats.error[0] >= 2.0**-52


@mark.parametrize(
    ("given", "error", "message"),
    [
        ({"method": "dop853", "estimate_error": True}, ValueError, "'dop853' keeps the error of its steps within rtol"),
        ({"method": "rk4", "estimate_error": False, "rtol": 1e-3}, ValueError, "rtol is a bound of the estimated"),
        ({"method": "rk4", "estimate_error": False, "atol": 1e-3}, ValueError, "atol is a bound of the estimated"),
        ({"method": "rk4", "estimate_error": "no"}, TypeError, "estimate_error must be True, False or None, got 'no'"),
    ],
)
def test_no_option_of_the_estimate_is_ignored(given: dict[str, Any], error: type[Exception], message: str) -> None:
    with raises(error, match=message):
        dyn.simulate(spring(), [1.0], [0.0], 1.0, **given)


@mark.parametrize(("method", "jacobians", "factors"), [("dop853", 0, 0), ("rodas", 1, 1)])
def test_jacobians_and_factorizations_are_counted(method: str, jacobians: int, factors: int) -> None:
    arm, start = random_arm(2), ([1.0, 0.2], [0.0, 0.0])
    run = dyn.simulate(arm, *start, 2.0, method, rtol=1e-6, atol=1e-6)
    trials = run.stats.steps + run.stats.rejected
    assert (run.njev, run.nlu) == (jacobians * run.stats.steps, factors * trials)
    assert (run.nfev, run.status, run.success) == (run.stats.nfev, 0, True)


@mark.parametrize("method", ["rk4", "verlet"])
def test_the_clock_is_no_part_of_an_estimate_of_what_does_not_depend_on_time(method):
    swing = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 9.81 * cg.cos(q[0]), "angle")
    runs = [dyn.simulate(swing, [0.5], [0.0], t0 + 1.0, method, t0=t0, dt=1e-3) for t0 in (0.0, 1e3, 1e12)]
    for run in runs:
        assert (run.q[-1].tolist(), run.stats.error) == (runs[0].q[-1].tolist(), runs[0].stats.error)
        assert run.stats.error < 1e-5
