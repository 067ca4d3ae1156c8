"""Forces on bodies: against MuJoCo, virtual work by differences, gravity by another name, and what cannot be one."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import Body, Force, Joint, Mechanism, MechanismError
from dynamics.multibody.algebra.spatial import from_quaternion
from tests.dynamics.mechanisms import FAMILIES, turned_arm
from tests.dynamics.models import Array, at, error, inputs, run, states
from tests.slow import slow
from tests.tolerances import EQUATIONS, SHORT_SUM, SOLVED

ROUNDING = 1e-12  # of the largest entry: two orders of summing the same few terms
DIFFERENCES = 1e-8  # of the largest entry: central differences of positions of size 1 with a step of 1e-5
AGREEMENT = 1e-10  # of the largest entry: rounding of two codes, times the condition number of M
HAND = (0.2, -0.3, 0.5)
VALUE, TORQUE = np.array([3.0, -2.0, 5.0]), np.array([0.7, 1.1, -0.4])


def pushed(mechanism: Mechanism, body: str, frame: str = "world", **given: Any) -> Mechanism:
    value, torque = given.pop("value", tuple(VALUE)), given.pop("torque", tuple(TORQUE))
    return replace(mechanism, forces=[Force(body, value, HAND, frame, torque)], **given)


def generalized(mechanism: Mechanism, state: dict[str, Any]) -> Array:
    """What the forces take from the torque of a motion: (n,) or (count, n)."""
    free = replace(mechanism, forces=(), parameters={})
    return run(dyn.inverse_dynamics(free), state) - run(dyn.inverse_dynamics(mechanism), state)


def points(mechanism: Mechanism, body: str) -> list[cg.Graph]:
    """Where HAND is on the body, its origin, and the tips of its axes."""
    return [mechanism.position(body, point) for point in (HAND, (0, 0, 0), *np.eye(3))]


def pose(graphs: list[cg.Graph], q: Array) -> tuple[Array, Array]:
    """Where HAND is, (3,), and the body's axes, as columns (3, 3), from positions alone."""
    places = [run(graph, {"q": q}) for graph in graphs]
    return places[0], np.column_stack([tip - places[1] for tip in places[2:]])


def work(graphs: list[cg.Graph], q: Array, value: Array, torque: Array, step: float = 1e-5) -> Array:
    """Virtual work along each coordinate, (n,), by central differences: f . dp + torque . dtheta, both in the world."""
    rates, turned = [], pose(graphs, q)[1]
    for unit in np.eye(len(q)):
        (before, old), (after, new) = (pose(graphs, q + sign * step * unit) for sign in (-1.0, 1.0))
        spin = (new - old) @ turned.T  # skew: dR R^T
        turn = 0.5 * np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])
        rates.append((value @ (after - before) + torque @ turn) / (2.0 * step))
    return np.array(rates)


# --- by other means


@mark.parametrize("frame", ["world", "body"])
@mark.parametrize("family", ["mixed", "welded", *slow("serial", "branched")])
def test_a_force_does_the_virtual_work_of_its_point(family: str, frame: str) -> None:
    mechanism = FAMILIES[family](7)
    q = states(mechanism, 1)["q"][0]
    for body in ("b0", "b4", mechanism.bodies[-1].name):
        graphs = points(mechanism, body)
        axes = pose(graphs, q)[1] if frame == "body" else np.eye(3)
        expected = work(graphs, q, axes @ VALUE, axes @ TORQUE)
        ours = generalized(pushed(mechanism, body, frame), at(states(mechanism, 1), 0))
        assert np.abs(ours - expected).max() < DIFFERENCES * np.abs(expected).max()


@mark.parametrize("family", ["mixed", "welded", *slow("serial", "branched")])
def test_a_force_at_every_centre_of_mass_is_gravity(family: str) -> None:
    """m a at the centre of each body, welded ones too, is what a further gravity a does; in every function."""
    mechanism, extra = FAMILIES[family](4), np.array([1.0, -2.0, 3.0])
    heavier = replace(mechanism, gravity=np.asarray(mechanism.gravity) + extra)
    pulled = replace(mechanism, forces=[Force(b.name, b.mass * extra, b.center) for b in mechanism.bodies])
    given = states(mechanism, 5)
    for make in (dyn.inverse_dynamics, dyn.forward_dynamics, lambda m: dyn.forward_dynamics(m, "dense")):
        assert error(run(make(pulled), given), run(make(heavier), given)) < ROUNDING
    start = np.full((2, mechanism.system.n), 0.1)
    ours, theirs = (dyn.simulate(each, *start, 0.1, "rk4", dt=0.01).q[-1] for each in (pulled, heavier))
    assert error(ours, theirs) < ROUNDING


