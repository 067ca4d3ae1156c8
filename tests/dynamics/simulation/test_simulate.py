"""simulate: what is recorded, how a run stops, and its statistics."""

import math
import warnings
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS, System
from dynamics.integrators import derive
from dynamics.simulation.run_options import Steps
from tests.dynamics.models import oscillator, random_arm
from tests.dynamics.step_options import step
from tests.each_row import each_row
from tests.early_end import stops

ROUNDING = 1e-14  # of a few sums of fractions, or of products of order 1
SPACING = 1e-12  # relative, of differences of rounded times
RK4_ERROR = 1e-8  # at dt = 10 ms: (w dt)^4 w t / 120 for w = 1.2 rad/s is 2e-10; v' = v^2 takes ten times that to v = 2


def runaway() -> System:
    """v' = v^2 on the second coordinate: v = v0 / (1 - v0 t) leaves at t = 1 / v0; a spring on the first."""
    return System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 0.5 * q[0] ** 2,
        ["calm", "wild"],
        forces=lambda q, qd, t: [0.0, qd[1] ** 2],
    )


@mark.parametrize("t_end", [1.0, 0.3, 0.05, 0.7000000000000001, 3.3333])
def test_the_last_row_is_at_t_end_exactly_whether_or_not_dt_divides_it(t_end: float) -> None:
    result = dyn.simulate(oscillator(), [1.0], [0.0], t_end, "rk4", dt=0.1)
    assert result.t[-1] == t_end
    assert result.stats.steps == math.ceil(t_end / 0.1 - SPACING)
    assert np.diff(result.t).max() <= 0.1 * (1 + SPACING)
    assert np.diff(result.t) == approx(t_end / result.stats.steps, rel=SPACING)


def test_t_eval_at_the_start_alone_is_the_start() -> None:
    result = dyn.simulate(oscillator(), [1.0], [0.5], 1.0, t_eval=[0.0])
    assert (result.t.tolist(), result.q.tolist(), result.qd.tolist()) == ([0.0], [[1.0]], [[0.5]])


def test_t_eval_on_the_default_instants_changes_nothing() -> None:
    options = step("rk4", 0.125)
    plain = dyn.simulate(random_arm(2), [1.0, 0.2], [0.0, 0.0], 0.5, "rk4", **options)
    chosen = dyn.simulate(random_arm(2), [1.0, 0.2], [0.0, 0.0], 0.5, "rk4", t_eval=plain.t, **options)
    assert (chosen.q == plain.q).all()
    assert (chosen.qd == plain.qd).all()
    assert (chosen.energy == plain.energy).all()


def test_energy_is_the_energy_graph_at_every_row() -> None:
    system = oscillator()
    result = dyn.simulate(system, [1.0], [0.3], 0.5, "rk4", dt=0.1, parameters={"m": 0.5})
    expected = 0.5 * 0.5 * result.qd[:, 0] ** 2 + 0.5 * 3.0 * result.q[:, 0] ** 2
    assert result.energy == approx(expected, rel=ROUNDING)
    driven = System(lambda q, qd, t: 0.5 * qd[0] ** 2 - q[0] * t, ["x"])
    result = dyn.simulate(driven, [1.0], [0.0], 0.5, "rk4", dt=0.1)
    assert result.energy == approx(0.5 * result.qd[:, 0] ** 2 + result.q[:, 0] * result.t, rel=ROUNDING)


@mark.parametrize(("method", "stages"), [("euler", 1), ("rk4", 4), ("verlet", 2), ("symplectic_euler", 1)])
def test_statistics_count_what_was_done(method: str, stages: int) -> None:
    stats = dyn.simulate(oscillator(), [1.0], [0.0], 1.0, method, dt=0.03, estimate_error=False).stats
    assert (stats.method, stats.steps, stats.rejected, stats.nfev) == (method, 34, 0, 34 * stages)
    assert stats.dt == approx(1.0 / 34, rel=SPACING)
    assert (stats.success, stats.message) == (True, "reached t_end")
    assert stats.seconds > 0.0


