"""Error and run time: errors are those of closed forms, orders are those declared."""

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from pytest import approx, raises

import dynamics as dyn
from dynamics.experiments.accuracy_task import INTERVALS, AccuracyTask
from dynamics.experiments.work_precision import measurement
from dynamics.experiments.work_precision.measurement import CHOSEN, EQUAL, FLOOR_ERROR, ErrorMetrics, Outcome, Solver
from dynamics.experiments.work_precision.named_tasks import TASKS, load
from dynamics.experiments.work_precision.work_precision import (
    Curve,
    Point,
    WorkPrecision,
    curve as curve_of,
    fitted_order,
    targets,
    to_csv,
    work_precision,
)
from dynamics.integrators import METHODS
from dynamics.multiprecision import Reference
from tests.each_row import each_row

T_END = 10.0  # s, of the scene spring_mass: q = cos t
ROUNDING = 1e-9  # a thousand times that of a power of R(i h) in float64
LEADING = 1e-3  # relative, of an error at least 1e-9: what rounding adds to it
REPEATED = 1e-4  # relative, of an error: the same steps in another program
TIMES = np.linspace(0.0, T_END, INTERVALS + 1)


@pytest.fixture(scope="module")
def report() -> WorkPrecision:
    """The oscillator by some of ours, quickly."""
    pytest.importorskip("llvmlite")
    methods = ("euler", "rk4", "dop853", "verlet", "midpoint", "radau")
    return work_precision("spring_mass", methods=methods, turns=1, limit=0.05)


def curve(report: WorkPrecision, name: str) -> Curve:
    return next(each for each in report.curves if each.name == name)


def after(multiplier: complex, count: int) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """q - i qd of the oscillator at TIMES, when a step multiplies it by that; exactly, it turns by exp(i t)."""
    return multiplier ** (np.arange(INTERVALS + 1) * (count // INTERVALS))


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("euler", lambda w: 1 + w),
        ("rk4", lambda w: 1 + w + w**2 / 2 + w**3 / 6 + w**4 / 24),
        ("midpoint", lambda w: (1 + w / 2) / (1 - w / 2)),
    ],
)
def test_errors_are_those_of_the_method_s_stability_function(report: WorkPrecision, name: str, factor: Any) -> None:
    """A step of a Runge-Kutta method multiplies q - i qd by R(i h), so that its error is known without a run."""
    largest = np.array([1.0, np.abs(np.sin(TIMES)).max()])  # of q and qd
    for point in curve(report, name).points:
        count = int(point.knob)
        found = after(factor(1j * T_END / count), count) - np.exp(1j * TIMES)
        errors = np.max(np.abs([found.real, found.imag]).T / largest, axis=1)
        assert point.steps == count
        assert point.step == approx(T_END / count)
        if errors[-1] > ROUNDING:
            assert point.error == approx(errors[-1], rel=LEADING)
            assert point.largest == approx(errors.max(), rel=LEADING)


def test_energy_drift_is_that_of_the_stability_function(report: WorkPrecision) -> None:
    for point in curve(report, "rk4").points:
        count = int(point.knob)
        w = 1j * T_END / count
        energy = np.abs(after(1 + w + w**2 / 2 + w**3 / 6 + w**4 / 24, count)) ** 2 / 2
        if abs(energy[-1] - 0.5) > ROUNDING:
            assert point.drift == approx(np.abs(energy - 0.5).max() / (np.sin(TIMES) ** 2 / 2).max(), rel=LEADING)