def test_a_spring_to_a_fixed_point_has_the_slope_of_its_energy() -> None:
    """A force that depends on q: its own dependence is not differentiated."""
    arm, anchor, stiffness = turned_arm(4), (0.4, -0.1, 0.8), 7.0
    place = arm.position("link 4", HAND)
    stretch = [p - a for p, a in zip(place.outputs.values(), anchor, strict=True)]
    sprung = replace(arm, forces=[Force("link 4", [-stiffness * s for s in stretch], HAND)])
    energy = cg.Graph(arm.system.q, {"V": 0.5 * stiffness * (stretch[0] ** 2 + stretch[1] ** 2 + stretch[2] ** 2)})
    given = at(states(arm, 1), 0)
    slope = run(cg.gradient(energy), given)
    assert generalized(sprung, given) == approx(-slope, rel=EQUATIONS)


def test_a_drag_takes_the_power_it_says() -> None:
    """A force of the velocity: f . v = -c v . v, with v the rate of the position."""
    arm = turned_arm(3)
    place = cg.jvp(arm.position("link 3", HAND))
    rename = dict(zip([node.name for node in place.inputs], [*arm.system.q, *arm.system.qd], strict=True))
    velocity = list(place(*[rename[node.name] for node in place.inputs]).values())
    dragged = replace(arm, forces=[Force("link 3", [-0.3 * v for v in velocity], HAND)])
    given = at(states(arm, 1), 0)
    speed = run(cg.Graph([*arm.system.q, *arm.system.qd], dict(zip("xyz", velocity, strict=True))), given)
    assert generalized(dragged, given) @ given["qd"] == approx(-0.3 * speed @ speed, rel=EQUATIONS)


def test_a_pendulum_pushed_at_its_tip_by_hand() -> None:
    """About y, the tip at l (-sin q, 0, -cos q): the lever of a force along x is -l cos q, along z l sin q."""
    rod = Body("rod", Joint("revolute", (0.0, 1.0, 0.0)), mass=1.0, center=(0.0, 0.0, -0.5))
    tip = (0.0, 0.0, -0.8)
    pendulum = Mechanism([rod], forces=[Force("rod", ("fx", 9.0, 2.0), tip)], parameters={"fx": 3.0})
    graph = dyn.inverse_dynamics(pendulum)
    assert graph.input_names == ("q0", "qd0", "qdd0", "fx")
    q = 0.4
    free = 0.25 * 1.5 + 9.81 * 0.5 * np.sin(q)
    expected = free - 0.8 * (-3.0 * np.cos(q) + 2.0 * np.sin(q))
    assert graph.evaluate({"q0": q, "qd0": 0.3, "qdd0": 1.5, "fx": 3.0})["tau0"] == approx(expected, rel=SHORT_SUM)
    place = pendulum.position("rod", tip).evaluate({"q0": q})
    assert list(place.values()) == approx([-0.8 * np.sin(q), 0.0, -0.8 * np.cos(q)], rel=SHORT_SUM)


# --- against MuJoCo


MODEL = """<mujoco><option gravity="1 2 -9"><flag contact="disable"/></option><worldbody>
<body name="post" pos="0.3 0.1 0.2" quat="1 2 3 4">
  <body name="shoulder" pos="0.1 0 0.3" euler="10 20 30">
    <joint axis="0 1 1" damping="0.3"/><geom size="0.1" pos="0.1 0 0"/>
    <body name="rail" pos="0.2 0.1 0">
      <joint type="slide" axis="1 0 2" stiffness="3"/><geom type="box" size="0.1 0.2 0.3"/>
      <body name="elbow" pos="0 0 0.4" euler="0 90 0">
        <joint axis="1 2 3" pos="0.1 0.2 0"/><geom size="0.1" pos="0 0.3 0"/>
        <body name="hand" pos="0 0.2 0.1" euler="40 0 50"><geom type="box" size="0.1 0.05 0.02" pos="0.1 0 0"/></body>
      </body>
      <body name="finger"><joint axis="0 0 1"/><geom size="0.05" pos="0.3 0 0" mass="0.4"/></body>
    </body>
  </body>
</body></worldbody></mujoco>"""


