"""Limits of joints as numbers: from files, to files, and where they are shown; beside MuJoCo's and Pinocchio's."""

import json
import math
import pickle
import re
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from dynamics.multibody.bodies.body import ANYTHING
from tests.dynamics.io.test_urdf import joint, link, robot
from tests.each_row import each_row
from viz import cli
from viz.models.live_motion import live_of

LEFT_OUT = pytest.mark.filterwarnings("ignore:.*left out:dynamics.MechanismWarning")
HALF = dyn.Limits((-0.5, 0.5))
Y = '<axis xyz="0 1 0"/>'
ROBOT = robot(
    *[link("base"), *[link(name, 1.0, np.eye(3)) for name in ("hinge", "wheel", "slide")]],
    joint("j_hinge", "revolute", "base", "hinge", f'{Y}<limit lower="-1" upper="2" effort="30" velocity="3.5"/>'),
    joint("j_wheel", "continuous", "hinge", "wheel", f'{Y}<limit effort="5" velocity="7"/>'),
    joint("j_slide", "prismatic", "wheel", "slide", f'{Y}<limit lower="0" upper="0.2" effort="50" velocity="0.5"/>'),
)
MODEL = """<mujoco><compiler angle="degree" autolimits="true"/><worldbody>
  <body name="a"><joint name="s" axis="0 1 0" range="-90 45" actuatorfrcrange="-8 9"/><geom size=".1"/>
    <body name="b" pos="0 0 -.5"><joint name="e" axis="0 1 0"/><joint name="p" type="slide" range="0 .3"/>
      <geom size=".1"/>
      <body name="c"><joint name="r" type="ball" range="0 30"/><geom size=".1"/></body></body></body></worldbody>
  <actuator><motor joint="s" gear="-3" ctrlrange="-1 4"/><motor joint="s" ctrlrange="-2 2"/>
    <motor joint="e" gear="2" forcerange="-1 5"/><position joint="p" kp="30" ctrlrange="-1 1" forcerange="-20 20"/>
  </actuator></mujoco>"""


@LEFT_OUT
def test_those_of_urdf_are_read() -> None:
    arm = dyn.load_urdf(ROBOT)
    assert arm.limits == {
        "j_hinge": dyn.Limits((-1.0, 2.0), (-3.5, 3.5), (-30.0, 30.0)),
        "j_wheel": dyn.Limits(velocity=(-7.0, 7.0), effort=(-5.0, 5.0)),
        "j_slide": dyn.Limits((0.0, 0.2), (-0.5, 0.5), (-50.0, 50.0)),
    }
    assert pickle.loads(pickle.dumps(arm)).limits == arm.limits
    assert list(arm.lock("wheel").limits) == ["j_hinge", "j_slide"]


@LEFT_OUT
def test_mujoco_reads_what_is_written() -> None:
    mujoco = pytest.importorskip("mujoco")
    for arm in (dyn.load_urdf(ROBOT), dyn.load_mjcf(MODEL)):
        with pytest.warns(dyn.MechanismWarning, match="left out") if arm.limits.get("j_hinge") else nullcontext():
            text = dyn.to_mjcf(arm)
        model = mujoco.MjModel.from_xml_string(text)
        again = dyn.load_mjcf(text)
        assert not again.left_out  # MuJoCo holds no motion to them, as we do not
        assert again.limits == {name: replace(each, velocity=ANYTHING) for name, each in arm.limits.items()}
        for j in [j for j in range(model.njnt) if model.joint(j).name in again.limits]:  # a ball has four coordinates
            name = model.joint(j).name
            position = tuple(model.jnt_range[j]) if model.jnt_limited[j] else ANYTHING
            effort = tuple(model.jnt_actfrcrange[j]) if model.jnt_actfrclimited[j] else ANYTHING
            assert (position, effort) == (again.limits[name].position, again.limits[name].effort)