def test_counts_are_those_of_a_simulation(report: WorkPrecision) -> None:
    """The same run through `simulate`, which makes its program by itself."""
    scene = dyn.scenes.load("spring_mass")
    for name in ("dop853", "radau"):
        point = next(each for each in curve(report, name).points if each.knob == approx(1e-6))
        smallest = float(np.abs(np.sin(TIMES)).max())  # of the largest values of q and qd
        run = dyn.simulate(scene, scene.q, scene.qd, T_END, name, rtol=point.knob, atol=point.knob * smallest)
        counts = run.stats.steps, run.stats.rejected, run.stats.nfev
        assert (point.steps, point.rejected, point.evaluations) == counts
        error = max(abs(run.q[-1, 0] - math.cos(T_END)), abs(run.qd[-1, 0] + math.sin(T_END)) / smallest)
        assert point.error == approx(error, rel=REPEATED)
        assert point.largest >= point.error
    point = curve(report, "rk4").points[2]
    assert (point.steps, point.evaluations) == (point.knob, 4 * point.knob)


def test_the_absolute_tolerance_goes_with_the_smallest_state() -> None:
    scene = dyn.scenes.load("spring_mass")
    found = load("spring_mass")
    outcome = measurement.Ours("dop853", found, 1e-4, measurement.problem_of(found)).ready(1e-5)()
    run = dyn.simulate(scene, scene.q, scene.qd, T_END, "dop853", rtol=1e-5, atol=1e-9)
    assert (outcome.steps, outcome.evaluations) == (run.stats.steps, run.stats.nfev)
    assert outcome.steps != dyn.simulate(scene, scene.q, scene.qd, T_END, "dop853", rtol=1e-5, atol=1e-5).stats.steps


def test_knobs_go_from_coarse_to_fine_and_stop(report: WorkPrecision) -> None:
    for each in report.curves:
        knobs = [point.knob for point in each.points]
        assert knobs == sorted(knobs, reverse=each.kind == CHOSEN)
        assert each.stopped
        assert all(0.0 < point.seconds <= point.median for point in each.points)
        assert each.kind == (CHOSEN if METHODS[each.name].adaptive else EQUAL)


def test_the_fitted_order_is_the_declared_one(report: WorkPrecision) -> None:
    for name in ("euler", "rk4", "verlet", "midpoint"):
        found = curve(report, name)
        assert found.fitted == approx(found.order, abs=0.05)


def test_an_order_is_fitted_above_rounding_alone() -> None:
    steps = [2.0**-k for k in range(3, 16)]
    errors = [7.0 * h**3 + 1e-15 for h in steps]
    assert fitted_order(steps, errors, 3) == approx(3.0, abs=1e-3)
    assert fitted_order(steps, [50.0 * h**3 * (1 + 20 * h) for h in steps], 3) == approx(3.0, abs=0.05)
    assert fitted_order(steps[:2], errors[:2]) is None
    assert fitted_order(steps, [FLOOR_ERROR / 2] * len(steps)) is None


def point(error: float, seconds: float, knob: float = 1e-6) -> Point:
    return Point(knob, 0.1, seconds, seconds, 10, 0, 40, error, error, None)


def test_targets_are_the_fastest_runs_that_are_good_enough() -> None:
    curves = [
        Curve("rk4", EQUAL, 4, None, "", (point(1e-2, 1.0), point(1e-7, 4.0))),
        Curve("dop853", CHOSEN, 8, None, "", (point(1e-7, 2.0), point(1e-13, 8.0))),
    ]
    found = [(each["error"], each["name"], each["seconds"]) for each in targets(curves)]
    assert found == [(1e-3, "dop853", 2.0), (1e-6, "dop853", 2.0), (1e-9, "dop853", 8.0), (1e-12, "dop853", 8.0)]


def test_csv_and_json_hold_the_points(report: WorkPrecision) -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv(report))))
    assert len(rows) == sum(len(each.points) for each in report.curves)
    first = report.curves[0].points[0]
    assert (float(rows[0]["error_at_end"]), int(rows[0]["steps"])) == (first.error, first.steps)
    content = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert content["reference_error"] <= 1e-30
    assert content["curves"][0]["points"][0]["error"] == first.error
    assert content["targets"][0]["error"] == 1e-3


def exact_motion(found: AccuracyTask, digits: int) -> Reference:
    exact = found.solution(found.times, digits=digits)
    assert exact is not None
    return exact