@stops
def test_a_run_that_leaves_the_numbers_keeps_its_rows_and_says_where() -> None:
    result = dyn.simulate(runaway(), [0.0, 0.0], [0.0, 1.0], 2.0, "rk4", dt=0.01)
    assert not result.stats.success
    assert result.stats.message.startswith("stopped at t = 1.0")
    assert "'wild'" in result.stats.message
    assert "calm" not in result.stats.message
    assert 0.9 < result.t[-1] < 1.1
    assert len(result.t) == len(result.q) == len(result.energy) == result.stats.steps + 1
    assert np.isfinite(result.q).all()
    assert np.isfinite(result.qd).all()
    assert result.qd[50, 1] == approx(1.0 / (1.0 - 0.5), rel=10.0 * RK4_ERROR)


@stops
def test_a_run_that_stops_before_the_first_recorded_instant_has_the_row_where_it_stopped() -> None:
    result = dyn.simulate(runaway(), [0.0, 0.0], [0.0, 1.0], 2.0, "rk4", dt=0.01, t_eval=[1.5, 2.0])
    every = dyn.simulate(runaway(), [0.0, 0.0], [0.0, 1.0], 2.0, "rk4", dt=0.01)
    assert (result.stats.success, result.t.tolist()) == (False, [every.t[-1]])
    assert (result.q[-1].tolist(), result.qd[-1].tolist()) == (every.q[-1].tolist(), every.qd[-1].tolist())
    assert "stopped at t = 1.0" in result.stats.message


@stops
@pytest.mark.filterwarnings("error")
@mark.parametrize("parameters", [{"m": 0.0}, {"m": 1e-300}])
def test_an_infinite_acceleration_stops_the_run_without_a_warning(parameters: dict[str, float]) -> None:
    result = dyn.simulate(oscillator(), [1.0], [0.0], 1.0, "rk4", dt=0.1, parameters=parameters)
    assert (len(result.t), result.stats.success, result.stats.steps) == (1, False, 0)
    assert result.stats.message.startswith("stopped at t = 0.1 s: ")


TURN = dyn.Event("turn", lambda q, qd, t: q[0] - 0.5, -1, reset=lambda q, qd, t: (q, [-qd[0]]))


