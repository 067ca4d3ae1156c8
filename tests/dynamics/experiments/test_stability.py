"""The stability table: its figures against other sources, verdicts that can fail, and its forms."""

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pytest import MonkeyPatch, approx, importorskip, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.experiments import text_table
from dynamics.experiments.stability import (
    case_runs,
    cases,
    energy_drift,
    huge_angles,
    known_limits as limits,
    single_evaluations,
    solutions,
    stability,
    stability_table,
)
from dynamics.experiments.stability.case_result import CaseResult, Measurement
from dynamics.integrators import METHODS, Method
from dynamics.integrators.step_control import embedded
from dynamics.integrators.tableau import DOPRI5
from tests.dynamics.lagrange_by_mpmath import floats, lagrange
from tests.dynamics.models import Array

STIFF, SMOOTH = "Robertson, to 1e11", "heavy top"
EXACT = 1e-13  # of the largest value: differences of 80 digits, and rounding of what is compared
RECOMPUTED = 1e-6  # relative, of a change of 1e-9: what rounding of the invariant adds to it
STORED = 1e-14  # relative to a state's size: constants of the graph are rounded, and may be folded otherwise
NO_ERROR = 1e-12  # of a straight line's drift: rounding of the means
SLOPES = 1e-5  # relative: central differences with steps of 1e-7


# Verdicts


def measurement(value: float, bound: float = 1.0) -> Measurement:
    return Measurement("error", value, bound, "of size", "for the test")


def result(*measurements: Measurement, **more: Any) -> CaseResult:
    return CaseResult("Cases", "a case", "what is hard", "a method", measurements, **more)


def test_a_figure_meets_its_bound_up_to_the_bound_and_not_as_nan() -> None:
    assert measurement(1.0).meets
    assert not measurement(1.0 + 2.0**-52).meets
    assert not measurement(math.nan).meets
    assert measurement(0.0, 0.0).meets


def test_a_verdict_needs_all_figures_and_the_end_of_the_run() -> None:
    assert result(measurement(0.5), measurement(0.6)).verdict == "meets"
    assert result(measurement(0.5), measurement(2.0)).verdict == "unexplained"
    assert result(measurement(0.5), measurement(2.0), reason="known").verdict == "limit"
    assert result(measurement(0.5), stopped="at t = 1 s").verdict == "unexplained"


def test_a_reason_accounts_for_so_much_and_no_more() -> None:
    (section, case, method), limit = next(iter(limits.LIMITS.items()))
    assert limits.reason(section, case, method, [measurement(0.9 * limit.within)]) == limit.reason
    assert limits.reason(section, case, method, [measurement(1.1 * limit.within)]) == ""
    assert limits.reason(section, case, method, [measurement(math.nan)]) == ""
    assert limits.reason(section, "another case", method, [measurement(2.0)]) == ""


def test_every_limit_is_of_a_row_that_exists_and_is_told_in_the_documentation() -> None:
    text = (Path(__file__).parents[3] / "docs" / "stability.md").read_text(encoding="utf-8")
    single = {f"{task}, {each.name}" for task in single_evaluations.TASKS for each in single_evaluations.FAMILIES}
    for section, case, method in limits.LIMITS:
        assert case in {"Cases": set(cases.names()), "Single evaluations": single}[section]
        assert method == "" or method in case_runs.methods_of(cases.load(case))
        assert case in " ".join(text.split())


# Solutions


def test_the_file_has_a_solution_of_every_case_that_has_one() -> None:
    kept = json.loads(solutions.FILE.read_text(encoding="utf-8"))
    assert set(kept) == {name for name, case in cases.TABLE.items() if case.exact or case.method}
    for name, entry in kept.items():
        case = cases.load(name)
        assert [float.fromhex(each) for each in entry["start"]] == list(case.start)
        assert float.fromhex(entry["t"]) == case.t_end
        assert len(entry["x"]) == len(case.start)
        assert entry["error"] <= 1e-20


