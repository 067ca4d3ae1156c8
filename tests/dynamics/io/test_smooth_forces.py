"""Smooth forces of robot files: limits as springs, friction without its jump, actuators."""

import math
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics.scenes.start import with_start
from tests.dynamics.io.test_contacts import silently

MUJOCO_ERROR = 1e-12  # relative to the largest acceleration
RUN_ERROR = 1e-6  # of runs at rtol 1e-9 through kinks

MODEL = """<mujoco><option>{flags}</option><worldbody><body name="a">
<joint name="ja" type="hinge" axis="0 1 0" range="-60 60" limited="true" frictionloss="0.1"
 actuatorfrcrange="-200 200" actuatorfrclimited="true"/><geom type="capsule" size=".05 .2" mass="1"/>
<body name="b" pos="0 0 .5"><joint name="jb" type="slide" axis="1 0 0.3" ref="0.1" frictionloss=".2"/>
<joint name="jc" type="hinge" axis="1 0 0"/><geom type="capsule" size=".04 .3" mass="0.4" pos=".1 0 0.1"/>
</body></body></worldbody><actuator>
<position name="x y" joint="ja" kp="50" kv="2" gear="3" ctrlrange="-.5 .5" ctrllimited="true"/>
<velocity name="x_y" joint="jb" kv="4" gear="-2" forcerange="-1 1" forcelimited="true"/>
<motor joint="jb" gear="5" group="1"/>
<general name="affine" joint="jc" gaintype="affine" gainprm="2 3 4" biastype="affine" biasprm="1 -2 -3"/>
<damper name="damper" joint="jc" kv="0.7" ctrlrange="0 2"/>
<motor name="unused" joint="jc" group="2"/>
{more}</actuator></mujoco>"""
INPUTS = ["ctrl_x_y", "ctrl_x_y_", "ctrl_2", "ctrl_affine", "ctrl_damper"]
SMOOTH: dict[str, Any] = {"limits": (1e3, 0.1), "friction": 0.01, "actuators": True}
ROBOT = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/><origin xyz="0 0 -.5"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="hinge" type="revolute">
<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-0.5" upper="1" effort="9" velocity="9"/>
<dynamics damping="0.2" friction="0.3"/></joint></robot>"""


PART = '<inertial pos="0.1 0.2 -0.3" mass="1.3" fullinertia="0.3 0.4 0.5 0.01 0.02 -0.03"/>'
HAND = f"""<mujoco><option>{{flags}}</option><worldbody><body name="m" mocap="true"/><body name="a" gravcomp="0.7">
<joint name="ja" axis="0 1 0" ref="20"/>{PART}<body name="b" gravcomp="1.4" pos=".1 .2 .3" euler="10 20 30">{PART}
<site name="s" pos=".1 .2 .3" euler="40 10 20"/><body name="c" gravcomp="-0.3" pos=".1 0 .4"><joint name="jc"
 type="slide" ref=".2"/>{PART}
<body name="d" gravcomp="0.3"><joint name="jd" type="slide" axis="1 2 3"/>{PART}</body></body></body>
</body><body name="f" gravcomp="2" pos="1 2 3"><freejoint name="root"/>{PART}
<site name="sf" pos=".3 .2 .1" euler="40 10 20"/></body>
</worldbody><tendon><fixed name="t" stiffness="3" damping=".5" springlength=".1 .2" limited="true" range="0 1"
 frictionloss="2"><joint joint="ja" coef="2"/><joint joint="jc" coef="-.4"/></fixed><fixed name="u" stiffness="3">