@mark.parametrize("body", ["post", "shoulder", "rail", "elbow", "hand", "finger"])
@mark.parametrize("frame", ["world", "body"])
def test_mujoco_s_applied_force_agrees(body: str, frame: str) -> None:
    """`mj_applyFT` at a point, and `xfrc_applied` at the centre of mass, on welded bodies too."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, mechanism = mujoco.MjData(model), dyn.load_mjcf(model)
    free = pushed(mechanism, body, frame, value=("fx", "fy", "fz"), torque=("mx", "my", "mz"))
    centre = replace(free, forces=[replace(free.forces[0], at=_center(mechanism, body))])
    graphs = [dyn.forward_dynamics(each) for each in (free, centre)]
    compiled = [cg.compile(graph, "python") for graph in graphs]
    place = cg.compile(mechanism.position(body, HAND), "python")
    index = model.body(body).id
    given_states = states(mechanism, 20)
    for row in range(20):
        state = at(given_states, row)
        rng = np.random.default_rng(row)
        value, torque = rng.normal(size=(2, 3))
        given = [[*state["q"], *state["qd"], *state["tau"], *(_ordered(graph, value, torque))] for graph in graphs]
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state["q"], state["qd"]
        mujoco.mj_forward(model, data)
        axes = data.xmat[index].reshape(3, 3)
        point = data.xpos[index] + axes @ HAND if body != "elbow" else data.xpos[index] + axes @ _shifted(HAND)
        assert place(state["q"]) == approx(point, abs=EQUATIONS)
        if frame == "body":
            value, torque = axes @ value, axes @ torque
        data.qfrc_applied[:] = state["tau"]
        mujoco.mj_applyFT(model, data, value, torque, point, index, data.qfrc_applied)
        mujoco.mj_forward(model, data)
        assert error(compiled[0](given[0]), np.array(data.qacc)) < AGREEMENT
        data.qfrc_applied[:] = state["tau"]
        data.xfrc_applied[index] = [*value, *torque]
        mujoco.mj_forward(model, data)
        assert error(compiled[1](given[1]), np.array(data.qacc)) < AGREEMENT


def _ordered(graph: cg.Graph, value: Array, torque: Array) -> list[float]:
    named = dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), [*value, *torque], strict=True))
    return [named[name] for name in graph.input_names if name in named]


def _center(mechanism: Mechanism, body: str) -> Any:
    return next(each.center for each in mechanism.bodies if each.name == body)


def _shifted(point: Any) -> Array:
    """A point of the elbow, whose frame is at its joint, in MuJoCo's frame of it."""
    return np.asarray(point) + (0.1, 0.2, 0.0)


# --- graphs


def test_parameters_are_inputs_that_simulate_binds() -> None:
    arm = turned_arm(2)
    pushable = replace(arm, forces=[Force("link 2", ("fx", 0.0, "fz"), HAND)], parameters={"fx": 2.0})
    fixed = replace(arm, forces=[Force("link 2", (2.0, 0.0, 0.0), HAND)])
    assert pushable.system.parameters == {"fx": 2.0, "fz": 0.0}
    start = ([0.1, 0.2], [0.3, 0.4], 0.3)
    default, chosen = (dyn.simulate(pushable, *start, parameters=p).q[-1] for p in ({}, {"fx": 0.0}))
    assert default == approx(dyn.simulate(fixed, *start).q[-1], rel=EQUATIONS)
    assert chosen == approx(dyn.simulate(arm, *start).q[-1], rel=EQUATIONS)
    assert default != approx(chosen, rel=1e-3)


def test_a_force_may_depend_on_time() -> None:
    rotor = Mechanism(
        [Body("rotor", Joint("revolute"), inertia=(1.0, 1.0, 1.0))],
        forces=[Force("rotor", torque=(0.0, 0.0, 2.0 * cg.variable("t")))],
    )
    run = dyn.simulate(rotor, [0.0], [0.0], 3.0, "rk4", dt=0.1)
    assert run.qd[-1] == approx([9.0])
    assert run.q[-1] == approx([9.0])