def kept_is_computed(name: str) -> None:
    case = cases.load(name)
    kept, computed = solutions.solution(case), case.solution()
    assert kept is not None
    assert computed is not None
    size = case.sizes(computed)
    grown = max(1.0, case.growth or 1e3)
    assert np.max(np.abs(kept.deviation(computed.x)[0]) / size) <= STORED * grown


@mark.parametrize("name", [*[name for name, case in cases.TABLE.items() if case.exact], "mass ratio 1e-12"])
def test_a_solution_in_the_file_is_the_one_computed(name: str) -> None:
    importorskip("mpmath")
    importorskip("flint")
    kept_is_computed(name)


@mark.slow
@mark.parametrize("name", [name for name, case in cases.TABLE.items() if case.method and not case.exact])
def test_every_solution_in_the_file_is_the_one_computed(name: str) -> None:
    importorskip("flint")
    kept_is_computed(name)


def test_a_case_with_another_start_is_computed_anew() -> None:
    importorskip("mpmath")
    case = cases.load("exponential decay")
    moved = replace(case, t_end=1.0)
    found = solutions.solution(moved)
    assert found is not None
    assert found.x[0, 0] == math.exp(-1.0)


# Runs of cases


def broken() -> Method:
    """Dormand and Prince with a weight off by 1e-4, in the step and not in the estimate of its error."""
    wrong = replace(DOPRI5, b=(DOPRI5.b[0] + 1e-4, *DOPRI5.b[1:]))
    return Method(5, lambda problem, dense: embedded(wrong, problem, dense), adaptive=True, degree=4)


@mark.parametrize("name", [SMOOTH, "next to the upright", "exponential growth", "smallest velocity"])
def test_a_method_meets_the_bounds_and_a_broken_one_does_not(name: str, monkeypatch: MonkeyPatch) -> None:
    good = case_runs.result(cases.load(name), "dopri5")
    assert good.verdict == "meets"
    assert good.steps > 0
    if name != "smallest velocity":  # without a rate there is nothing to be wrong about
        monkeypatch.setitem(METHODS, "dopri5", broken())
        assert case_runs.result(cases.load(name), "dopri5").verdict == "unexplained"


@mark.parametrize("method", ["radau", "rodas"])
def test_stiff_methods_meet_the_bounds(method: str) -> None:
    found = case_runs.result(cases.load(STIFF), method)
    assert found.verdict == "meets"
    assert [each.quantity for each in found.measurements] == [each.quantity for each in cases.load(STIFF).criteria]


