"""Starts of scenes: by names, and where rest would show nothing."""

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import scenes
from dynamics.scenes.start import moving_start, rest_text, start_text, with_start
from tests.each_row import each_row

ARM = scenes.of_model(dyn.planar_arm([1.0, 1.0], [1.0, 1.0]))
FIRST = scenes.of_model(dyn.OdeSystem(lambda x, t: [-x[0]], ["decay"]))


@each_row(
    ("scene", "start", "q", "qd"),
    [
        (ARM, {"q0": 0.3, "qd1": 1.0}, (0.3, 0.0), (0.0, 1.0)),
        (ARM, {"q.joint 2": 0.3, "joint 1": 1}, (1.0, 0.3), (0.0, 0.0)),
        (ARM, [1.0, 2.0, 3.0, 4.0], (1.0, 2.0), (3.0, 4.0)),
        (ARM, {}, (0.0, 0.0), (0.0, 0.0)),
        (FIRST, {"decay": 2.0}, (2.0,), ()),
        (FIRST, {"q0": 2.0}, (2.0,), ()),
    ],
)
def test_a_start_is_given_by_names_or_as_numbers(scene, start, q, qd):
    started = with_start(scene, start)
    assert (started.q, started.qd) == (q, qd)


@each_row(
    ("start", "message"),
    [
        ({"joint 3": 1.0}, "there is no joint 3; did you mean 'q.joint 2'"),
        ({"q0": 1.0, "joint 1": 1.0}, "joint 1 is given twice, once as q0"),
        ({"q0": "x"}, "start: q0 must be"),
        ({"q0": np.inf}, "q needs 2 finite numbers"),
        ([1.0], r"the start needs 4 numbers \(q.joint 1, q.joint 2, qd.joint 1, qd.joint 2\), got 1"),
    ],
)
def test_a_start_that_does_not_fit_is_told(start, message):
    with pytest.raises((TypeError, ValueError), match=message):
        with_start(ARM, start)


@each_row("scene", [*map(scenes.load, scenes.names()), FIRST])
def test_every_name_of_a_state_sets_that_one_alone(scene):
    names = [f"q{i}" for i in range(len(scene.q))] + [f"qd{i}" for i in range(len(scene.qd))]
    called = dyn.display_names(scene)
    for i, name in enumerate(names):
        wanted = [*scene.q, *scene.qd]
        wanted[i] = 7.0
        for each in {name, called.get(name, name), *scene.coordinates[i : i + 1]}:
            started = with_start(scene, {each: 7.0})
            assert [*started.q, *started.qd] == wanted


def system(energy, **more):
    return scenes.of_model(dyn.System(energy, "x y", **more))


RESTING = {
    "a hanging arm": ARM,
    "a free particle": system(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2)),
    "attraction without a place at its center": system(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.sqrt(q[0] ** 2 + q[1] ** 2)
    ),
    "a rod that hangs": system(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1],
        constraints=lambda q, t: {"rod": q[0] ** 2 + (q[1] - 1.0) ** 2 - 1.0},
    ),
    "decay": FIRST,
    "a small stiff thing": system(lambda q, qd, t: 1e-12 * (qd[0] ** 2 + qd[1] ** 2) - 1e-30 * (q[0] ** 2 + q[1] ** 2)),
    "a slide without gravity": scenes.of_model(
        dyn.Mechanism([dyn.Body("b", dyn.Joint("prismatic"), mass=1.0)], gravity=(0.0, 0.0, 0.0))
    ),
}


@each_row("name", RESTING)
def test_a_scene_that_would_rest_for_ever_starts_where_it_moves(name):
    scene, rate = moving_start(RESTING[name]), dyn.state_equation(RESTING[name])
    assert scene.q + scene.qd != RESTING[name].q + RESTING[name].qd
    values = dict.fromkeys(rate.input_names, 0.0) | dict(zip(rate.input_names, scene.q + scene.qd, strict=False))
    rates = np.array(list(rate.evaluate(values).values()))
    assert np.isfinite(rates).all()
    assert rates.any()
    assert moving_start(scene) is scene
    driven = moving_start(RESTING[name], free=False)  # something else may move it
    assert (driven is RESTING[name]) == ("center" not in name)
    assert start_text(scene) != "0"
    motion = dyn.simulate(scene, scene.q, scene.qd or None, 3.0)  # a center that attracts is passed by
    assert motion.stats.success
    why = "at its start the rates are not finite" if "center" in name else "at rest nothing moves"
    assert rest_text(RESTING[name], scene) == f"{why}, so it starts at {start_text(scene)}"


def test_many_joints_are_not_wound_up():
    scene = moving_start(scenes.of_model(dyn.planar_arm([1.0] * 9, [1.0] * 9)))
    assert sum(scene.q) == pytest.approx(np.pi)
    assert start_text(scene).endswith(", and 5 more")


@each_row("name", scenes.names())
def test_a_scene_that_moves_keeps_its_start(name):
    scene = scenes.load(name)
    assert moving_start(scene) is scene