@LEFT_OUT
def test_those_of_mjcf_are_mujocos() -> None:
    mujoco = pytest.importorskip("mujoco")
    arm, model = dyn.load_mjcf(MODEL), mujoco.MjModel.from_xml_string(MODEL)
    for j in range(3):
        expected = tuple(model.jnt_range[j]) if model.jnt_limited[j] else (-math.inf, math.inf)
        assert arm.limits[model.joint(j).name].position == expected
    efforts = {name: each.effort for name, each in arm.limits.items()}
    assert efforts["s"] == (-8.0, 5.0)  # -12 to 3 by a gear of -3, and 2 to both sides, within -8 to 9
    assert (efforts["e"], efforts["p"]) == ((-2.0, 10.0), (-20.0, 20.0))
    assert {arm.limits[name] for name in arm.coordinates[3:]} == {dyn.Limits()}  # a ball has none
    data = mujoco.MjData(model)
    forces = []
    for ctrl in np.random.default_rng(0).uniform(-50.0, 50.0, (200, model.nu)):
        data.ctrl[:] = ctrl
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_actuator[:2].copy())
    assert np.min(forces, axis=0) == pytest.approx([-8.0, -2.0])
    assert np.max(forces, axis=0) == pytest.approx([5.0, 10.0])


def test_a_joint_of_several_coordinates_has_one_for_each() -> None:
    each = (HALF, None)
    body = dyn.Body("b", dyn.Joint("universal", limits=each), mass=1.0, inertia=(1.0, 1.0, 1.0))
    assert [*dyn.Mechanism([body]).limits.values()] == [HALF, dyn.Limits()]
    with pytest.raises(dyn.MechanismError, match=r"limits must be one number, or 2 for angle1, angle2"):
        dyn.Mechanism([dyn.Body("b", dyn.Joint("universal", limits=[None] * 3), mass=1.0)])


@each_row(
    "made, said",
    [
        (lambda: dyn.Limits((1.0, -1.0)), "limits: position must be (lower, upper), got (1.0, -1.0)"),
        (lambda: dyn.Limits(velocity=(0.0, math.nan)), "limits: velocity must be (lower, upper), got (0.0, nan)"),
        (
            lambda: dyn.Mechanism([dyn.Body("b", dyn.Joint("ball", limits=HALF), mass=1.0)]),
            "body 'b': a joint of the kind 'ball' has no limits",
        ),
    ],
)
def test_what_are_no_limits_is_told(made: Any, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        made()


def test_what_cannot_be_in_a_file_is_said() -> None:
    pytest.importorskip("mujoco")
    half = dyn.Joint("revolute", limits=dyn.Limits((-1.0, math.inf), (0.0, 1.0), (0.0, 0.0)))
    said = "MJCF has no limits of velocity (b) and no limits whose ends are one number (b): left out"
    with pytest.warns(dyn.MechanismWarning, match=re.escape(said)):
        text = dyn.to_mjcf(dyn.Mechanism([dyn.Body("b", half, mass=1.0, inertia=(1.0, 1.0, 1.0))]))
    assert dyn.load_mjcf(text).limits == {"b": dyn.Limits((-1.0, math.inf))}


@LEFT_OUT
def test_a_run_says_which_it_left_and_sliders_end_there(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "arm.urdf").write_text(ROBOT, encoding="utf-8")
    start = "--start=qd.j_hinge=4,qd.j_slide=-0.1"
    cli.main(["simulate", str(tmp_path / "arm.urdf"), start, "--t-end=0.4", "--json"])
    said = json.loads(capsys.readouterr().out)["beyond_limits"]
    assert [each.partition(" at ")[0] for each in said] == [
        "position of j_slide leaves 0 to 0.2 m",
        "velocity of j_hinge leaves -3.5 to 3.5 rad/s",
    ]
    data: Any = live_of(dyn.scenes.of_file(tmp_path / "arm.urdf")).to_dict()
    ends = {each["name"]: (each["low"], each["high"]) for each in data["inputs"]}
    assert ends["q0"] == (-1.0, 2.0)
    assert ends["q2"] == (0.0, 0.2)
    assert (ends["qd1"], ends["tau1"]) == ((-7.0, 7.0), (-5.0, 5.0))
    assert ends["q1"] == (-math.pi, math.pi)