def task(name: str, **options: Any) -> tuple[AccuracyTask, ErrorMetrics, float]:
    found = load(name, **options)
    metrics = ErrorMetrics(found, exact_motion(found, 20))
    return found, metrics, metrics.smallest


class Broken(Solver):
    """Raises, gives no numbers, and gets better only at fine knobs."""

    tolerances: Sequence[float] = (1e-1, 1e-2, 1e-3, 1e-4)

    def ready(self, knob: float) -> Any:
        def run() -> Outcome:
            if knob == 1e-1:
                raise RuntimeError("too\ncoarse")
            if knob == 1e-4:
                return Outcome(np.array([math.nan, 0.0]))
            return Outcome(np.array([math.cos(T_END), -math.sin(T_END)]) + knob, 1)

        return measurement.Run(run)

    def rows(self, knob: float) -> Any:
        if knob == 1e-2:
            raise RuntimeError("not at these instants")
        return np.full((INTERVALS + 1, 2), math.nan)


def test_a_solver_that_fails_keeps_its_good_points_and_a_reason() -> None:
    found, metrics, smallest = task("spring_mass")
    entry = measurement.sweep(Broken("broken", found, smallest), metrics.at_end, 1.0)
    assert [each.knob for each in entry.tried] == [1e-2, 1e-3]
    assert entry.stopped == "is not finite"
    assert entry.tried[0].error == approx(1e-2, rel=1e-2)
    measurement.time_in_turns(entry.tried, 1)
    for each in curve_of(entry, metrics).points:
        assert each.largest == math.inf
        assert each.drift is None


def test_settings() -> None:
    assert {"kepler 0.3", "kepler 0.9", "robertson"} <= TASKS.keys()
    arm, planet, reaction = load("triple_pendulum"), load("kepler 0.9"), load("robertson")
    assert (arm.conservative, planet.conservative, reaction.conservative) == (False, True, False)
    assert not reaction.mechanical
    assert len(arm.times) == INTERVALS + 1
    assert (arm.times[-1], reaction.times) == (arm.t_end, [0.0, 1e11])
    moved = load("triple_pendulum", t_end=1.5, start=[0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    assert (moved.t_end, moved.start) == (1.5, (0.1, 0.2, 0.3, 0.0, 0.0, 0.0))
    assert load("damped spring pendulum, k = 1e+08").name == load("spring pendulum 1e8").name


def test_another_start_has_another_exact_motion() -> None:
    found = load("spring_mass", start=[0.0, 2.0], t_end=1.0)
    exact = exact_motion(found, 15)
    assert exact.x[-1] == approx(np.array([2.0 * math.sin(1.0), 2.0 * math.cos(1.0)]), rel=1e-14)


@each_row(
    ("arguments", "said"),
    [
        ({"name": "nothing"}, "there is no scene 'nothing'"),
        ({"name": "spring_mass", "options": {"t_end": -1.0}}, "t_end must be positive"),
        (
            {"name": "spring_mass", "options": {"start": [1.0]}},
            r"the start needs 2 numbers \(q.theta, qd.theta\), got 1",
        ),
        ({"name": "kepler 0.3", "options": {"start": [1.0] * 4}}, "has a start of its own"),
        ({"name": "spring_mass", "methods": ["rk5"]}, "there is no method 'rk5'"),
        ({"name": "spring_mass", "turns": 0}, "turns must be at least 1"),
    ],
)
def test_mistakes(arguments: dict[str, Any], said: str) -> None:
    with raises(ValueError, match=said):
        work_precision(**arguments)


def test_a_start_without_rates_is_moved_and_said(tmp_path) -> None:
    """A planet at the center that attracts it, where a model of one's own starts by default."""
    text = "import cgraph as cg, dynamics as dyn\nmodel = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2)"
    (tmp_path / "planet.py").write_text(f"{text} + 1.0 / cg.sqrt(q[0] ** 2 + q[1] ** 2), 'x y')\n")
    task = load(f"{tmp_path / 'planet.py'}:model")
    assert any(task.q)
    assert "q.x" in task.about