def test_a_run_that_stops_meets_nothing(monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(case_runs, "MOST_STEPS", 10)
    found = case_runs.result(cases.load(SMOOTH), "dopri5")
    assert "max_steps" in found.stopped
    assert not found.explained
    assert {each.quantity for each in found.measurements if math.isnan(each.value)} == {"error"}


def test_invariants_are_those_of_the_case_and_errors_those_of_the_state() -> None:
    case = cases.load("Kepler, e = 0.9")
    solution = solutions.solution(case)
    run = case_runs.trajectory(case, "dop853")
    x, y, u, v = np.concatenate([run.q, run.qd], axis=1).T
    found = case_runs.changes(case, run, {"energy", "angular momentum"})
    energy, momentum = 0.5 * (u * u + v * v) - 1.0 / np.hypot(x, y), x * v - y * u
    assert found["energy"] == approx(np.max(np.abs(energy - energy[0])), rel=RECOMPUTED)
    assert found["angular momentum"] == approx(np.max(np.abs(momentum - momentum[0])), rel=RECOMPUTED)
    assert solution is not None
    error = np.abs(np.array([x[-1], y[-1], u[-1], v[-1]]) - solution.x[0]) / np.array(case.size)
    assert case_runs.errors(case, run, solution)["error"] == approx(np.max(error), rel=RECOMPUTED)


def test_an_invariant_is_measured_by_its_scale_and_what_is_missing_is_no_number() -> None:
    energy = cases.Criterion("energy", 1.0, "for the test", scale=4.0)
    assert case_runs.measurement(energy, {"energy": 2.0}).value == 0.5
    assert case_runs.measurement(cases.Criterion("error", 1.0, "for the test"), {"error": 2.0}).value == 2.0
    assert math.isnan(case_runs.measurement(energy, {}).value)


# Long runs


def test_the_drift_of_a_line_is_its_slope_and_that_of_an_oscillation_is_none() -> None:
    t = np.arange(100_001) / 1e5
    wave = 0.01 * np.sin(2.0 * math.pi * 1234.5 * t)
    straight = energy_drift.drift(5.0 + 1e-6 * t, 5.0)
    assert straight.drift == approx(2e-7, rel=1e-6)
    assert straight.error < NO_ERROR
    still = energy_drift.drift(5.0 + wave, 5.0)
    assert abs(still.drift) < energy_drift.SIGMAS * still.error < 1e-8
    assert still.band == approx(0.004, rel=1e-3)
    both = energy_drift.drift(5.0 + wave + 1e-6 * t, 5.0)
    assert both.drift == approx(2e-7, rel=1e-2)
    assert abs(both.drift) > energy_drift.SIGMAS * both.error


def test_a_noisy_slope_is_within_its_error() -> None:
    rng = np.random.default_rng(5)
    found = [energy_drift.drift(1.0 + 1e-9 * rng.normal(size=4096), 1.0) for _ in range(200)]
    scores = np.array([each.drift / each.error for each in found])
    assert np.max(np.abs(scores)) < energy_drift.SIGMAS
    assert 0.8 < np.std(scores) < 1.4  # Student's t with 14 degrees of freedom: 1.08


@mark.parametrize("motion", energy_drift.MOTIONS)
@mark.parametrize("method", ["verlet", "gauss6"])
def test_symplectic_methods_do_not_drift(motion: str, method: str) -> None:
    assert energy_drift.result(motion, method, energy_drift.QUICK).verdict == "meets"


@mark.parametrize("motion", energy_drift.MOTIONS)
def test_a_method_that_loses_energy_is_seen_to(motion: str) -> None:
    assert energy_drift.result(motion, "rk4", energy_drift.QUICK).verdict == "unexplained"


# Single evaluations


def random_arm(n: int) -> tuple[dyn.PlanarArm, Array, Array, Array]:
    rng = np.random.default_rng(n)
    arm = dyn.planar_arm(rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist(), 0.1)
    q, qd, third = rng.uniform(-3.0, 3.0, n), rng.normal(size=n), rng.normal(size=n)
    return arm, q, qd, third


@mark.parametrize("n", [1, 2, 5])
def test_exact_torques_are_those_of_lagranges_equation(n: int) -> None:
    """By differences of L itself in 80 digits: another formula, other arithmetic."""
    importorskip("flint")
    from dynamics.reference.planar_arm_equations import torques

    arm, q, qd, qdd = random_arm(n)
    expected = lagrange(arm, {"q": q, "qd": qd, "qdd": qdd})
    found = torques(arm, q, qd, qdd).high
    assert np.max(np.abs(found - floats(expected.tau))) < EXACT * expected.largest


@mark.parametrize("n", [1, 2, 5, 20])
def test_exact_accelerations_give_the_torques_back(n: int) -> None:
    importorskip("flint")
    from dynamics.reference.planar_arm_equations import accelerations, torques

    arm, q, qd, tau = random_arm(n)
    qdd = accelerations(arm, q, qd, tau)
    back = torques(arm, q, qd, qdd.high)
    size = np.max(np.abs(torques(arm, q, qd, 2.0 * qdd.high).high - back.high))  # M qdd
    assert np.max(np.abs(back.high - tau)) < 1e-15 * n * size
    assert np.max(np.abs(qdd.low)) <= np.spacing(np.max(np.abs(qdd.high)))


def test_digits_are_added_until_the_result_has_enough() -> None:
    """Masses 24 decades apart, for which the first attempt cannot do."""
    importorskip("flint")
    from dynamics.reference.planar_arm_equations import accelerations, torques

    _, q, qd, tau = random_arm(6)
    arm = dyn.planar_arm([1e-24] * 5 + [1.0], [1.0] * 6)
    qdd = accelerations(arm, q, qd, tau)
    assert np.isfinite(qdd.high).all()
    assert np.isfinite(torques(arm, q, qd, qdd.high).high).all()


@mark.parametrize("task", single_evaluations.TASKS)
def test_the_condition_is_what_changes_of_the_data_make(task: str) -> None:
    """Differences of the exact values, each input and parameter changed by itself."""
    importorskip("flint")
    n, step = 3, 1e-7
    arm, q, qd, third = random_arm(n)
    solve = single_evaluations.TASKS[task].exact
    expected = np.zeros(n)

    def change(there: Any, back: Any) -> None:
        nonlocal expected
        expected += np.abs(there.high - back.high) / (2.0 * step)

    point = np.concatenate([q, qd, third])
    for i in range(3 * n):
        moved = [point * (1.0 + sign * step * (np.arange(3 * n) == i)) for sign in (1, -1)]
        change(*[solve(arm, *each.reshape(3, n)) for each in moved])
    for i, link in enumerate(arm.links):
        for what in ("mass", "length", "center", "inertia"):
            arms = []
            for sign in (1, -1):
                changed = replace(link, **{what: getattr(link, what) * (1.0 + sign * step)})
                arms.append(replace(arm, links=(*arm.links[:i], changed, *arm.links[i + 1 :])))
            change(*[solve(each, q, qd, third) for each in arms])
        scaled = [tuple([c * (1.0 + sign * step * (j == i)) for j, c in enumerate(arm.damping)]) for sign in (1, -1)]
        change(*[solve(replace(arm, damping=each), q, qd, third) for each in scaled])
    change(*[solve(replace(arm, gravity=arm.gravity * (1.0 + sign * step)), q, qd, third) for sign in (1, -1)])
    found = single_evaluations.Arms(single_evaluations.TASKS[task], n).condition(arm, point)
    assert found == approx(expected, rel=SLOPES)


@mark.parametrize("family", single_evaluations.FAMILIES[:5], ids=lambda each: each.name)
@mark.parametrize("task", single_evaluations.TASKS)
def test_single_evaluations_are_within_the_bound(task: str, family: single_evaluations.Family) -> None:
    importorskip("flint")
    arms = single_evaluations.Arms(single_evaluations.TASKS[task], 4, ["python"])
    assert single_evaluations.measurement(family, arms).meets


HEAVY = next(each for each in single_evaluations.FAMILIES if each.name == "last mass 1e12")


def test_a_heavy_mass_at_the_end_of_a_chain_needs_double_double() -> None:
    importorskip("flint")
    plain, doubled = (
        single_evaluations.measurement(HEAVY, single_evaluations.Arms(single_evaluations.TASKS[task], 8, ["python"]))
        for task in ("forward dynamics", "forward dynamics in double-double")
    )
    assert plain.value > 1e6
    assert doubled.value < 1.0


def test_a_constant_that_is_off_is_seen() -> None:
    """A mass wrong by 1e-13 is some hundred ulps of the condition."""
    importorskip("flint")
    task = single_evaluations.TASKS["forward dynamics"]

    def off(arm: Any) -> cg.Graph:
        if not isinstance(arm, dyn.PlanarArm):
            return task.derive(arm)
        first = replace(arm.links[0], mass=arm.links[0].mass * (1.0 + 1e-13))
        return task.derive(replace(arm, links=(first, *arm.links[1:])))

    arms = single_evaluations.Arms(task._replace(derive=off), 3, ["python"])
    assert not single_evaluations.measurement(single_evaluations.FAMILIES[0], arms).meets


# Huge angles


def test_angles_fill_their_range_with_both_signs() -> None:
    found = huge_angles.angles(6.0, 9.0, 1000)
    assert np.min(np.abs(found)) >= 1e6
    assert np.max(np.abs(found)) <= 1e9
    assert 400 < np.count_nonzero(found > 0.0) < 600


def test_sine_and_cosine_of_huge_angles_are_reduced_exactly() -> None:
    importorskip("flint")
    found = list(huge_angles.results(100))
    assert len(found) == 2 * len(single_evaluations.available())
    assert all(each.meets for each in found), [each.measurements for each in found]


def test_an_angle_that_is_reduced_in_float64_is_seen() -> None:
    importorskip("flint")
    points = huge_angles.angles(6.0, 9.0, 50)
    known = huge_angles.exact(points)
    assert huge_angles.ulps(np.array([np.sin(points), np.cos(points)]), known) <= 1.0
    short = np.fmod(points, 2.0 * math.pi)
    assert huge_angles.ulps(np.array([np.sin(short), np.cos(short)]), known) > 1e3


def test_sines_are_those_of_mpmath() -> None:
    importorskip("flint")
    mpmath = importorskip("mpmath")
    points = huge_angles.angles(200.0, 308.0, 20)
    with mpmath.workdps(400):
        sines = [float(mpmath.sin(mpmath.mpf(x))) for x in points.tolist()]
    assert huge_angles.exact(points).high[0].tolist() == sines


# The table


ROWS = [
    result(measurement(0.5), measurement(1e-9), steps=120, rejected=3, seconds=0.25),
    result(measurement(2.0), reason="a reason " * 20, steps=10),
    result(measurement(math.nan), stopped="stopped at t = 1 s"),
    CaseResult(
        "Sine and cosine",
        "a name longer than a column of the table has room for",
        "",
        "llvm",
        (measurement(0.1),),
    ),
]


def test_the_table_fits_its_width_and_gives_every_reason_once() -> None:
    text = stability_table.text([*ROWS[:2], ROWS[1], *ROWS[2:]])
    assert max(map(len, text.splitlines())) <= text_table.WIDTH
    assert " ".join(text.split()).count("a reason " * 19) == 1
    assert "stopped at t = 1 s: no reason is known" in text
    assert text.endswith("5 rows: 2 meets, 2 limit, 1 unexplained")
    assert "nan (1) !" in text
    assert "0.5 (1), error 1.0e-09 (1)" in text


def test_the_data_are_json_without_nan_and_csv_with_a_line_for_each_figure() -> None:
    content = stability.to_dict(ROWS, 1.5, quick=True)
    again = json.loads(json.dumps(content, allow_nan=False))
    assert [len(each["rows"]) for each in again["sections"]] == [3, 0, 0, 1]
    assert again["sections"][0]["rows"][2]["measurements"][0]["value"] == "nan"
    lines = list(csv.DictReader(io.StringIO(stability.to_csv(ROWS))))
    assert [each["meets"] for each in lines] == ["True", "True", "False", "False", "True"]
    assert lines[0]["bound"] == "1.0"


def test_quick_cases_are_cases() -> None:
    assert set(stability.QUICK) <= set(cases.names())


def test_an_unknown_case_is_refused() -> None:
    with raises(ValueError, match="there is no case"):
        list(case_runs.results(["x"]))


@mark.slow
def test_a_quick_run_has_no_unexplained_row() -> None:
    importorskip("flint")
    said: list[str] = []
    found = stability.run(quick=True, say=said.append)
    assert len(said) == len(found)
    assert [f"{each.case}, {each.method}" for each in found if not each.explained] == []
    assert {each.section for each in found} == set(stability.ABOUT)
