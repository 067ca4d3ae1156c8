"""The stability table: its figures against other sources, verdicts that can fail, and its forms."""

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pytest import MonkeyPatch, approx, mark, param

from dynamics.experiments import text_table
from dynamics.experiments.accuracy_task import KEPT_ENDS
from dynamics.experiments.stability import (
    case_result as limits,
    case_runs,
    cases,
    energy_drift,
    single_evaluations,
    stability,
)
from dynamics.experiments.stability.case_result import CaseResult, Measurement
from dynamics.integrators import METHODS, Method, runge_kutta
from dynamics.integrators.tableau import DOPRI5
from tests.early_end import stops

STIFF, SMOOTH = "Robertson, to 1e11", "heavy top"
RECOMPUTED = 1e-6  # relative, of a change of 1e-9: what rounding of the invariant adds to it
STORED = 1e-14  # relative to a state's size: constants of the graph are rounded, and may be folded otherwise
NO_ERROR = 1e-12  # of a straight line's drift: rounding of the means


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
    (section, case, method), (why, within) = next(iter(limits.LIMITS.items()))
    assert limits.reason(section, case, method, [measurement(0.9 * within)]) == why
    assert limits.reason(section, case, method, [measurement(1.1 * within)]) == ""
    assert limits.reason(section, case, method, [measurement(math.nan)]) == ""
    assert limits.reason(section, "another case", method, [measurement(2.0)]) == ""


def test_every_limit_is_of_a_row_that_exists_and_is_told_in_the_documentation() -> None:
    text = (Path(__file__).parents[3] / "docs" / "stability.md").read_text(encoding="utf-8")
    single = {f"{task}, {each.name}" for task in single_evaluations.TASKS for each in single_evaluations.FAMILIES}
    for section, case, method in limits.LIMITS:
        assert case in {"Cases": set(cases.names()), "Single evaluations": single}[section]
        assert method == "" or method in case_runs.methods_of(cases.load(case))
        assert case in " ".join(text.split())


def test_the_file_has_a_solution_of_every_case_whose_error_is_measured() -> None:
    kept = json.loads(KEPT_ENDS.read_text(encoding="utf-8"))
    watched = {name: [each.quantity for each in case.criteria] for name, case in cases.table().items()}
    assert set(kept) == {name for name, what in watched.items() if any(each.startswith("error") for each in what)}
    for name, entry in kept.items():
        case = cases.load(name)
        assert [float.fromhex(each) for each in entry["start"]] == list(case.start)
        assert float.fromhex(entry["t"]) == case.t_end
        assert len(entry["x"]) == len(case.start)
        assert entry["error"] <= 1e-20


# Mazzia and Magherini, "Test Set for Initial Value Problem Solvers", release 2.4 (2008): ROBER at t = 1e11, VDPOL at
# t = 2, which differs from a Taylor series of 386286 steps by 2e-14.
PUBLISHED = {
    "Robertson, to 1e11": [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050],
    "Van der Pol, mu = 1000": [1.706167732170483, -0.8928097010247975],
}


@mark.parametrize("name", PUBLISHED)
def test_kept_solutions_of_stiff_cases_are_the_published_values_to_their_digits(name: str) -> None:
    found = cases.load(name).solution()
    assert found is not None
    assert found.x[-1] == approx(PUBLISHED[name], rel=1e-13)


COMPUTED = [name for name, case in cases.table().items() if case.series]


@mark.parametrize("name", [param(name, marks=() if name == "mass ratio 1e-12" else mark.slow) for name in COMPUTED])
def test_a_solution_in_the_file_is_the_one_computed(name: str) -> None:
    case = cases.load(name)
    kept, computed = case.solution(), replace(case, ends=None).solution()
    assert kept is not None
    assert computed is not None
    size = case.sizes(computed)
    grown = max(1.0, case.growth or 1e3)
    assert np.max(np.abs(kept.deviation(computed.x)[0]) / size) <= STORED * grown


def test_a_case_with_another_start_is_computed_anew() -> None:
    found = replace(cases.load("exponential decay"), t_end=1.0).solution()
    assert found is not None
    assert found.x[0, 0] == math.exp(-1.0)


def broken() -> Method:
    """Dormand and Prince with a weight off by 1e-4, in the step and not in the estimate of its error."""
    wrong = replace(DOPRI5, b=(DOPRI5.b[0] + 1e-4, *DOPRI5.b[1:]))
    return runge_kutta(wrong)


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


@stops
def test_a_run_that_stops_meets_nothing(monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(case_runs, "MOST_STEPS", 10)
    found = case_runs.result(cases.load(SMOOTH), "dopri5")
    assert "max_steps" in found.stopped
    assert found.verdict == "unexplained"
    assert {each.quantity for each in found.measurements if math.isnan(each.value)} == {"error"}


def test_invariants_are_those_of_the_case_and_errors_those_of_the_state() -> None:
    case = cases.load("Kepler, e = 0.9")
    solution = case.solution()
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


ROWS = [
    result(measurement(0.5), measurement(1e-9), steps=120, rejected=3, seconds=0.25),
    result(measurement(2.0), reason="a reason " * 20, steps=10),
    result(measurement(math.nan), stopped="stopped at t = 1 s"),
    CaseResult(
        "Single evaluations", "a name longer than a column of the table has room for", "", "llvm", (measurement(0.1),)
    ),
]


def test_the_table_fits_its_width_and_gives_every_reason_once() -> None:
    text = stability.text([*ROWS[:2], ROWS[1], *ROWS[2:]])
    assert max(map(len, text.splitlines())) <= text_table.WIDTH
    assert " ".join(text.split()).count("a reason " * 19) == 1
    assert "stopped at t = 1 s: no reason is known" in text
    assert text.endswith("5 rows: 2 meets, 2 limit, 1 unexplained")
    assert "nan (1) !" in text
    assert "0.5 (1), error 1.0e-09 (1)" in text


def test_the_data_are_json_without_nan_and_csv_with_a_line_for_each_figure() -> None:
    content = stability.to_dict(ROWS, 1.5, quick=True)
    again = json.loads(json.dumps(content, allow_nan=False))
    assert [len(each["rows"]) for each in again["sections"]] == [3, 0, 1]
    assert again["sections"][0]["rows"][2]["measurements"][0]["value"] == "nan"
    lines = list(csv.DictReader(io.StringIO(stability.to_csv(ROWS))))
    assert [each["meets"] for each in lines] == ["True", "True", "False", "False", "True"]
    assert lines[0]["bound"] == "1.0"


def test_quick_cases_are_cases() -> None:
    assert set(stability.QUICK) <= set(cases.names())


@mark.slow
def test_a_quick_run_has_no_unexplained_row() -> None:
    said: list[str] = []
    found = stability.run(quick=True, say=said.append)
    assert len(said) == len(found)
    assert [f"{each.case}, {each.method}" for each in found if each.verdict == "unexplained"] == []
    assert {each.section for each in found} == set(stability.ABOUT)
