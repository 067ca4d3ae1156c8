"""Comparisons of integrators at equal error: who is within it, what is fastest, and whose rates are whose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import cgraph as cg
from dynamics.experiments.work_precision import comparisons
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.experiments.work_precision.trajectory_runs import Ours, Outcome, Solver
from dynamics.experiments.work_precision.work_precision import Subject, subject
from tests.bench.motions.comparisons import Comparison, SolveIvp, numpy_rate

ERROR = 1e-6
ROUNDING = 1e-12  # of rates written by hand, beside those of the graph


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    pytest.importorskip("flint")
    return subject(load("spring_mass", t_end=3.0), tmp_path_factory.mktemp("exact"))


class Refusing(Solver):
    """Never runs."""

    def __init__(self, *args: Any) -> None:
        super().__init__("refusing", "", *args[:2])

    def ready(self, knob: float) -> Any:
        raise ValueError("will\nnot")

    def rows(self, knob: float) -> Any:
        raise NotImplementedError


def test_runs_within_the_error_are_kept_and_refusals_are_told(spring: Subject) -> None:
    race = Comparison(spring, 1e-9)
    race.ours(["dop853"], [1e-2, 1e-10])
    race.ours(["rk4"], [64, 4096])
    race.add("refusing", Refusing, [1e-3])
    assert all(each.error <= 1e-9 for runs in race.tried.values() for each in runs)
    assert {name: [each.knob for each in runs] for name, runs in race.tried.items()} == {
        "dop853": [1e-10],
        "rk4": [4096],
        "refusing": [],
    }
    lines = race.text().splitlines()
    assert {line.split()[0] for line in lines[2:4]} == {"dop853", "rk4"}
    assert lines[2].split()[2] == "1.00"  # the fastest of ours comes first
    assert "refusing at 1e-03: will not" in lines


def test_the_first_good_knobs_are_enough(spring: Subject) -> None:
    race = Comparison(spring, ERROR)
    race.add("dop853", lambda *args: Ours("dop853", *args), [1e-8, 1e-9, 1e-10], most=1)
    assert [each.knob for each in race.tried["dop853"]] == [1e-8]


def test_solve_ivp_gets_the_rate_it_is_given(spring: Subject) -> None:
    pytest.importorskip("scipy")
    solver = SolveIvp(lambda t, x: np.array([x[1], -x[0]]), *spring[:3])
    outcome: Outcome = solver.ready(1e-9)()
    assert spring.metrics.at_end(outcome.x) < ERROR
    assert float(spring.metrics.errors(solver.rows(1e-9)).max()) < ERROR


def test_rates_written_in_numpy_are_those_of_the_graph(tmp_path: Any) -> None:
    pytest.importorskip("flint")
    at = subject(load("triple_pendulum", t_end=0.1), tmp_path)
    compiled, rate = cg.compile(at.problem.rate, "python"), numpy_rate()
    for x in np.random.default_rng(1).normal(size=(5, 6)):
        expected = np.array(compiled.values([*x.tolist(), 0.0]))
        assert rate(0.0, x) == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * np.abs(expected).max())


def test_the_energy_of_symplectic_methods_stays_in_a_band_and_that_of_rk4_falls() -> None:
    (text,) = comparisons.energy("", steps=4000, starts=4)
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines()[4:]}
    assert float(rows["gauss6"][0]) < float(rows["gauss4"][0]) < float(rows["midpoint"][0]) < 1e-2
    assert float(rows["rk4"][1]) < 0.0
