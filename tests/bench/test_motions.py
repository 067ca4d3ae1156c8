"""Motions at equal true error: every group has its cell or a reason, and an exact end that is none is noticed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from dynamics.experiments.work_precision.measurement import Entry, Outcome, Run, Tried, problem_of
from dynamics.multiprecision import Reference
from tests.bench.motions.motion_runs import HeyokaBatch, Many, Motion
from tests.bench.motions.motion_scenes import MOTIONS, TIMES, exact_end, sizes
from tests.bench.motions.motions import Row, cost, motions
from tests.bench.motions.trajectory_peers import OURS, Heyoka
from tests.each_row import each_row

NAME, T_END = "Henon and Heiles", TIMES[0]


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    pytest.importorskip("scipy")
    return list(motions([NAME], [T_END], (1e-6, 1e-9), ["SciPy", "MuJoCo"], repeats=1, count=20))


def test_a_motion_and_its_ensemble_have_rows_of_every_error(rows: list[Row]) -> None:
    assert [(row.scene, row.t_end, row.error, row.count) for row in rows] == [
        (NAME, T_END, error, count) for count in (1, 20) for error in (1e-6, 1e-9)
    ]
    for row in rows:
        assert row.doubt == ""
        assert row.ratio is None  # heyoka was not asked
        groups = {OURS, "SciPy"} if row.count == 1 else {OURS}
        assert set(row.cells) == groups
        assert all(cell.seconds > 0.0 and cell.steps for cell in row.cells.values())
    assert [set(row.missed) for row in rows] == [{"MuJoCo"}] * 2 + [set()] * 2


def test_a_wrong_exact_end_is_noticed() -> None:
    pytest.importorskip("scipy")
    end = exact_end(NAME, T_END)
    assert isinstance(end, Reference)
    wrong = replace(end, decimal=(tuple([f"{float(value) + 1e-7:.17g}" for value in end.decimal[0]]),))
    row, *_ = motions([NAME], [T_END], [1e-6], ["SciPy"], repeats=1, count=0, exact={(NAME, T_END): wrong})
    assert "the exact end is doubted" in row.doubt


def test_a_cost_is_interpolated_between_the_runs_about_an_error() -> None:
    def tried(knob: float, error: float, seconds: float) -> Tried:
        run, outcome = Run(lambda: None, seconds=[seconds, 9.0], processor=[seconds / 2, 9.0]), Outcome(np.zeros(1), 7)
        return Tried(knob, run, outcome, error)

    entry = Entry(Motion("dop853", MOTIONS[NAME](), 1.0), [tried(1e-4, 1e-5, 1.0), tried(1e-6, 1e-9, 4.0)])
    between = cost(entry, 1e-7, 1)
    assert between is not None
    assert (between.seconds, between.processor, between.knob) == (approx(2.0), approx(1.0), approx(1e-5))
    for error, seconds in ((1e-4, 1.0), (1e-9, 4.0)):
        end = cost(entry, error, 2)
        assert end is not None
        assert end.seconds == approx(seconds / 2)
    assert cost(entry, 1e-12, 1) is None


LARGE = ("arm 7", "free 35")  # take seconds to compile


@each_row("name", [pytest.param(name, marks=pytest.mark.slow) if name in LARGE else name for name in MOTIONS])
def test_exact_ends_are_those_of_the_motions(name: str) -> None:
    """Which is noticed by a run that takes the shortest."""
    task = replace(MOTIONS[name](), t_end=T_END, size=tuple(sizes(name)))
    end = exact_end(name, T_END)
    assert isinstance(end, Reference)
    outcome = Motion("radau" if task.stiff else "dop853", task, 1.0).ready(1e-12)()
    assert np.max(np.abs(end.deviation(outcome.x[None])) / sizes(name)) < 1e-9


def test_heyoka_batches_end_where_ours_do() -> None:
    pytest.importorskip("heyoka")
    task = replace(MOTIONS[NAME](), t_end=1.0)
    starts = np.array(task.start) + 0.01 * np.random.default_rng(0).normal(size=(11, 4))  # no whole number of vectors
    theirs = HeyokaBatch(task, starts, Heyoka(task, 1.0, problem_of(task))).ready(1e-15)()
    ours = Many("dop853", task, starts).ready(1e-13)()
    assert theirs.x == approx(ours.x, rel=1e-11, abs=1e-11)
    assert theirs.steps
