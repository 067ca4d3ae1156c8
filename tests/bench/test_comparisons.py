"""Comparisons of integrators at equal error: who is within it, what is fastest, and whose rates are whose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import cgraph as cg
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.experiments.work_precision.work_precision import Subject, subject
from tests.bench.motions import comparisons
from tests.bench.motions.comparisons import Comparison, numpy_rate

ERROR = 1e-6
ROUNDING = 1e-12  # of rates written by hand, beside those of the graph


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    return subject(load("spring_mass", t_end=3.0), tmp_path_factory.mktemp("exact"))


def test_runs_within_the_error_are_kept_and_refusals_are_told(spring: Subject) -> None:
    race = Comparison(spring, 1e-9)
    race.ours(["dop853"], [1e-2, 1e-10])
    race.ours(["rk4"], [64, 4096])
    assert all(each.error <= 1e-9 for runs in race.tried.values() for each in runs)
    assert {name: [each.knob for each in runs] for name, runs in race.tried.items()} == {
        "dop853": [1e-10],
        "rk4": [4096],
    }
    lines = race.text().splitlines()
    assert {line.split()[0] for line in lines[2:4]} == {"dop853", "rk4"}
    assert lines[2].split()[2] == "1.00"  # the fastest of ours comes first


def test_rates_written_in_numpy_are_those_of_the_graph(tmp_path: Any) -> None:
    at = subject(load("triple_pendulum", t_end=0.1), tmp_path)
    compiled, rate = cg.compile(at.problem.rate, "python"), numpy_rate()
    for x in np.random.default_rng(1).normal(size=(5, 6)):
        expected = np.array(compiled.values([*x.tolist(), 0.0]))
        assert rate(0.0, x) == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * np.abs(expected).max())


def test_the_energy_of_symplectic_methods_stays_in_a_band_and_that_of_rk4_falls() -> None:
    (text,) = comparisons.energy(steps=4000, starts=4)
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines()[4:]}
    assert float(rows["gauss6"][0]) < float(rows["gauss4"][0]) < float(rows["midpoint"][0]) < 1e-2
    assert float(rows["rk4"][1]) < 0.0