@mark.parametrize(
    ("method", "options"),
    [
        ("rk4", {"events": TURN}),  # in a later leg
        ("gauss4", {}),
        ("dopri5", {}),
        ("rk4", {"t_eval": [0.0, 1e3]}),  # the state between these times is the last row
    ],
)
def test_ctrl_c_keeps_the_rows(
    method: str, options: dict[str, Any], capsys: pytest.CaptureFixture[str], ctrl_c: Any
) -> None:
    given = {"method": method, "backend": "python", **step(method, 1e-3), **options}
    dyn.simulate(oscillator(), [1.0], [0.0], 0.1, **given | {"t_eval": None})  # what it needs is made
    watched = "events" in options
    for delay in (1.5 if watched else 0.5, 6.0, 24.0):  # s; a machine that is busy may not have begun after the first
        timer = ctrl_c(delay)
        try:
            run = dyn.simulate(oscillator(), [1.0], [0.0], 1e3, **given, progress=watched)
        except KeyboardInterrupt:  # before the first step
            continue
        timer.join()
        written = capsys.readouterr().err
        if not watched or (run.stats.steps > 1000 and written):
            break
    assert (run.stats.success, run.stats.message) == (False, f"interrupted after t = {run.t[-1]:.6g} s")
    with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
        whole = dyn.simulate(oscillator(), [1.0], [0.0], 1e3, **given, max_steps=run.stats.steps + 100)
    assert len(run.t) == len(run.q) == len(run.energy)
    if "t_eval" not in options:
        assert (run.q == whole.q[: len(run.q)]).all()
    if watched:
        assert len(run.events["turn"].t)
        assert written.startswith("\rsimulate [")  # a line of progress, which is ended
        assert written.endswith(" s\n")


ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({"q": [1.0, 2.0]}, r"q must have shape \(1,\).* got \(2,\)"),
    ({"q": [math.nan]}, "q must be finite, got .*nan"),
    ({"q": [1 + 2j]}, "q must be real numbers, got complex numbers"),
    ({"q": np.ma.masked_array([1.0], [True])}, "q must be real numbers, got an array with masked values"),
    ({"q": [[1.0], [1.0, 2.0]]}, "q must be an array of real numbers, got rows of different lengths"),
    ({"qd": [math.inf]}, "qd must be finite, got .*inf"),
    ({"qd": None}, r"qd must have shape \(1,\)"),
    ({"t_end": 0.0}, "t_end must be another time than t0, got 0.0 s for both"),
    ({"t_end": None}, r"where does the run end: t_end, or t_span = \(t0, t_end\), must be given"),
    ({"t_span": (0.0, 1.0)}, "t_span says where the run starts .*: leave out t0 and t_end"),
    ({"t_span": (0.0, 1.0, 2.0), "t_end": None}, r"t_span must be two times, .* shape \(3,\)"),
    ({"t_eval": []}, r"t_eval must be increasing times in \[0, t_end = 1 s\]"),
    ({"t_eval": [0.0, 0.5, 0.25]}, "t_eval must be increasing .*, got 0.5 before 0.25"),
    ({"t_eval": 0.5}, "t_eval must be increasing"),
    ({"t0": 0.5, "t_eval": [0.2, 0.9]}, r"increasing times in \[0.5, t_end = 1 s\], got 0.2"),
    ({"t_end": -1.0, "t_eval": [-0.5, -0.2]}, "t_eval must be decreasing .* got -0.5 before"),
    ({"dt": -0.1}, "dt must be positive and finite, got -0.1 s"),
    ({"dt": 1e-17}, "dt = 1e-17 s is below the resolution of the time at t_end = 1 s"),
    ({"t0": -1e15, "dt": 0.1}, r"dt = 0.1 s is below the resolution .* at t0 = -1e\+15 s"),
    ({"dt": 1e-13}, r"9999999999990 steps of 2 numbers take .* GiB are free: record fewer times"),
    ({"method": "rk5"}, "there is no method 'rk5'; there are euler, rk4, "),
    (
        {"method": "dopri5"},
        "'dopri5' chooses its steps: max_step limits them; equal steps of dt = 0.1 s need method='rk4'",
    ),
    ({"max_step": 0.1}, r"'rk4' makes equal steps: .* dt, not by max_step \(got max_step = 0.1 s\)"),
    ({"method": "dopri5", "dt": None, "max_step": 0.0}, "max_step must be positive and finite, got 0.0 s"),
    ({"method": "dopri5", "dt": None, "first_step": 0.0}, "first_step must be positive and finite, got 0.0 s"),
    ({"rtol": 0.0, "atol": 0.0}, "not both 0"),
    ({"rtol": 0.0, "atol": [1e-9, 0.0]}, "not both 0"),
    ({"atol": [1e-9, -1.0]}, "rtol and atol must be finite"),
    ({"atol": [1e-9] * 3}, r"shape \(2,\), one for each of q0, qd0; got \(3,\)"),
    ({"events": [dyn.Event("e", lambda q, qd, t: 1.0)]}, "event 'e' must be a node of the state"),
    ({"events": [dyn.Event("e", lambda q, qd, t: cg.variable("z"))]}, "event 'e' must be a node of the state"),
    ({"events": [dyn.Event("e", lambda q, qd, t: q[0])] * 2}, "two events have the name 'e'"),
    ({"tau": [1.0, 2.0]}, "tau needs one number for each of .*: 1, got 2"),
    ({"tau": math.nan}, "tau must be finite, got nan for '"),
    ({"parameters": {"c": 1.0}}, r"the system has no parameter c \(it has m, k\)"),
    ({"parameters": {"k": math.inf}}, "parameter 'k' must be .*finite.* got inf"),
]