def test_forces_are_tagged_with_their_body() -> None:
    arm = turned_arm(4)
    graph = dyn.inverse_dynamics(pushed(arm, "link 3"))
    tagged = [node for node in graph.nodes if "force" in node.tags]
    assert tagged
    assert all("link 3" in node.tags for node in tagged)
    assert any("adjoint" in node.roles for node in tagged)
    assert not any("force" in node.tags for node in dyn.inverse_dynamics(arm).nodes)


def test_only_the_joints_between_a_body_and_the_world_feel_its_force() -> None:
    mechanism = FAMILIES["branched"](9)
    carried = {body.name: body.parent for body in mechanism.bodies}
    path, at_ = set(), "b7"
    while at_ != "world":
        path.add(at_)
        at_ = carried[at_]
    felt = generalized(pushed(mechanism, "b7"), at(states(mechanism, 1), 0))
    assert {name for name, each in zip(mechanism.system.coordinates, felt, strict=True) if each} == path
    assert len(path) < 9


def test_no_force_costs_nothing_and_one_costs_little() -> None:
    """18 nodes a joint on the way, of some 550: a rotation of the force, one of the point, and the lever."""
    arm = turned_arm(30)
    without, with_ = (len(dyn.inverse_dynamics(each).nodes) for each in (arm, pushed(arm, "link 30", torque=(0, 0, 0))))
    assert len(dyn.inverse_dynamics(replace(arm, forces=[])).nodes) == without
    assert with_ - without <= 18 * 30


def test_a_force_on_what_is_welded_to_the_world_does_nothing() -> None:
    base = Body("base", Joint("fixed", position=(1.0, 0.0, 0.0)), mass=1.0)
    arm = Body("arm", Joint("revolute", (0.0, 1.0, 0.0)), "base", mass=1.0, center=(0.5, 0.0, 0.0))
    free = Mechanism([base, arm])
    still = replace(free, forces=[Force("base", (1.0, 2.0, 3.0), torque=(4.0, 5.0, 6.0))])
    assert len(dyn.forward_dynamics(still).nodes) == len(dyn.forward_dynamics(free).nodes)
    assert free.position("base", (0.0, 2.0, 0.0)).evaluate({"q0": 0.3}) == {"x": 1.0, "y": 2.0, "z": 0.0}


@mark.parametrize("formulation", ["chain_rule_literal", "euler_embedded", "kinetic_only_exact"])
def test_every_formulation_takes_the_force_off(formulation: str) -> None:
    arm = turned_arm(3)
    given = at(states(arm, 1), 0)
    expected = generalized(pushed(arm, "link 3"), given)
    old = {"q_old": given["q"], "qd_old": given["qd"], "dt": 0.0, **given}
    free, ours = (dyn.inverse_dynamics(each, formulation) for each in (arm, pushed(arm, "link 3")))
    difference = np.array(list(free.evaluate(inputs(free, old)).values())) - run(ours, old)
    assert difference == approx(expected, rel=SOLVED)


def test_a_turned_body_s_axes_turn_its_force() -> None:
    """A body frame given by a quaternion: the two frames differ by the rotation at q = 0."""
    turn = from_quaternion([1.0, 2.0, 3.0, 4.0])
    joint = Joint("prismatic", (1.0, 1.0, 0.0), orientation=turn)
    cart = Mechanism([Body("cart", joint, mass=1.0)])
    given = at(states(cart, 1), 0)
    in_body = generalized(pushed(cart, "cart", "body"), given)
    assert in_body == approx([VALUE @ (1.0, 1.0, 0.0) / np.sqrt(2.0)], rel=SHORT_SUM)
    in_world = generalized(pushed(cart, "cart"), given)
    assert in_world == approx([VALUE @ turn @ (1.0, 1.0, 0.0) / np.sqrt(2.0)], rel=SHORT_SUM)


def test_bodies_and_forces_may_come_from_iterators() -> None:
    arm = turned_arm(3)
    read = Mechanism(iter(arm.bodies), forces=iter([Force("link 3", VALUE, HAND)]))
    listed = replace(arm, forces=[Force("link 3", VALUE, HAND)])
    given = states(arm, 2)
    for each in (read, replace(read)):
        assert error(run(dyn.inverse_dynamics(each), given), run(dyn.inverse_dynamics(listed), given)) < ROUNDING
    assert len(read.bodies) == 3


