"""Sides of surfaces along a run: which hold, what rows are by them, and by how much the rate of a model jumps there."""

import pickle
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.integrators.surfaces import surfaces

ROUNDING = 1e-13  # relative to numbers near 1
STEPS: list[dict[str, Any]] = [{}, {"form": "momentum"}, {"method": "verlet", "dt": 0.01}]


@pytest.mark.parametrize("options", STEPS)
def test_rows_of_a_block_that_sticks_have_its_acceleration_and_friction(options: dict[str, Any]) -> None:
    block = dyn.System(lambda q, qd, t: qd[0] ** 2 - 6.0 * q[0], "x", forces=lambda q, qd, t: [-8.0 * cg.sign(qd[0])])
    run = dyn.simulate(block, [0.0], [2.0], 1.0, **options)
    rests = run.t >= run.modes.t[1]
    for each in (run, pickle.loads(pickle.dumps(run))):
        np.testing.assert_allclose(each["qdd.x"], np.where(rests, 0.0, -7.0), atol=ROUNDING)
        np.testing.assert_allclose(each["forces.x"], np.where(rests, 6.0, -8.0), rtol=ROUNDING)
    assert run.modes.surfaces == ("p.x / 2" if "form" in options else "qd.x",)
    assert (run.modes.sides.tolist(), run.modes.slides.tolist()) == ([[1.0], [0.0]], [[False], [True]])
    assert ", 1 turn at surfaces;" in repr(run)


def test_rows_before_and_after_a_reset_have_sides_of_their_own() -> None:
    bounce = dyn.Event("bounce", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.8 * qd[0]]))
    ball = dyn.System(lambda q, qd, t: qd[0] ** 2 / 2, "y", forces=lambda q, qd, t: [-9.0 - cg.sign(qd[0])])
    run = dyn.simulate(ball, [1.0], [-1.0], 0.7, events=bounce)
    np.testing.assert_allclose(run["qdd.y"], -9.0 - np.sign(run["qd.y"]), rtol=ROUNDING)
    assert (np.diff(run.t) == 0.0).sum() == len(run.events["bounce"].t) == 1


def test_a_motion_back_has_the_sides_of_that_forth() -> None:
    model = dyn.OdeSystem(lambda x, t, p: [cg.floor(t / p["T"]) + abs(abs(x[0]) - 1.0)], "x", {"T": 1.0})
    forth = dyn.simulate(model, [-0.3], None, 2.5)
    back = dyn.simulate(model, forth.q[-1], None, 0.0, t0=2.5)
    assert forth.modes.surfaces == ("floor(t)", "x", "sign(x) * x - 1")
    times = np.linspace(0.1, 2.4, 7)
    assert (back.modes.at(times[::-1])[::-1] == forth.modes.at(times)).all()
    assert len(np.unique(forth.modes.at(times), axis=0)) > 3


def test_the_rate_of_a_model_jumps_or_kinks_by_what_differences_say() -> None:
    def forces(q: list[cg.Node], qd: list[cg.Node], t: cg.Node, p: Any) -> list[cg.Node]:
        return [cg.where(cg.less(qd[0], p["belt"]), 2.0, -q[0]) - 3.0 * cg.maximum(q[0] - 1.0, 0.0)]

    model = dyn.System(
        lambda q, qd, t: qd[0] ** 2 / 2 - 4.0 * cg.maximum(t, 0.0) ** 3, "x", {"belt": 0.5}, forces=forces
    )
    at = {"q0": 0.3, "qd0": 0.1, "t": 2.0, "belt": 0.5}
    found = {each.formula: (each.kind, each.by) for each in surfaces(model, at)}
    rate = dyn.state_equation(model)
    low, high = (rate.evaluate(at | {"qd0": v, "tau0": 0.0})["qd0_dot"] for v in (0.5 - 1e-9, 0.5 + 1e-9))
    assert found["qd.x - belt"] == ("jump", {"qd0_dot": pytest.approx(high - low)})
    assert found["q.x - 1"] == ("kink", {"qd0_dot": pytest.approx(-3.0)})
    assert all(set(each.tags) == {"force"} for each in surfaces(model, at))


def test_a_start_from_which_no_sides_let_the_motion_go_on_is_a_trajectory_of_one_row() -> None:
    """Signs that multiply: of the four pairs none stays, and no mixture of them holds the origin."""

    def rate(x: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        a, b = map(cg.sign, x)
        return [2.0 * b + a - a * b - 1.0, 1.0 - 2.0 * a - 2.0 * a * b]

    with pytest.warns(dyn.SimulationWarning, match="no sides of the surfaces"):
        run = dyn.simulate(dyn.OdeSystem(rate, "x y"), [0.0, 0.0], None, 1.0)
    assert not run.success
    assert run.modes is not None
    assert run.t.tolist() == [0.0]
    assert run.modes.sides.shape == (0, 2)