@each_row("given, message", ARGUMENTS)
def test_what_cannot_be_is_refused_in_a_sentence(given: dict[str, Any], message: str) -> None:
    arguments = {"q": [1.0], "qd": [0.0], "t_end": 1.0, "method": "rk4", "dt": 0.1} | given
    with raises((TypeError, ValueError, MemoryError), match=message):
        dyn.simulate(oscillator(), **arguments)


def test_what_was_made_for_a_model_is_used_again_and_only_for_the_same() -> None:
    """Each change of a model or of its numbers gives the motion that a fresh one has."""

    def model(mass: float = 1.0) -> dyn.System:
        return dyn.System(
            lambda q, qd, t, p: 0.5 * mass * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2, ["x"], {"k": 2.0}, damping=0.1
        )

    def ends(system: dyn.System, **options: Any) -> float:
        return float(dyn.simulate(system, [1.0], [0.0], 1.0, "dop853", **options).q[-1, 0])

    kept = model()
    first = ends(kept)
    made = derive(kept, {"k": 2.0, "tau0": 0.0})
    assert made is derive(kept, {"k": 2.0, "tau0": 0.0})
    assert made is not derive(kept, {"k": 2.0, "tau0": -0.0})
    assert ends(kept) == first
    assert ends(model(2.0)) != first
    assert ends(kept, parameters={"k": 3.0}) == ends(model(), parameters={"k": 3.0}) != first
    assert ends(kept, tau=0.5) != first
    kept.parameters["k"] = 3.0
    assert ends(kept) == ends(model(), parameters={"k": 3.0})
    kept.damping = (0.7,)
    assert ends(kept, parameters={"k": 2.0}) != first


def test_a_last_time_past_the_end_by_rounding_is_the_end() -> None:
    times = 0.1 * np.arange(4)
    assert times[-1] > 0.3
    run = dyn.simulate(oscillator(), [1.0], [0.0], 0.3, t_eval=times)
    assert run.t[-1] == 0.3
    assert times[-1] > 0.3  # the caller's array is as it was


@stops
def test_rows_that_fill_the_memory_end_the_run() -> None:
    whole = dyn.simulate(oscillator(), [1.0], [0.0], 200.0, "dop853", max_step=1e-2)
    hundred = 3.0 * 24.0 * 100.0  # rows of time and state
    with patch.multiple("dynamics.simulation.outcome", SMALL_MEMORY=0.0, room=lambda: hundred):
        run = dyn.simulate(oscillator(), [1.0], [0.0], 200.0, "dop853", max_step=1e-2)
    assert run.stats.message.startswith("stopped at t = ")
    assert "the rows fill the memory; t_eval records fewer" in run.stats.message
    assert not run.stats.success
    assert np.array_equal(run.q, whole.q[: len(run.q)])


def test_a_parameter_that_the_system_has_not_is_named() -> None:
    with raises(ValueError, match=r"the system has no parameter 'm' \(it has none\); give it to `parameters`"):
        System(lambda q, qd, t, p: p["m"] * qd[0] ** 2, ["x"])
    with raises(ValueError, match=r"the system has no parameter 'm' \(it has k\)"):
        dyn.OdeSystem(lambda x, t, p: [p["m"] * x[0]], ["x"], {"k": 1.0})


@mark.parametrize("method", METHODS)
def test_an_option_is_taken_or_refused_by_name(method: str) -> None:
    equal = not METHODS[method].adaptive
    for name, value in {"dt": 0.1, "max_step": 0.1, "first_step": 0.1, "estimate_error": True}.items():
        if equal == (name in ("dt", "estimate_error")):
            Steps(method, **{name: value})
        else:
            with raises(ValueError, match=f"'{method}' .*{name}"):
                Steps(method, **{name: value})
    for name in ("rtol", "atol"):
        Steps(method, **{name: 1e-3})
        with raises(ValueError, match="rtol and atol must be finite"):
            Steps(method, **{name: -1e-3})