def test_components_whose_rates_are_one_node_add_up() -> None:
    """Of a slide along x and y alike, both velocities are the same node."""
    cart = Mechanism([Body("cart", Joint("prismatic", (1.0, 1.0, 0.0)), mass=1.0)])
    felt = generalized(pushed(cart, "cart"), at(states(cart, 1), 0))
    assert felt == approx([(VALUE[0] + VALUE[1]) / np.sqrt(2.0)], rel=SHORT_SUM)


# --- what cannot be


ROTOR = Mechanism([Body("rotor", Joint("revolute"), inertia=(1.0, 1.0, 1.0))])
COMPONENT = "the force on body 'rotor': a component of {} must be a finite number, a parameter's name or a node,"
BAD: dict[str, tuple[Any, str]] = {
    "unknown body": ([Force("hand", (1, 0, 0))], "there is a force on the unknown body 'hand'"),
    "the world": ([Force("world", (1, 0, 0))], "there is a force on the unknown body 'world'"),
    "no name": ([Force(3, (1, 0, 0))], "there is a force on the unknown body 3"),
    "no force": ([(1, 0, 0)], "forces must be of the type Force or JointForce, got tuple: (1, 0, 0)"),
    "one force": (Force("rotor"), "forces must be a sequence of Force or JointForce, got Force: "),
    "frame": (
        [Force("rotor", (1, 0, 0), frame="local")],
        "the force on body 'rotor': frame must be one of world, body, got 'local'",
    ),
    "point": ([Force("rotor", at=(0, 0))], "the force on body 'rotor': at must be (3,) finite numbers, got (0, 0)"),
    "point NaN": (
        [Force("rotor", at=(0, np.nan, 0))],
        "the force on body 'rotor': at must be (3,) finite numbers, got (0, nan, 0)",
    ),
    "two components": (
        [Force("rotor", (1, 0))],
        "the force on body 'rotor': value must have three components, got (1, 0)",
    ),
    "text": ([Force("rotor", "fxy")], "the force on body 'rotor': value must have three components, got 'fxy'"),
    "a number": (
        [Force("rotor", torque=2.0)],
        "the force on body 'rotor': torque must have three components, got 2.0",
    ),
    "infinite": (
        [Force("rotor", (0, np.inf, 0))],
        f"{COMPONENT.format('value')} got inf",
    ),
    "none": (
        [Force("rotor", torque=(0, None, 0))],
        f"{COMPONENT.format('torque')} got None",
    ),
}


@mark.parametrize("case", BAD)
def test_a_force_that_cannot_be_is_refused(case: str) -> None:
    forces, message = BAD[case]
    with raises(MechanismError, match="^" + re.escape(message)) as caught:
        replace(ROTOR, forces=forces)
    assert "\n" not in str(caught.value)


@mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("q0", {}, "parameter 'q0' has the name of a coordinate"),
        ("m", {"m": np.nan}, "parameter 'm' must be a finite number, got nan"),
        ("m", {"n": 1.0}, "the mechanism has no body, joint or force that uses the parameter 'n'"),
        ("a b", {}, "the name of a parameter must be without white space, got 'a b'"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused(name: str, parameters: dict[str, float], message: str) -> None:
    with raises(ValueError, match=re.escape(message)):
        _ = replace(ROTOR, forces=[Force("rotor", torque=(0, 0, name))], parameters=parameters).system


def test_a_node_s_own_parameters_need_a_value() -> None:
    pushed_ = [Force("rotor", torque=(0, 0, 2.0 * cg.variable("m")))]
    assert replace(ROTOR, forces=pushed_, parameters={"m": 3.0}).system.parameters == {"m": 3.0}
    with raises(ValueError, match="the system uses 'm', which is no coordinate, parameter or t"):
        _ = replace(ROTOR, forces=pushed_).system


def test_the_place_of_no_body_is_refused() -> None:
    with raises(MechanismError, match=r"^there is no body 'hand' in the mechanism$"):
        ROTOR.position("hand")
    with raises(MechanismError, match=r"^position on body 'rotor': at must be \(3,\) finite numbers, got 1.0$"):
        ROTOR.position("rotor", 1.0)


@mark.parametrize("write", [dyn.to_mjcf, dyn.to_urdf])
def test_a_file_has_no_forces(write: Any) -> None:
    pushed_ = replace(ROTOR, forces=[Force("rotor", (1, 0, 0))])
    with raises(MechanismError, match=r"^(MJCF|URDF) has no forces, there is one on body 'rotor'$"):
        write(pushed_)