<joint joint="jd" coef="2"/><joint joint="jc" coef="-.4"/><joint joint="ja" coef="-.4"/></fixed></tendon><actuator>
<position name="x" tendon="t" kp="10" kv="2" gear="3" ctrlrange="-1 1" forcerange="-30 30"/>
<motor name="y" site="s" gear="1 2 3 4 5 6"/><motor name="z" joint="root" gear="6 5 4 1 2 3" ctrlrange="-.1 .2"/>
<motor name="u" jointinparent="root" gear="6 5 4 1 2 3"/><position name="v" site="sf" kp="3" gear="3 2 1 1 2 2"/>
<motor name="w" joint="ja"/></actuator><keyframe><key name="home" qpos=".1 .2 .3 1 2 3 4 5 6 7" qvel="1 2 3 4 5 6 7 8 9"
 ctrl="1 2 3 4 5 6"/><key/></keyframe></mujoco>"""
NO_RANGES = '<flag contact="disable" limit="disable" frictionloss="disable"/>'


def compiled(flags: str = "", more: str = "") -> Any:
    mj = pytest.importorskip("mujoco").MjModel.from_xml_string(MODEL.format(flags=flags, more=more))
    mj.opt.disableactuator = 1 << 2
    return mj


@mark.parametrize("hand", [False, True])
def test_forces_are_those_of_mujoco(hand: bool) -> None:
    """Gear, gain and bias, ranges, groups that are off; of a hand, tendons, sites, balanced weights: accelerations."""
    mujoco = pytest.importorskip("mujoco")
    mj = mujoco.MjModel.from_xml_string(HAND.format(flags=NO_RANGES)) if hand else compiled(NO_RANGES)
    model = silently(dyn.load_mjcf, mj, **SMOOTH)
    forward, rng = dyn.forward_dynamics(model), np.random.default_rng(1)
    assert model.left_out == ("motions of mocap bodies, which stand where the file has them (m)",) * hand
    inputs = [f"ctrl_{name}" for name in "xyzuvw"] if hand else INPUTS
    assert sorted(forward.input_names[-len(inputs) :]) == sorted(inputs)
    assert dyn.certify(model, states=3, twin=mj).residuals[-1].passed
    clipped = 0
    for _ in range(50):
        data = mujoco.MjData(mj)
        for field in (data.qpos, data.qvel, data.ctrl, data.qfrc_applied):
            field[:] = rng.normal(size=len(field))
        mujoco.mj_normalizeQuat(mj, data.qpos)
        mujoco.mj_forward(mj, data)
        clipped += abs(data.actuator_force[0]) == 30.0 if hand else abs(data.qfrc_actuator[0]) == 200.0
        given = [*data.qpos, *data.qvel, *data.qfrc_applied]
        at = dict(zip(forward.input_names, given, strict=False)) | dict(zip(inputs, data.ctrl, strict=False))
        ours = np.array(list(forward.evaluate(at).values()))
        assert ours == approx(data.qacc, abs=MUJOCO_ERROR * np.abs(data.qacc).max())
    assert 10 < clipped < 50


def test_a_keyframe_is_the_state_that_mujoco_starts_from() -> None:
    """By name or number, with inputs, and what is left of it where a joint is locked and a body taken off."""
    mujoco = pytest.importorskip("mujoco")
    mj = mujoco.MjModel.from_xml_string(HAND.format(flags=""))
    model, data = silently(dyn.load_mjcf, mj, **SMOOTH), mujoco.MjData(mj)
    for k, key in ((0, "home"), (0, 0), (1, "key 1")):
        mujoco.mj_resetDataKeyframe(mj, data, k)
        q, qd = dyn.start(model, key)
        assert (q.tolist(), qd.tolist()) == (data.qpos.tolist(), data.qvel.tolist())
    scene = with_start(dyn.scenes.of_model(model), "home")
    assert [scene.parameters[f"ctrl_{name}"] for name in "xyzuvw"] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    q, qd = dyn.start(model.lock("a", 0.3).detach("f"), "home")
    assert (q.tolist(), qd.tolist()) == ([0.2, 0.3], [2.0, 3.0])
    with raises(ValueError, match="there is no start 'hone'; did you mean 'home'"):
        dyn.start(model, "hone")
    on_tendon = {type(force).__name__: force.body for force in model.forces if isinstance(force.body, dict)}
    assert [[*on_tendon[kind]] for kind in ("JointLimit", "JointFriction")] == [["a", "c"]] * 2


def test_half_a_balanced_weight_takes_half_the_torque_and_energy_stays() -> None:
    """m g l sin q / 2; the same by every formulation, and a share that is a parameter."""
    rod = dyn.Body("rod", dyn.Joint("revolute", (0, 1, 0)), mass=1.0, center=(0, 0, -1), gravity_compensation="share")
    model = dyn.Mechanism([rod], parameters={"share": 0.5})
    at = {"q0": 0.3, "qd0": 0.0, "qdd0": 0.0, "share": 0.5}
    for name in ("chain_rule", "chain_rule_literal", "newton_euler"):
        torque = dyn.inverse_dynamics(model, name).evaluate(at)["tau0"]
        assert torque == approx(1.449526613674, rel=1e-12)
    run, energy = dyn.simulate(model, [0.3], [0.0], 2.0, rtol=1e-12, atol=1e-12), dyn.energy(model)
    ends = [energy.evaluate({"q0": run.q[k, 0], "qd0": run.qd[k, 0], "share": 0.5})["E"] for k in (0, -1)]
    assert ends[1] == approx(ends[0], rel=1e-10)
    assert dyn.forward_dynamics(model).evaluate({"q0": 1.0, "qd0": 0.0, "tau0": 0.0, "share": 1.0})["qdd0"] == 0.0


def test_what_is_taken_is_not_left_out_and_the_rest_is() -> None:
    mj = compiled(more='<intvelocity name="memory" joint="jc" kp="3" actrange="-1 1"/>')
    with pytest.warns(
        dyn.MechanismWarning, match=r"left out contacts \(.*\); actuators that act with no input .memory"
    ):
        model = dyn.load_mjcf(mj, **SMOOTH)
    kinds = [type(force).__name__ for force in model.forces]
    assert {kind: kinds.count(kind) for kind in kinds} == {"JointLimit": 1, "JointFriction": 2, "Actuator": 5}
    limit = next(force for force in model.forces if isinstance(force, dyn.JointLimit))
    assert (limit.body, limit.upper, limit.stiffness, limit.damping) == ("a", approx(math.pi / 3.0), 1e3, 0.1)
    off = silently(dyn.load_mjcf, compiled('<flag constraint="disable" actuation="disable"/>'), **SMOOTH)
    assert (off.forces, off.left_out) == ((), ())


SEVERAL = """<orientation name="many" joint="ball" kp="5"/><pid name="pid" joint="one" kp="3" velrange="0.2 1"/>
<motor name="least" joint="one" gear="7" ctrlrange="0.5 1" ctrllimited="true"/><motor joint="one" gear="2"/>"""


def test_actuators_after_one_of_several_inputs_keep_their_numbers() -> None:
    """Ranges of inputs and gears are arrays of inputs and outputs, of which an actuator may have several."""
    mujoco = pytest.importorskip("mujoco")
    if not hasattr(mujoco.mjtGain, "mjGAIN_SO3"):
        pytest.skip("before 3.12 MuJoCo has one input for each actuator")
    inertial = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.2 0.3"/>'
    bodies = f'<body><joint name="ball" type="ball"/>{inertial}<body><joint name="one"/>{inertial}</body></body>'
    text = f"<mujoco><worldbody>{bodies}</worldbody><actuator>{SEVERAL}</actuator></mujoco>"
    said = "many: so3, pid: -3 length input at least 0.2"
    with pytest.warns(dyn.MechanismWarning, match="left out"):
        none = dyn.load_mjcf(text)
    least = "least: input at least 0.5 times gear 7"
    assert none.left_out == ("actuators (1)", f"actuators that act with no input ({said}, {least})")
    model = silently(dyn.load_mjcf, text, actuators=True)
    assert model.left_out == (f"actuators that act with no input ({said})",)
    motors = [force for force in model.forces if isinstance(force, dyn.Actuator)]
    assert [(motor.gear, motor.input_range) for motor in motors] == [(7.0, (0.5, 1.0)), (2.0, None)]


def test_limits_and_friction_of_a_urdf() -> None:
    with pytest.warns(dyn.MechanismWarning, match="joint limits .hinge.; friction loss"):
        dyn.load_urdf(ROBOT)
    model = dyn.load_urdf(ROBOT, limits=(200.0, 0.5), friction=0.02)
    assert model.left_out == ()
    state = {"q0": 1.25, "qd0": 0.4, "tau0": 0.0}
    plain = dyn.Mechanism(model.bodies)
    difference = [dyn.forward_dynamics(each).evaluate(state)["qdd0"] for each in (model, plain)]
    force = -200.0 * 0.25 * (1.0 + 0.5 * 0.4) - 0.3 * math.tanh(0.4 / 0.02)
    inertia = 0.1 + 0.5**2
    assert difference[0] - difference[1] == approx(force / inertia)


def cart(*forces: dyn.JointForce) -> dyn.Mechanism:
    return dyn.Mechanism([dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)], forces=forces)


@mark.parametrize("side", [1.0, -1.0])
@mark.parametrize("unit", [1.0, 1e-9])
def test_a_limit_gives_back_what_it_took_but_for_its_damping(side: float, unit: float) -> None:
    """In meters and nanometers: a spring returns the speed v, one with damping v (1 - 2/3 d v) to first order."""
    for d in (0.0, 0.05):
        limit = dyn.JointLimit("cart", -unit, unit, stiffness=2e4, damping=d / unit)
        run = dyn.simulate(cart(limit), [0.5 * side * unit], [side * unit], t_end=1.0)
        returned = -run.qd[-1, 0] / (side * unit)
        assert returned == approx(1.0 - 2.0 / 3.0 * d, abs=d * d + RUN_ERROR)
        assert (side * run.forces[:, 0] <= 0.0).all()


@mark.parametrize(
    ("force", "message"),
    [
        (dyn.JointLimit("cart", 1.0, -1.0, 1e3), "lower must be below upper"),
        (dyn.JointLimit("cart", -1.0, 1.0, -1.0), "stiffness must be finite and at least 0"),
        (dyn.JointFriction("cart", 1.0, -1.0), "velocity must be finite and at least 0"),
        (dyn.Actuator("cart", "u", gain=(1.0,)), "gain needs three finite numbers"),
        (dyn.Actuator("cart", "u", force_range=(1.0, -1.0)), "force_range must be"),
        (dyn.Actuator("nobody", "u"), "unknown body 'nobody'"),
    ],
)
def test_a_joint_force_out_of_range_is_refused(force: dyn.JointForce, message: str) -> None:
    with raises(dyn.MechanismError, match=message):
        cart(force)


@mark.parametrize("options", [{"limits": (0.0, 1.0)}, {"limits": (1.0,)}, {"friction": -1.0}, {"friction": math.nan}])
def test_options_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with raises(dyn.MechanismError, match=next(iter(options))):
        dyn.load_urdf(ROBOT, **options)
